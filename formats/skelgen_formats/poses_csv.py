"""Poses CSV: bodies with position and orientation per frame, as magnetic sensors give; skelgen's own layout.

Layout, comma-separated text::

    skelgen-poses,1                                   the format and its version
    rate,120.0,Hz
    unit,mm                                           of positions; mm, cm, m and others are read
    frame,time,pelvis.x,pelvis.y,pelvis.z,pelvis.qw,pelvis.qx,pelvis.qy,pelvis.qz,thigh.x,...
    0,0.0,12.5,-3.0,880.1,1.0,0.0,0.0,0.0,...

Per body seven columns: the position of its origin in the world, and the unit quaternion (scalar first) of the rotation
that takes the body's axes to the world's: p_world = R(q) p_body + (x, y, z). Axes are right-handed. A body that is not
seen in a frame has seven empty cells. The time, in seconds, is for the reader's convenience; the rate counts.
Quaternions may be off unit length by a thousandth and are normalised; q and -q mean the same, qw >= 0 is written.

The bodies of a project are its limbs, whose origins are the joints to their parents. If the motion leaves open where
one of these joints is, columns ``thigh.determined`` stand last, one for each limb with a joint above: 0 where the
motion does not determine its origin, or 1. They are not read.
"""

import csv
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, WriteError
from skelgen.files import replacing
from skelgen.geometry.rotations import quaternion_from_matrix
from skelgen.model import Poses, Project
from skelgen.progress import Monitor, with_progress
from skelgen_formats.bodies import take_from_bodies
from skelgen_formats.bones import never_seen_remarks
from skelgen_formats.lines import Sample, decoded_head, read_lines
from skelgen_formats.markers import mm_per_unit
from skelgen_formats.options import AXES, FIXED_DISTANCE, RATE, UNIT, Format, Options, Writable, per_mm
from skelgen_formats.text import defused, parse_rows, rate_in, split_cells, undefused
from skelgen_formats.writing import check_writable_names

_MAGIC = "skelgen-poses"
_VERSION = "1"
_COLUMNS = ("x", "y", "z", "qw", "qx", "qy", "qz")
_MARK = ".determined"
_LEADING_CELLS = 2  # frame and time
_HEADER_LINES = 4


