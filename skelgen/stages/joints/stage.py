"""Stage 3: find the joints between limbs and the tree that they form.

A joint is a point that keeps its distance to the markers of two limbs (Schönauer 2007, 3.5). Every pair of limbs is
tried on sampled frames; the cheapest joints span the tree; those that are kept are placed in all frames.
"""

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.topology import joint_children
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.costs import comparable_costs
from skelgen.stages.joints.edge_certainty import with_certainty
from skelgen.stages.joints.nearness import neighbour_odds
from skelgen.stages.joints.parameters import JointConstraints, JointParameters
from skelgen.stages.joints.search import PairSearch, place_in_blocks, place_joints, side_by_side
from skelgen.stages.joints.segments import make_segments, markers_of_limbs, sample_frames
from skelgen.stages.joints.tree import (
    find_tree,
    loop_joints,
    stuck_joint_notices,
    tree_notices,
    undetermined_limb_notices,
    usual_radius,
)


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
        Told of progress and of notices.

    Raises
    ------
    InputError
        If no marker belongs to a limb, or the constraints cannot be met.
    """
    parameters = parameters or JointParameters()
    monitor.begin("joints")
    if not limbs.n_limbs:
        raise InputError(f"{trajectories.name or 'the take'}: no marker belongs to a limb, so there are no joints")
    stated = (constraints or JointConstraints()).with_parameters(parameters, trajectories.names, limbs)
    markers = markers_of_limbs(trajectories.positions, limbs, int(parameters.samples))
    n_frames, frames = len(markers[0]), sample_frames(len(markers[0]), parameters)
    segments = make_segments(markers, frames)
    body_of_limb = stated.bodies(limbs.body_of_limb if parameters.separate else np.zeros_like(limbs.body_of_limb))
    odds = neighbour_odds(segments, frames, body_of_limb)
    guesses = PairSearch(segments, frames, parameters, seed, monitor, odds).guesses()
    costs = comparable_costs(guesses, limbs.n_limbs, parameters.alpha, odds)
    radius = usual_radius(segments, frames) if parameters.separate else None
    tree = find_tree(costs, guesses, [segment.n_markers for segment in segments], stated, radius)
    joints, segments = place_joints(segments, frames, tree.parents, parameters, seed, monitor, guesses)
    raw = side_by_side(joints, tree.parents, n_frames)
    if n_frames < trajectories.n_frames:
        raw = place_in_blocks(trajectories.positions, limbs, tree.parents, parameters, seed, monitor, guesses)
    in_order = [joints[child] for child in joint_children(tree.parents)]
    topology = Topology(
        parents=tree.parents,
        joint_costs=tree.costs,
        raw_joint_positions=raw,
        n_iterations=np.array([joint.n_iterations for joint in in_order], dtype=np.intp),
        values=np.array([joint.cost(parameters.alpha_final) for joint in in_order]),
        alpha=parameters.alpha,
        loops=loop_joints(tree.parents, costs),
        final_alpha=parameters.alpha_final,
    )
    topology = with_certainty(topology, costs.turns, stated)
    for notice in (
        *tree_notices(topology, costs, guesses, (tree.cut, len(np.unique(body_of_limb)))),
        *undetermined_limb_notices(segments),
    ):
        monitor.notice(notice)
    if parameters.solver == "conjugate-gradient":
        for notice in stuck_joint_notices(joints, tree.parents):
            monitor.notice(notice)
    return topology
