"""Read points and rotations of a C3D file; `layout` finds where they are.

Points with a residual below 0 and points at exactly (0, 0, 0) are unseen. Points that a model computed from markers are
no markers: those that the groups of POINT name as outputs, those whose residual is 0 throughout where others are
measured, and those with residual 0 throughout and a name of Vicon's models.

Theia and Visual3D write poses of segments behind the points. By C-Motion's extension of C3D the group ROTATION has
USED, LABELS, DATA_START (a block) and RATIO (poses per frame of the points). Of each pose stand 17 f32: the matrix that
takes the segment's axes to the world's and its origin, 4 x 4, column by column, in the unit of the points; then how
reliable it is, below 0 where the segment was not seen.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import open_regular
from skelgen.geometry.computed_points import are_axes
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import counted
from skelgen_formats.assumed_units import assumed_mm_per_unit, stated_mm_per_unit
from skelgen_formats.bodies import take_from_bodies
from skelgen_formats.c3d.layout import (
    MOST_HEADER_FRAMES,
    WORDS_PER_POINT,
    C3dLayout,
    byte_of_block,
    has_rotations,
    read_layout,
)
from skelgen_formats.c3d.parameters import dec_floats, number_of
from skelgen_formats.lines import Sample
from skelgen_formats.markers import (
    COMPUTED,
    are_outputs,
    frames_in_blocks,
    mm_per_unit,
    noted,
    scaled,
    take_from_markers,
    zeros_unseen,
)
from skelgen_formats.options import ALL_POINTS, AUTO, MARKERS

_OUTPUT_GROUPS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS", "MODELED_MARKERS", "USERMOS")
_MASS = re.compile(r"\w*Cent(re|er)Of(Mass|Gravity)(Floor)?")


class _Points(NamedTuple):
    """Positions of a file, in how many frames each point is marked as computed and as measured, and infinite ones."""

    positions: Floats
    computed: Ints
    measured: Ints
    n_infinite: int


def read_c3d(
    path: Path, points: str = MARKERS, bodies: bool = False, sample: Sample | None = None, recorded_unit: str = AUTO
) -> Trajectories | PointCloud | Poses:
    """Read the points of a C3D file.

    Parameters
    ----------
    path : Path
        The file.
    points : str
        `ALL_POINTS` to read points that a model computed, too.
    bodies : bool
        Whether segments with rotations are read although there are points.
    sample : Sample, optional
        Some frames only, where the file says how many there are.
    recorded_unit : str
        Unit of lengths where the file names none; `AUTO` tells it by their size.

    Returns
    -------
    Trajectories
        Positions in mm; a `PointCloud` if no trajectory has a label; `Poses` of segments if there are no points.

    Raises
    ------
    FormatError
        If the file is damaged or cut off.
    """
    layout = read_layout(path)
    if has_rotations(layout.parameters) and (bodies or layout.n_points == 0):
        return read_rotations(path, layout)
    notices = list(layout.notices)
    if has_rotations(layout.parameters):
        notices.append("segments with rotations are left out; `--bodies` reads them instead of the points")
    names = _names(layout, notices)
    frames = np.arange(layout.n_frames)
    chosen = sample.of(frames) if sample and not layout.counted else frames
    read = _read_points(path, layout, chosen)
    if layout.counted:
        notices.append(f"the header cannot say how many frames there are; {len(read.positions)} were found")
    if read.n_infinite:
        notices.append(f"{counted(read.n_infinite, 'position is', 'positions are')} infinite, and taken as unseen")
    _compare_counts(layout, len(read.positions) + layout.n_frames - len(chosen), notices)
    outputs = _are_outputs(layout, names, read)
    left_out = outputs & (points != ALL_POINTS)
    generated = int(read.computed[~left_out].sum())
    if generated and read.measured.any():
        whole = len(chosen) == layout.n_frames
        some = counted(generated, "position is", "positions are") if whole else "some positions are"
        notices.append(f"{some} marked as computed (residual 0), and taken as if measured")
    kept = read.positions[:, ~left_out] if left_out.any() and not left_out.all() else read.positions
    units = [unit for unit in layout.texts("POINT", "UNITS") if unit]
    if units:
        factor = stated_mm_per_unit(path, "POINT:UNITS", units[0], notices, recorded_unit)
    else:
        factor = assumed_mm_per_unit(kept, notices, recorded_unit)
    if kept is read.positions:
        return take_from_markers(path, scaled(path, kept, factor), names, layout.rate, notices, left_out)
    computed = [name for name, is_out in zip(names, left_out.tolist(), strict=True) if is_out]
    noted(notices, computed, np.ones(len(computed), dtype=bool), COMPUTED)
    remaining = [name for name, is_out in zip(names, left_out.tolist(), strict=True) if not is_out]
    return take_from_markers(path, scaled(path, kept, factor), remaining, layout.rate, notices)


def _are_outputs(layout: C3dLayout, names: Sequence[str], read: _Points) -> Bools:
    """Return which points a model computed, shape (n_points,)."""
    short = [name.rpartition(":")[2] for name in names]
    groups = {*_OUTPUT_GROUPS, *layout.texts("POINT", "TYPE_GROUPS")} - {"LABELS"}  # the latter names further ones
    listed = {text.rpartition(":")[2] for group in groups for text in layout.texts("POINT", group)} - {""}
    unmeasured = (read.measured == 0) & (read.computed > 0)
    named = are_outputs(short) | np.array([_MASS.fullmatch(name) is not None for name in short]) | are_axes(short)
    outputs = np.array([name in listed for name in short]) | (unmeasured & named)
    others = unmeasured & ~outputs
    if others.sum() < (read.measured > 0).sum():  # else the file marks measured points so
        outputs |= others
    return np.asarray(outputs)


def _names(layout: C3dLayout, notices: list[str]) -> list[str]:
    labels = layout.texts("POINT", "LABELS")[: layout.n_points]
    labels += [""] * (layout.n_points - len(labels))
    unnamed = [number for number, label in enumerate(labels, start=1) if not label]
    if unnamed:
        first = f"'point {unnamed[0]}'"
        one, several = (
            f"point has no label and is called {first}",
            f"points have no label and are called {first} and so on",
        )
        notices.append(counted(len(unnamed), one, several))
    return [label or f"point {number}" for number, label in enumerate(labels, start=1)]


def _read_points(path: Path, layout: C3dLayout, chosen: Ints) -> _Points:
    """Return positions of some frames, shape (n, n_points, 3), NaN where unseen, and how they are marked."""
    positions = np.empty((len(chosen), layout.n_points, 3))
    last = n_infinite = 0  # the last frame that is filled
    computed, measured = (np.zeros(layout.n_points, dtype=np.intp) for _ in range(2))
    with open_regular(path) as stream:
        for first, block in frames_in_blocks(positions):
            points = _points(layout, _raw(stream, layout, chosen[first : first + len(block)]))
            filled = np.flatnonzero(points.any(axis=(1, 2)))
            last = first + int(filled[-1]) if len(filled) else last
            block[:], residuals = points[:, :, :3], points[:, :, 3]
            block[residuals < 0] = np.nan
            infinite = np.isinf(block).any(axis=2)
            block[infinite] = np.nan
            n_infinite += int(infinite.sum())
            seen = ~np.isnan(zeros_unseen(block)[..., 0])
            computed += (seen & (residuals == 0)).sum(axis=0)
            measured += (residuals > 0).sum(axis=0)
    # points without residual and camera are computed, by the convention, if others of the file have them
    return _Points(positions[: last + 1] if layout.counted else positions, computed, measured, n_infinite)


def _raw(stream: BinaryIO, layout: C3dLayout, frames: Ints) -> bytes:
    """Return the bytes of frames: at once, if they follow each other."""
    size = layout.frame_words * layout.word_bytes
    n_bytes = len(frames) * size if len(frames) and frames[-1] - frames[0] + 1 == len(frames) else size
    pieces = []
    for frame in frames[:: n_bytes // size].tolist():
        stream.seek(layout.data_start + frame * size)
        pieces.append(stream.read(n_bytes))
    return b"".join(pieces)


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
        notices.append(
            f"{counted(found, 'frame was', 'frames were')} read as the header says, although POINT:FRAMES says "
            f"{stated_frames:g}"
        )


_WORDS = 17  # per pose: a matrix and how reliable it is
_LAB = "worldbody"  # the world itself, which Theia lists as a segment
_SUFFIX = "_4X4"


def read_rotations(path: Path, layout: C3dLayout) -> Poses:
    """Read the segments of a C3D file as bodies.

    Parameters
    ----------
    path : Path
        The file.
    layout : C3dLayout
        What it says of itself.

    Raises
    ------
    FormatError
        If the poses lie outside the file, or are not those of rigid bodies.
    """
    count, ratio = (int(number_of(layout.parameters, ("ROTATION", key), 1)) for key in ("USED", "RATIO"))
    start = byte_of_block(layout.parameters, "ROTATION")
    if start <= 0 or ratio < 1:
        raise FormatError(path, "ROTATION", f"DATA_START is block {start // 512 + 1} and RATIO {ratio}; one is damaged")
    with open_regular(path) as stream:
        stream.seek(start)
        raw = stream.read()
    whole = len(raw) // (4 * _WORDS * count)
    words = raw[: 4 * _WORDS * count * whole]
    floats = dec_floats(words) if layout.dec else np.frombuffer(words, f"{layout.order}f4")
    frames = floats.reshape(whole, count, _WORDS).astype(np.float64)
    frames = frames[: layout.n_frames * ratio] if layout.n_frames else frames
    matrices = frames[:, :, :16].reshape(len(frames), count, 4, 4).swapaxes(2, 3)
    matrices[frames[:, :, 16] < 0] = np.nan
    turns = matrices[:, :, :3, :3].reshape(len(frames), count, 9)
    poses = np.concatenate([matrices[:, :, :3, 3], turns], axis=2)
    names = [name.removesuffix(_SUFFIX) for name in layout.texts("ROTATION", "LABELS")[:count]]
    names += [f"segment {number}" for number in range(len(names) + 1, count + 1)]
    kept = [place for place, name in enumerate(names) if name != _LAB]
    notices = [*layout.notices, *([f"{_LAB} is the world, and left out"] if len(kept) < count else [])]
    units = [unit for unit in layout.texts("POINT", "UNITS") if unit]
    if not units:
        notices.append("the file names no length unit; mm are assumed")
    factor = mm_per_unit(path, "POINT:UNITS", units[0]) if units else 1.0
    called = [names[place] for place in kept]
    return take_from_bodies(path, poses[:, kept], factor, called, layout.rate * ratio, notices)
