"""What writers share: parts of a project that they keep, markers that they can take, and the axis that is up.

Formats declare which parts they keep, and what is lost is told. Markers are written with filled positions, and a table
of these. What is found to be up in the recording is turned to what a format says is up.
"""

import csv
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from skelgen.errors import MissingResultError, WriteError
from skelgen.files import replacing
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.filled import Filled, PositionSource
from skelgen.model.placed_joints import Place, place_of
from skelgen.progress import SILENT, Monitor
from skelgen_formats.options import AUTO, AXES, Options, Writable
from skelgen_formats.text import defused


def trajectories_of(value: Writable, title: str) -> Trajectories:
    """Return the measured markers of a value, or raise `WriteError` that says what would work.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        With labelled markers.
    title : str
        Of the format, for the error.
    """
    if isinstance(value, Filled):
        return value.measured
    if isinstance(value, Project):
        value = value.trajectories if value.has("labels") else value.take
    if isinstance(value, Trajectories):
        return value
    has = "bodies with orientation: poses can be written as poses-csv"
    if isinstance(value, PointCloud):
        has = "points without labels: run the stage 'labels' first, or use mfml"
    raise WriteError(f"{title} holds labelled markers and this value has {has}")


def check_writable_names(
    path: Path, names: Sequence[str], forbidden: str, clean: Callable[[str], str] = str
) -> list[str]:
    """Return the names as `clean` makes them; refuse those that the format cannot hold or that become equal.

    Parameters
    ----------
    path : Path
        The file, for errors.
    names : sequence of str
        Of the markers.
    forbidden : str
        Characters that no name may hold, beside ends of lines.
    clean : callable (name) -> str
        Makes a name as it is written.
    """
    cleaned = [clean(name) for name in names]
    for name in cleaned:
        if not name or any(character in name for character in forbidden + "\r\n\0"):
            what = "is empty or holds a character that this format cannot hold; rename it"
            raise WriteError(f"{path}: the name {name!r} {what}")
    twice = [name for name, count in Counter(cleaned).items() if count > 1]
    if twice:
        raise WriteError(f"{path}: two names would both be written as {twice[0]!r}; rename one")
    return cleaned


TABLE_SUFFIX = ".filled.csv"
"""What follows the stem in the name of the table."""


def check_markers(value: Writable, title: str, filled: bool) -> None:
    """Raise if a writer of markers cannot take a value; errors as `markers_to_write`.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.
    filled : bool
        Whether filled positions are wanted.
    """
    if not filled or isinstance(value, Filled):
        trajectories_of(value, title)
    elif not isinstance(value, Project):
        what = "gaps are filled from a skeleton, and a take has none: give a project that is fitted"
        raise WriteError(f"{title}: {what}")
    elif not value.has("skeleton"):
        raise MissingResultError(f"{title}: gaps are filled from a skeleton: run the stage 'skeleton' first")


def markers_to_write(value: Writable, title: str, filled: bool, monitor: Monitor = SILENT) -> Trajectories | Filled:
    """Return what a writer is to write: measured markers, or `Filled` if filled positions are wanted.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        Of `Filled` without `filled`, the measured markers are written; the gaps of a project are filled with it.
    title : str
        Of the format, for errors.
    filled : bool
        Whether filled positions are wanted.
    monitor : Monitor
        Shows the progress of filling; may cancel.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or nothing to fill them from.
    MissingResultError
        If filling is wanted and the project has no skeleton yet.
    """
    check_markers(value, title, filled)
    if filled and isinstance(value, Filled):
        return value
    if filled and isinstance(value, Project):
        from skelgen.kinematics.gap_filling.filling import fill_project  # noqa: PLC0415 - numeric code of filling alone

        return fill_project(value, monitor)
    return trajectories_of(value, title)


def positions_of(markers: Trajectories | Filled) -> Trajectories:
    """Return the markers with all positions that are to be written."""
    return markers.trajectories if isinstance(markers, Filled) else markers


def write_table(markers: Trajectories | Filled, path: Path) -> list[Path]:
    """Write the table of filled positions beside a file of markers; nothing if these are measured.

    The table has a row per filled position: frame (from 0), marker, source and standard deviation [mm].

    Parameters
    ----------
    markers : Trajectories or Filled
        What was written.
    path : Path
        The file of markers.
    """
    if not isinstance(markers, Filled):
        return []
    table = table_of(path)
    with replacing(table) as temporary, temporary.open("w", newline="", encoding="utf-8", errors="replace") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("frame", "marker", "source", "std_mm"))
        for frame, marker in np.argwhere(markers.filled).tolist():
            source = PositionSource(int(markers.source[frame, marker]))
            name, std = defused(markers.measured.names[marker]), f"{markers.std[frame, marker]:.3f}"
            rows.writerow((frame, name, source.word, std))
    return [table]


def marker_files(path: Path, filled: bool) -> tuple[Path, ...]:
    """Return the files that a writer of markers will make of a path.

    Parameters
    ----------
    path : Path
        The file of markers.
    filled : bool
        Whether filled positions are written.
    """
    return (path, table_of(path)) if filled else (path,)


def table_of(path: Path) -> Path:
    """Return where the table of filled positions belongs to a file of markers."""
    return path.with_name(path.stem.removesuffix(TABLE_SUFFIX.removesuffix(".csv")) + TABLE_SUFFIX)


_GRAVITY = 9.80665  # m/s^2, the standard

