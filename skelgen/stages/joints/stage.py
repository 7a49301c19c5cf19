"""Stage 3: find the joints between limbs and the tree that they form.

A joint is a point that keeps its distance to the markers of two limbs (Schönauer 2007, 3.5). Every pair of limbs is
tried on sampled frames; the cheapest joints span the tree; those that are kept are placed in all frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import outward_order, spanning_forest
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.constraints import Pair, limb_pairs, obeyed_costs
from skelgen.stages.joints.costs import comparable_costs
from skelgen.stages.joints.pairs import MIN_COMMON, JointGuess, guess_joint, map_pairs
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.placing import (
    place_in_blocks,
    place_joints,
    sample_frames,
    spread,
    stacked,
    telling_frames,
    tracks_of_limbs,
)
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment, make_segment, typical_variance
from skelgen.stages.joints.tree import false_joints, loop_joints, slack_sentences, tree_sentences, usual_radius

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
    joined: Iterable[Pair] = (),
    parted: Iterable[Pair] = (),
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
    joined, parted : iterable of pairs of int
        Limbs that are joined, and that are not, the lower index first; beside those in `parameters`.

    Raises
    ------
    InputError
        If no marker belongs to a limb.
    """
    parameters = parameters or JointParameters()
    monitor.begin("joints")
    if limbs.n_limbs == 0:
        raise InputError(f"{trajectories.name or 'the take'}: no marker belongs to a limb, so there are no joints")
    tracks = tracks_of_limbs(trajectories.positions, limbs, parameters)
    frames = sample_frames(len(tracks[0]), parameters)
    segments = [make_segment(track, telling_frames(track, frames)) for track in tracks]
    guesses = _all_pairs(segments, frames, parameters, seed, n_jobs, monitor)
    sizes = np.array([segment.n_markers for segment in segments])
    judged = comparable_costs(guesses, limbs.n_limbs, parameters.alpha)
    wanted = (*joined, *limb_pairs(parameters.joined, trajectories.names, limbs))
    refused = (*parted, *limb_pairs(parameters.parted, trajectories.names, limbs))
    costs = obeyed_costs(judged.costs, wanted, refused)
    cut: list[tuple[int, int]] = []
    if parents is None:
        parents = spanning_forest(costs, sizes, root)
        if parameters.separate:
            false = false_joints(parents, judged, guesses, usual_radius([track[frames] for track in tracks]))
            cut = [edge for edge in false if (min(edge), max(edge)) not in wanted]
            parents = _without(cut, parents, costs, sizes, root)
    _check_parents(parents, judged.costs)
    kept, segments = place_joints(segments, frames, parents, parameters, seed, monitor)
    children = outward_order(parents)[(parents < 0).sum() :]
    if len(tracks[0]) == trajectories.n_frames:
        raw = stacked([kept[int(child)] for child in children], trajectories.n_frames)
    else:
        raw = place_in_blocks(trajectories.positions, limbs, parents, parameters, seed, monitor)
    topology = Topology(
        parents=parents,
        joint_costs=np.where(np.isfinite(costs), judged.costs, np.nan),
        raw_joint_positions=raw,
        n_iterations=np.array([kept[int(child)].n_iterations for child in children], dtype=np.intp),
        values=np.array([_value(kept[int(child)], parameters.alpha_final) for child in children]),
        alpha=parameters.alpha,
        loops=loop_joints(parents, judged),
    )
    for sentence in (*tree_sentences(topology, judged, guesses, cut), *slack_sentences(segments)):
        monitor.notice(sentence)
    return topology


def _without(cut: list[tuple[int, int]], parents: Ints, costs: Floats, sizes: Ints, root: int | None) -> Ints:
    """The tree without some of its edges, each part rooted at its limb with most joints."""
    if not cut:
        return parents
    kept = np.full_like(costs, np.inf)
    for child in np.flatnonzero(parents >= 0):
        if (int(parents[child]), int(child)) not in cut:
            kept[child, parents[child]] = kept[parents[child], child] = costs[child, parents[child]]
    return spanning_forest(kept, sizes, root)


def _all_pairs(
    segments: list[Segment], frames: Ints, parameters: JointParameters, seed: int, n_jobs: int, monitor: Monitor
) -> Costs:
    """Guess every pair; then let limbs without a pose gain one from their best joint and guess their pairs again."""
    segments = list(segments)
    sampled = [segment.at(frames) for segment in segments]
    typical = typical_variance(segment.noise for segment in segments)
    pairs = list(combinations(range(len(segments)), 2))
    guesses: Costs = {}

    def guess(some: list[tuple[int, int]]) -> None:
        work = [_common_frames(segments, sampled, pair, frames) for pair in some]
        found = map_pairs(work, typical, parameters, seed, n_jobs, monitor)
        guesses.update(zip(some, found, strict=True))

    guess(pairs)
    if parameters.solver != "closed-form":
        return guesses
    joined: set[int] = set()
    while (choice := _surest_joint_to_small_limb(guesses, segments, joined)) is not None:
        small, pair = choice
        joined.add(small)
        whole = guess_joint(segments[pair[0]], segments[pair[1]], typical, parameters.alpha, parameters, seed)
        segments[small] = segments[small].with_joint(whole.positions, frames)
        sampled[small] = segments[small].at(frames)
        guess([other for other in pairs if small in other and other != pair])
    return guesses


def _common_frames(
    segments: list[Segment], sampled: list[Segment], pair: tuple[int, int], frames: Ints
) -> tuple[Segment, Segment]:
    """Both limbs in the sampled frames, or, where these hardly show both, in others that do."""
    first, second = pair
    if (sampled[first].is_known & sampled[second].is_known).sum() >= ENOUGH_FRAMES:
        return sampled[first], sampled[second]
    one, other = segments[first], segments[second]
    both = np.flatnonzero(one.is_known & other.is_known)
    chosen = spread(both, len(frames))
    if len(both) < ENOUGH_FRAMES:
        chosen = np.union1d(chosen, spread(np.flatnonzero(one.is_seen & other.is_seen), len(frames)))
    return one.at(chosen), other.at(chosen)


def _surest_joint_to_small_limb(
    guesses: Costs, segments: list[Segment], joined: set[int]
) -> tuple[int, tuple[int, int]] | None:
    """The cheapest joint from a limb with poses to one without, and that one."""
    best: tuple[float, int, tuple[int, int]] | None = None
    for pair, guess in guesses.items():
        for small, body in (pair, pair[::-1]):
            waits = small not in joined and segments[small].lacks_poses and not segments[body].lacks_poses
            if waits and np.isfinite(guess.square) and (best is None or guess.doubt < best[0]):
                best = (guess.doubt, small, pair)
    return None if best is None else best[1:]


def _check_parents(parents: Ints, costs: Floats) -> None:
    if len(parents) != len(costs):
        raise InputError(f"the hierarchy has {len(parents)} limbs, the take {len(costs)}")
    for child in np.flatnonzero(parents >= 0):
        if not np.isfinite(costs[child, parents[child]]):
            raise InputError(
                f"limbs {parents[child]} and {child} are to be joined, but no {MIN_COMMON} frames show both of them"
            )


def _value(guess: JointGuess, alpha: float) -> float:
    return guess.square + alpha * guess.distance if np.isfinite(guess.square) else np.nan
