"""Sphinx: the pages of this folder and the reference from the docstrings, as one site that needs no network.

sphinx-build -W --keep-going docs out/site
"""

import logging
import re
import sys
from pathlib import Path
from types import GenericAlias
from typing import Any

import latex2mathml.converter
from docutils import nodes
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import skelgen

sys.path.append(str(Path(__file__).parent))
from reference import write_reference

ROOT = Path(__file__).parent.parent

project = "skelgen"
author = "The skelgen founders"
copyright = "2026, The skelgen founders"
release = version = skelgen.__version__

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc"]
default_role = "code"  # docstrings write names in single back quotes

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
highlight_language = "none"  # indented blocks are commands and their answers

autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_typehints = "none"  # numpydoc sections state types with shapes and units
autodoc_use_type_comments = False  # there are none, and each function would be read again to look for them
numpydoc_show_class_members = False

toc_object_entries = False  # thousands of entries beside each page, and twice the time
html_theme = "furo"
html_math_renderer = "mathml"
html_favicon = html_logo = str(ROOT / "gui" / "skelgen_gui" / "skelgen.svg")
html_title = f"skelgen {release}"

logging.disable(logging.DEBUG)  # a hundred thousand sentences that nobody reads

_environments: list[SandboxedEnvironment] = []


def one_environment(loader: Any) -> SandboxedEnvironment:
    """Return the same environment every time: numpydoc compiles its template anew for each of 9000 docstrings."""
    if not _environments:
        _environments.append(SandboxedEnvironment(loader=loader))
    return _environments[0]


def keep_bars(app: Sphinx, what: str, name: str, described: Any, options: Any, lines: list[str]) -> None:
    """Keep the bars of |x|, which reStructuredText takes for a name to be replaced."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def leave_out(app: Sphinx, what: str, name: str, described: Any, skipped: bool, options: Any) -> bool | None:
    """Leave out what a module imports from other libraries, and names for types, which have no signature."""
    is_foreign = not str(getattr(described, "__module__", project)).startswith(project)
    return True if is_foreign or isinstance(described, GenericAlias) or hasattr(described, "__origin__") else None


def add_contents(app: Sphinx, page: str, source: list[str]) -> None:
    """Append the tree of all pages to the index, which lists them in tables for those who read it as a file."""
    if page == "index":
        pages = [link.removesuffix(".md") for link in re.findall(r"\]\(([^):#]+\.md)", source[0])]
        listed = "\n".join([*dict.fromkeys(pages), "reference/index"])
        source[0] += f"\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"


def inline_formula(translator: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(latex2mathml.converter.convert(node.astext()))
    raise nodes.SkipNode


def formula(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula that stands alone."""
    translator.body.append(latex2mathml.converter.convert(node.astext(), display="block"))
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Write the reference's pages; draw formulas as MathML, which browsers show without scripts."""
    docscrape_sphinx.SandboxedEnvironment = one_environment
    app.connect("autodoc-process-docstring", keep_bars, priority=400)  # before numpydoc
    app.connect("autodoc-skip-member", leave_out)
    app.connect("source-read", add_contents)
    app.connect("builder-inited", lambda builder: write_reference(Path(builder.srcdir) / "reference"))
    app.add_html_math_renderer("mathml", inline_renderers=(inline_formula, None), block_renderers=(formula, None))
