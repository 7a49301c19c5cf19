"""Labels that jump to where another label was: the trace that an exchange leaves in two successive frames."""

from __future__ import annotations

from collections import Counter
from types import ModuleType

import numpy as np

from skelgen.compiling import loops
from skelgen.geometry.pairs import pair_lengths
from skelgen.model.arrays import Floats, Ints

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


def step_loops() -> ModuleType:
    """Return `steps`, or its compiled twin."""
    return loops("skelgen.stages.labels.repair.compiled_steps", "skelgen.stages.labels.repair.steps")


def neighbours_of(positions: Floats, most: int = N_NEIGHBOURS) -> Ints:
    """Nearest markers of each marker by typical distance, itself first, shape (n_markers, up to most + 1)."""
    sample = positions[np.linspace(0, len(positions) - 1, min(len(positions), 60)).astype(np.intp)]
    first, second = np.triu_indices(positions.shape[1], 1)
    lengths = np.sort(pair_lengths(sample, first, second), axis=1)
    places = np.maximum((~np.isnan(lengths)).sum(axis=1) - 1, 0) // 2
    usual = lengths[np.arange(len(lengths)), places]
    middle = np.full((positions.shape[1], positions.shape[1]), -1.0)  # itself is nearest
    middle[first, second] = middle[second, first] = np.where(np.isnan(usual), np.inf, usual)
    return np.argsort(middle, axis=1, kind="stable")[:, : most + 1]


def expected_places(positions: Floats, chosen: Ints, neighbours: Ints, rate: float) -> tuple[Floats, Floats]:
    """Expect each chosen label where it was last, if not too long ago, moved on by the median step of its neighbours.

    Returns
    -------
    places : ndarray, shape (n_frames, n_chosen, 3), mm
        NaN where nothing is expected.
    ages : ndarray, shape (n_frames, n_chosen)
        Frames since the label was seen.
    """
    found: tuple[Floats, Floats] = step_loops().expected_places(positions, chosen, neighbours, BRIDGED_SECONDS * rate)
    return found


def jumping_cycles(positions: Floats, neighbours: Ints, rate: float) -> tuple[Cycle, ...]:
    """Find which labels jump to each other's places anywhere in the take; candidates, not yet believed.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    neighbours : ndarray of intp, shape (n_markers, n_neighbours)
        From `neighbours_of`.
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
    overlap = int(BRIDGED_SECONDS * rate) + 1
    step = max(2 * overlap, CHUNK_FLOATS // n_markers**2)
    found: Counter[Cycle] = Counter()
    for start in range(1, n_frames, step):
        begin = max(0, start - overlap)
        part = positions[begin : start + step]
        expected, _ = expected_places(part, np.arange(n_markers), neighbours, rate)
        jumped, target = step_loops().strayed(part[start - begin :], expected[start - begin :], FARTHER)
        for frame in np.flatnonzero(jumped.any(axis=1)):
            markers = np.flatnonzero(jumped[frame])
            found.update(_cycles(dict(zip(markers.tolist(), target[frame, markers].tolist(), strict=True))))
    return tuple(cycle for cycle, _ in sorted(found.items(), key=lambda item: (-item[1], item[0])))


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
