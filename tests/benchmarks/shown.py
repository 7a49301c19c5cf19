"""What the benchmarks share: where they ran, and tables of what is wanted and what is reached."""

from __future__ import annotations

from collections.abc import Iterable

from skelgen.benchmark.page import machine_line, verdict
from skelgen.benchmark.speed import in_own_process, peak_gigabytes
from skelgen.evaluation import Table

__all__ = ["in_own_process", "peak_gigabytes", "show", "show_machine", "verdict"]


def show(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table and an empty line."""
    table = Table(title, tuple(columns), tuple(tuple(row) for row in rows))
    print(*table.lines(), "", sep="\n")


def show_machine() -> None:
    """Print on what the figures were reached."""
    print(f"{machine_line()}\n")
