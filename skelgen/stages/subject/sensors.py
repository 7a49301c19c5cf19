r"""Sensors put on a subject: where each sits on its limb, found by the joints.

In a calibrated take the joint of two limbs is at one place, whether the parent's sensor or the child's carries it. How
far these two places are apart in the new take is noise where both sensors sit as they sat, and more where one does
not. The gaps in equal spans of both takes are compared by Welch's test, one-sided, the level shared by all joints.

A limb whose joints all have wider gaps has a sensor that moved; the limb with most joints is treated first. Its joints'
places in the sensor's frame are found anew, while those in the neighbours' frames may differ as well (SCoRE, Ehrig et
al. 2006): the deviations p, q minimise :math:`\sum |R_1 (a + p) + t_1 - R_2 (b + q) - t_2|^2`. The rigid transform
that brings the calibrated places onto them is how the sensor moved. This is repeated until no gap is left that a sensor
could explain. Where a limb has fewer than three joints, or all on one line, they leave the sensor's rotation about them
open: axes of its joints are then not determined, and the joints are ball joints.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import ttest_ind

from skelgen.geometry.orientation import fit_transform, rotation_by_svd
from skelgen.geometry.rotations import moved_points, vector_from_matrix
from skelgen.kinematics.rigid_bodies import determines_pose
from skelgen.model import Joint, Skeleton
from skelgen.model.arrays import Floats
from skelgen.stages.labels import with_free_joints
from skelgen.stages.skeleton import SkeletonParameters
from skelgen.stages.subject.changes import LEAST_SPANS, LEVEL, log_root_mean_squares

LEAST_ROTATION = 0.05
"""Part of the largest singular value below which a direction is not determined: rotations of some 3 degrees."""

REPEATS = 10
"""Times that one sensor is placed: along a hinge's axis its joint is free, and follows the other joints."""

ROUNDS = 3
"""Times that each sensor is placed: its neighbours may have been placed after it."""

ANCHOR_WEIGHT = 0.01
"""Of a joint's weight, for the sensor's markers where they were: what joints leave open stays as it was."""


@dataclass(frozen=True)
class SensorShift:
    """A sensor that sits elsewhere on its limb than in the calibrated take.

    Attributes
    ----------
    limb : int
        The limb.
    shift : float, mm
        By how far the sensor's origin moved.
    turn : float, degrees
        By how much it rotated.
    """

    limb: int
    shift: float
    turn: float


def find_moved_sensors(
    skeleton: Skeleton, before: Floats, after: Floats
) -> tuple[Skeleton, tuple[SensorShift, ...], tuple[int, ...]]:
    """Find sensors that sit elsewhere than in the calibrated take.

    Parameters
    ----------
    skeleton : Skeleton
        The subject's, of virtual markers on sensors.
    before, after : ndarray, shape (n_frames, n_markers, 3), mm
        Its markers in the calibrated and in the new take, NaN where unseen.

    Returns
    -------
    skeleton : Skeleton
        With the markers of sensors that moved where they are now; joints whose axes are not determined are ball joints.
    shifts : tuple of SensorShift
        Those sensors.
    open_joints : tuple of int
        Joints whose gap no shift of a sensor explains.
    """
    known = [_log_gaps(skeleton, joint, before) for joint in skeleton.joints]
    now, moved, n_placed = skeleton, set[int](), [0] * skeleton.n_limbs
    while True:
        wider = [index for index in range(skeleton.n_joints) if _is_wider(now, index, known, after)]
        limb = _limb_with_moved_sensor(now, wider, n_placed)
        if limb < 0:
            shifts = [_shift_of(skeleton, now, limb) for limb in sorted(moved)]
            return _with_determined_axes(now, shifts), tuple(shifts), tuple(wider)
        for _ in range(REPEATS):
            now = _with_sensor_placed(now, limb, after)
        moved.add(limb)
        n_placed[limb] += 1


def _with_determined_axes(skeleton: Skeleton, shifts: list[SensorShift]) -> Skeleton:
    """The skeleton with ball joints on limbs whose sensors moved and whose joints leave the rotation open."""
    freed: set[int] = set()
    for seat in shifts:
        own = _joints_of(skeleton, seat.limb)
        places = np.array([_ends(skeleton.joints[index], seat.limb)[0] for index in own])
        if not determines_pose(places, np.ones((1, len(places)), dtype=np.bool_), SkeletonParameters().flatness)[0]:
            freed.update(own)
    return with_free_joints(skeleton, tuple(sorted(freed)))


def _is_wider(skeleton: Skeleton, index: int, known: list[Floats], after: Floats) -> bool:
    gaps = _log_gaps(skeleton, skeleton.joints[index], after)
    if min(len(gaps), len(known[index])) < LEAST_SPANS:
        return False
    p_value = float(ttest_ind(gaps, known[index], equal_var=False, alternative="greater").pvalue)
    return p_value < LEVEL / skeleton.n_joints


