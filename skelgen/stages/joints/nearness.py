"""How near limbs stay to each other all the time: what holds of neighbours in anything articulated.

Where limbs hardly turn, or carry one marker or two, the gap of a joint says little: hands that hang still could be
joined to each other. But a marker of a limb stays near some marker of its neighbour, at a distance that hardly changes.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.model.arrays import Floats, Ints, evenly_spread
from skelgen.stages.joints.segments import Segment

LOOKED_AT = 200
"""Frames: soft tissue and joints are slow, more would repeat each other."""

FARTHEST = 0.95
"""Part of the frames in which two markers are no farther from each other than what counts: labels may jump."""

LEAST_COMMON = 8
"""Frames that must show both markers."""

ENOUGH_LIMBS = 4
"""Fewer say nothing of what is usual."""

SOFT = 0.5
"""Of the usual deviation between neighbours: less says nothing more."""


def remoteness(segments: Sequence[Segment], frames: Ints) -> Floats:
    """Return how much farther and less steadily each two limbs are apart than neighbours usually are.

    The product of the square of how far, and of the deviation of how far, the pair of markers is for which it is least;
    each in units of its median over limbs and their nearest. On real people and simulated bodies, with limbs given,
    joint costs times this choose 97 of 100 joints right where costs alone choose 85.

    Parameters
    ----------
    segments : sequence of Segment
        All limbs.
    frames : ndarray of intp
        Sampled frames.

    Returns
    -------
    ndarray, shape (n_limbs, n_limbs)
        Without unit; 1 is usual, also where limbs are never seen together.
    """
    if len(segments) < ENOUGH_LIMBS:
        return np.ones((len(segments), len(segments)))
    markers = [segment.markers[evenly_spread(frames, LOOKED_AT)] for segment in segments]
    places, limb_of = (
        np.concatenate(markers, axis=1),
        np.repeat(np.arange(len(markers)), [one.shape[1] for one in markers]),
    )
    far, unsteady = np.full((2, len(markers), len(markers)), np.inf)
    for marker, limb in enumerate(limb_of.tolist()):
        gaps = np.sort(np.linalg.norm(places - places[:, [marker]], axis=2), axis=0)  # NaN last
        n_common = (~np.isnan(gaps)).sum(axis=0)
        other = np.flatnonzero((n_common >= LEAST_COMMON) & (limb_of != limb))
        last = (FARTHEST * (n_common[other] - 1)).astype(np.intp)
        np.minimum.at(far[limb], limb_of[other], gaps[last, other])
        rarely = np.sqrt(len(gaps) / n_common[other])  # markers seen together in few frames had little time to move
        np.minimum.at(unsteady[limb], limb_of[other], rarely * np.nanstd(gaps[:, other], axis=0))
    shares = _of_usual(far, 0.0) ** 2 * _of_usual(unsteady, SOFT)
    return np.where(np.isfinite(shares), shares, 1.0)


def _of_usual(values: Floats, floor: float) -> Floats:
    """Values in units of the median over limbs of their least, each with `floor` of these added."""
    least = values.min(axis=1)
    known = least[np.isfinite(least)]
    usual = max(float(np.median(known)) if len(known) else 1.0, np.finfo(np.float64).tiny)
    return np.asarray((values / usual + floor) / (1 + floor))
