"""Evidence of slips: a marker's place on its limb, in its distances to its mates, and its leaps in space.

On a limb of three markers, a step across their plane hardly changes a distance. The step itself is visible, because
markers move on smooth paths. A marker that leaps may have slipped; it surely has only if distances confirm it.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from skelgen._kernels import marker_steps as kernels
from skelgen._kernels.marker_steps import LINE_FRAMES
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, lengths_of, median_of_known, quantile_of
from skelgen.model.arrays import Floats, Ints

N_MATES = 5
"""Markers, those at the steadiest distance, against which a place is measured."""

AT_FIRST, LATER, LARGEST_GAIN = 0.4, 0.15, 2.5
"""Parts of the step that distances must show in the frame, and later, when skin has moved; and the largest part."""

GLITCH_FRAMES = 4
"""Frames after which an error of the tracker is over, but not a slip."""

LASTING_PARTS = (0.1, 0.25, 0.5, 1.0)
"""Parts of the least time of a slip over which means before and after are compared."""

MEDIAN_LENGTH = 1.538
"""Median length of a vector whose three coordinates are standard normal."""

LARGEST = 0.5
"""Of the typical distance to the mates: a larger jump is a wrong label, not a slip."""

LEAST_DEVIATION = 0.05
"""mm; least deviation of distances, however exact the take."""

MOST_CANDIDATES = 20
"""Frames that are examined for each marker; if there are more, none stands out."""

COMMON = 0.999
"""Part of the frames of the take in which a measure is below what a slip must exceed."""

ABOVE_COMMON, ABOVE_COMMON_AT_ONCE = 2.5, 1.3
"""How many times the step between lines, and that of the single frame, must exceed that."""

COMES_BACK = 0.5
"""Part of a leap; if the marker moves back by it soon after, the leap was a wrong label or a glitch."""

SMALLEST = 0.05
"""mm; least common leap, however exact the take."""


class PlaceOnLimb:
    """Distances of one marker to its mates, how they change from before each frame to after it, and its own step.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        All markers, NaN where unseen.
    marker : int
        The marker.
    near : ndarray of intp
        Markers among which its mates are found.
    seen : ndarray, shape (n_frames, 3), mm
        Its step in space against its neighbours.
    window : int, frames
        How long a slip lasts at least.
    """

    def __init__(self, positions: Floats, marker: int, near: Ints, seen: Floats, window: int) -> None:
        lengths = kernels.lengths(positions, marker, near)
        spread = _spread(kernels.changes(lengths, window, 0))
        chosen = np.argsort(spread, kind="stable")[:N_MATES]
        chosen = chosen[np.isfinite(spread[chosen])]
        self.mates, self.spread, self.window = near[chosen], spread[chosen], window
        self.lengths: Floats = np.take(lengths, chosen, axis=1)
        self.sudden: Floats = kernels.jumps(self.lengths)
        self._positions, self._marker = positions, marker
        self.step = self._fitted(seen) if len(chosen) else seen

    @cached_property
    def at_once(self) -> Floats:
        """Changes of the distances from the frame before, shape (n_frames, n_mates)."""
        return np.diff(self.lengths, axis=0, prepend=np.nan)

    @cached_property
    def later(self) -> list[Floats]:
        """Changes of the distances between means before and some later, over shorter and longer times."""
        windows = [max(round(part * self.window), 2) for part in LASTING_PARTS]
        return [kernels.changes(self.lengths, window, GLITCH_FRAMES) for window in windows]

    @cached_property
    def largest(self) -> float:
        """Largest step [mm] that may be a slip."""
        known = self.lengths[~np.isnan(self.lengths)]
        return LARGEST * float(np.median(known)) if len(known) else 0.0

    def _fitted(self, seen: Floats) -> Floats:
        """Step of the marker [mm], shape (n_frames, 3), from those of its distances and from that seen in space.

        Least squares, weighted by how much either varies in the take: of a fast movement distances tell more, and
        across the plane of few mates only the step in space does.
        """
        weights = 1.0 / _spread(self.sudden) ** 2
        direct = 1.0 / float(_spread(lengths_of(seen)[:, np.newaxis])[0]) ** 2
        weights = np.append(weights, direct)
        steps: Floats = kernels.fitted_steps(self._positions, self._marker, self.mates, self.sudden, weights, seen)
        return steps

    def weights(self, frame: int) -> Floats:
        """How much each mate's distance tells of the step in a frame, shape (n_mates,)."""
        away = self._positions[frame, self._marker] - self._positions[frame, self.mates]
        with np.errstate(invalid="ignore"):  # markers in one place have no direction
            along = away @ self.step[frame] / self.lengths[frame]
        return np.where(np.isnan(along), 0.0, along) / self.spread**2

    def gains(self, frame: int, weights: Floats) -> Floats:
        """Changes of distances as parts of what the step demands: of the lines, of the frame, and of later means.

        Parameters
        ----------
        frame : int
            Where the step is.
        weights : ndarray, shape (n_mates,)
            How much each mate's distance tells of the step.
        """
        expected = max(float((weights**2 * self.spread**2).sum()), np.finfo(float).tiny)
        parts = np.array([part[frame] for part in (self.sudden, self.at_once, *self.later)])
        return _weighted(parts, weights) / expected

    def variations(self, weights: Floats) -> float:
        """The step in standard deviations of what distances vary between later and earlier means."""
        usual = float(_spread(_weighted(self.later[-1], weights)[:, np.newaxis])[0])
        return float((weights**2 * self.spread**2).sum()) / usual


