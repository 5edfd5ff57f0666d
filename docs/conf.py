"""Sphinx configuration of the documents."""

import re
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

from gustform_cli.catalogue import all_types
from gustform_cli.info import describe

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


class ComponentReference(Directive):
    """A section for each component type with what `gustform info` prints: the declarations are the one source."""

    def run(self) -> list[nodes.Node]:
        return [self.section(name, describe(name)) for name in all_types()]

    @staticmethod
    def section(name: str, text: str) -> nodes.Node:
        # The title and its underline are already there as the section's own.
        body = "\n".join(text.splitlines()[2:])
        section = nodes.section(ids=[nodes.make_id(name)], names=[nodes.fully_normalize_name(name)])
        section += nodes.title(text=name)
        section += nodes.literal_block(body, body, language="text")
        return section


def setup(app: Sphinx) -> None:
    app.add_directive("component-reference", ComponentReference)
    app.add_html_math_renderer("mathml", inline_renderers=(visit_math, None), block_renderers=(visit_math, None))
