"""The page of a benchmark: one HTML file with tables and drawings, which needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skelgen.app.pages import write_html
from skelgen.app.report.wording import counted
from skelgen.benchmark.machine import machine_line
from skelgen.benchmark.sections import MISSED, REACHED, Section


def write_benchmark_page(
    sections: Sequence[Section], path: Path, *, measured: str = "", command: str = "", missing: Sequence[str] = ()
) -> Path:
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
    missing : sequence of str
        Suites that are not measured yet.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    return write_html(
        __name__.rpartition(".")[0],
        path,
        sections=sections,
        machine=machine_line(),
        measured=measured,
        command=command,
        sentence=counts_sentence(sections),
        missing=", ".join(missing),
        missed=MISSED,
    )


def counts_sentence(sections: Sequence[Section]) -> str:
    """Return in words how many of the figures that are wanted were reached."""
    reached, missed = (sum(section.count(what) for section in sections) for what in (REACHED, MISSED))
    return f"{reached} of {counted(reached + missed, 'wanted figure')} reached"
