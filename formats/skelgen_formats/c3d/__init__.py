"""C3D, the exchange format of motion capture: read and written as takes, and written with joints as virtual points.

`layout` is what a file states of itself, `writer` writes points as a stream. Points with a residual below 0 and points
at exactly (0, 0, 0) are unseen. ezc3d is not used
because it trusts headers: a single damaged byte can end the whole process or fill the memory, which no caller can
catch, it stops after 65535 frames, and it keeps every array that it is given. The tests compare with it, and with the
package `c3d`.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from skelgen.files import open_regular
from skelgen.model import PointCloud, Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.filled import Filled, PositionSource
from skelgen.progress import SILENT, Monitor
from skelgen_formats.c3d.layout import MAGIC, MOST_HEADER_FRAMES, WORDS_PER_POINT, C3dLayout, dec_floats, read_layout
from skelgen_formats.c3d.writer import write_points
from skelgen_formats.markers import (
    check_markers,
    frames_in_blocks,
    marker_files,
    markers_to_write,
    mm_per_unit,
    positions_of,
    scaled,
    take_from_markers,
    trajectories_of,
    write_table,
    zeros_unseen,
)
from skelgen_formats.options import AXES, FILLED, RATE, UNIT, Format, Options, Writable, finished_project

__all__ = [
    "C3D",
    "C3D_JOINTS",
    "read_c3d",
    "write_c3d",
    "write_c3d_joints",
]

_TITLE, _JOINTS_TITLE = "C3D", "C3D with joints"
_FIRST_PRINTABLE = 0x20  # block numbers lie below; above, "P" as second byte is text


def write_c3d(
    value: Writable, path: Path, filled: bool = False, unit: str = "mm", monitor: Monitor = SILENT
) -> list[Path]:
    """Write labelled markers as C3D: f32, unseen markers with residual -1.

    Parameters
    ----------
    value : Project, Trajectories or Filled
        What to write.
    path : Path
        The file.
    filled : bool
        Whether filled positions are written, with residual 0 and no camera, as c3d.org has it for points that are not
        measured; measured ones then have residual 1 and camera 1, because nobody knows which cameras saw them.
    unit : str
        Of the lengths in the file.
    monitor : Monitor
        Shows the progress of filling; may cancel.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or a name is longer than 127 bytes.
    """
    markers = markers_to_write(value, _TITLE, filled, monitor)
    write_points(positions_of(markers), path, unit, markers.source if isinstance(markers, Filled) else None)
    return [path, *write_table(markers, path)]


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    take = trajectories_of(project, _TITLE)
    far = float(np.nanmax(np.abs(take.positions), initial=0.0))
    rounded = f"Positions are rounded to single precision, to {np.spacing(np.float32(far)):.1g} mm."
    cut = f"Some programs show only the first {MOST_HEADER_FRAMES} of the {take.n_frames} frames of a C3D file."
    return (rounded, cut) if take.n_frames > MOST_HEADER_FRAMES else (rounded,)


C3D = Format(
    name="c3d",
    title=_TITLE,
    suffixes=(".c3d",),
    holds="markers",
    sniff=lambda head, path: len(head) > 1 and head[1] == MAGIC and 0 < head[0] < _FIRST_PRINTABLE,
    read=lambda path, options: read_c3d(path),
    write=lambda value, path, options, monitor: write_c3d(value, path, options.filled, options.unit, monitor),
    check=lambda value, options: check_markers(value, _TITLE, options.filled),
    files=lambda path, options: marker_files(path, options.filled),
    keeps=("markers", "names"),
    remarks=_remarks,
    filled_mark="filled positions have residual 0 and no camera, measured ones residual 1 and one camera",
    options=(AXES, UNIT, RATE, FILLED),
    note="Units from the file; residual below 0 and all zeros are unseen; any number of labels and frames; f32 in mm.",
)


def write_c3d_joints(value: Writable, path: Path, unit: str = "mm", monitor: Monitor = SILENT) -> list[Path]:
    """Write measured markers and joints as the points of a C3D file.

    Joints have residual 0 and no camera, as c3d.org has it for points that are computed; measured markers have residual
    1 and camera 1, unseen ones residual -1.

    Parameters
    ----------
    value : Project
        Finished.
    path : Path
        The file.
    unit : str
        Of the lengths in the file.
    monitor : Monitor
        May cancel before the file is written.

    Raises
    ------
    WriteError
        If the value is no project, a marker is called like a joint, or as for C3D.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = finished_project(value, _JOINTS_TITLE)
    markers, joints = project.trajectories, project.motion.joint_positions
    points = replace(
        markers,
        positions=np.concatenate([markers.positions, joints], axis=1),
        names=(*markers.names, *project.skeleton.joint_names),
    )
    measured = np.where(markers.seen, PositionSource.MEASURED, PositionSource.NONE)
    computed = np.full(joints.shape[:2], PositionSource.JOINT)
    write_points(points, path, unit, np.concatenate([measured, computed], axis=1))
    return [path]


