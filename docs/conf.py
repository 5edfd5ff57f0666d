"""Sphinx configuration of the documents."""

import re
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

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
html_math_renderer = "mathml"


def visit_math(self: HTML5Translator, node: nodes.Element) -> None:
    """Formulas become MathML, which browsers show by themselves: the pages need no network."""
    block = isinstance(node, nodes.math_block)
    mathml = convert(node.astext(), display="block" if block else "inline")
    self.body.append(f'<div style="margin: 1em 0">{mathml}</div>\n' if block else mathml)
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    app.add_html_math_renderer("mathml", inline_renderers=(visit_math, None), block_renderers=(visit_math, None))
