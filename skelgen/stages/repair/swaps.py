"""Find markers that exchange their labels for some frames, and give the labels back.

An exchange changes distances within limbs, and lets labels jump to each other's places when it begins and ends. For
cycles of two to four labels that show either, the evidence of every frame is summed (`exchange_evidence`). The clearest
exchanges are undone, and the search is repeated on what is left.

Bodies with orientation that exchange their names each jump to where the other was; `exchanged_back` undoes that.
"""

import dataclasses
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.marker_steps import lengths as lengths_to
from skelgen.geometry.statistics import median_of_known
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.labelling import Finding
from skelgen.progress import SILENT, Monitor, frames_between
from skelgen.stages.repair.exchange_evidence import (
    Cycle,
    Evidence,
    RigidModel,
    best_spans,
    find_evidence,
    jumping_cycles,
    limb_pairs,
    misfits,
    neighbours_of,
    rigid_model,
    robust_limbs,
)

MOST_ROUNDS = 12
"""Each round undoes all exchanges that do not touch each other; a take needs two or three."""

MOST_CANDIDATES = 400
"""Cycles examined in a round: bounds the work on takes whose labels mean nothing."""

BAD = 5.0
"""Standard deviations by which a marker's distances are off, in the median, where its label is doubted."""

LEAST_FRAMES = 3
"""Frames in which two labels must be doubted together for their exchange to be examined."""

CLEAR_JUMP = 6.0
"""nats; the squared distance to the other marker's place is four hundred times smaller than that to the own. Where
it is as many times larger, no label is exchanged, whatever distances say: a limb that stood still before moves, say."""

BETTER = 0.8
"""An exchange that only distances show must bring the misfit below this part of it."""

TOLD_APART = 2.0
"""Standard deviations by which some distance must change if two labels are exchanged, or distances cannot tell."""

Span = tuple[float, Cycle, int, int]
"""Evidence [nats] of an exchange, its labels, first and last frame."""


@dataclass(frozen=True)
class Swap:
    """Labels that were exchanged for some frames.

    Attributes
    ----------
    markers : tuple of int
        Indices; each label sits on the marker of the next one, the last on that of the first.
    names : tuple of str
        Their labels.
    first_frame, last_frame : int
        Both included.
    misfit_before, misfit_after : float, mm
        Root mean square deviation of the distances to their limbs, as found and as repaired; NaN without any.
    jumps : bool
        Whether the labels jump to each other's places at the begin or the end.
    gain : float, nats
        Evidence of all distances and jumps.
    """

    markers: tuple[int, ...]
    names: tuple[str, ...]
    first_frame: int
    last_frame: int
    misfit_before: float
    misfit_after: float
    jumps: bool
    gain: float

    @property
    def evidence(self) -> str:
        """Evidence in words."""
        seen = "; the labels are seen jumping" if self.jumps else ""
        return (
            f"their distances are off by {self.misfit_before:.1f} mm as they were called and by "
            f"{self.misfit_after:.1f} mm exchanged{seen}"
        )

    @property
    def sentence(self) -> str:
        """Notice for the user."""
        frames = frames_between(self.first_frame, self.last_frame)
        return f"labels exchanged in {frames}, repaired: {' -> '.join(self.names)} ({self.evidence})"

    @property
    def finding(self) -> Finding:
        """Finding for the label quality."""
        return Finding("exchanged", self.names, self.first_frame, self.last_frame, self.evidence, "given back")


def find_swaps(
    trajectories: Trajectories, least_evidence: float = 5.0, *, limbs: Limbs | None = None, monitor: Monitor = SILENT
) -> tuple[Swap, ...]:
    """Find cycles of two to four labels that were exchanged for some frames.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers; gaps are fine.
    least_evidence : float, nats
        Least evidence of distances for an exchange.
    limbs : Limbs, optional
        Rigid groups; found robustly if left out.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    tuple of Swap
        In the order in which `repair_swaps` undoes them.
    """
    if trajectories.n_markers < 2 or trajectories.n_frames < 2:
        return ()
    model = rigid_model(trajectories, limbs or robust_limbs(trajectories))
    found: list[Swap] = []
    current = trajectories
    for done in range(MOST_ROUNDS):
        monitor.advance(done, MOST_ROUNDS)
        swaps = _one_round(current, model, least_evidence)
        if not swaps:
            break
        found += swaps
        current = repair_swaps(current, swaps)
    return tuple(found)