def _remarks_on_joints(project: Project, options: Options) -> tuple[str, ...]:
    told_apart = "Joints have residual 0 and no camera, measured markers residual 1 and one camera."
    return (told_apart, *C3D.remarks(project, options))


C3D_JOINTS = Format(
    name="c3d-joints",
    title=_JOINTS_TITLE,
    suffixes=(".joints.c3d",),
    holds="joints",
    write=lambda value, path, options, monitor: write_c3d_joints(value, path, options.unit, monitor),
    check=lambda value, options: finished_project(value, _JOINTS_TITLE),
    keeps=("markers", "names", "joints"),
    remarks=_remarks_on_joints,
    options=(AXES, RATE, UNIT),
    note="Markers as measured, and the joints' centres as virtual points named after parent and child limb.",
)


_HUMAN_SIZE_M = 50.0  # all coordinates of a capture in metres lie below this, of one in mm hardly ever


def read_c3d(path: Path) -> Trajectories | PointCloud:
    """Read the points of a C3D file.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the file is damaged, cut off, or two points have the same label.
    """
    layout = read_layout(path)
    notices: list[str] = []
    names = _names(layout, notices)
    positions, generated = _read_points(path, layout)
    if layout.counted:
        notices.append(f"the header cannot say how many frames there are; {len(positions)} were found")
    _compare_counts(layout, len(positions), notices)
    if generated:
        notices.append(f"{generated} positions are marked as computed (residual 0), and taken as if they were measured")
    factor = _mm_per_unit(path, layout, positions, notices)
    return take_from_markers(path, scaled(path, positions, factor), names, layout.rate, notices)


def _names(layout: C3dLayout, notices: list[str]) -> list[str]:
    labels = layout.texts("POINT", "LABELS")[: layout.n_points]
    labels += [""] * (layout.n_points - len(labels))
    unnamed = [number for number, label in enumerate(labels, start=1) if not label]
    if unnamed:
        notices.append(f"{len(unnamed)} points have no label and are called 'point {unnamed[0]}' and so on")
    return [label or f"point {number}" for number, label in enumerate(labels, start=1)]


def _read_points(path: Path, layout: C3dLayout) -> tuple[Floats, int]:
    """Return positions, shape (n_frames, n_points, 3), NaN where unseen, and how many are marked as computed."""
    positions = np.empty((layout.n_frames, layout.n_points, 3))
    last, n_computed, n_measured = 0, 0, 0  # the last frame that is filled
    with open_regular(path) as stream:
        stream.seek(layout.data_start)
        for first, block in frames_in_blocks(positions):
            points = _points(layout, stream.read(len(block) * layout.frame_words * layout.word_bytes))
            filled = np.flatnonzero(points.any(axis=(1, 2)))
            last = first + int(filled[-1]) if len(filled) else last
            block[:], residuals = points[:, :, :3], points[:, :, 3]
            block[residuals < 0] = np.nan
            seen = ~np.isnan(zeros_unseen(block)[..., 0])
            n_computed += int((seen & (residuals == 0)).sum())
            n_measured += int((residuals > 0).sum())
    # points without residual and camera are computed, by the convention, if others of the file have them
    return positions[: last + 1] if layout.counted else positions, n_computed if n_measured else 0


def _points(layout: C3dLayout, raw: bytes) -> Floats:
    """Return coordinates and residual of some frames' points, shape (n_frames, n_points, 4), in the file's unit."""
    integers = layout.scale > 0
    if layout.dec and not integers:
        words = dec_floats(raw)
    else:
        words = np.frombuffer(raw, f"{layout.order}{'i2' if integers else 'f4'}")
    frames = words.reshape(-1, layout.frame_words)[:, : WORDS_PER_POINT * layout.n_points]
    with np.errstate(invalid="ignore"):  # a NaN that signals is a NaN
        points = frames.reshape(-1, layout.n_points, WORDS_PER_POINT).astype(np.float64)
    if integers:
        points[:, :, :3] *= layout.scale
    return points


def _compare_counts(layout: C3dLayout, found: int, notices: list[str]) -> None:
    stated = layout.parameters.get(("POINT", "FRAMES"))
    if stated is None or stated.size == 0 or stated.dtype.kind == "S":
        return
    stated_frames = float(stated.reshape(-1)[0]) % (MOST_HEADER_FRAMES + 1)
    if found <= MOST_HEADER_FRAMES and stated_frames != found:
        notices.append(f"{found} frames were read as the header says, although POINT:FRAMES says {stated_frames:g}")


def _mm_per_unit(path: Path, layout: C3dLayout, positions: Floats, notices: list[str]) -> float:
    units = [unit for unit in layout.texts("POINT", "UNITS") if unit]
    if units:
        return mm_per_unit(path, "POINT:UNITS", units[0])
    far = max(float(np.nanmax(np.abs(block), initial=0.0)) for _, block in frames_in_blocks(positions))
    unit = "m" if far < _HUMAN_SIZE_M else "mm"
    notices.append(f"the file names no length unit; {unit} is assumed since coordinates reach {far:.3g}")
    return mm_per_unit(path, "", unit)
