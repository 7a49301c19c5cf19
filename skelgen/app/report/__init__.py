"""The report: one self-contained HTML file of what was read, what was found and how the run went.

Texts and tables come from the template, drawings are inline SVG in the template's colours, large matrices are small
embedded pictures. Nothing is loaded from elsewhere, and apart from times the same project gives the same bytes.
"""

from importlib import resources
from pathlib import Path

from jinja2 import DictLoader, Environment, StrictUndefined

from skelgen.app.drawing.wording import degrees, digits, duration, fixed, percent, shown
from skelgen.app.report.contents import ReportContent, ViewContent, report_content, view_content
from skelgen.errors import InputError
from skelgen.files import replacing
from skelgen.model import Project
from skelgen.progress import SILENT, Monitor

__all__ = ["report_html", "write_report", "write_view"]

_FILTERS = {words.__name__: words for words in (degrees, digits, duration, fixed, percent, shown)}
_TEMPLATES = ("template.html", "labels.html", "style.html", "macros.html", "play.html", "view.html")


def write_report(project: Project, path: Path, monitor: Monitor = SILENT) -> Path:
    """Write the report of a project; whatever stages have run is shown.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    path : Path
        The HTML file; it appears whole or not at all.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    WriteError
        If the file cannot be written.
    """
    return _written(report_html(project, monitor), path)


def write_view(project: Project, path: Path) -> Path:
    """Write a page that holds the view alone: markers and skeleton that turn and play.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    path : Path
        The HTML file; it appears whole or not at all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If nothing is ever seen in the take.
    WriteError
        If the file cannot be written.
    """
    content = view_content(project)
    if content.play is None:
        raise InputError(f"{project.name or 'the take'}: no point is seen in any frame, so there is nothing to view")
    return _written(_rendered("view.html", content), path)


def _written(html: str, path: Path) -> Path:
    with replacing(path) as temporary:
        # A name that was read from a broken file may hold halves of characters: they become question marks.
        temporary.write_text(html, encoding="utf-8", errors="replace")
    return path


def report_html(project: Project, monitor: Monitor = SILENT) -> str:
    """Return the report as a text; see `write_report`.

    Parameters
    ----------
    project : Project
        Any project.
    monitor : Monitor
        Shows progress; may cancel.
    """
    return _rendered("template.html", report_content(project, monitor))


def _rendered(template: str, content: ReportContent | ViewContent) -> str:
    folder = resources.files(__name__)
    sources = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in _TEMPLATES}
    environment = Environment(
        loader=DictLoader(sources), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(_FILTERS)
    return environment.get_template(template).render(vars(content))
