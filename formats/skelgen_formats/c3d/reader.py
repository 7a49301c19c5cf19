"""Read the points of a C3D file; `layout` finds where they are.

Points with a residual below 0 and points at exactly (0, 0, 0) are unseen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from skelgen.files import open_regular
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats
from skelgen_formats.c3d.layout import MOST_HEADER_FRAMES, WORDS_PER_POINT, C3dLayout, dec_floats, read_layout
from skelgen_formats.markers import frames_in_blocks, mm_per_unit, scaled, take_from_markers, zeros_unseen

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
