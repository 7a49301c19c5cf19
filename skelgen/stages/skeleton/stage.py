"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame.

Limbs are aligned over all frames and averaged, joined from the root, and posed from the root outward in closed form
(Schönauer 2007, 3.8). From there, limbs, joints and poses are refined together by maximum likelihood, which removes the
errors that add up from limb to limb (Gaschler 2011, 5.3).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.geometry.statistics import spread_of_markers
from skelgen.kinematics.calibration.limb_errors import deviations
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.kinematics.joints.observability import observed_joints, open_directions, size_of_limb
from skelgen.model import Joint, Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.skeleton.assembly import StructuredTake
from skelgen.stages.skeleton.fitting import FittedBody, fit_body
from skelgen.stages.skeleton.joints import limb_size
from skelgen.stages.skeleton.long_takes import fitted_frames, play_back
from skelgen.stages.skeleton.loops import ClosedLoops, loop_notices, stated_loops
from skelgen.stages.skeleton.parameters import SkeletonParameters


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
        Receives progress.
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
    loops = _loops(parameters, take, monitor)
    frames = fitted_frames(take)
    some = take.at(frames)
    fitted = _fitted(some, loops, parameters, are_poses, monitor)
    skeleton = _make_skeleton(fitted, limbs, some.topology)
    motion = _make_motion(fitted, some.trajectories, skeleton)
    n_outliers = _counted_outliers(fitted, trajectories.n_markers)
    if len(frames) < trajectories.n_frames:
        played = play_back(fitted, skeleton, take, frames, parameters, monitor)
        motion, n_outliers = played.motion, played.n_outliers
    if parameters.frames_per_second:
        motion = replace(motion, rate=parameters.frames_per_second)
    notices = (*_unseen_notices(motion), *_outlier_notices(n_outliers, trajectories), *_loop_notices(fitted))
    for notice in (*notices, *(joint.notice for joint in observed_joints(skeleton, motion) if joint.sentence)):
        monitor.notice(notice)
    return skeleton, motion


def _loops(parameters: SkeletonParameters, take: StructuredTake, monitor: Monitor) -> tuple[tuple[int, int], ...]:
    loops = stated_loops(parameters.loops, take)
    if loops and parameters.fit != "whole-chain":
        monitor.notice("loops stay open: only the fit of the whole chain closes them")
    return loops


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


def _counted_outliers(fitted: list[FittedBody], n_markers: int) -> Ints:
    """Number of frames in which each marker is left out."""
    n_outliers = np.zeros(n_markers, dtype=np.intp)
    for one in fitted:
        n_outliers[one.body.markers] += one.outliers.sum(axis=0)
    return n_outliers


def _loop_notices(fitted: list[FittedBody]) -> Iterator[str]:
    """Say of each loop how it was closed."""
    for one in fitted:
        if one.loops:
            yield from loop_notices(one.loops, one.body.limbs)


def _unseen_notices(motion: Motion) -> Iterator[str]:
    """Say of each limb that is never seen to turn, and in one sentence which are interpolated, the worst first."""
    unseen, n_frames = (~motion.limb_seen).sum(axis=0).tolist(), motion.n_frames
    for limb, count in enumerate(unseen):
        if count == n_frames:
            yield f"no frame shows enough of limb {limb} to tell how it turns"
    some = (limb for limb, count in enumerate(unseen) if 0 < count < n_frames)
    worst = sorted(some, key=lambda limb: (-unseen[limb], limb))
    if worst:
        parts = [f"limb {limb} in {unseen[limb]} ({100 * unseen[limb] / n_frames:.1f} %)" for limb in worst]
        yield f"interpolated where a frame shows too little of a limb: {', '.join(parts)} of {n_frames} frames"


def _outlier_notices(n_outliers: Ints, trajectories: Trajectories) -> Iterator[str]:
    """Say in one sentence which markers have positions that cannot be theirs, the worst first."""
    counts = dict(zip(trajectories.names, n_outliers.tolist(), strict=True))
    worst = sorted((name for name in counts if counts[name]), key=lambda name: (-counts[name], name))
    if worst:
        parts = [f"{name} in {counts[name]}" for name in worst]
        yield f"left out of the fit because it cannot belong to the marker: {', '.join(parts)} frames"


