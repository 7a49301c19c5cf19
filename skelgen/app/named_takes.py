"""Labelled takes of one body by the names of their markers: the frames of all, and which markers sit elsewhere in one.

A take alone may show too little for limbs: a squat nothing of the arms. Where the names are the same, no skeleton is
needed to know which marker is which. A marker that moved between takes has other distances to those that keep theirs to
each other; it counts as another marker.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames

SHARED = 0.8
"""Of the names of the take that has fewer."""

LOOKED_AT = 300
"""Frames of a take in which distances are measured."""

MATES = 2
"""Markers whose distances to one are steadiest and shortest, by their product: they are on its limb, or beside."""

FAR, SURE = 8.0, 6.0
"""mm, and standard deviations of the distance within a take, by which a distance must differ between takes."""

LEAST_DEVIATION = 0.5
"""mm; steadier distances are luck."""

MOST_MOVED = 0.25
"""Of the markers: if more sit elsewhere, names do not say which marker is which, or it is another body."""


def are_named_alike(takes: Sequence[Trajectories]) -> bool:
    """Whether all takes name mostly the same markers."""
    first = set(takes[0].names)
    return all(len(first & set(take.names)) >= SHARED * min(len(first), take.n_markers) for take in takes[1:])


def moved_markers(reference: Trajectories, take: Trajectories) -> tuple[str, ...] | None:
    """Return the names of the markers that sit elsewhere in a take; None if these are too many to be believed.

    Parameters
    ----------
    reference, take : Trajectories
        Labelled; markers of the same name are compared.
    """
    names = [name for name in take.names if name in reference.names]
    old, new = (_distances(one, names) for one in (reference, take))
    deviation = np.maximum(np.maximum(old[1], new[1]), LEAST_DEVIATION)
    differs = np.abs(np.nan_to_num(new[0], posinf=0.0) - np.nan_to_num(old[0], posinf=0.0)) > np.maximum(
        SURE * deviation, FAR
    )
    mates = np.argsort(deviation * np.maximum(old[0], new[0]), axis=1, kind="stable")[:, :MATES]
    believed, moved = np.isfinite(deviation), list[int]()
    while True:
        usable = np.take_along_axis(believed, mates, axis=1)
        shares = (usable & np.take_along_axis(differs, mates, axis=1)).sum(axis=1) / np.maximum(usable.sum(axis=1), 1)
        worst = int(shares.argmax()) if len(shares) else 0
        if not len(shares) or shares[worst] <= 0.5:
            return tuple(names[marker] for marker in sorted(moved))
        moved.append(worst)
        if len(moved) > MOST_MOVED * len(names):
            return None
        believed[worst] = believed[:, worst] = False


def _distances(take: Trajectories, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Median and standard deviation of the distance between each two markers [mm]; infinite deviations if unknown."""
    columns: Ints = np.array([take.names.index(name) for name in names], dtype=np.intp)
    shown = take.positions[spread_frames(take.n_frames, LOOKED_AT)][:, columns]
    gaps = np.linalg.norm(shown[:, :, np.newaxis] - shown[:, np.newaxis], axis=3)
    known = ~np.isnan(gaps).all(axis=0) & ~np.eye(len(names), dtype=np.bool_)
    gaps = np.where(known, gaps, 0.0)
    middle = np.nanmedian(gaps, axis=0)
    return np.where(known, middle, np.inf), np.where(known, np.nanstd(gaps, axis=0), np.inf)
