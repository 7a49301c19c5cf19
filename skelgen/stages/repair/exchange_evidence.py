"""Evidence that some labels are exchanged in a cycle, frame by frame: distances within limbs, and jumps.

The likelihood of distances is Student's t, that of jumps between frames a Cauchy distribution: single large deviations
do not decide. The best sequence of the two states, as labelled and exchanged, is found by dynamic programming
(Viterbi 1967). Cycles that are worth examining are those whose labels jump to each other's places.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels import marker_steps as kernels
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, median_and_deviation, pair_lengths
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.stages.limbs import LimbParameters, rigid_groups
from skelgen.stages.repair.departures import LEAST_COMMON, trimmed_deviations

STATISTIC_FRAMES = 5000
"""Frames from which medians are taken: bounds memory for long takes."""

LEAST_SPREAD = 1e-3
"""Of a distance: the least spread, however exact the take."""


@dataclass(frozen=True, eq=False)
class RigidModel:
    """Limbs with their usual inner distances.

    Attributes
    ----------
    limb_of_marker : ndarray of intp, shape (n_markers,)
        -1 = on no limb.
    distance : ndarray, shape (n_markers, n_markers), mm
        Median distance of markers of one limb; NaN for others.
    spread : ndarray, shape (n_markers, n_markers), mm
        Robust standard deviation of these.
    """

    limb_of_marker: Ints
    distance: Floats
    spread: Floats

    def partners(self, marker: int) -> Ints:
        """Markers whose distance to one marker is known."""
        return np.flatnonzero(~np.isnan(self.distance[marker]))


def robust_limbs(trajectories: Trajectories) -> Limbs:
    """Group markers into limbs, unmoved by labels that are wrong for up to a quarter of the time."""
    n_markers = trajectories.n_markers
    labels = np.full(n_markers, -1, dtype=np.intp)
    deviation = trimmed_deviations(trajectories.positions)
    usable = np.flatnonzero((~np.isnan(deviation)).sum(axis=1) > 1)
    if len(usable) > 1:
        inner = deviation[np.ix_(usable, usable)]
        inner = np.where(np.isnan(inner), np.nanmax(inner), inner)
        groups = rigid_groups(inner, LimbParameters())
        labels[usable] = np.unique(groups, return_inverse=True)[1]
    return Limbs(labels, deviation)


def rigid_model(trajectories: Trajectories, limbs: Limbs) -> RigidModel:
    """Compute the median and the spread of all distances within limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Rigid groups of these.
    """
    n_markers = trajectories.n_markers
    distance, spread = np.full((2, n_markers, n_markers), np.nan)
    first, second = limb_pairs(limbs)
    if len(first):
        positions = trajectories.positions[spread_frames(trajectories.n_frames, STATISTIC_FRAMES)]
        middle, deviation, count = median_and_deviation(pair_lengths(positions, first, second))
        usual = float(np.median(deviation[count >= LEAST_COMMON])) if (count >= LEAST_COMMON).any() else 0.0
        deviation = np.maximum(deviation, np.maximum(usual / 2, LEAST_SPREAD * middle))
        known = (count >= LEAST_COMMON) & (deviation > 0)
        for matrix, values in ((distance, middle), (spread, deviation)):
            matrix[first[known], second[known]] = matrix[second[known], first[known]] = values[known]
    return RigidModel(limbs.limb_of_marker, distance, spread)


def limb_pairs(limbs: Limbs) -> tuple[Ints, Ints]:
    """All pairs of markers that share a limb."""
    first, second = np.triu_indices(limbs.n_markers, 1)
    same = (limbs.limb_of_marker[first] == limbs.limb_of_marker[second]) & (limbs.limb_of_marker[first] >= 0)
    return first[same], second[same]


FREEDOMS = 4.0
"""Degrees of freedom of the distribution of distances: tails heavier than normal, as skin has them."""

JUMP_WEIGHT = 2.0
"""Exponent of the distribution of jumps, the Cauchy distribution in three dimensions."""

CORRELATED_SECONDS = 0.1
"""Deviations of distances within this time are correlated: together they count as one."""

SWITCH_COST = 8.0
"""nats that the begin or the end of an exchange costs: one in about 3000 frames is expected."""

PRIOR_COST = 1e-3
"""nats per frame that exchanged labels cost: of two equal explanations the shorter exchange is taken."""

LEAST_STEP = 1e-2
"""mm; keeps the distribution of jumps finite for markers that move exactly together."""

N_NEIGHBOURS = 5
"""Nearest markers whose median step says where a marker is expected next; up to two of them may be wrong."""

BRIDGED_SECONDS = 0.5
"""A marker that was unseen for longer is expected nowhere."""

FARTHER = 2.0
"""A label has jumped if its own place is this many times farther away than another label's."""

MOST_CYCLE = 4
"""Most markers that exchange their labels in a cycle."""

CHUNK_FLOATS = 4_000_000
"""Distances held at once: 32 MB."""

