"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame.

Limbs are aligned over all frames and averaged, joined from the root, and posed from the root outward in closed form
(Schönauer 2007, 3.8). From there, limbs, joints and poses are refined together by maximum likelihood, which removes the
errors that add up from limb to limb (Gaschler 2011, 5.3).
"""

from collections.abc import Iterator

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.joints.observability import observed_joints
from skelgen.model import Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.skeleton.assembly import StructuredTake
from skelgen.stages.skeleton.fitting import FittedBody, fit_body
from skelgen.stages.skeleton.long_takes import fitted_frames, play_back
from skelgen.stages.skeleton.loops import loop_notices, stated_loops
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.result import make_motion, make_skeleton


def fit_skeleton(
    trajectories: Trajectories,
    limbs: Limbs,
    topology: Topology,
    parameters: SkeletonParameters | None = None,
    *,
    monitor: Monitor = SILENT,
    are_poses: bool = False,
) -> tuple[Skeleton, Motion]:
    """Fit a rigid skeleton and its motion.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.
    topology : Topology
        The tree and the raw joints.
    parameters : SkeletonParameters, optional
        How.
    monitor : Monitor
        Told of progress.
    are_poses : bool
        Whether the markers stand for bodies with orientation: however many, they give six numbers in each frame.

    Returns
    -------
    tuple of Skeleton and Motion
        The motion is complete: limbs that cannot be seen are interpolated and marked.

    Raises
    ------
    InputError
        If no marker of a tree is ever seen.
    """
    parameters = parameters or SkeletonParameters()
    monitor.begin("skeleton")
    take = StructuredTake(trajectories, limbs, topology)
    loops = stated_loops(parameters.loops, take)
    if loops and parameters.fit != "whole-chain":
        monitor.notice("loops stay open: only the fit of the whole chain closes them")
    frames = fitted_frames(take)
    some = take.at(frames)
    fitted = _fitted(some, loops, parameters, are_poses, monitor)
    skeleton = make_skeleton(fitted, limbs, some.topology)
    motion = make_motion(fitted, some.trajectories, skeleton)
    observed = observed_joints(skeleton, motion)
    n_outliers = np.zeros(trajectories.n_markers, dtype=np.intp)
    for one in fitted:
        n_outliers[one.body.markers] += one.outliers.sum(axis=0)
    if len(frames) < trajectories.n_frames:
        played = play_back(fitted, skeleton, take, frames, parameters, monitor)
        motion, n_outliers = played.motion, played.n_outliers
    notices = [*_unseen_notices(motion), *_outlier_notices(n_outliers, trajectories)]
    notices += [notice for one in fitted if one.loops for notice in loop_notices(one.loops, one.body.limbs)]
    for notice in (*notices, *(joint.sentence for joint in observed if joint.sentence)):
        monitor.notice(notice)
    return skeleton, motion


def _fitted(
    take: StructuredTake,
    loops: tuple[tuple[int, int], ...],
    parameters: SkeletonParameters,
    are_poses: bool,
    monitor: Monitor,
) -> list[FittedBody]:
    """Fit all trees of a take."""
    bodies = take.bodies()
    fitted = []
    for index, body in enumerate(bodies):
        if np.isnan(body.positions[:, :, 0]).all():
            name = take.trajectories.name or "the take"
            raise InputError(f"{name}: no marker of limb {body.limbs[0]} is seen in any frame")
        # Pairs of limbs that close loops of one body, by position in the body, shape (n_loops, 2)
        place = {limb: position for position, limb in enumerate(body.limbs.tolist())}
        own = [[place[limb] for limb in pair] for pair in loops if pair[0] in place]
        fitted.append(fit_body(body, parameters, np.array(own, dtype=np.intp).reshape(-1, 2), are_poses))
        monitor.advance(index + 1, len(bodies))
    return fitted


def _unseen_notices(motion: Motion) -> Iterator[str]:
    """Say in one sentence which limbs are interpolated, the worst first."""
    unseen = (~motion.limb_seen).sum(axis=0).tolist()
    worst = sorted((limb for limb, count in enumerate(unseen) if count), key=lambda limb: (-unseen[limb], limb))
    if worst:
        n_frames = motion.n_frames
        parts = [f"limb {limb} in {unseen[limb]} ({100 * unseen[limb] / n_frames:.1f} %)" for limb in worst]
        yield f"interpolated where a frame shows too little of a limb: {', '.join(parts)} of {n_frames} frames"


def _outlier_notices(n_outliers: Ints, trajectories: Trajectories) -> Iterator[str]:
    """Say in one sentence which markers have positions that cannot be theirs, the worst first."""
    counts = dict(zip(trajectories.names, n_outliers.tolist(), strict=True))
    worst = sorted((name for name in counts if counts[name]), key=lambda name: (-counts[name], name))
    if worst:
        parts = [f"{name} in {counts[name]}" for name in worst]
        yield f"left out of the fit because it cannot belong to the marker: {', '.join(parts)} frames"