def is_lasting(gains: Floats) -> bool:
    """Whether a step is as large at once and is still there later, as far as the take goes.

    Parameters
    ----------
    gains : ndarray, shape (2 + number of `LASTING_PARTS`,)
        See `PlaceOnLimb.gains`; NaN where the take ends before.
    """
    n_first = len(gains) - len(LASTING_PARTS) + 1  # the lines, the frame itself and the shortest means
    later = gains[n_first:][~np.isnan(gains[n_first:])]
    enough = (gains[:n_first] > AT_FIRST).all() and (later > LATER).all() and len(later) > 1
    return bool(enough and np.nanmax(gains) < LARGEST_GAIN)


def jump_frames(own: Floats, factor: float) -> list[int]:
    """Frames at which a marker jumps by more than it does elsewhere, the clearest first.

    Parameters
    ----------
    own : ndarray, shape (n_frames, 3), mm
        Its step in each frame.
    factor : float
        By how many times its usual step it must jump.
    """
    size = lengths_of(own)
    known = size[size > 0]
    if not len(known):
        return []
    usual = max(float(np.median(known)) / MEDIAN_LENGTH, LEAST_DEVIATION)
    high = np.flatnonzero(size > factor * usual)
    frames: list[int] = []
    taken: set[int] = set()
    for frame in high[np.argsort(-size[high], kind="stable")][: LINE_FRAMES * MOST_CANDIDATES].tolist():
        if len(frames) == MOST_CANDIDATES:
            break
        if frame not in taken:
            frames.append(frame)
            taken.update(range(frame - LINE_FRAMES, frame + LINE_FRAMES + 1))
    return frames


def _weighted(measures: Floats, weights: Floats) -> Floats:
    """Weighted sum of what is known in each frame; NaN where nothing is."""
    return np.asarray(np.where(np.isnan(measures).all(axis=1), np.nan, np.nan_to_num(measures) @ weights))


def significance(measures: Floats, weights: Floats, frame: int, window: int, above: float) -> float:
    """Return a weighted sum of changes in standard deviations; 0 if such sums are common in the take.

    Parameters
    ----------
    measures : ndarray, shape (n_frames, n_mates), mm
        Changes of the distances to mates, NaN where unknown.
    weights : ndarray, shape (n_mates,)
        How much each of them tells.
    frame : int
        Where the sum is taken.
    window : int, frames
        Frames about it that do not count as the rest of the take.
    above : float
        How many times the sum must exceed what is `COMMON`.
    """
    sums = _weighted(measures, weights)
    value = float(sums[frame])
    rest = np.abs(np.concatenate([sums[: max(frame - window, 0)], sums[frame + window :]]))
    rest = rest[~np.isnan(rest)]
    if not len(rest) or np.isnan(value) or value < above * quantile_of(rest, COMMON):
        return 0.0
    usual = SIGMA_OF_MEDIAN * float(np.median(rest))
    return value / max(usual, LEAST_DEVIATION * float(np.linalg.norm(weights)))


def _spread(values: Floats) -> Floats:
    """Robust standard deviation of each column [mm]; infinite where nothing is known."""
    middle = median_of_known(np.abs(values))
    return np.maximum(SIGMA_OF_MEDIAN * np.where(np.isnan(middle), np.inf, middle), LEAST_DEVIATION)


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
    size = lengths_of(steps)
    peaks = np.flatnonzero((size > least) & (size == _highest(size))).tolist() if (size > least).any() else []
    if not peaks:
        return []
    kinks = _kinks(paces())
    sharp = np.nan_to_num(np.linalg.norm(kinks, axis=1))
    found: list[tuple[int, float]] = []
    for frame in peaks:
        near = slice(max(frame - LINE_FRAMES, 0), frame + LINE_FRAMES + 1)
        best = max(frame - 1, 0) + int(sharp[max(frame - 1, 0) : frame + 2].argmax())
        above = _above_common(size, size[frame], near)
        if above <= ABOVE_COMMON or _above_common(sharp, sharp[best], near) <= ABOVE_COMMON_AT_ONCE:
            continue
        if not (_is_undone(steps, frame, frame, window) or _is_undone(kinks, best, frame, LINE_FRAMES)):
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
    return value / max(quantile_of(rest, COMMON) if len(rest) else 0.0, SMALLEST)


def _is_undone(steps: Floats, frame: int, middle: int, window: int) -> bool:
    """Whether a step as large as a good part of that in a frame leads back, shortly after it or before."""
    first = max(middle - window, 0)
    back = np.nan_to_num(steps[first : middle + window + 1] @ steps[frame])
    back[max(frame - 1 - first, 0) : frame + 2 - first] = 0.0  # a single kink has half of itself on either side
    return bool((back < -COMES_BACK * float(steps[frame] @ steps[frame])).any())