Cycle = tuple[int, ...]
"""Markers, each of which sits at the next one's place, the last at the first one's."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence for an exchange, frame by frame.

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


def find_evidence(positions: Floats, cycle: Cycle, model: RigidModel, neighbours: Ints, rate: float) -> Evidence:
    """Find the evidence for an exchange of labels in every frame.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    cycle : tuple of int
        Labels, each of which may sit on the marker of the next one.
    model : RigidModel
        Distances within limbs.
    neighbours : ndarray of intp, shape (n_markers, n_neighbours)
        From `neighbours_of`.
    rate : float, Hz
        Frame rate.
    """
    before, after = misfits(positions, cycle, model)
    gain = np.nan_to_num(_nats(before)).sum(axis=1) - np.nan_to_num(_nats(after)).sum(axis=1)
    markers = np.array(cycle)
    positions, markers, neighbours = contiguous(positions, markers, neighbours)
    places, ages = kernels.expected_places(positions, markers, neighbours, BRIDGED_SECONDS * rate)
    own = positions[:, markers]
    # Typical error [mm] of an expectation, for each frame since the label was seen
    error = np.linalg.norm(own - places, axis=2) / np.maximum(ages, 1.0)
    error = error[~np.isnan(error)]
    sigma = max(SIGMA_OF_MEDIAN * float(np.median(error)), LEAST_STEP) if len(error) else LEAST_STEP
    kept = _jump_nats(own - places, ages, sigma)
    entries = kept - _jump_nats(own - np.roll(places, -1, axis=1), np.roll(ages, -1, 1), sigma)
    exits = kept - _jump_nats(own - np.roll(places, 1, axis=1), np.roll(ages, 1, 1), sigma)
    n_correlated = max(1.0, CORRELATED_SECONDS * rate)
    return Evidence(gain / n_correlated, np.nan_to_num(entries).sum(axis=1), np.nan_to_num(exits).sum(axis=1))


def misfits(positions: Floats, cycle: Cycle, model: RigidModel) -> tuple[Floats, Floats]:
    """Deviations of the distances of a cycle's labels to their limbs, in standard deviations.

    Parameters
    ----------
    positions, cycle, model
        As in `find_evidence`.

    Returns
    -------
    before, after : ndarray, shape (n_frames, n_pairs)
        As labelled, and with the labels exchanged.
    """
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
    gain, entry, leave = evidence.distances - PRIOR_COST, evidence.entries - SWITCH_COST, evidence.exits - SWITCH_COST
    if not _any_pays(gain, entry, leave):
        return []
    gains, entries, exits = gain.tolist(), entry.tolist(), leave.tolist()
    normal, swapped = 0.0, -SWITCH_COST + gains[0]
    ended, begun = [False], [True]
    for gain, entry, leave in zip(gains[1:], entries[1:], exits[1:], strict=True):
        ended.append(swapped + leave > normal)
        begun.append(normal + entry > swapped)
        normal, swapped = max(normal, swapped + leave), max(swapped, normal + entry) + gain
    return _traced_back(ended, begun, swapped > normal)


def _any_pays(gain: Floats, entry: Floats, leave: Floats) -> bool:
    """Whether a span exists that gains more than its begin and its end cost; in most takes there is none."""
    upto = np.cumsum(gain)
    begun, ended = entry - (upto - gain), upto + np.append(leave[1:], 0.0)
    begun[0] = -SWITCH_COST
    return bool((ended + np.maximum.accumulate(begun) > 0).any())


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


def _jump_nats(error: Floats, ages: Floats, sigma: float) -> Floats:
    width = sigma * np.maximum(ages, 1.0)  # what was not seen for long may be anywhere
    return np.asarray(JUMP_WEIGHT * np.log1p((error**2).sum(axis=2) / width**2) + error.shape[2] * np.log(width))


def neighbours_of(positions: Floats, most: int = N_NEIGHBOURS) -> Ints:
    """Nearest markers of each marker by typical distance, itself first, shape (n_markers, up to most + 1).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    most : int
        Number of neighbours.
    """
    sample = positions[np.linspace(0, len(positions) - 1, min(len(positions), 60)).astype(np.intp)]
    first, second = np.triu_indices(positions.shape[1], 1)
    lengths = np.sort(pair_lengths(sample, first, second), axis=1)
    places = np.maximum((~np.isnan(lengths)).sum(axis=1) - 1, 0) // 2
    usual = lengths[np.arange(len(lengths)), places]
    middle = np.full((positions.shape[1], positions.shape[1]), -1.0)  # itself is nearest
    middle[first, second] = middle[second, first] = np.where(np.isnan(usual), np.inf, usual)
    return np.argsort(middle, axis=1, kind="stable")[:, : most + 1]


def jumping_cycles(positions: Floats, neighbours: Ints, rate: float) -> tuple[Cycle, ...]:
    """Find cycles of labels that jump to each other's places anywhere in the take; candidates for exchanges.

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
        Those seen most often first; pairs in rising order, longer cycles in both directions.
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
        part, markers, beside = contiguous(part, np.arange(n_markers), neighbours)
        expected, _ = kernels.expected_places(part, markers, beside, BRIDGED_SECONDS * rate)
        part, expected = contiguous(part[start - begin :], expected[start - begin :])
        jumped, target = kernels.strayed(part, expected, FARTHER)
        for frame in np.flatnonzero(jumped.any(axis=1)):
            moved = np.flatnonzero(jumped[frame])
            found.update(_cycles(dict(zip(moved.tolist(), target[frame, moved].tolist(), strict=True))))
    return tuple(cycle for cycle, _ in sorted(found.items(), key=lambda item: (-item[1], item[0])))


def _cycles(target: dict[int, int]) -> set[Cycle]:
    cycles: set[Cycle] = set()
    for start, other in target.items():
        cycles.add((min(start, other), max(start, other)))
        cycle = [start]
        while len(cycle) < MOST_CYCLE and target.get(cycle[-1], start) not in cycle:
            cycle.append(target[cycle[-1]])
        if len(cycle) > 2 and target.get(cycle[-1]) == start:
            cycles |= {_from_least(tuple(cycle)), _from_least(tuple(reversed(cycle)))}
    return cycles


def _from_least(cycle: Cycle) -> Cycle:
    least = cycle.index(min(cycle))
    return cycle[least:] + cycle[:least]
