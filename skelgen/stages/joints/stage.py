"""Stage 3: find the joints between limbs and the tree that they form.

A joint is a point that keeps its distance to the markers of two limbs (Schönauer 2007, 3.5). Every pair of limbs is
tried on sampled frames; the cheapest joints span the tree; those that are kept are placed in all frames.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.standing import fixed_limbs, is_steady
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import joint_children
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.between import without_middle_joints
from skelgen.stages.joints.costs import JointCosts, comparable_costs, with_certainty
from skelgen.stages.joints.false_joints import Parting, median_radius
from skelgen.stages.joints.loops import closing_loops, loop_joints
from skelgen.stages.joints.nearness import neighbour_odds
from skelgen.stages.joints.pairs import Guessing, JointGuess
from skelgen.stages.joints.parameters import JointConstraints, JointParameters, Pair
from skelgen.stages.joints.parted import PartedBodies, parted_tree
from skelgen.stages.joints.search import PairSearch, place_in_blocks, place_joints, positions_of_joints
from skelgen.stages.joints.segments import Segment, make_segments, markers_of_limbs, sample_frames
from skelgen.stages.joints.sliding import sliding_limbs, sliding_loop_notices
from skelgen.stages.joints.still_limbs import n_moving_parts, still_limb_notices, still_limbs
from skelgen.stages.joints.tree import Tree, find_tree, stuck_joint_notices, tree_notices, undetermined_limb_notices
from skelgen.stages.limbs import worn_neighbours

ONE_PERSON = 1.0
"""Log odds by what is worn, for or against a joint of two limbs, from which both are on one person: a quarter of the
most."""


def find_joints(
    trajectories: Trajectories,
    limbs: Limbs,
    parameters: JointParameters | None = None,
    *,
    constraints: JointConstraints | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Topology:
    """Find joints and topology; descents are shared among the processes of a surrounding `joblib.parallel_config`.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.
    parameters : JointParameters, optional
        How.
    constraints : JointConstraints, optional
        What the user states of the tree, beside what the parameters hold.
    seed : int
        Seed of the annealing jitter, where that is asked for.
    monitor : Monitor
        Receives progress and notices.

    Raises
    ------
    InputError
        If no marker belongs to a limb, or the constraints cannot be met.
    """
    return JointSearch(trajectories, limbs, parameters, seed).find(constraints, monitor)


class JointSearch:
    """The search for the joints and the tree of a take: again with other constraints, pairs are not tried anew.

    Parameters
    ----------
    trajectories, limbs, parameters, seed
        As for `find_joints`.
    """

    def __init__(
        self, trajectories: Trajectories, limbs: Limbs, parameters: JointParameters | None = None, seed: int = 0
    ) -> None:
        self._trajectories, self._limbs = trajectories, limbs
        self._parameters = parameters or JointParameters()
        self._how = Guessing(self._parameters, seed)
        self._tried: dict[bytes, tuple[Floats, Floats, PairSearch]] = {}

    @cached_property
    def _segments(self) -> tuple[list[Segment], Ints]:
        """All limbs, and the frames at which pairs are tried."""
        markers = markers_of_limbs(self._trajectories.positions, self._limbs, int(self._parameters.samples))
        frames = sample_frames(len(markers[0]), self._parameters)
        return make_segments(markers, frames), frames

    def _pairs(self, body_of_limb: Ints, monitor: Monitor) -> tuple[Floats, Floats, PairSearch]:
        """Log odds that limbs are neighbours, what is worn says of that, and the search for the joints of all pairs."""
        key = body_of_limb.tobytes()
        if key not in self._tried:
            segments, frames = self._segments
            worn = self._worn(body_of_limb)
            odds = neighbour_odds(segments, frames, body_of_limb) + worn
            search = PairSearch(segments, frames, self._how, monitor, odds)
            search.guesses()
            self._tried = {key: (odds, worn, search)}
        return self._tried[key]

    def _worn(self, body_of_limb: Ints) -> Floats:
        """Log odds that limbs are neighbours by what is worn on each body; 0 where nothing known is worn."""
        odds = np.zeros((len(body_of_limb),) * 2)
        if not self._parameters.known_neighbours:
            return odds
        positions, limb_of_marker = self._trajectories.positions, self._limbs.limb_of_marker
        for body in np.unique(body_of_limb).tolist():
            limbs = np.flatnonzero(body_of_limb == body)
            markers = np.flatnonzero(np.isin(limb_of_marker, limbs))
            own = np.searchsorted(limbs, limb_of_marker[markers])
            odds[np.ix_(limbs, limbs)] = worn_neighbours(positions[:, markers], own)
        return odds

    def _parting(self, guesses: Mapping[Pair, JointGuess], odds: Floats, worn: Floats) -> Parting:
        """What is known of bodies before the tree is parted, given what `_pairs` returns."""
        segments, frames = self._segments
        slides = sliding_limbs([segment.at(frames) for segment in segments], guesses, odds)
        return Parting(median_radius(segments, frames), np.abs(worn) >= ONE_PERSON, slides)

    def find(self, constraints: JointConstraints | None = None, monitor: Monitor = SILENT) -> Topology:
        """Find joints and topology.

        Parameters
        ----------
        constraints, monitor
            As for `find_joints`, which says what is raised.
        """
        trajectories, limbs, parameters, how = self._trajectories, self._limbs, self._parameters, self._how
        monitor.begin("joints")
        if not limbs.n_limbs:
            raise InputError(f"{trajectories.name or 'the take'}: no marker belongs to a limb, so there are no joints")
        stated = (constraints or JointConstraints()).with_parameters(parameters, trajectories.names, limbs)
        segments, frames = self._segments
        body_of_limb = stated.bodies(limbs.body_of_limb if parameters.separate else np.zeros_like(limbs.body_of_limb))
        odds, worn, search = self._pairs(body_of_limb, monitor)
        guesses = search.guesses_with(stated.edges(limbs.n_limbs))
        n_markers = [segment.n_markers for segment in segments]
        costs, between = comparable_costs(guesses, limbs.n_limbs, parameters.alpha, odds), set[Pair]()
        if not parameters.n_nearest:
            costs, between = without_middle_joints(costs, guesses, [segment.at(frames) for segment in segments])
        stated = stated.seen(costs.order, monitor)
        parting = self._parting(guesses, odds, worn) if parameters.separate else None
        tree = find_tree(costs, guesses, n_markers, stated, parting)
        markers = [segment.markers for segment in segments]
        fixed = fixed_limbs(markers, tree.parents)
        parting = parting.beside(np.array([is_steady(limb) for limb in markers]), tree.parents) if parting else None
        if (tree.parents[fixed] >= 0).any() or (parting and parting.strangers):
            rooted = replace(stated, roots=(*stated.roots, *fixed))
            tree = find_tree(costs, guesses, n_markers, rooted, parting)
        joints, placed = place_joints(segments, frames, tree.parents, how, monitor, guesses)
        n_frames = len(segments[0].points)
        raw = positions_of_joints(joints, tree.parents, n_frames)
        if n_frames < trajectories.n_frames:
            raw = place_in_blocks(trajectories.positions, limbs, tree.parents, how, monitor, guesses)
        topology = _with_joints(tree, [joints[child] for child in joint_children(tree.parents)], raw, parameters)
        seeming = [pair for pair in loop_joints(tree.parents, costs, n_markers) if pair not in between]
        posed = [segment.at(frames) for segment in placed]
        loops = closing_loops(seeming, tree.parents, posed, costs.expected, how)
        topology = with_certainty(replace(topology, loops=loops), costs.turns, limbs, stated, worn)
        notices = [*tree_notices(topology, costs, guesses, tree, len(np.unique(body_of_limb)))]
        notices += sliding_loop_notices(parting.slides if parting else {}, tree.parents, loops)
        notices += undetermined_limb_notices(placed)
        notices += still_limb_notices(
            markers,
            np.concatenate([topology.edges, np.reshape(topology.loops, (-1, 2)).astype(np.intp)]),
        )
        if parameters.solver == "conjugate-gradient":
            notices += stuck_joint_notices(joints, tree.parents)
        for notice in notices:
            monitor.notice(notice)
        return topology

    @cached_property
    def is_still(self) -> Bools:
        """Which limbs stand still in the room, shape (n_limbs,)."""
        return still_limbs([segment.markers for segment in self._segments[0]])

    def parted(self, n_bodies: int) -> PartedBodies | None:
        """Part limbs into a stated number of bodies, where the joints of the tree fit worst; None if that fails.

        Parameters
        ----------
        n_bodies : int
            How many bodies there are; each has at least `LEAST_MARKERS` markers.
        """
        n_limbs, sizes = self._limbs.n_limbs, [segment.n_markers for segment in self._segments[0]]
        odds, _, search = self._pairs(np.zeros(n_limbs, dtype=np.intp), SILENT)
        costs = comparable_costs(search.guesses(), n_limbs, self._parameters.alpha, odds)
        parents = find_tree(costs, search.guesses(), sizes, JointConstraints(), None).parents
        if self._n_moving_parts(parents, costs) == n_bodies:
            left_out = self.is_still
            order = np.where(left_out | left_out[:, np.newaxis], np.inf, costs.order)
            parents = find_tree(replace(costs, order=order), search.guesses(), sizes, JointConstraints(), None).parents
        else:
            left_out = np.zeros(n_limbs, dtype=np.bool_)
        return parted_tree(parents, costs.comparable, np.where(left_out, 0, sizes), n_bodies)

    def _n_moving_parts(self, parents: Ints, costs: JointCosts) -> int:
        """Into how many parts moving limbs fall without those that stand still, by the tree and its loops."""
        markers = [segment.markers for segment in self._segments[0]]
        children = np.flatnonzero(parents >= 0)
        loops = np.reshape(loop_joints(parents, costs, [limb.shape[1] for limb in markers]), (-1, 2)).astype(np.intp)
        return n_moving_parts(markers, np.concatenate([np.stack([parents[children], children], axis=1), loops]))


def _with_joints(tree: Tree, joints: list[JointGuess], raw: Floats, parameters: JointParameters) -> Topology:
    """The tree with its joints from the roots outward, and their raw positions [mm], (n_frames, n_joints, 3)."""
    return Topology(
        parents=tree.parents,
        joint_costs=tree.costs,
        raw_joint_positions=raw,
        n_iterations=np.array([joint.n_iterations for joint in joints], dtype=np.intp),
        values=np.array([joint.cost(parameters.alpha_final) for joint in joints]),
        alpha=parameters.alpha,
        final_alpha=parameters.alpha_final,
    )