def _make_skeleton(fitted: list[FittedBody], limbs: Limbs, topology: Topology) -> Skeleton:
    """Join fitted bodies into one skeleton.

    Parameters
    ----------
    fitted : list of FittedBody
        All trees.
    limbs : Limbs
        Which marker is on which limb.
    topology : Topology
        The trees.
    """
    offsets = np.full((limbs.n_markers, 3), np.nan)
    spread, noise, offset_std = (np.full(shape, np.nan) for shape in (limbs.n_markers, limbs.n_markers, offsets.shape))
    reference = np.tile(np.eye(4), (topology.n_limbs, 1, 1))
    joint_above: dict[int, Joint] = {}
    n_open = np.zeros(topology.n_limbs, dtype=np.intp)
    for one in fitted:
        offsets[one.body.markers] = one.chain.offsets
        error = one.body.positions - one.poses.markers(one.chain)
        spread[one.body.markers] = np.nan_to_num(spread_of_markers(error))
        noise[one.body.markers] = one.noise
        stds = np.zeros_like(one.chain.offsets)
        for limb in range(one.chain.n_limbs):
            change = one.chain_from_errors[limb] @ one.errors.offsets(limb)
            stds[one.chain.limb_of_marker == limb] = np.minimum(deviations(change), limb_size(one.chain, limb))
        offset_std[one.body.markers] = stds
        reference[one.body.limbs, :3, 3] = one.poses[np.array([one.reference])].origins(one.chain)[0]
        joint_above |= _joints(one)
        if one.n_open is not None:
            n_open[one.body.limbs] = one.n_open
    skeleton = Skeleton(
        parents=topology.parents,
        joints=tuple(joint_above[int(child)] for child in topology.children),
        limb_of_marker=limbs.limb_of_marker,
        marker_offsets=offsets,
        marker_std=spread,
        reference_pose=reference,
        offset_std=offset_std,
        marker_noise=noise,
        loops=tuple(joint for one in fitted if one.loops is not None for joint in _loop_joints(one, one.loops)),
    )
    joints = tuple(_with_open_directions(skeleton, joint, int(n_open[joint.child])) for joint in skeleton.joints)
    return replace(skeleton, joints=joints, length_std=_length_std(fitted, skeleton))


def _with_open_directions(skeleton: Skeleton, joint: Joint, n_by_motion: int) -> Joint:
    """Note in how many directions motion leaves a joint open, and in how many of these what is usual tells it."""
    axis = joint.axis if joint.kind == "hinge" else None
    n_open = open_directions(joint.place_covariance, size_of_limb(skeleton, joint.child), axis)
    usual = 0 if joint.is_placed_by_marker_set else max(n_by_motion - n_open, 0)
    return replace(joint, open_directions=max(n_open, n_by_motion), usual_directions=usual)


def _make_motion(fitted: list[FittedBody], trajectories: Trajectories, skeleton: Skeleton) -> Motion:
    """Gather the poses of all bodies.

    Parameters
    ----------
    fitted : list of FittedBody
        All trees.
    trajectories : Trajectories
        The take that they were fitted to.
    skeleton : Skeleton
        Made of them.
    """
    n_frames = trajectories.n_frames
    world_from_limb = np.tile(np.eye(4), (n_frames, skeleton.n_limbs, 1, 1))
    markers = np.full((n_frames, trajectories.n_markers, 3), np.nan)
    seen = np.zeros((n_frames, skeleton.n_limbs), dtype=bool)
    deviations = np.zeros((n_frames, skeleton.n_limbs, 3))
    for one in fitted:
        world_from_limb[:, one.body.limbs] = transform_from(one.poses.rotations, one.poses.origins(one.chain))
        markers[:, one.body.markers] = one.poses.markers(one.chain)
        seen[:, one.body.limbs] = one.seen
        deviations[:, one.body.limbs] = one.deviations
    children = np.array([joint.child for joint in skeleton.joints], dtype=np.intp)
    return Motion(
        world_from_limb=world_from_limb,
        joint_positions=world_from_limb[:, :, :3, 3][:, children],
        marker_positions=markers,
        residuals=np.linalg.norm(trajectories.positions - markers, axis=2),
        limb_seen=seen,
        rate=trajectories.rate,
        joint_std=deviations[:, children],
        compute_angles=MotionAngles(skeleton, trajectories.positions),
    )


