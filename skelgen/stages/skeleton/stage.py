"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame.

Limbs are lined up over all frames and averaged, joined from the root, and posed from the root outward in closed form
(Schönauer 2007, 3.8). From there, limbs, joints and poses are refined together by maximum likelihood, which removes the
errors that add up from limb to limb (Gaschler 2011, 5.3).
"""

from __future__ import annotations

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import ROTATORS
from skelgen.kinematics.joints.observability import observed_joints
from skelgen.model import Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.skeleton.assembly import cut_out
from skelgen.stages.skeleton.fitting import fit_body
from skelgen.stages.skeleton.long_takes import at_frames, play_back, telling_frames
from skelgen.stages.skeleton.loops import ring_sentences, wanted_rings
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
        Whether the markers stand for bodies with orientation: however many, they tell six numbers in each frame.

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
    pairs = wanted_rings(parameters.loops, topology, trajectories, limbs)
    if pairs and parameters.fit != "whole-chain":
        monitor.notice("rings stay open: only the fit of the whole chain closes them")
    telling = telling_frames(trajectories, limbs)
    some, there = at_frames(trajectories, topology, telling)
    fitted = []
    for index, root in enumerate(topology.roots):
        body = cut_out(some, limbs, there, int(root))
        if not (~np.isnan(body.positions[:, :, 0])).any():
            raise InputError(f"{trajectories.name or 'the take'}: no marker of limb {root} is seen in any frame")
        place = {int(limb): position for position, limb in enumerate(body.limbs)}
        rings = np.array([[place[limb] for limb in pair] for pair in pairs if pair[0] in place], dtype=np.intp)
        fitted.append(fit_body(body, parameters, ROTATORS[parameters.rotation], are_poses, rings))
        monitor.advance(index + 1, len(topology.roots))
    skeleton = make_skeleton(fitted, limbs, there)
    motion = make_motion(fitted, some, skeleton)
    observed = observed_joints(skeleton, motion)
    n_outliers = np.zeros(trajectories.n_markers, dtype=np.intp)
    for one in fitted:
        n_outliers[one.body.markers] = one.outliers.sum(axis=0)
    if len(telling) < trajectories.n_frames:
        played = play_back(fitted, skeleton, trajectories, limbs, topology, parameters, telling, monitor)
        motion, n_outliers = played.motion, played.n_outliers
    _report_unseen(motion, monitor)
    _report_outliers(n_outliers, trajectories, monitor)
    for one in fitted:
        if one.rings is not None:
            for sentence in ring_sentences(one.rings, one.body.limbs):
                monitor.notice(sentence)
    for seen in observed:
        if seen.sentence:
            monitor.notice(seen.sentence)
    return skeleton, motion


def _report_unseen(motion: Motion, monitor: Monitor) -> None:
    """Say in one sentence which limbs are interpolated, the worst first."""
    unseen = (~motion.limb_seen).sum(axis=0).tolist()
    worst = sorted((limb for limb, count in enumerate(unseen) if count), key=lambda limb: (-unseen[limb], limb))
    if worst:
        n_frames = motion.n_frames
        parts = [f"limb {limb} in {unseen[limb]} ({100 * unseen[limb] / n_frames:.1f} %)" for limb in worst]
        monitor.notice(
            f"interpolated where a frame shows too little of a limb: {', '.join(parts)} of {n_frames} frames"
        )


def _report_outliers(n_outliers: Ints, trajectories: Trajectories, monitor: Monitor) -> None:
    """Say in one sentence which markers have positions that cannot be theirs, the worst first."""
    counts = dict(zip(trajectories.names, n_outliers.tolist(), strict=True))
    worst = sorted((name for name in counts if counts[name]), key=lambda name: (-counts[name], name))
    if worst:
        parts = [f"{name} in {counts[name]}" for name in worst]
        monitor.notice(f"left out of the fit because it cannot belong to the marker: {', '.join(parts)} frames")
