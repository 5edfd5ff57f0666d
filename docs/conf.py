"""Sphinx configuration of the documents."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

project = "gustform"
author = "the gustform authors"
copyright = author
version = re.search(
    r'^__version__ = "([^"]+)"', (ROOT / "library/gustform/__init__.py").read_text(), flags=re.MULTILINE
).group(1)
release = version

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
# Files of the repository outside docs/ are linked for those who read the sources; here they are plain names.
suppress_warnings = ["myst.xref_missing"]

html_theme = "furo"
html_title = "gustform"
html_static_path = []