def _joints(one: FittedBody) -> dict[int, Joint]:
    """Joint above each limb but the root, by the child's index in the take."""
    found = {}
    for limb in range(1, one.chain.n_limbs):
        parent, kind = int(one.chain.parents[limb]), one.types[limb - 1]
        size = limb_size(one.chain, limb)
        changes = [one.chain_from_errors[where] @ one.errors.joint(limb, where) for where in (parent, limb)]
        covariance, in_child = (_below(change @ change.T, size) for change in changes)
        child = int(one.body.limbs[limb])
        found[child] = Joint(
            parent=int(one.body.limbs[parent]),
            child=child,
            position_in_parent=one.chain.joints[limb],
            position_in_child=np.zeros(3),
            kind=kind.kind,
            axis=kind.axis_in_parent if kind.kind in {"hinge", "universal"} else None,
            std=_root(covariance),
            second_axis=kind.axis_in_child if kind.kind == "universal" else None,
            covariance=covariance,
            covariance_in_child=in_child,
            axis_std=_axis_std(one, limb, parent),
            second_axis_std=_axis_std(one, limb, limb),
            turn_covariance=one.rotation_covariances[limb],
            is_placed_by_marker_set=limb in one.by_marker_set,
        )
    return found


def _loop_joints(one: FittedBody, closed: ClosedLoops) -> Iterator[Joint]:
    """Joints that close loops; they are ball joints: their points meet."""
    joints = closed.joints
    for limbs, places, covariances in zip(joints.limbs.tolist(), joints.places, closed.covariances, strict=True):
        capped = [_below(size, limb_size(one.chain, limb)) for size, limb in zip(covariances, limbs, strict=True)]
        yield Joint(
            parent=int(one.body.limbs[limbs[0]]),
            child=int(one.body.limbs[limbs[1]]),
            position_in_parent=places[0],
            position_in_child=places[1],
            kind="ball",
            axis=None,
            std=_root(capped[0]),
            covariance=capped[0],
            covariance_in_child=capped[1],
        )


def _below(covariance: Floats, size: float) -> Floats:
    """Covariance of a position [mm^2], shape (3, 3), with deviations no larger than the limb, even if undetermined."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.clip(values, 0.0, size**2)) @ vectors.T)


def _root(covariance: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def _axis_std(one: FittedBody, limb: int, where: int) -> Floats | None:
    """Standard deviations of an axis in one of its limbs: from the chain, or from the joint type where that is free."""
    kind = one.types[limb - 1]
    if kind.kind not in {"hinge", "universal"}:
        return None
    if one.errors.articulation.types[limb] == kind.kind:
        return np.asarray(np.minimum(deviations(one.chain_from_errors[where] @ one.errors.axis(limb, where)), 1.0))
    own = slice(3, 6) if where == limb else slice(0, 3)
    return _root(kind.axis_covariance[own, own])


def _length_std(fitted: list[FittedBody], skeleton: Skeleton) -> Floats:
    """Standard deviations of the skeleton's lengths, in their order."""
    body_of = {int(limb): (one, place) for one in fitted for place, limb in enumerate(one.body.limbs)}
    stds = []
    for first, second in skeleton.lengths:
        one, limb = body_of[skeleton.limb_of_length((first, second))]
        ends = [body_of[skeleton.joints[index].child][1] for index in (first, second)]
        stds.append(min(float(deviations(one.errors.length(ends[0], ends[1], limb))), limb_size(one.chain, limb)))
    return np.array(stds)
