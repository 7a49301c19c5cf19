"""Labels that jump to where another label was: the trace that an exchange leaves in two successive frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints

N_NEIGHBOURS = 5
"""Nearest markers whose median step says where a marker is expected next; up to two of them may be wrong."""

BRIDGED_SECONDS = 0.5
"""A marker unseen for longer says nothing of where it is expected."""

FARTHER = 2.0
"""A label has jumped when its own place is that many times farther off than another label's."""

MOST_CYCLE = 4
"""Markers that exchange their labels in a ring."""

CHUNK_FLOATS = 4_000_000
"""Distances held at once: 32 MB."""

Cycle = tuple[int, ...]
"""Markers, each of which sits at the next one's place, the last at the first one's."""


@dataclass(frozen=True, eq=False)
class Expectations:
    """Where labels are expected.

    Attributes
    ----------
    places : ndarray, shape (n_frames, n_chosen, 3), mm
        From where the label was last seen and the motion of its neighbours; NaN if that is too long ago.
    ages : ndarray, shape (n_frames, n_chosen)
        Frames since then.
    """

    places: Floats
    ages: Floats


def neighbours_of(positions: Floats, most: int = N_NEIGHBOURS) -> Ints:
    """Nearest markers of each marker by typical distance, itself first, shape (n_markers, up to most + 1)."""
    sample = positions[np.linspace(0, len(positions) - 1, min(len(positions), 60)).astype(np.intp)]
    distance = np.sort(np.linalg.norm(sample[:, :, np.newaxis] - sample[:, np.newaxis], axis=3), axis=0)
    middle = distance[np.maximum((~np.isnan(distance)).sum(axis=0) - 1, 0) // 2, *np.indices(distance.shape[1:])]
    middle = np.where(np.isnan(middle), np.inf, middle)
    np.fill_diagonal(middle, -1.0)
    return np.argsort(middle, axis=1, kind="stable")[:, : most + 1]


def expectations(positions: Floats, chosen: Ints, neighbours: Ints, rate: float) -> Expectations:
    """Expect each chosen label where it was last, moved on by the median step of its neighbours."""
    steps = np.diff(positions, axis=0, prepend=np.nan)
    around = np.sort(steps[:, neighbours[chosen]], axis=2)
    count = (~np.isnan(around[..., 0])).sum(axis=2)
    middle = np.maximum(count - 1, 0) // 2
    moved = np.take_along_axis(around, middle[:, :, np.newaxis, np.newaxis], axis=2)[:, :, 0]
    travelled = np.cumsum(np.nan_to_num(moved), axis=0)
    own = positions[:, chosen]
    index = np.arange(len(own))[:, np.newaxis]
    last = np.maximum.accumulate(np.where(np.isnan(own[..., 0]), -1, index), axis=0)
    last = np.concatenate([np.full((1, len(chosen)), -1), last[:-1]])
    column = np.arange(len(chosen))
    places = own[last, column] + travelled - travelled[last, column]
    ages = np.where(last < 0, np.inf, index - last)
    return Expectations(np.where((ages <= BRIDGED_SECONDS * rate)[..., np.newaxis], places, np.nan), ages)


def jumping_cycles(positions: Floats, rate: float) -> tuple[Cycle, ...]:
    """Find which labels jump to each other's places anywhere in the take; candidates, not yet believed.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    rate : float, Hz
        Frame rate.

    Returns
    -------
    tuple of cycles
        Those seen most often first; pairs rising, rings in both directions.
    """
    n_frames, n_markers = positions.shape[:2]
    if n_frames < 2 or n_markers < 2:
        return ()
    neighbours = neighbours_of(positions)
    overlap = int(BRIDGED_SECONDS * rate) + 1
    step = max(2 * overlap, CHUNK_FLOATS // n_markers**2)
    found: Counter[Cycle] = Counter()
    for start in range(1, n_frames, step):
        begin = max(0, start - overlap)
        part = positions[begin : start + step]
        expected = expectations(part, np.arange(n_markers), neighbours, rate).places
        jumped, target = _jumps(part[start - begin :], expected[start - begin :])
        for frame in np.flatnonzero(jumped.any(axis=1)):
            markers = np.flatnonzero(jumped[frame])
            found.update(_cycles(dict(zip(markers.tolist(), target[frame, markers].tolist(), strict=True))))
    return tuple(cycle for cycle, _ in sorted(found.items(), key=lambda item: (-item[1], item[0])))


def _jumps(positions: Floats, expected: Floats) -> tuple[Bools, Ints]:
    """Which labels are nearer to another one's expected place than to their own, and to whose."""
    unseen = np.isnan(positions[..., 0])
    centre = np.nan_to_num(np.where(unseen[..., np.newaxis], 0.0, positions).sum(axis=1, keepdims=True))
    centre /= np.maximum((~unseen).sum(axis=1), 1)[:, np.newaxis, np.newaxis]
    a, b = positions - centre, expected - centre
    square = (a**2).sum(axis=2)[:, :, np.newaxis] + (b**2).sum(axis=2)[:, np.newaxis] - 2 * a @ b.swapaxes(1, 2)
    own = np.diagonal(square, axis1=1, axis2=2)
    square = np.where(np.isnan(square), np.inf, square)
    target = np.argmin(square, axis=2)
    nearest = np.take_along_axis(square, target[:, :, np.newaxis], axis=2)[..., 0]
    itself = target == np.arange(positions.shape[1])
    return (own > FARTHER**2 * np.maximum(nearest, 0.0)) & ~itself & np.isfinite(nearest), target


def _cycles(target: dict[int, int]) -> set[Cycle]:
    cycles: set[Cycle] = set()
    for start, other in target.items():
        cycles.add((min(start, other), max(start, other)))
        ring = [start]
        while len(ring) < MOST_CYCLE and target.get(ring[-1], start) not in ring:
            ring.append(target[ring[-1]])
        if len(ring) > 2 and target.get(ring[-1]) == start:
            cycles |= {_from_least(tuple(ring)), _from_least(tuple(reversed(ring)))}
    return cycles


def _from_least(ring: Cycle) -> Cycle:
    least = ring.index(min(ring))
    return ring[least:] + ring[:least]
