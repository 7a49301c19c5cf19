"""How far joints and lengths between them are from the truth, from the Cramer-Rao bound, and from what is predicted.

The place of a hinge along its axis is not determined by any motion. There the error is measured across the axis: what
lies along the true axis, frame by frame, is left out. The same holds for a length that ends at a hinge: both the found
and the true vector between the joints are projected across the axes of the hinges at its ends before they are compared.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.calibration.uncertainty import Bound, cramer_rao_bound
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed
from skelgen.model import Motion, Project, Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.model.topology import outward_order
from skelgen.simulation.truth import Truth

_PARALLEL = 1e-6  # sine of the angle between two hinge axes below which they count as one direction


@dataclass(frozen=True)
class JointScore:
    """How far one joint is from its true place.

    Attributes
    ----------
    name : str
        The true joint.
    kind_true, kind_found : str
        Type of joint; nothing is found before the skeleton is fitted.
    mean, median, maximum : float or None, mm
        Distance over all frames, for a hinge across its axis; None before the skeleton is fitted.
    raw_mean : float or None, mm
        Mean distance before the fit of rigid limbs, over the frames that have a raw joint.
    bound : float or None, mm
        Mean distance that no unbiased method can go below (Cramer-Rao), for noise as large as the take's.
    times_bound : float or None
        Mean distance over the frames of the bound, in units of the bound.
    predicted : float or None, mm
        Mean distance that the result itself predicts.
    coverage : float or None
        Part of the frames and axes in which the predicted 95 % intervals hold the truth.
    """

    name: str
    kind_true: str
    kind_found: str
    mean: float | None
    median: float | None
    maximum: float | None
    raw_mean: float | None
    bound: float | None = None
    times_bound: float | None = None
    predicted: float | None = None
    coverage: float | None = None


@dataclass(frozen=True)
class LengthScore:
    """The distance between two joints of one limb.

    Attributes
    ----------
    limb, first, second : str
        The true limb and joints.
    is_across_hinges : bool
        Whether a hinge is among the joints, so that the lengths are those across its axis.
    true, found : float, mm
        Lengths.
    error : float, mm
        Found minus true.
    """

    limb: str
    first: str
    second: str
    is_across_hinges: bool
    true: float
    found: float
    error: float


def joint_distances(positions: Floats, true_of_joint: Ints, truth: Truth) -> Floats:
    """Return the distance of joints from their true places, for hinges across the true axis.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_joints, 3), mm
        Joints of the result in the world; NaN where unknown.
    true_of_joint : ndarray of intp, shape (n_joints,)
        True joint of each.
    truth : Truth
        The true joints.

    Returns
    -------
    ndarray, shape (n_frames, n_joints), mm
    """
    return np.asarray(np.linalg.norm(joint_errors(positions, true_of_joint, truth), axis=2))


def joint_errors(positions: Floats, true_of_joint: Ints, truth: Truth) -> Floats:
    """Return the vectors from true positions to joints, for hinges across the true axis, mm.

    Parameters
    ----------
    positions, true_of_joint, truth
        As for `joint_distances`.
    """
    gap = positions - truth.joint_positions[:, true_of_joint]
    axes = _hinge_axes(truth)[:, true_of_joint]
    return np.asarray(gap - (gap * axes).sum(axis=2, keepdims=True) * axes)


def _hinge_axes(truth: Truth) -> Floats:
    """Axes of the hinges in the world, zero for other joints, shape (n_frames, n_joints, 3)."""
    is_hinge = np.array([kind == "hinge" for kind in truth.joint_kinds], dtype=np.bool_)
    return np.where(is_hinge[:, np.newaxis], truth.joint_axes, 0.0)


def score_joints(
    true_of_joint: Ints, truth: Truth, *, raw: Floats | None, fitted: Floats | None, types: tuple[str, ...]
) -> tuple[JointScore, ...]:
    """Score every joint that is true, in the order of the truth.

    Parameters
    ----------
    true_of_joint : ndarray of intp, shape (n_joints,)
        True joint of each joint of the result, -1 where there is none.
    truth : Truth
        The true joints.
    raw, fitted : ndarray, shape (n_frames, n_joints, 3), mm, or None
        Joints before and after the fit of rigid limbs.
    types : tuple of str, length n_joints
        Types of the joints found; empty before the fit.
    """
    shared = [int(joint) for joint in np.argsort(true_of_joint, kind="stable") if true_of_joint[joint] >= 0]
    true_joints = true_of_joint[shared]
    before, after = (
        None if positions is None else joint_distances(positions[:, shared], true_joints, truth)
        for positions in (raw, fitted)
    )
    return tuple(
        JointScore(
            name=truth.joint_names[true_joint],
            kind_true=truth.joint_kinds[true_joint],
            kind_found=types[joint] if types else "",
            mean=None if after is None else float(after[:, column].mean()),
            median=None if after is None else float(np.median(after[:, column])),
            maximum=None if after is None else float(after[:, column].max()),
            raw_mean=None if before is None else _mean_or_none(before[:, column]),
        )
        for column, (joint, true_joint) in enumerate(zip(shared, true_joints, strict=True))
    )


def _mean_or_none(values: Floats) -> float | None:
    """Return the mean of what is not NaN, or None if nothing is left."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else None