def _log_gaps(skeleton: Skeleton, joint: Joint, positions: Floats) -> Floats:
    """Logarithms of the gap's root mean square in each span."""
    first, second = (_limb_poses(skeleton, limb, positions) for limb in (joint.parent, joint.child))
    gaps = np.linalg.norm(_moved(first, joint.position_in_parent) - _moved(second, joint.position_in_child), axis=1)
    return log_root_mean_squares(gaps, ~np.isnan(gaps))


def _moved(poses: Floats, place: Floats) -> Floats:
    """A place of a limb in the world, shape (n_frames, 3)."""
    return moved_points(poses, place[np.newaxis])[:, 0]


def _limb_poses(skeleton: Skeleton, limb: int, positions: Floats) -> Floats:
    """Poses of a limb by its own sensor, shape (n_frames, 4, 4), NaN where unseen."""
    markers = skeleton.markers_of(limb)
    seen = ~np.isnan(positions[:, markers, 0])
    if not len(markers):
        return np.full((len(positions), 4, 4), np.nan)
    return fit_transform(skeleton.marker_offsets[markers], positions[:, markers], seen)


def _limb_with_moved_sensor(skeleton: Skeleton, wider: list[int], n_placed: list[int]) -> int:
    """The limb with most joints, all of them with wider gaps, of those that were placed least often; -1 for none."""
    counts = {
        limb: len(own)
        for limb in range(skeleton.n_limbs)
        if n_placed[limb] < ROUNDS and (own := _joints_of(skeleton, limb)) and set(own) <= set(wider)
    }
    if not counts:
        return -1
    return max(counts, key=lambda limb: (-n_placed[limb], counts[limb], limb not in skeleton.roots))


def _ends(joint: Joint, limb: int) -> tuple[Floats, Floats]:
    """Places of a joint in one of its limbs, and in the other."""
    ends = (joint.position_in_parent, joint.position_in_child)
    return ends if joint.parent == limb else ends[::-1]


def _joints_of(skeleton: Skeleton, limb: int) -> list[int]:
    return [index for index, joint in enumerate(skeleton.joints) if limb in (joint.parent, joint.child)]


def _with_sensor_placed(skeleton: Skeleton, limb: int, positions: Floats) -> Skeleton:
    """The skeleton with one sensor where it fits the joints of its limb."""
    markers = skeleton.markers_of(limb)
    own = _limb_poses(skeleton, limb, positions)
    places, found = [], []
    for index in _joints_of(skeleton, limb):
        joint = skeleton.joints[index]
        here, there = _ends(joint, limb)
        other = _limb_poses(skeleton, joint.child if joint.parent == limb else joint.parent, positions)
        places.append(here)
        # How far a joint is in a limb's frame from its calibrated place [mm]; in the other limb it may differ as well
        both = ~np.isnan(own[:, 0, 0]) & ~np.isnan(other[:, 0, 0])
        rows = np.concatenate([own[both, :3, :3], -other[both, :3, :3]], axis=2).reshape(-1, 6)
        apart = _moved(other[both], there) - _moved(own[both], here)
        found.append(here + np.linalg.lstsq(rows, apart.ravel(), rcond=LEAST_ROTATION)[0][:3])
    anchors = skeleton.marker_offsets[markers]
    now_from_limb = _weighted_fit(np.vstack([places, anchors]), np.vstack([found, anchors]), len(places))
    offsets = skeleton.marker_offsets.copy()
    offsets[markers] = moved_points(np.asarray(np.linalg.inv(now_from_limb)), anchors)
    return replace(skeleton, marker_offsets=offsets)


def _shift_of(before: Skeleton, after: Skeleton, limb: int) -> SensorShift:
    """How a sensor moved on its limb."""
    places = [skeleton.marker_offsets[skeleton.markers_of(limb)] for skeleton in (before, after)]
    shift = float(np.linalg.norm(places[1].mean(axis=0) - places[0].mean(axis=0)))
    moved = fit_transform(places[0], places[1][np.newaxis], np.ones((1, len(places[0])), dtype=np.bool_))[0]
    return SensorShift(limb, shift, float(np.degrees(np.linalg.norm(vector_from_matrix(moved[:3, :3])))))


def _weighted_fit(source: Floats, target: Floats, n_joints: int) -> Floats:
    """Rigid transform of points, of which those after the joints are anchors."""
    weights = np.where(np.arange(len(source)) < n_joints, 1.0, ANCHOR_WEIGHT)
    before, after = (np.average(points, axis=0, weights=weights) for points in (source, target))
    moments = ((target - after) * weights[:, np.newaxis]).T @ (source - before)
    transform = np.eye(4)
    transform[:3, :3] = rotation_by_svd(moments)
    transform[:3, 3] = after - transform[:3, :3] @ before
    return transform