UPRIGHTABLE = replace(
    AXES,
    help="Which axis is up: as recorded; auto turns what is found to be up to where the format has it; z-to-y, y-to-z.",
    choices=(*TURNS, AUTO),
)
UPRIGHT = replace(UPRIGHTABLE, default=AUTO)
"""Those of formats that say which axis is up, see `Format.up`; by default as recorded, and turned."""


def turn_wished(value: Writable, options: Options, up: str) -> str:
    """Return the turn of the world, a key of `TURNS`, that a user wants for a value.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    options : Options
        With the choice of axes.
    up : str
        See `Format.up`.
    """
    if options.axes != AUTO:
        return options.axes
    from skelgen.geometry.up_axis import turn_to  # noqa: PLC0415 - scipy is slow to load

    return turn_to(value, up)


def remark_on_up(project: Project, options: Options, up: str, title: str) -> tuple[str, ...]:
    """Say if what is up in the file will not be what is up in the recording, or may not be.

    Parameters
    ----------
    project : Project
        As recorded.
    options : Options
        With the choice of axes.
    up : str
        See `Format.up`.
    title : str
        Of the format.
    """
    from skelgen.geometry.up_axis import turn_to, up_of  # noqa: PLC0415 - scipy is slow to load

    found, turn = up_of(project), turn_wished(project, options, up)
    if not found:
        return (f"{title} takes {up} to be up, and the recording does not tell what is: see which axes are right.",)
    comes = found if turn == AS_RECORDED else turn[-1] if turn.startswith(found) else ""
    if comes == up:
        return ()
    wish = turn_to(project, up)
    advice = f": choose axes {wish}" if wish != AS_RECORDED else ""
    return (f"{title} takes {up} to be up; in the recording it is {found}{advice}.",)


def turned_up(axes: str) -> str:
    """Return the axis that a turn of the world, a key of `TURNS`, brings upward; empty if nothing is turned."""
    return "" if axes == AS_RECORDED else axes[-1]


def gravity(project: Project, up: str, default: str) -> Floats:
    """Return the acceleration of gravity [m/s^2], shape (3,).

    Parameters
    ----------
    project : Project
        In the axes of the file.
    up : str
        The axis that is up in the file; what is found if empty.
    default : str
        The one that is where nothing is found, see `Format.up`.
    """
    from skelgen.geometry.up_axis import up_of  # noqa: PLC0415 - scipy is slow to load

    found = up or up_of(project) or default
    return np.where(np.array(list("xyz")) == found[-1], _GRAVITY if found.startswith("-") else -_GRAVITY, 0.0)


@dataclass(frozen=True)
class Part:
    """One kind of thing that a project holds.

    Attributes
    ----------
    name : str
        What formats declare in `Format.keeps`.
    title : str
        How a sentence names it.
    is_in : callable (project) -> bool
        Whether a project has it.
    in_every_frame : bool
        Whether it has a value in every frame.
    """

    name: str
    title: str
    is_in: Callable[[Project], bool]
    in_every_frame: bool = False


def _has_markers(project: Project) -> bool:
    return project.has("labels") or isinstance(project.take, Trajectories)


PARTS: tuple[Part, ...] = (
    Part("points", "the points of the recording", lambda project: isinstance(project.take, PointCloud), True),
    Part("bodies", "the bodies with their orientations", lambda project: isinstance(project.take, Poses), True),
    Part("markers", "the positions of the markers", _has_markers, True),
    Part("names", "the names of the markers", _has_markers),
    Part("confidence", "how sure the labels are", lambda project: project.has_labelling),
    Part("limbs", "which marker is on which limb", lambda project: project.has("limbs")),
    Part("joints", "the positions of the joints", lambda project: project.has("skeleton"), True),
    Part("angles", "the angles of the joints with their deviations", lambda project: project.has("skeleton"), True),
    Part("kinds", "types and axes of the joints", lambda project: project.has("skeleton")),
    Part("uncertainty", "how sure the joints are", lambda project: project.has("skeleton")),
    Part("motion", "how the limbs turn", lambda project: project.has("skeleton"), True),
)
"""All parts, in the order in which the stages find them."""


def parts_in(project: Project) -> tuple[Part, ...]:
    """Return the parts that a project has."""
    return tuple(part for part in PARTS if part.is_in(project))


_OF_JOINTS = "The motion does not determine where these joints are"
_OF_HINGES = "The motion does not determine where these hinges are along their axes"
_SENTENCES = {
    Place.CHOICE: f"{_OF_JOINTS}; their places are a choice",
    Place.IN_PART: f"{_OF_JOINTS}; their places are in part a choice",
    Place.MARKER_SET: f"{_OF_JOINTS}; the marker set places them",
    Place.USUAL: f"{_OF_JOINTS}; what is usual of bodies places them",
    Place.CHOICE_ALONG_AXIS: f"{_OF_HINGES}; that is a choice",
    Place.USUAL_ALONG_AXIS: f"{_OF_HINGES}; what is usual of bodies places them",
}


def choices_in(project: Project) -> tuple[str, ...]:
    """Say which joints the motion does not determine, and what places these instead.

    Parameters
    ----------
    project : Project
        With or without a skeleton.
    """
    if not project.has("skeleton"):
        return ()
    names: dict[Place, list[str]] = {place: [] for place in _SENTENCES}
    for name, joint in zip(project.skeleton.joint_names, project.skeleton.joints, strict=True):
        names.get(place_of(joint), []).append(name)
    return tuple(f"{_SENTENCES[place]}: {', '.join(of)}." for place, of in names.items() if of)