def score_lengths(skeleton: Skeleton, positions: Floats, true_of_joint: Ints, truth: Truth) -> tuple[LengthScore, ...]:
    """Compare the distances between joints of one limb with the true ones.

    Parameters
    ----------
    skeleton : Skeleton
        Says which joints a limb has.
    positions : ndarray, shape (n_frames, n_joints, 3), mm
        Joints of the result in the world.
    true_of_joint : ndarray of intp, shape (n_joints,)
        True joint of each, -1 where there is none; pairs with a false joint are left out.
    truth : Truth
        The true joints.
    """
    scores = []
    for first, second in skeleton.lengths:
        pair = int(true_of_joint[first]), int(true_of_joint[second])
        if min(pair) < 0:
            continue
        shared = set(truth.edges[pair[0]].tolist()) & set(truth.edges[pair[1]].tolist())
        if len(shared) == 1:
            found = positions[:, first] - positions[:, second]
            scores.append(_length_score(found, pair, truth.limb_names[shared.pop()], truth))
    return tuple(scores)


def _length_score(found: Floats, pair: tuple[int, int], limb: str, truth: Truth) -> LengthScore:
    axes = _hinge_axes(truth)[:, list(pair)]
    true = truth.joint_positions[:, pair[0]] - truth.joint_positions[:, pair[1]]
    true_length, found_length = (
        float(np.linalg.norm(_across(vectors, axes[:, 0], axes[:, 1]), axis=1).mean()) for vectors in (true, found)
    )
    first, second = (truth.joint_names[joint] for joint in pair)
    is_across = bool(axes.any())
    return LengthScore(limb, first, second, is_across, true_length, found_length, found_length - true_length)


def _across(vectors: Floats, first: Floats, second: Floats) -> Floats:
    """Remove from vectors, shape (n_frames, 3), what lies in the span of two axes that may be zero or parallel."""
    rest = second - _along(second, first)
    size = np.linalg.norm(rest, axis=1, keepdims=True)
    other = np.where(size > _PARALLEL, rest / np.maximum(size, _PARALLEL), 0.0)
    vectors = vectors - _along(vectors, first)
    return np.asarray(vectors - _along(vectors, other))


def _along(vectors: Floats, axes: Floats) -> Floats:
    return np.asarray((vectors * axes).sum(axis=1, keepdims=True) * axes)


