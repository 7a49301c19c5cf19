"""The tables that several commands print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skelgen.cli.screen import Screen

if TYPE_CHECKING:
    from skelgen.evaluation import Table

_TITLES = {
    "limbs": "Limbs",
    "joints": "Joints",
    "angles": "Joint angles",
    "rings": "Joints that close rings",
    "lengths": "Lengths between the joints of a limb",
}
_SPOKEN = ("not_determined",)  # sentences: they are said as notes while the stages run, and are too long for a column


def show_take(screen: Screen, facts: Mapping[str, Any]) -> None:
    """Print one line about a take."""
    count = f"{facts['count']} {facts['kind'] if facts['kind'] != 'poses' else 'bodies'}"
    screen.say(f"{facts['name']}: {count}, {facts['frames']} frames at {facts['rate_hz']:g} Hz")


def show_project(screen: Screen, tables: Mapping[str, Any]) -> None:
    """Print what a project holds: take, limbs, joints, lengths, residuals, times."""
    show_take(screen, tables["take"])
    if "labelling" in tables:
        _show_labelling(screen, tables["labelling"])
    for key, title in _TITLES.items():
        screen.table(title, [_without(_SPOKEN, row) for row in tables.get(key, ())])
    if "residuals" in tables:
        screen.table("Residuals of all markers", [tables["residuals"]])
    times = ", ".join(f"{row['stage']} {row['seconds']:.2f} s" for row in tables["stages"])
    screen.say(f"stages: {times or 'none has run'}")


def _without(names: Sequence[str], row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in names}


def _show_labelling(screen: Screen, facts: Mapping[str, Any]) -> None:
    """Print how sure the labels are in a line, and what could be done about it."""
    parts = [f"{facts['markers']} markers"]
    if "tracklets" in facts:
        parts[0] += f" from {facts['tracklets']} tracklets"
    spans = "1 doubtful span" if facts["doubtful_spans"] == 1 else f"{facts['doubtful_spans']} doubtful spans"
    parts.append(f"{spans} ({100 * facts['doubtful_share']:.2g} % of the positions)")
    if "left_out" in facts:
        parts.append(f"{facts['left_out']} points left out ({100 * facts['left_out_share']:.2g} %)")
    if "seed_markers" in facts:
        agreement = 100 * facts["seed_agreement"]
        parts.append(f"the seed's method finds {facts['seed_markers']} and agrees in {agreement:.1f} % of the points")
    screen.say(f"labels: {'; '.join(parts)}")
    for sentence in facts["advice"]:
        screen.say(f"  try: {sentence}")


def show_files(screen: Screen, files: Sequence[Path]) -> None:
    """Print which files were written."""
    screen.say("written: " + ", ".join(str(file) for file in files))


def show_evaluation(screen: Screen, tables: Iterable[Table]) -> None:
    """Print scores against the truth."""
    for table in tables:
        screen.table(table.title, [dict(zip(table.columns, row, strict=True)) for row in table.rows])
