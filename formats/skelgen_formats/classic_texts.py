"""The text files of the classic program (Schönauer 2007, 4.2 and 4.6): the cost matrix of the markers, and the tree.

Numbers are separated by blanks, and lines that begin with ``#`` say what they are, so that `numpy.loadtxt` reads both.
The matrix has a row per marker: the standard deviations of its distances to all markers. The tree has a row per limb:
the limb, its parent (-1 for a root) and the cost of the joint between them (nan for a root). What limbs are
called stands in the lines with ``#``, and, once the skeleton is fitted, which joints the motion does not determine.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Project
from skelgen_formats.options import Format, Writable
from skelgen_formats.writing import choices_in

_COSTS_TITLE, _TREE_TITLE = "Cost matrix of the markers, text", "Tree of the limbs, text"


def write_costs(value: Writable, path: Path) -> list[Path]:
    """Write the matrix that the clustering of markers into limbs rests on.

    Parameters
    ----------
    value : Project
        With limbs.
    path : Path
        The file.

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If markers are not grouped into limbs yet.
    """
    project = _project(value, _COSTS_TITLE)
    deviation = project.limbs.distance_deviation
    head = ["standard deviation of the distance between each two markers [mm]; nan: never seen together"]
    head.append(f"markers: {', '.join(project.trajectories.names)}")
    head += [f"limb {limb}: {_limb(project, limb)}" for limb in range(project.limbs.n_limbs)]
    _write(path, [*_comments(head), *(" ".join(map(repr, row)) for row in deviation.tolist())])
    return [path]


def write_tree(value: Writable, path: Path) -> list[Path]:
    """Write the spanning tree of the limbs with the cost of each joint.

    Parameters
    ----------
    value : Project
        With a tree.
    path : Path
        The file.

    Raises
    ------
    WriteError
        If the value is no project, or the file cannot be written.
    MissingResultError
        If limbs are not joined yet.
    """
    project = _project(value, _TREE_TITLE)
    topology = project.topology
    lines = [f"limb {limb}: {_limb(project, limb)}" for limb in range(topology.n_limbs)]
    rows = []
    for limb, parent in enumerate(topology.parents.tolist()):
        cost = float(topology.joint_costs[parent, limb]) if parent >= 0 else np.nan
        rows.append(f"{limb} {parent} {cost!r}")
    _write(path, [*_comments([*lines, *choices_in(project), "limb parent cost_mm2"]), *rows])
    return [path]


def _limb(project: Project, limb: int) -> str:
    """Name of a limb, and its markers."""
    markers = (project.trajectories.names[marker] for marker in project.limbs.markers_of(limb))
    return f"{project.limbs.names[limb]}: {', '.join(markers)}"


def _write(path: Path, lines: Iterable[str]) -> None:
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
    write=lambda value, path, options, monitor: write_costs(value, path),
    check=lambda value, options: _project(value, _COSTS_TITLE).limbs,
    keeps=("names",),
    note="Standard deviations of all distances between markers, which the grouping into limbs rests on.",
)
TREE = Format(
    name="tree",
    title=_TREE_TITLE,
    suffixes=(".tree.txt",),
    holds="summary",
    write=lambda value, path, options, monitor: write_tree(value, path),
    check=lambda value, options: _project(value, _TREE_TITLE).topology,
    keeps=("names", "limbs"),
    marks_open="lines with `#`, once the skeleton is fitted",
    note="One row per limb: its parent and the cost of the joint between them.",
)
