"""Markers that leap in space within one frame and do not come back: slips that no distance need show.

On a limb of three markers, a step across their plane hardly changes a distance. The step itself is visible, because
markers move on smooth paths. A marker that leaps may have slipped; it surely has only if distances confirm it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skelgen._kernels.marker_steps import LINE_FRAMES
from skelgen.model.arrays import Floats

COMMON = 99.9
"""Percentile of a measure over the take, which a slip must exceed."""

ABOVE_COMMON, ABOVE_COMMON_AT_ONCE = 2.5, 1.3
"""How many times the step between lines, and that of the single frame, must exceed that."""

COMES_BACK = 0.5
"""Part of a leap; if the marker moves back by it soon after, the leap was a wrong label or a glitch."""

SMALLEST = 0.05
"""mm; least common leap, however exact the take."""


def leaps(steps: Floats, paces: Callable[[], Floats], least: float, window: int) -> list[tuple[int, float]]:
    """Find the frames in which a marker leaps, and how many times farther than in all but few other frames.

    Parameters
    ----------
    steps : ndarray, shape (n_frames, 3), mm
        Where lines through the frames before and after each frame miss each other, 0 where that is unknown.
    paces : callable () -> ndarray, shape (n_frames, 3), mm
        From the frame before to each, less what the neighbours move; NaN where that is unknown. Asked for if needed.
    least : float, mm
        Smaller leaps do not count.
    window : int, frames
        How long a slip lasts at least.
    """
    size = np.linalg.norm(steps, axis=1)
    peaks = np.flatnonzero((size > least) & (size == _highest(size))).tolist() if (size > least).any() else []
    if not peaks:
        return []
    kinks = _kinks(paces())
    sharp = np.nan_to_num(np.linalg.norm(kinks, axis=1))
    found: list[tuple[int, float]] = []
    for frame in peaks:
        near = slice(max(frame - LINE_FRAMES, 0), frame + LINE_FRAMES + 1)
        best = max(frame - 1, 0) + int(sharp[max(frame - 1, 0) : frame + 2].argmax())
        above, at_once = _above_common(size, size[frame], near), _above_common(sharp, sharp[best], near)
        stays = not (_is_undone(steps, frame, frame, window) or _is_undone(kinks, best, frame, LINE_FRAMES))
        if above > ABOVE_COMMON and at_once > ABOVE_COMMON_AT_ONCE and stays:
            found.append((best, above))
    return found


def _kinks(paces: Floats) -> Floats:
    """How far the pace of each frame is from the mean of those before and after it, shape (n_frames, 3)."""
    result = np.full(paces.shape, np.nan)
    if len(paces) > 2:
        result[1:-1] = paces[1:-1] - (paces[:-2] + paces[2:]) / 2
    return result


def _highest(size: Floats) -> Floats:
    """Largest value within the lines about each frame."""
    padded = np.pad(size, LINE_FRAMES, constant_values=-np.inf)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * LINE_FRAMES + 1).max(axis=1))


def _above_common(size: Floats, value: float, near: slice) -> float:
    rest = np.concatenate([size[: near.start], size[near.stop :]])
    rest = rest[rest > 0]
    return value / max(float(np.percentile(rest, COMMON)) if len(rest) else 0.0, SMALLEST)


def _is_undone(steps: Floats, frame: int, middle: int, window: int) -> bool:
    """Whether a step as large as a good part of that in a frame leads back, shortly after it or before."""
    first = max(middle - window, 0)
    back = np.nan_to_num(steps[first : middle + window + 1] @ steps[frame])
    back[max(frame - 1 - first, 0) : frame + 2 - first] = 0.0  # a single kink has half of itself on either side
    return bool((back < -COMES_BACK * float(steps[frame] @ steps[frame])).any())