def read_poses(path: Path, fixed_distance: float = 0.0, sample: Sample | None = None) -> Poses:
    """Read bodies with orientation.

    Parameters
    ----------
    path : Path
        The file.
    fixed_distance : float, mm
        Distance of two sensors that are fixed to one limb, from which the unit is found; 0: as the file says.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    Poses
        Transforms with translations in mm; bodies that are never seen are dropped with a notice.

    Raises
    ------
    FormatError
        If a line is not as the layout demands, or a quaternion is not one of a rotation.
    """
    lines = read_lines(path, sample)
    header = [split_cells(path, line, number, ",") for number, line in enumerate(lines[:_HEADER_LINES], start=1)]
    rate, factor = _rate_and_unit(path, header)
    names, wanted = _names(path, header[3])
    rows = parse_rows(path, lines.rows(_HEADER_LINES), len(header[3]), ",", range(wanted), leading=_LEADING_CELLS)
    numbers = rows.reshape(len(rows), len(names), len(_COLUMNS))
    take = take_from_bodies(path, numbers, factor, names, rate)
    if not fixed_distance:
        return take
    from skelgen.kinematics.sensor_frames import scaled_by_fixed_sensors  # noqa: PLC0415 - few takes need it

    return scaled_by_fixed_sensors(take, fixed_distance)


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write bodies with orientation; quaternions with scalar first."""
    take = _poses_of(value)
    names = check_writable_names(path, take.names, "")
    numbers = np.full((*take.world_from_body.shape[:2], len(_COLUMNS)), np.nan)
    seen = ~np.isnan(take.world_from_body[:, :, 0, 0])
    rotations = quaternion_from_matrix(take.world_from_body[seen, :3, :3])
    numbers[seen] = np.concatenate([take.world_from_body[seen, :3, 3], rotations], axis=1)
    numbers = numbers * ([per_mm(options.unit)] * 3 + [1.0] * 4)
    marks = _marks(value)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        titles = ["frame", "time", *(f"{defused(name)}.{column}" for name in names for column in _COLUMNS)]
        titles += [f"{defused(name)}{_MARK}" for name in marks]
        header = ((_MAGIC, _VERSION), ("rate", repr(take.rate), "Hz"), ("unit", options.unit), titles)
        csv.writer(stream, lineterminator="\n").writerows(header)
        for frame, row in enumerate(with_progress(numbers.reshape(take.n_frames, -1), take.n_frames, monitor)):
            cells = ["" if x != x else repr(x) for x in row.tolist()]  # noqa: PLR0124 - NaN differs from itself
            stream.write(",".join([str(frame), repr(frame / take.rate), *cells, *marks.values()]) + "\n")


def _marks(value: Writable) -> dict[str, str]:
    """Whether the motion determines the joint above each limb that is written, 1 or 0; nothing if it does all."""
    if not isinstance(value, Project) or isinstance(value.take, Poses):
        return {}
    joints, names = value.skeleton.joints, value.skeleton.limb_names
    if all(joint.is_determined for joint in joints):
        return {}
    return {names[joint.child]: str(int(joint.is_determined)) for joint in joints}


def _poses_of(value: Writable) -> Poses:
    """The bodies of a recording, or the limbs of a project that has found them; a limb that is not seen is left out."""
    take = value.take if isinstance(value, Project) else value
    if isinstance(take, Poses):
        return take
    if isinstance(value, Project) and value.has("skeleton"):
        motion = value.motion
        seen = np.where(motion.limb_seen[..., np.newaxis, np.newaxis], motion.world_from_limb, np.nan)
        return Poses(seen, value.skeleton.limb_names, motion.rate, value.name)
    raise WriteError(
        "poses-csv holds bodies with orientation and this value has markers: find its skeleton first, or write c3d, trc"
        " or csm"
    )


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    if isinstance(project.take, Poses):
        return ("Bodies are written as they were recorded, not as the skeleton poses them.",)
    hidden = int(project.motion.interpolated.any(axis=1).sum())
    empty = f"; in {hidden} of {project.motion.n_frames} frames some limb is not seen, whose cells are empty"
    fitted = f"The bodies are the limbs of the skeleton as it was fitted{empty if hidden else ''}."
    return (fitted, *(f"{one} Their cells are empty." for one in never_seen_remarks(project)))


def _rate_and_unit(path: Path, header: Sequence[Sequence[str]]) -> tuple[float, float]:
    if len(header) < _HEADER_LINES:
        raise FormatError(path, len(header), f"the header is cut off; {_HEADER_LINES} lines belong to it")
    if list(header[0][:2]) != [_MAGIC, _VERSION]:
        raise FormatError(path, 1, f"the first line must be '{_MAGIC},{_VERSION}'; another version cannot be read")
    for number, key in ((2, "rate"), (3, "unit")):
        if len(header[number - 1]) < 2 or header[number - 1][0] != key:
            raise FormatError(path, number, f"the line must begin with '{key},' and its value")
    return rate_in(path, 2, header[1][1], "rate"), mm_per_unit(path, 3, header[2][1])


def _names(path: Path, titles: Sequence[str]) -> tuple[list[str], int]:
    """Names of the bodies, and how many columns there are before the marks of joints."""
    titles = list(takewhile(lambda title: not title.endswith(_MARK), titles))
    columns = titles[_LEADING_CELLS:]
    titled = [title.rpartition(".")[0] for title in columns[:: len(_COLUMNS)]]
    expected = ["frame", "time", *(f"{name}.{column}" for name in titled for column in _COLUMNS)]
    names = [undefused(name) for name in titled]
    if not names or titles != expected:
        raise FormatError(path, 4, f"column titles must be frame, time and {', '.join(_COLUMNS)} of each body in turn")
    if len(set(names)) < len(names) or not all(name.strip() for name in names):
        raise FormatError(path, 4, "two bodies have the same name, or one has none; names must differ")
    return names, len(titles)


FORMAT = Format(
    name="poses-csv",
    title="Poses CSV (skelgen)",
    suffixes=(".poses.csv",),
    holds="poses",
    sniff=lambda head, path: decoded_head(head).startswith(_MAGIC),
    read=lambda path, options: read_poses(path, options.fixed_distance, options.sample),
    write=_write,
    check=lambda value, options: _poses_of(value),
    keeps=("bodies", "motion"),
    marks_open="columns `<limb>.determined` of the joints above the limbs, 1 or 0, the last; left out if all are 1",
    remarks=_remarks,
    options=(AXES, UNIT, RATE, FIXED_DISTANCE),
    note="Position and unit quaternion (scalar first) of each body, or limb of a project, per frame; unseen is empty.",
)
