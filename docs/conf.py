"""Settings of the documentation site: `sphinx-build -W docs site` builds it, without a network."""

from __future__ import annotations

import re
from importlib.metadata import version as find_version
from typing import TYPE_CHECKING

from docutils import nodes
from latex2mathml.converter import convert

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

project = "softcover"
author = "softcover"
version = release = find_version("softcover")

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "myst_parser"]
myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_block"]
myst_heading_anchors = 4
# Formulas are drawn by MathML of the browser, so that the site needs no network: see `setup` below.
html_math_renderer = "mathml"
source_suffix = {".md": "markdown"}
exclude_patterns = ["site"]

# `Sensor` is a class of fastmodel and one of the driver: a mention in a signature may mean either.
suppress_warnings = ["ref.python"]

autodoc_member_order = "bysource"
autosummary_generate = False  # the tables only; the entries stand below them
autodoc_typehints = "signature"
# Docstrings mark code by single backticks, as Markdown does.
default_role = "code"
napoleon_google_docstring = True
napoleon_use_rtype = False
napoleon_use_ivar = True

# Characters that reStructuredText would take for markup: bars, and underscores at the end of a word.
_SPECIAL = re.compile(r"\||(?<=\w)_(?=\W|$)")

html_theme = "furo"
html_title = "softcover"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False


def setup(app: Sphinx) -> None:
    """Draw formulas as MathML, which browsers show without scripts or a network; read docstrings as they are meant."""
    app.add_html_math_renderer("mathml", (_draw_inline, None), (_draw_block, None))
    app.connect("autodoc-process-docstring", _translate, priority=600)
    app.connect("autodoc-process-docstring", _list_names, priority=700)
    app.connect("html-page-context", _state_levels, priority=900)


def _state_levels(_app: Sphinx, _page: str, _template: str, context: dict[str, object], _tree: object) -> None:
    """Give the captions of the navigation the level of a heading, which screen readers need and Sphinx leaves out."""
    tree = str(context.get("furo_navigation_tree", ""))
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def _draw_inline(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(convert(node.astext(), display="inline"))
    raise nodes.SkipNode


def _draw_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode


def _list_names(_app: Sphinx, what: str, _name: str, obj: object, _options: object, lines: list[str]) -> None:
    """Begin the page of a package with a table of its public names, each with the first sentence on it."""
    public = getattr(obj, "__all__", ()) if what == "module" else ()
    if public:
        lines += ["", ".. autosummary::", "   :nosignatures:", "", *(f"   {each}" for each in public), ""]


def _translate(_app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]) -> None:
    """Make reStructuredText of a docstring: escape bars and trailing underscores, mark indented blocks as code."""
    block = None  # indentation of the line above the present block of code
    for index, line in enumerate(lines):
        if block is not None and (not line or _indent(line) > block):
            continue
        block = None
        parts = re.split(r"(`[^`]*`)", line)
        text = "".join(part if part.startswith("`") else re.sub(_SPECIAL, r"\\\g<0>", part) for part in parts)
        blank, *after = lines[index + 1 : index + 3] or [""]
        if line.endswith(":") and not line.endswith("::") and not blank and after and _indent(after[0]) > _indent(line):
            block = _indent(line)
            text += ":"
        lines[index] = text


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())
