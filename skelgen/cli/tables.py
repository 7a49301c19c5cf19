"""The tables that several commands print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skelgen.cli.screen import Screen

if TYPE_CHECKING:
    from skelgen.evaluation import Table

_TITLES = {"limbs": "Limbs", "joints": "Joints", "lengths": "Lengths between the joints of a limb"}


def show_take(screen: Screen, facts: Mapping[str, Any]) -> None:
    """Print one line about a take."""
    count = f"{facts['count']} {facts['kind'] if facts['kind'] != 'poses' else 'bodies'}"
    screen.say(f"{facts['name']}: {count}, {facts['frames']} frames at {facts['rate_hz']:g} Hz")


def show_project(screen: Screen, tables: Mapping[str, Any]) -> None:
    """Print what a project holds: take, limbs, joints, lengths, residuals, times."""
    show_take(screen, tables["take"])
    for key, title in _TITLES.items():
        screen.table(title, tables.get(key, ()))
    if "residuals" in tables:
        screen.table("Residuals of all markers", [tables["residuals"]])
    times = ", ".join(f"{row['stage']} {row['seconds']:.2f} s" for row in tables["stages"])
    screen.say(f"stages: {times or 'none has run'}")


def show_files(screen: Screen, files: Sequence[Path]) -> None:
    """Print which files were written."""
    screen.say("written: " + ", ".join(str(file) for file in files))


def show_evaluation(screen: Screen, tables: Iterable[Table]) -> None:
    """Print scores against the truth."""
    for table in tables:
        screen.table(table.title, [dict(zip(table.columns, row, strict=True)) for row in table.rows])
