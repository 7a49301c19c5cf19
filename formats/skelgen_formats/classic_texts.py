"""Text files of limbs: those of the classic program (Schönauer 2007, 4.2 and 4.6), cost matrix and tree, and a table.

Numbers are separated by blanks, and lines that begin with ``#`` say what they are, so that `numpy.loadtxt` reads both.
The matrix has a row per marker: the standard deviations of its distances to all markers. The tree has a row per limb:
the limb, its parent (-1 for a root) and the cost of the joint between them (nan for a root). What limbs are
called stands in the lines with ``#``, and, once the skeleton is fitted, which joints the motion does not determine.
The table has a row per marker: its name, its limb, and the limb's name.
"""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Project
from skelgen.progress import Monitor
from skelgen_formats.options import Format, Options, Writable
from skelgen_formats.text import defused
from skelgen_formats.writing import choices_in

_COSTS_TITLE, _TREE_TITLE = "Cost matrix of the markers, text", "Tree of the limbs, text"
_LIMBS_TITLE = "Limbs of the markers, CSV"

LIMB_COLUMNS = ("marker", "limb", "name")
"""Titles of the table of limbs."""


def _write_costs(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the matrix that the clustering of markers into limbs rests on."""
    project = _project(value, _COSTS_TITLE)
    deviation = project.limbs.distance_deviation
    head = ["standard deviation of the distance between each two markers [mm]; nan: never seen together"]
    head.append(f"markers: {', '.join(project.trajectories.names)}")
    head += [f"limb {limb}: {_limb(project, limb)}" for limb in range(project.limbs.n_limbs)]
    _write_lines(path, [*_comments(head), *(" ".join(map(repr, row)) for row in deviation.tolist())])


def _write_tree(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the spanning tree of the limbs with the cost of each joint."""
    project = _project(value, _TREE_TITLE)
    topology = project.topology
    lines = [f"limb {limb}: {_limb(project, limb)}" for limb in range(topology.n_limbs)]
    rows = []
    for limb, parent in enumerate(topology.parents.tolist()):
        cost = float(topology.joint_costs[parent, limb]) if parent >= 0 else np.nan
        rows.append(f"{limb} {parent} {cost!r}")
    _write_lines(path, [*_comments([*lines, *choices_in(project), "limb parent cost_mm2"]), *rows])


def _write_limbs(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write which marker is on which limb; names that a spreadsheet takes for formulas begin with an apostrophe."""
    project = _project(value, _LIMBS_TITLE)
    called = [*map(defused, project.limbs.names), ""]  # the last one is for -1
    found = zip(map(defused, project.trajectories.names), project.limbs.limb_of_marker.tolist(), strict=True)
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8", errors="replace") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(LIMB_COLUMNS)
        rows.writerows((marker, limb, called[limb]) for marker, limb in found)


def _limb(project: Project, limb: int) -> str:
    """Name of a limb, and its markers."""
    markers = (project.trajectories.names[marker] for marker in project.limbs.markers_of(limb))
    return f"{project.limbs.names[limb]}: {', '.join(markers)}"


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")


def _comments(lines: Iterable[str]) -> list[str]:
    return [f"# {' '.join(line.split())}" for line in lines]


def _project(value: Writable, title: str) -> Project:
    if not isinstance(value, Project):
        raise WriteError(f"{title} holds what is found in a take, not a take; run the stages first")
    return value


COSTS = Format(
    name="costs",
    title=_COSTS_TITLE,
    suffixes=(".costs.txt",),
    holds="summary",
    write=_write_costs,
    check=lambda value, options: _project(value, _COSTS_TITLE).limbs,
    keeps=("names",),
    note="Standard deviations of all distances between markers, which the grouping into limbs rests on.",
)
TREE = Format(
    name="tree",
    title=_TREE_TITLE,
    suffixes=(".tree.txt",),
    holds="summary",
    write=_write_tree,
    check=lambda value, options: _project(value, _TREE_TITLE).topology,
    keeps=("names", "limbs"),
    marks_open="lines with `#`, once the skeleton is fitted",
    note="One row per limb: its parent and the cost of the joint between them.",
)
LIMBS = Format(
    name="limbs-csv",
    title=_LIMBS_TITLE,
    suffixes=(".limbs.csv",),
    holds="summary",
    write=_write_limbs,
    check=lambda value, options: _project(value, _LIMBS_TITLE).limbs,
    keeps=("names", "limbs"),
    note="One row per marker: its limb (-1 = left out) and what the limb is called; `--names` reads it.",
)
