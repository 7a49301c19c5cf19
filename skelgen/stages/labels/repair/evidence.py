"""How much better a take is explained, frame by frame, if some labels are exchanged in a ring.

Distances within limbs are judged by the likelihood of Student's t, jumps between frames by that of a Cauchy-like law:
both forgive single large deviations. The best switching between the two states is found by dynamic programming
(Viterbi 1967).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.repair.jumps import Cycle, expected_places
from skelgen.stages.labels.repair.rigid import RigidModel

FREEDOMS = 4.0
"""Degrees of freedom of the law of distances: heavier tails than normal, as skin has them."""

JUMP_WEIGHT = 2.0
"""Exponent of the law of jumps, the Cauchy law of three coordinates."""

CORRELATED_SECONDS = 0.1
"""Deviations of distances within this time repeat each other: together they count as one."""

SWITCH_COST = 8.0
"""Nats that the beginning or the end of an exchange costs: one in about 3000 frames is expected."""

PRIOR_COST = 1e-3
"""Nats per frame that exchanged labels cost: what nothing tells apart is exchanged for the shorter time."""

LEAST_STEP = 1e-2
"""mm, keeps the law of jumps finite for markers that move exactly together."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for an exchange.

    Attributes
    ----------
    distances : ndarray, shape (n_frames,), nats
        Gain of all distances if labels are exchanged in the frame.
    entries, exits : ndarray, shape (n_frames,), nats
        Gain of all jumps if the exchange begins with the frame, or is over in it.
    """

    distances: Floats
    entries: Floats
    exits: Floats


def weigh(positions: Floats, cycle: Cycle, model: RigidModel, neighbours: Ints, rate: float) -> Evidence:
    """Weigh the hypothesis that the labels of a ring are exchanged, for every frame."""
    before, after = misfits(positions, cycle, model)
    gain = np.nan_to_num(_nats(before)).sum(axis=1) - np.nan_to_num(_nats(after)).sum(axis=1)
    markers = np.array(cycle)
    places, ages = expected_places(positions, markers, neighbours, rate)
    own = positions[:, markers]
    sigma = _steps(own, places, ages)
    kept = _jump_nats(own - places, ages, sigma)
    entries = kept - _jump_nats(own - np.roll(places, -1, axis=1), np.roll(ages, -1, 1), sigma)
    exits = kept - _jump_nats(own - np.roll(places, 1, axis=1), np.roll(ages, 1, 1), sigma)
    calm = max(1.0, CORRELATED_SECONDS * rate)
    return Evidence(gain / calm, np.nan_to_num(entries).sum(axis=1), np.nan_to_num(exits).sum(axis=1))


def misfits(positions: Floats, cycle: Cycle, model: RigidModel) -> tuple[Floats, Floats]:
    """Deviations of the ring's distances in standard deviations, as they are and if exchanged, (n_frames, n_pairs)."""
    pairs = {(min(m, k), max(m, k)) for m in cycle for k in model.partners(m).tolist()}
    first, second = np.array(sorted(pairs), dtype=np.intp).reshape(-1, 2).T
    involved = np.unique(np.concatenate([first, second, np.array(cycle)]))
    column = {int(marker): place for place, marker in enumerate(involved)}
    held_by = {column[place]: column[label] for label, place in zip(cycle, (*cycle[1:], cycle[0]), strict=True)}
    source = np.array([held_by.get(place, place) for place in range(len(involved))])
    a, b = np.searchsorted(involved, first), np.searchsorted(involved, second)
    part = positions[:, involved]
    usual, spread = model.distance[first, second], model.spread[first, second]
    before = np.linalg.norm(part[:, a] - part[:, b], axis=2)
    after = np.linalg.norm(part[:, source[a]] - part[:, source[b]], axis=2)
    return (before - usual) / spread, (after - usual) / spread


def best_spans(evidence: Evidence) -> list[tuple[int, int]]:
    """First and last frame of every span in which the labels are best exchanged."""
    gains = (evidence.distances - PRIOR_COST).tolist()
    entries, exits = (evidence.entries - SWITCH_COST).tolist(), (evidence.exits - SWITCH_COST).tolist()
    normal, swapped = 0.0, -SWITCH_COST + gains[0]
    ended, begun = [False], [True]
    for gain, entry, leave in zip(gains[1:], entries[1:], exits[1:], strict=True):
        ended.append(swapped + leave > normal)
        begun.append(normal + entry > swapped)
        normal, swapped = max(normal, swapped + leave), max(swapped, normal + entry) + gain
    return _traced_back(ended, begun, swapped > normal)


def _traced_back(ended: list[bool], begun: list[bool], inside: bool) -> list[tuple[int, int]]:
    spans, last = [], len(ended) - 1
    for frame in range(len(ended) - 1, -1, -1):
        if inside and begun[frame]:
            spans.append((frame, last))
            inside = False
        elif not inside and ended[frame]:
            inside, last = True, frame - 1
    return spans[::-1]


def _nats(deviation: Floats) -> Floats:
    return np.asarray((FREEDOMS + 1) / 2 * np.log1p(deviation**2 / FREEDOMS))


def _steps(own: Floats, places: Floats, ages: Floats) -> float:
    """Typical error [mm] of an expectation, for each frame since the label was seen."""
    error = np.linalg.norm(own - places, axis=2) / np.maximum(ages, 1.0)
    error = error[~np.isnan(error)]
    return max(SIGMA_OF_MEDIAN * float(np.median(error)), LEAST_STEP) if len(error) else LEAST_STEP


def _jump_nats(error: Floats, ages: Floats, sigma: float) -> Floats:
    width = sigma * np.maximum(ages, 1.0)  # what was not seen for long may be anywhere
    return np.asarray(JUMP_WEIGHT * np.log1p((error**2).sum(axis=2) / width**2) + error.shape[2] * np.log(width))
