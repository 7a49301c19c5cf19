"""What the benchmarks share: where they ran, and tables of what is wanted and what is reached."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib.metadata import version

from skelgen.evaluation import Table

PACKAGES = ("skelgen", "numpy", "scipy", "scikit-learn")


def show(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table and an empty line."""
    table = Table(title, tuple(columns), tuple(tuple(row) for row in rows))
    print(*table.lines(), "", sep="\n")


def show_machine() -> None:
    """Print on what the figures were reached."""
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {versions}\n")


def verdict(is_reached: bool) -> str:
    """Return what the last column says."""
    return "reached" if is_reached else "MISSED"