@dataclass(frozen=True)
class MarkerScore:
    """Deviation of one marker.

    Attributes
    ----------
    limb : str
        True limb, empty where the marker does not exist in the truth.
    marker : str
        Its label in the result.
    from_tracked : float or None, mm
        Mean distance of the reconstructed from the tracked position over the frames where it is tracked.
    from_true : float or None, mm
        Mean distance of the reconstructed from the true position, over all frames: where the marker would be if it
        were rigidly fixed to its limb.
    """

    limb: str
    marker: str
    from_tracked: float | None
    from_true: float | None


def score_markers(
    trajectories: Trajectories, motion: Motion, true_of_marker: Ints, truth: Truth
) -> tuple[MarkerScore, ...]:
    """Score every marker that the skeleton carries, grouped by true limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Tracked markers.
    motion : Motion
        Reconstructed markers.
    true_of_marker : ndarray of intp, shape (n_markers,)
        True marker of each, -1 where there is none.
    truth : Truth
        True markers and limbs.
    """
    from_tracked = np.linalg.norm(motion.marker_positions - trajectories.positions, axis=2)
    gap = motion.marker_positions - truth.marker_positions[:, true_of_marker]
    from_true = np.where(true_of_marker >= 0, np.linalg.norm(gap, axis=2), np.nan)
    is_carried = np.asarray(~np.isnan(motion.marker_positions).all(axis=(0, 2)))
    limb = np.where(true_of_marker >= 0, truth.limb_of_marker[true_of_marker], truth.n_limbs)
    names = (*truth.limb_names, "")
    scores = []
    for marker in np.lexsort((true_of_marker, limb)):
        if is_carried[marker]:
            distances = _mean_or_none(from_tracked[:, marker]), _mean_or_none(from_true[:, marker])
            scores.append(MarkerScore(names[limb[marker]], trajectories.names[marker], *distances))
    return tuple(scores)


MOST_FRAMES = 2000
"""Frames from which the bound is computed at most, evenly spread: more would hardly make it smaller."""

SIGMAS_OF_95 = 1.96
"""Half the width of the interval that holds 95 % of normal numbers, in standard deviations."""

DISTANCE_OF_STD = np.sqrt(8 / np.pi) / np.sqrt(3)
"""Mean length of normal vectors whose deviation is 1 / sqrt 3 along each of three axes."""


def _bound_of_take(trajectories: Trajectories, true_of_marker: Ints, truth: Truth) -> tuple[Bound, float, Ints] | None:
    """Return the bound of a take's joints, in the order of the truth's.

    Parameters
    ----------
    trajectories : Trajectories
        What was measured.
    true_of_marker : ndarray of intp, shape (n_markers,)
        True marker of each marker, -1 where there is none.
    truth : Truth
        The truth.

    Returns
    -------
    tuple of Bound, float [mm] and ndarray of intp, or None
        The bound, without the root; the noise of a coordinate, which is all that sets measured positions apart from
        rigid limbs; and the frames. None for several trees, or where markers are missing.
    """
    if truth.n_limbs < 2 or (truth.parents < 0).sum() != 1:
        return None
    frames = spread_frames(truth.n_frames, MOST_FRAMES)
    measured = np.full((len(frames), truth.n_markers, 3), np.nan)
    known = true_of_marker >= 0
    measured[:, true_of_marker[known]] = trajectories.positions[frames][:, known]
    errors = measured - truth.marker_positions[frames]
    if np.isnan(errors).all(axis=(0, 2)).any():
        return None
    noise = float(np.sqrt(np.nanmean(errors**2)))
    if noise == 0.0:
        return None
    chain, articulation, poses = true_chain(truth)
    return cramer_rao_bound(observed(chain, articulation, poses[frames], measured), noise), noise, frames


