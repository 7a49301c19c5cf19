"""Read the points of a C3D file; `layout` finds where they are.

Points with a residual below 0 and points at exactly (0, 0, 0) are unseen.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats
from skelgen_formats.c3d.layout import MOST_HEADER_FRAMES, WORDS_PER_POINT, C3dLayout, dec_floats, read_layout
from skelgen_formats.markers import mm_per_unit, scaled, take_from_markers, zeros_unseen

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
    raw, residuals = _read_points(path, layout)
    if layout.counted:
        notices.append(f"the header cannot say how many frames there are; {len(raw)} were found")
    _compare_counts(layout, len(raw), notices)
    raw[residuals < 0] = np.nan
    positions = zeros_unseen(raw)
    # points without residual and camera are computed, by the convention, if others of the file have them
    generated = int(((residuals == 0) & ~np.isnan(positions[..., 0])).sum())
    if generated and (residuals > 0).any():
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
    frames = words.reshape(layout.n_frames, layout.frame_words)[:, : WORDS_PER_POINT * layout.n_points]
    points = frames.reshape(layout.n_frames, layout.n_points, WORDS_PER_POINT).astype(np.float64)
    if layout.counted:
        filled = np.flatnonzero(points.any(axis=(1, 2)))
        points = points[: filled[-1] + 1] if len(filled) else points[:1]
    if integers:
        points[:, :, :3] *= layout.scale
    return points[:, :, :3], points[:, :, 3]


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
    far = float(np.nanmax(np.abs(positions), initial=0.0))
    unit = "m" if far < _HUMAN_SIZE_M else "mm"
    notices.append(f"the file names no length unit; {unit} is assumed since coordinates reach {far:.3g}")
    return mm_per_unit(path, "", unit)