def repair_swaps(trajectories: Trajectories, swaps: Iterable[Swap]) -> Trajectories:
    """Give exchanged labels back, one swap after the other; nothing else changes.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    swaps : iterable of Swap
        From `find_swaps`.

    Returns
    -------
    Trajectories
        With a notice per swap; the same object if there is no swap.
    """
    swaps = tuple(swaps)
    if not swaps:
        return trajectories
    positions = trajectories.positions.copy()
    for swap in swaps:
        frames = slice(swap.first_frame, swap.last_frame + 1)
        places = [*swap.markers[1:], swap.markers[0]]
        positions[frames, places] = positions[frames, list(swap.markers)]
    notices = tuple(swap.sentence for swap in sorted(swaps, key=lambda swap: swap.first_frame))
    return dataclasses.replace(trajectories, positions=positions, notices=trajectories.notices + notices)


def indistinguishable_pairs(trajectories: Trajectories, *, limbs: Limbs | None = None) -> tuple[tuple[str, str], ...]:
    """Name the pairs of markers on one limb whose exchange changes no distance by more than it varies anyway.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs, optional
        Rigid groups; found robustly if left out.
    """
    limbs = limbs or robust_limbs(trajectories)
    model = rigid_model(trajectories, limbs)
    pairs = []
    for first, second in zip(*limb_pairs(limbs), strict=True):
        change = (model.distance[first] - model.distance[second]) / np.hypot(model.spread[first], model.spread[second])
        if not (np.abs(change) > TOLD_APART).any():
            pairs.append((trajectories.names[first], trajectories.names[second]))
    return tuple(pairs)


def _one_round(trajectories: Trajectories, model: RigidModel, least_evidence: float) -> list[Swap]:
    """The clearest exchanges that do not touch each other."""
    [positions], rate = contiguous(trajectories.positions), trajectories.rate
    neighbours = neighbours_of(positions)
    # Pairs of labels whose distances to their limbs are off in the same frames
    doubted = np.stack([_is_off(positions, marker, model) for marker in range(positions.shape[1])], axis=1)
    markers = np.flatnonzero(doubted.sum(axis=0) >= LEAST_FRAMES)
    together = doubted[:, markers].T.astype(np.float64) @ doubted[:, markers].astype(np.float64)
    pairs = [(i, j) for i, j in combinations(range(len(markers)), 2) if together[i, j] >= LEAST_FRAMES]
    pairs.sort(key=lambda pair: -together[pair])
    doubted_pairs = [(int(markers[i]), int(markers[j])) for i, j in pairs]
    cycles = dict.fromkeys((*jumping_cycles(positions, neighbours, rate), *doubted_pairs))
    spans: list[Span] = []
    for cycle in list(cycles)[:MOST_CANDIDATES]:
        evidence = find_evidence(positions, cycle, model, neighbours, rate)
        spans += _clear_spans(positions, cycle, evidence, model, least_evidence)
    spans.sort(key=lambda span: (-span[0], span[1:]))
    return [_swap(trajectories, span, model, neighbours) for span in _apart(spans, model)]


def _clear_spans(
    positions: Floats, cycle: Cycle, evidence: Evidence, model: RigidModel, least_evidence: float
) -> list[Span]:
    spans = []
    for first, last in best_spans(evidence):
        distances = float(evidence.distances[first : last + 1].sum())
        jumps = _jump_gains(evidence, first, last)
        by_distance = distances > least_evidence and min(jumps) > -CLEAR_JUMP
        by_distance = by_distance and _is_better(positions[first : last + 1], cycle, model)
        by_jumps = min(jumps) > CLEAR_JUMP and distances > -least_evidence and last - first + 1 < len(positions) / 2
        if by_distance or by_jumps:
            spans.append((distances + sum(jumps), cycle, first, last))
    return spans


def _jump_gains(evidence: Evidence, first: int, last: int) -> tuple[float, float]:
    """Gains of the jumps at both ends; 0 where the take itself begins or ends."""
    end = float(evidence.exits[last + 1]) if last + 1 < len(evidence.exits) else 0.0
    return (float(evidence.entries[first]) if first else 0.0), end