def true_chain(truth: Truth) -> tuple[Chain, Articulation, ChainPoses]:
    """Return the truth of one tree as a chain; limb k is the child of joint k - 1."""
    order = outward_order(truth.parents)
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.arange(len(order))
    parents = np.where(truth.parents[order] >= 0, place[truth.parents[order]], -1)
    rotations = truth.world_from_limb[:, order, :3, :3]
    origins = np.concatenate([truth.world_from_limb[0, order[:1], :3, 3], truth.joint_positions[0]])
    ways = origins - origins[np.maximum(parents, 0)]
    joints = np.einsum("lji,lj->li", rotations[0, np.maximum(parents, 0)], ways)
    limb_of_marker = place[truth.limb_of_marker]
    arms = truth.marker_positions[0] - origins[limb_of_marker]
    offsets = np.einsum("mji,mj->mi", rotations[0, limb_of_marker], arms)
    chain = Chain(parents, limb_of_marker, joints, offsets)
    poses = ChainPoses(truth.world_from_limb[:, order[0], :3, 3], rotations)
    return chain, _articulation(truth, chain, rotations), poses


def _articulation(truth: Truth, chain: Chain, rotations: Floats) -> Articulation:
    free = Articulation.free(chain.n_limbs)
    types = ("ball", *truth.joint_kinds)
    in_parent, in_child, between = free.in_parent.copy(), free.in_child.copy(), np.zeros(chain.n_limbs)
    for limb in range(1, chain.n_limbs):
        if types[limb] not in {"hinge", "universal"}:
            continue
        parent = rotations[:, chain.parents[limb]]
        relative = parent.swapaxes(1, 2) @ rotations[:, limb]
        in_parent[limb] = parent[0].T @ truth.joint_axes[0, limb - 1]
        in_child[limb] = relative[0].T @ in_parent[limb]
        if types[limb] == "universal":
            # The axis in the child about which the first one goes round in a cone.
            seen = np.einsum("fji,j->fi", relative, in_parent[limb])
            in_child[limb] = np.linalg.svd(seen - seen.mean(axis=0), full_matrices=False)[2][2]
            between[limb] = np.arccos(np.clip(in_parent[limb] @ relative[0] @ in_child[limb], -1.0, 1.0))
    return Articulation(types, in_parent, in_child, between)


def with_limits(
    scores: tuple[JointScore, ...], project: Project, true_of_joint: Ints, true_of_marker: Ints, truth: Truth
) -> tuple[JointScore, ...]:
    """Return joint scores with the bound, the predicted deviation, and the coverage of predicted intervals.

    Parameters
    ----------
    scores : tuple of JointScore
        In the order of the truth.
    project : Project
        With a skeleton.
    true_of_joint, true_of_marker : ndarray of intp
        True joint and marker of each, -1 where there is none.
    truth : Truth
        The truth.
    """
    motion = project.motion
    shared = [int(joint) for joint in np.argsort(true_of_joint, kind="stable") if true_of_joint[joint] >= 0]
    true_joints = true_of_joint[shared]
    limit = _bound_of_take(project.trajectories, true_of_marker, truth)
    result = []
    for score, joint, true_joint in zip(scores, shared, true_joints, strict=True):
        full, found = score, motion.joint_positions[:, [joint]]
        if limit is not None:
            bound, _, frames = limit
            use = bound.determined[:, true_joint + 1]
            smallest = float(bound.distance[use, true_joint + 1].mean())
            error = joint_distances(found, np.array([true_joint]), truth)[frames, 0][use]
            full = dataclasses.replace(full, bound=smallest, times_bound=float(error.mean()) / smallest)
        if motion.joint_std is not None:
            std = motion.joint_std[:, joint]
            gap = np.abs(joint_errors(found, np.array([true_joint]), truth)[:, 0])
            held = gap <= SIGMAS_OF_95 * std + np.finfo(np.float32).eps * np.abs(found[:, 0])
            predicted = DISTANCE_OF_STD * np.linalg.norm(std, axis=1).mean()
            full = dataclasses.replace(full, predicted=float(predicted), coverage=float(held.mean()))
        result.append(full)
    return tuple(result)
