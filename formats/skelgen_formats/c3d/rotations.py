"""Rotations in C3D: poses of segments that Theia and Visual3D write behind the points.

By C-Motion's extension of C3D the group ROTATION has USED, LABELS, DATA_START (a block) and RATIO (poses per frame of
the points). Of each pose stand 17 f32: the matrix that takes the segment's axes to the world's and its origin, 4 x 4,
column by column, in the unit of the points; then how reliable it is, below 0 where the segment was not seen.
"""

from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import open_regular
from skelgen.model import Poses
from skelgen_formats.bodies import blank_unseen, quaternions_from_matrices, take_from_bodies, transforms_of
from skelgen_formats.c3d.layout import C3dLayout, byte_of_block
from skelgen_formats.c3d.parameters import dec_floats, number_of
from skelgen_formats.markers import mm_per_unit

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
    numbers = blank_unseen(matrices[:, :, :3].reshape(len(frames), count, 12).copy()).reshape(len(frames), count, 3, 4)
    quaternions = quaternions_from_matrices(path, numbers[..., :3])
    names = [name.removesuffix(_SUFFIX) for name in layout.texts("ROTATION", "LABELS")[:count]]
    names += [f"segment {number}" for number in range(len(names) + 1, count + 1)]
    kept = [place for place, name in enumerate(names) if name != _LAB]
    notices = [*layout.notices, *([f"{_LAB} is the world, and left out"] if len(kept) < count else [])]
    units = [unit for unit in layout.texts("POINT", "UNITS") if unit]
    if not units:
        notices.append("the file names no length unit; mm are assumed")
    poses = np.concatenate([numbers[..., 3], quaternions], axis=2)[:, kept]
    transforms = transforms_of(path, poses, mm_per_unit(path, "POINT:UNITS", units[0]) if units else 1.0)
    return take_from_bodies(path, transforms, [names[place] for place in kept], layout.rate * ratio, notices)