def _is_better(positions: Floats, cycle: Cycle, model: RigidModel) -> bool:
    before, after = misfits(positions, cycle, model)
    fits = bool(median_of_known(np.abs(after).reshape(-1, 1))[0] < BAD)  # else the labels are neither's
    return fits and bool(np.nansum(after**2) < BETTER**2 * np.nansum(before**2))


def _apart(spans: list[Span], model: RigidModel) -> list[Span]:
    """Spans, the clearest first, without those that share a limb and frames with one before."""
    chosen: list[tuple[set[int], Span]] = []
    for span in spans:
        _, cycle, first, last = span
        touched = {
            int(model.limb_of_marker[marker]) if model.limb_of_marker[marker] >= 0 else ~marker for marker in cycle
        }
        if all(last < begin - 1 or first > end + 1 or not touched & other for other, (_, _, begin, end) in chosen):
            chosen.append((touched, span))
    return [span for _, span in chosen]


def _swap(trajectories: Trajectories, span: Span, model: RigidModel, neighbours: Ints) -> Swap:
    gain, cycle, first, last = span
    evidence = find_evidence(trajectories.positions, cycle, model, neighbours, trajectories.rate)
    pairs = {(min(m, k), max(m, k)) for m in cycle for k in model.partners(m).tolist()}
    spread = np.array([model.spread[pair] for pair in sorted(pairs)])
    before, after = misfits(trajectories.positions[first : last + 1], cycle, model)
    names = tuple(trajectories.names[marker] for marker in cycle)
    jumps = max(_jump_gains(evidence, first, last)) > CLEAR_JUMP
    return Swap(cycle, names, first, last, _rms(before * spread), _rms(after * spread), jumps, gain)


def _rms(deviation: Floats) -> float:
    known = deviation[~np.isnan(deviation)]
    return float(np.sqrt((known**2).mean())) if len(known) else float("nan")


def _is_off(positions: Floats, marker: int, model: RigidModel) -> Bools:
    partners = model.partners(marker)
    if not len(partners):
        return np.zeros(len(positions), dtype=bool)
    lengths = lengths_to(positions, marker, partners)
    off = np.abs(lengths - model.distance[marker, partners]) / model.spread[marker, partners]
    return np.asarray((off > BAD).sum(axis=1) * 2 >= np.maximum((~np.isnan(off)).sum(axis=1), 1))


NEARER = 0.2
"""Part of its jump at which a body must be from where the other was."""

LEAST_JUMPS = 10.0
"""How many times its usual step a body must jump."""


def exchanged_back(poses: Floats) -> tuple[Floats, tuple[tuple[int, int, int], ...]]:
    """Exchange bodies back that changed their names.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, n_bodies, 4, 4), translations in mm
        world_from_body; NaN where unseen.

    Returns
    -------
    poses : ndarray, shape (n_frames, n_bodies, 4, 4)
        Those given where nothing was exchanged.
    found : tuple of (int, int, int)
        Two bodies and the first frame in which they are exchanged, in the order of time.
    """
    found: list[tuple[int, int, int]] = []
    places = poses[:, :, :3, 3].copy()
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    known = steps[~np.isnan(steps)]
    least = LEAST_JUMPS * float(np.median(known)) if len(known) else np.inf
    back = poses
    for one, other in combinations(range(poses.shape[1]), 2):
        for frame in _exchanges(places[:, one], places[:, other], least):
            back = back.copy() if back is poses else back
            back[frame:, [one, other]] = back[frame:, [other, one]]
            places[frame:, [one, other]] = places[frame:, [other, one]]
            found.append((one, other, frame))
    return back, tuple(sorted(found, key=lambda exchange: exchange[2]))


def _exchanges(one: Floats, other: Floats, least: float) -> Iterator[int]:
    """Frames in which two bodies [mm], shape (n_frames, 3), change places, of those that show both."""
    seen: Ints = np.flatnonzero(~np.isnan(one[:, 0] + other[:, 0]))
    if len(seen) < 2:
        return
    before, after = seen[:-1], seen[1:]
    stays = np.minimum(_distances_apart(one[after], one[before]), _distances_apart(other[after], other[before]))
    changes = np.maximum(_distances_apart(one[after], other[before]), _distances_apart(other[after], one[before]))
    for index in np.flatnonzero((changes < NEARER * stays) & (stays > least)):
        yield int(after[index])


def _distances_apart(one: Floats, other: Floats) -> Floats:
    return np.asarray(np.linalg.norm(one - other, axis=1))
