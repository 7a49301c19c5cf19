"""HTML pages of one file, from templates that lie beside the code that fills them."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from skelgen.files import replacing

TEMPLATE = "page.html"


def write_html(package: str, path: Path, **values: Any) -> Path:
    """Fill the template of a package and write the page.

    Parameters
    ----------
    package : str
        Name of the package that holds the template.
    path : Path
        The HTML file.
    **values
        What the template names.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    source = resources.files(package).joinpath(TEMPLATE).read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    html = environment.from_string(source).render(values)
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8", errors="replace")
    return path
