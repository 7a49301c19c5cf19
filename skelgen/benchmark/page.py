"""The page of a benchmark: one HTML file with tables and drawings, which needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from skelgen.app.report.wording import counted
from skelgen.benchmark.machine import machine_line
from skelgen.benchmark.sections import MISSED, REACHED, Section
from skelgen.files import replacing


def write_benchmark_page(sections: Sequence[Section], path: Path, *, measured: str = "", command: str = "") -> Path:
    """Write the page.

    Parameters
    ----------
    sections : sequence of Section
        From `run_benchmark`.
    path : Path
        The HTML file.
    measured : str
        When, and how long it took.
    command : str
        What repeats it.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    source = resources.files(__name__.rpartition(".")[0]).joinpath("page.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    html = environment.from_string(source).render(
        sections=sections,
        machine=machine_line(),
        measured=measured,
        command=command,
        sentence=counts_sentence(sections),
        missed=MISSED,
    )
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8")
    return path


def counts_sentence(sections: Sequence[Section]) -> str:
    """Return in words how many of the figures that are wanted were reached."""
    reached, missed = (sum(section.count(what) for section in sections) for what in (REACHED, MISSED))
    return f"{reached} of {counted(reached + missed, 'wanted figure')} reached"
