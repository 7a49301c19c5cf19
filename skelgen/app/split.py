"""Limbs of takes in which slipped markers were split: the parts of a marker sit on one limb.

Parts are never seen together, and each in fewer frames than the marker: limbs are found with the longer part alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Floats, Ints


def limbs_with_parts(
    trajectories: Trajectories, split: tuple[tuple[str, ...], ...], find: Callable[[Trajectories], Limbs]
) -> Limbs:
    """Find limbs with one part of every split marker, and put the other parts on the limb of that.

    Parameters
    ----------
    trajectories : Trajectories
        With all parts.
    split : tuple of tuple of str
        Names of parts, those of one marker with the same first name.
    find : callable (trajectories) -> Limbs
        Groups markers.
    """
    part_of = _representatives(trajectories, split)
    kept = np.flatnonzero(part_of == np.arange(trajectories.n_markers))
    if len(kept) == trajectories.n_markers:
        return find(trajectories)
    names = tuple(trajectories.names[int(np.argmax(part_of == marker))] for marker in kept)  # as the user knows it
    found = find(dataclasses.replace(trajectories, positions=trajectories.positions[:, kept], names=names))
    deviation = np.full((trajectories.n_markers, trajectories.n_markers), np.nan)
    deviation[np.ix_(kept, kept)] = found.distance_deviation
    for marker in np.flatnonzero(part_of != np.arange(trajectories.n_markers)):
        deviation[marker] = deviation[:, marker] = _deviations(trajectories.positions, int(marker))
    return Limbs(found.limb_of_marker[np.searchsorted(kept, part_of)], deviation)


def _representatives(trajectories: Trajectories, split: tuple[tuple[str, ...], ...]) -> Ints:
    """For each marker the part that stands for it: the one of its parts that is seen in most frames."""
    result, seen = np.arange(trajectories.n_markers), trajectories.seen.sum(axis=0)
    index = {name: marker for marker, name in enumerate(trajectories.names)}
    for first in dict.fromkeys(names[0] for names in split):
        parts = {index[name] for names in split if names[0] == first for name in names if name in index}
        if parts:
            result[sorted(parts)] = max(sorted(parts), key=lambda part: int(seen[part]))
    return result


def _deviations(positions: Floats, marker: int) -> Floats:
    """Standard deviation of a marker's distance to all [mm], NaN where never seen together, 0 to itself."""
    lengths = np.linalg.norm(positions - positions[:, [marker]], axis=2)
    known = ~np.isnan(lengths)
    count = known.sum(axis=0)
    mean = np.where(known, lengths, 0.0).sum(axis=0) / np.maximum(count, 1)
    squares = np.where(known, (lengths - mean) ** 2, 0.0).sum(axis=0)
    return np.where(count > 0, np.sqrt(squares / np.maximum(count, 1)), np.nan)
