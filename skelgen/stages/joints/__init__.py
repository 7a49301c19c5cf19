"""Stage 3: find the joints between limbs and the tree that they form.

A joint is a point that keeps its distance to the markers of two limbs (Schönauer 2007, 3.5). Every pair of limbs is
tried on sampled frames; the cheapest joints span the tree; those that are kept are placed in all frames.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.shape import LimbShape
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import outward_order
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.loose import loose_sentences
from skelgen.stages.joints.pairs import MIN_COMMON, JointGuess, Segment, guess_joint, make_segment
from skelgen.stages.joints.parallel import map_pairs
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.tree import spanning_tree

__all__ = ["JointParameters", "find_joints"]

Costs = dict[tuple[int, int], JointGuess]


def find_joints(
    trajectories: Trajectories,
    limbs: Limbs,
    parameters: JointParameters | None = None,
    *,
    seed: int = 0,
    n_jobs: int = 1,
    monitor: Monitor = SILENT,
    parents: Ints | None = None,
    root: int | None = None,
) -> Topology:
    """Find joints and topology.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.
    parameters : JointParameters, optional
        How.
    seed : int
        Seed of the annealing jitter, where that is asked for.
    n_jobs : int
        Processes for the pairs of limbs, which are independent; -1 takes all cores.
    monitor : Monitor
        Told of progress.
    parents : ndarray of intp, shape (n_limbs,), optional
        The tree where it is known, -1 for roots; found if left out.
    root : int, optional
        Limb that is the root of its tree; by default the one with most joints.

    Raises
    ------
    InputError
        If no marker belongs to a limb.
    """
    parameters = parameters or JointParameters()
    monitor.begin("joints")
    if limbs.n_limbs == 0:
        raise InputError(f"{trajectories.name or 'the take'}: no marker belongs to a limb, so there are no joints")
    tracks = [trajectories.positions[:, limbs.markers_of(limb)] for limb in range(limbs.n_limbs)]
    frames = sample_frames(trajectories.n_frames, parameters)
    sampled = [make_segment(track[frames], np.arange(len(frames))) for track in tracks]
    guesses = _all_pairs(sampled, parameters, seed, n_jobs, monitor)
    costs = _cost_matrix(guesses, limbs.n_limbs)
    if parents is None:
        parents = spanning_tree(costs, np.array([segment.n_markers for segment in sampled]), root)
    _check_parents(parents, costs)
    kept = _place_joints(tracks, frames, parents, parameters, seed, monitor)
    children = outward_order(parents)[(parents < 0).sum() :]
    _report_separate_bodies(parents, monitor)
    topology = Topology(
        parents=parents,
        joint_costs=np.where(np.isfinite(costs), costs, np.nan),
        raw_joint_positions=_stacked([kept[int(child)].positions for child in children], trajectories.n_frames),
        n_iterations=np.array([kept[int(child)].n_iterations for child in children], dtype=np.intp),
        values=np.array([_finite(kept[int(child)].cost) for child in children]),
        alpha=parameters.alpha,
    )
    for sentence in loose_sentences(trajectories, limbs, topology):
        monitor.notice(sentence)
    return topology


def sample_frames(n_frames: int, parameters: JointParameters) -> Ints:
    """Frames at which all pairs of limbs are tried, rising."""
    step = parameters.sampling or max(1.0, n_frames / parameters.samples)
    return np.unique(np.arange(0, n_frames, step).astype(np.intp).clip(max=n_frames - 1))  # rounding may reach the end


def _all_pairs(segments: list[Segment], parameters: JointParameters, seed: int, n_jobs: int, monitor: Monitor) -> Costs:
    """Guess every pair; then let limbs without a pose gain one from their best joint and guess their pairs again."""
    pairs = list(combinations(range(len(segments)), 2))
    guesses: Costs = {}
    _guess_into(guesses, pairs, segments, parameters, seed, n_jobs, monitor)
    if parameters.solver != "closed-form":
        return guesses
    everywhere = np.arange(len(segments[0].points))
    joined: set[int] = set()
    while (choice := _surest_joint_to_small_limb(guesses, segments, joined)) is not None:
        small, pair = choice
        joined.add(small)
        segments[small] = segments[small].with_joint(guesses[pair].positions, everywhere)
        changed = [other for other in pairs if small in other and other != pair]
        _guess_into(guesses, changed, segments, parameters, seed, n_jobs, monitor)
    return guesses


def _guess_into(
    guesses: Costs,
    pairs: list[tuple[int, int]],
    segments: list[Segment],
    parameters: JointParameters,
    seed: int,
    n_jobs: int,
    monitor: Monitor,
) -> None:
    work = [(segments[first], segments[second]) for first, second in pairs]
    found = map_pairs(work, parameters.alpha, parameters, seed, n_jobs, monitor)
    guesses.update(zip(pairs, found, strict=True))


def _surest_joint_to_small_limb(
    guesses: Costs, segments: list[Segment], joined: set[int]
) -> tuple[int, tuple[int, int]] | None:
    """The cheapest joint from a limb with poses to one without, and that one."""
    best: tuple[float, int, tuple[int, int]] | None = None
    for pair, guess in guesses.items():
        for small, body in (pair, pair[::-1]):
            waits = not segments[small].shape.has_pose and small not in joined and segments[body].shape.has_pose
            if waits and np.isfinite(guess.cost) and (best is None or guess.cost < best[0]):
                best = (guess.cost, small, pair)
    return None if best is None else best[1:]


def _cost_matrix(guesses: Costs, n_limbs: int) -> Floats:
    costs = np.full((n_limbs, n_limbs), np.inf)
    np.fill_diagonal(costs, 0.0)
    for (first, second), guess in guesses.items():
        costs[first, second] = costs[second, first] = guess.cost
    return costs


def _place_joints(
    tracks: list[Floats], frames: Ints, parents: Ints, parameters: JointParameters, seed: int, monitor: Monitor
) -> dict[int, JointGuess]:
    """Place the joints of the tree in all frames, those between limbs with poses first; keys are child limbs."""
    segments = [make_segment(track, frames) for track in tracks]
    waiting = [int(child) for child in np.flatnonzero(parents >= 0)]
    n_joints = len(waiting)
    kept: dict[int, JointGuess] = {}
    while waiting:
        waiting.sort(key=lambda child: -_known(segments[child].shape) - _known(segments[parents[child]].shape))
        child = waiting.pop(0)
        pair = (int(parents[child]), child)
        kept[child] = guess_joint(segments[pair[0]], segments[pair[1]], parameters.alpha_final, parameters, seed)
        for limb in pair:
            if not segments[limb].shape.has_pose:
                segments[limb] = segments[limb].with_joint(kept[child].positions, frames)
        monitor.advance(len(kept), n_joints)
    return kept


def _known(shape: LimbShape) -> int:
    return int(shape.has_pose)


def _stacked(positions: list[Floats], n_frames: int) -> Floats:
    return np.stack(positions, axis=1) if positions else np.zeros((n_frames, 0, 3))


def _check_parents(parents: Ints, costs: Floats) -> None:
    if len(parents) != len(costs):
        raise InputError(f"the hierarchy has {len(parents)} limbs, the take {len(costs)}")
    for child in np.flatnonzero(parents >= 0):
        if not np.isfinite(costs[child, parents[child]]):
            raise InputError(
                f"limbs {parents[child]} and {child} are to be joined, but no {MIN_COMMON} frames show both of them"
            )


def _finite(value: float) -> float:
    return value if np.isfinite(value) else np.nan


def _report_separate_bodies(parents: Ints, monitor: Monitor) -> None:
    n_roots = int((parents < 0).sum())
    if n_roots > 1:
        monitor.notice(f"{n_roots} limbs or groups of limbs are never seen together: they are separate bodies")
