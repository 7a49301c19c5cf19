"""C3D, the exchange format of motion capture: read here, written with ezc3d and, behind the first frame, `c3d_data`.

The layout is told in `c3d_layout`. ezc3d is not used for reading because it trusts headers: a single damaged byte can
end the whole process or fill the memory, which no caller can catch, and it stops after 65535 frames. The tests read
every file with it too and compare. Points with a residual below 0 and points at exactly (0, 0, 0) are unseen.

More than 65535 frames are written so that their number is stated in TRIAL:ACTUAL_END_FIELD, as Vicon does, and in
POINT:LONG_FRAMES, as c3d.org proposes. Programs that know neither, ezc3d 1.7 among them, show the first 65535 frames.
More than 255 labels go on in POINT:LABELS2 and so forth. Written data are f32, so positions keep 7 digits.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import PointCloud, Project, Take, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled, Source
from skelgen.progress import SILENT, Monitor
from skelgen_formats.c3d.layout import MAGIC, MOST_HEADER_FRAMES, C3dLayout, dec_floats, read_layout
from skelgen_formats.c3d.writer import write_frames
from skelgen_formats.markers import (
    check_markers,
    check_writable_names,
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
from skelgen_formats.motion_csv import joint_names
from skelgen_formats.options import AXES, FILLED, RATE, UNIT, per_mm
from skelgen_formats.parts import finished_project
from skelgen_formats.registry import Format

_TITLE = "C3D"
_HUMAN_SIZE_M = 50.0  # all coordinates of a capture in metres lie below this, of one in mm hardly ever
_LONGEST_NAME = 127  # the format has signed bytes for some lengths
_MOST_POINTS = 65535
_CAMERAS = 7  # bits of the mask
_FIRST_PRINTABLE = 0x20  # block numbers lie below; above, "P" as second byte is text


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
    raw, residuals = _read_points(path, layout)
    if layout.counted:
        notices.append(f"the header cannot say how many frames there are; {len(raw)} were found")
    _compare_counts(layout, len(raw), notices)
    raw[residuals < 0] = np.nan
    positions = zeros_unseen(raw)
    _tell_of_generated(positions, residuals, notices)
    factor = _mm_per_unit(path, layout, positions, notices)
    return take_from_markers(path, scaled(path, positions, factor), names, layout.rate, notices)


def write_c3d(
    value: Project | Take | Filled, path: Path, filled: bool = False, unit: str = "mm", monitor: Monitor = SILENT
) -> list[Path]:
    """Write labelled markers as C3D: f32, unseen markers with residual -1.

    With `filled`, filled positions have residual 0 and no camera, as c3d.org has it for points that are not measured,
    and measured ones residual 1 and camera 1, because by which cameras they were seen is not known.

    Raises
    ------
    WriteError
        If the value has no labelled markers, or a name is longer than 127 bytes.
    """
    markers = markers_to_write(value, _TITLE, filled, monitor)
    write_points(positions_of(markers), path, unit, markers.source if isinstance(markers, Filled) else None)
    return [path, *write_table(markers, path)]


def write_points(take: Trajectories, path: Path, unit: str, source: Ints | None = None) -> None:
    """Write the points of a C3D file.

    Parameters
    ----------
    take : Trajectories
        The points.
    path : Path
        The file.
    unit : str
        Of the lengths in it.
    source : ndarray of intp, shape (n_frames, n_markers), optional
        A `Source` of each, by which computed points are told from measured ones.

    Raises
    ------
    WriteError
        If there are too many points, or a name is too long or twice there.
    """
    names = check_writable_names(path, take.names, "", str.strip)
    too_long = [name for name in names if len(name.encode()) > _LONGEST_NAME]
    if too_long or take.n_markers > _MOST_POINTS:
        what = f"the name {too_long[0]!r} is too long" if too_long else f"{take.n_markers} markers are too many"
        raise WriteError(f"{path}: {what} for C3D; csm or trc can hold it")
    with replacing(path) as temporary:
        try:
            content = _content(take, names, unit)
            if source is not None:
                content["data"]["meta_points"] = _told_apart(source[:1].T)
            content.write(os.fspath(temporary))
        except (RuntimeError, ValueError, IndexError) as error:
            raise WriteError(f"{path}: ezc3d cannot write it: {error}") from error
        if take.n_frames == 0 or take.n_markers == 0:
            return
        try:
            write_frames(temporary, take.positions * per_mm(unit), source)
        except (OSError, ValueError) as error:  # ezc3d does not notice a disk that is full
            raise WriteError(f"{path}: cannot be written whole: is the disk full?") from error


def _names(layout: C3dLayout, notices: list[str]) -> list[str]:
    labels = layout.texts("POINT", "LABELS")[: layout.n_points]
    labels += [""] * (layout.n_points - len(labels))
    unnamed = [number for number, label in enumerate(labels, start=1) if not label]
    if unnamed:
        notices.append(f"{len(unnamed)} points have no label and are called 'point {unnamed[0]}' and so on")
    return [label or f"point {number}" for number, label in enumerate(labels, start=1)]


def _read_points(path: Path, layout: C3dLayout) -> tuple[Floats, Floats]:
    """Return positions, shape (n_frames, n_points, 3), and residuals, shape (n_frames, n_points)."""
    with path.open("rb") as stream:
        stream.seek(layout.data_start)
        raw = stream.read(layout.n_frames * layout.frame_words * layout.word_bytes)
    integers = layout.scale > 0
    if layout.dec and not integers:
        words = dec_floats(raw)
    else:
        words = np.frombuffer(raw, f"{layout.order}{'i2' if integers else 'f4'}")
    frames = words.reshape(layout.n_frames, layout.frame_words)[:, : 4 * layout.n_points]
    points = frames.reshape(layout.n_frames, layout.n_points, 4).astype(np.float64)
    if layout.counted:
        points = _without_padding(points)
    if integers:
        points[:, :, :3] *= layout.scale
    return points[:, :, :3], points[:, :, 3]


def _tell_of_generated(positions: Floats, residuals: Floats, notices: list[str]) -> None:
    """Points without residual and camera are computed, by the convention, if others of the file have them."""
    generated = int(((residuals == 0) & ~np.isnan(positions[..., 0])).sum())
    if generated and (residuals > 0).any():
        notices.append(f"{generated} positions are marked as computed (residual 0), and taken as if they were measured")


def _compare_counts(layout: C3dLayout, found: int, notices: list[str]) -> None:
    said = layout.parameters.get(("POINT", "FRAMES"))
    if said is None or said.size == 0 or said.dtype.kind == "S":
        return
    said_frames = float(said.reshape(-1)[0]) % (MOST_HEADER_FRAMES + 1)
    if found <= MOST_HEADER_FRAMES and said_frames != found:
        notices.append(f"{found} frames were read as the header says, although POINT:FRAMES says {said_frames:g}")


def _without_padding(points: Floats) -> Floats:
    filled = np.flatnonzero(points.any(axis=(1, 2)))
    return points[: filled[-1] + 1] if len(filled) else points[:1]


def _mm_per_unit(path: Path, layout: C3dLayout, positions: Floats, notices: list[str]) -> float:
    units = [unit for unit in layout.texts("POINT", "UNITS") if unit]
    if units:
        return mm_per_unit(path, "POINT:UNITS", units[0])
    far = float(np.nanmax(np.abs(positions), initial=0.0))
    unit = "m" if far < _HUMAN_SIZE_M else "mm"
    notices.append(f"the file names no length unit; {unit} is assumed since coordinates reach {far:.3g}")
    return mm_per_unit(path, "", unit)


def _content(take: Trajectories, names: list[str], unit: str) -> Any:
    import ezc3d  # noqa: PLC0415 - compiled code that only this format needs

    content = ezc3d.c3d()
    point = content["parameters"]["POINT"]
    point["UNITS"]["value"] = [unit]
    point["RATE"]["value"] = [take.rate]
    point["LABELS"]["value"] = names
    if take.n_frames > MOST_HEADER_FRAMES:
        content.add_parameter("POINT", "LONG_FRAMES", [float(take.n_frames)])
        content.add_parameter("TRIAL", "ACTUAL_START_FIELD", [0])  # makes the group; the next lines make it integer
        content["parameters"]["TRIAL"]["ACTUAL_START_FIELD"] = _long_word(1)
        content["parameters"]["TRIAL"]["ACTUAL_END_FIELD"] = _long_word(take.n_frames)
    first = take.positions[:1] * per_mm(unit)  # the others come after it, see `c3d_data`
    points = np.ones((4, take.n_markers, len(first)))
    points[:3] = np.moveaxis(first, -1, 0).swapaxes(1, 2)
    content["data"]["points"] = points
    return content


def _told_apart(source: Ints) -> dict[str, Any]:
    """Residuals and cameras by which computed points are told from measured ones and from gaps."""
    cameras = np.zeros((_CAMERAS, *source.shape), dtype=bool)
    cameras[0] = source == Source.MEASURED
    residuals = np.where(cameras[0], 1.0, np.where(source == Source.NONE, -1.0, 0.0))
    return {"residuals": residuals[np.newaxis], "camera_masks": cameras}


def _long_word(number: int) -> dict[str, Any]:
    import ezc3d  # noqa: PLC0415 - compiled code that only this format needs

    words = np.array([number % (MOST_HEADER_FRAMES + 1), number // (MOST_HEADER_FRAMES + 1)])
    return {"type": ezc3d.ezc3d.INT, "description": "", "is_locked": False, "value": words}


def _sniff(head: bytes, path: Path) -> bool:
    return len(head) > 1 and head[1] == MAGIC and 0 < head[0] < _FIRST_PRINTABLE


def _remarks(project: Project, options: Mapping[str, Any]) -> tuple[str, ...]:
    take = trajectories_of(project, _TITLE)
    far = float(np.nanmax(np.abs(take.positions), initial=0.0))
    rounded = f"Positions are rounded to single precision, to {np.spacing(np.float32(far)):.1g} mm."
    if take.n_frames <= MOST_HEADER_FRAMES:
        return (rounded,)
    return (
        rounded,
        f"Some programs show only the first {MOST_HEADER_FRAMES} of the {take.n_frames} frames of a C3D file.",
    )


C3D = Format(
    name="c3d",
    title=_TITLE,
    suffixes=(".c3d",),
    holds="markers",
    sniff=_sniff,
    read=read_c3d,
    write=write_c3d,
    check=lambda value, options: check_markers(value, _TITLE, bool(options.get(FILLED.name))),
    files=marker_files,
    keeps=("markers", "names"),
    remarks=_remarks,
    filled_mark="filled positions have residual 0 and no camera, measured ones residual 1 and one camera",
    options=(AXES, UNIT, RATE, FILLED),
    note="Units from the file; residual below 0 and all zeros are unseen; any number of labels and frames; f32 in mm.",
)


_JOINTS_TITLE = "C3D with joints"


def write_c3d_joints(value: Project | Take, path: Path, unit: str = "mm", monitor: Monitor = SILENT) -> list[Path]:
    """Write measured markers and joints as the points of a C3D file.

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
        names=(*markers.names, *joint_names(project.skeleton)),
    )
    measured = np.where(markers.seen, Source.MEASURED, Source.NONE)
    computed = np.full(joints.shape[:2], Source.JOINT)
    write_points(points, path, unit, np.concatenate([measured, computed], axis=1))
    return [path]


def _remarks_on_joints(project: Project, options: Mapping[str, Any]) -> tuple[str, ...]:
    told_apart = "Joints have residual 0 and no camera, measured markers residual 1 and one camera."
    return (told_apart, *C3D.remarks(project, options))


C3D_JOINTS = Format(
    name="c3d-joints",
    title=_JOINTS_TITLE,
    suffixes=(".joints.c3d",),
    holds="joints",
    write=write_c3d_joints,
    check=lambda value, options: finished_project(value, _JOINTS_TITLE),
    keeps=("markers", "names", "joints"),
    remarks=_remarks_on_joints,
    options=(AXES, RATE, UNIT),
    note="Markers as measured, and the joints' centres as virtual points named after parent and child limb.",
)
