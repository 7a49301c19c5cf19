"""Errors of a rig against the distance from it, as in Gaschler (2011), figures 6.1 to 6.4."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import slopes_of_camera
from skelgen.capture.error_propagation import HINGE, angle_covariance, point_covariances, pose_covariances, seen_by_both
from skelgen.capture.optics import view_centre
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_quaternion, matrix_from_vector, moved_points, transform_from
from skelgen.model.arrays import Floats
from skelgen.model.rig import N_CAMERA_STD, BodyTarget, CaptureSettings, StereoRig, TargetJoint

WORKING_DISTANCES = (500.0, 600.0, 700.0, 800.0, 900.0, 1000.0, 1250.0, 1500.0, 1750.0, 2000.0, 2500.0, 3000.0)
"""Distances [mm] of the working space of Gaschler (2011)."""

N_TURNS = 100
"""Random orientations over which errors are averaged: one of a target seen edge-on is no measure of it."""

TYPICAL_POINTS = np.array(
    [[39.5, 4.1, -5.3], [-19.3, 35.9, 6.6], [-23.8, -29.8, 8.6], [9.8, -13.1, -44.7], [-10.5, 5.7, 35.0]]
)
"""mm; all distances differ by more than the detection of bodies needs (`propose_targets`)."""

ARM = 150.0
"""mm between a typical joint and the targets on both sides of it."""

LARGEST_BEND = np.radians(45.0)
"""rad; joints are bent at random up to this, about each axis that they have."""

AXES, IN_ALL, JOINED = ("x", "y", "z"), "in all", "held by the joint"
"""Names of components; the last is all of them for an estimate that lets the joint hold both bodies together."""


@dataclass(frozen=True, eq=False)
class ErrorCurve:
    """Errors of one thing at some distances.

    Attributes
    ----------
    what : str
        ``ball``, ``body upper_arm``, ``hinge joint elbow``.
    unit : str
        ``mm`` or ``degrees``.
    columns : tuple of str
        Names of the components; the last is their root of the sum of squares where there are several.
    std : ndarray, shape (n_distances, n_columns)
        Standard deviations; NaN where the thing is not seen by both cameras.
    """

    what: str
    unit: str
    columns: tuple[str, ...]
    std: Floats


@dataclass(frozen=True, eq=False)
class RigErrors:
    """All curves of a rig.

    Attributes
    ----------
    distances : ndarray, shape (n_distances,), mm
        From the middle between the cameras, along the line in the middle of both views.
    noise : float, px
        Standard deviation of a ball's centre that the errors come from; they grow in proportion.
    curves : tuple of ErrorCurve
        For a ball, each body, each joint.
    """

    distances: Floats
    noise: float
    curves: tuple[ErrorCurve, ...]


def errors_by_distance(settings: CaptureSettings, distances: Sequence[float] = WORKING_DISTANCES) -> RigErrors:
    """Return the errors of a rig's points, bodies and joint angles against the distance.

    Parameters
    ----------
    settings : CaptureSettings
        The rig; its bodies and joints, or typical ones where it has none.
    distances : sequence of float, mm
        From the middle between the cameras.

    Raises
    ------
    InputError
        If a distance is not above 0.
    """
    away = np.asarray(distances, dtype=np.float64)
    if not away.size or not np.isfinite(away).all() or away.min() <= 0:
        raise InputError("distances of the errors must be above 0 mm")
    places = view_centre(settings.rig, away)
    quaternions = np.random.default_rng(0).normal(size=(N_TURNS, 4))
    turns = matrix_from_quaternion(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
    bodies = settings.bodies or (typical_target("typical target"),)
    joints = settings.joints or typical_joints()
    targets = {body.name: body for body in (*settings.bodies, *typical_pair())}
    curves = [_of_ball(settings.rig, places)]
    if settings.rig.covariance is not None:
        curves.append(_of_calibration(settings.rig, places))
    for body in bodies:
        curves += _of_body(settings.rig, body, places, turns)
    curves += [_of_joint(settings.rig, joint, targets, places, turns) for joint in joints]
    return RigErrors(away, settings.rig.noise, tuple(curves))


def typical_target(name: str) -> BodyTarget:
    """Return five balls within 98 mm that no rotation brings onto each other, as in Gaschler (2011), figure 6.2."""
    return BodyTarget(name, TYPICAL_POINTS - TYPICAL_POINTS.mean(axis=0))


def typical_pair() -> tuple[BodyTarget, BodyTarget]:
    """Return the targets of `typical_joints`."""
    return typical_target("typical parent"), typical_target("typical child")


def typical_joints() -> tuple[TargetJoint, TargetJoint]:
    """Return a ball joint and a hinge between two typical targets, each with its middle 150 mm from the joint."""
    up, down = (transform_from(np.eye(3), np.array([0.0, 0.0, height])) for height in (ARM, -ARM))
    parent, child = (target.name for target in typical_pair())
    across = transform_from(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.zeros(3))
    return (
        TargetJoint("typical ball joint", "ball", parent, child, up, down),
        TargetJoint("typical hinge", HINGE, parent, child, up @ across, down @ across),
    )


def _of_ball(rig: StereoRig, places: Floats) -> ErrorCurve:
    """Figure 6.1: one ball, along the axes of the left camera; z is depth."""
    covariances = point_covariances(rig, places)
    covariances[~seen_by_both(rig, places)] = np.nan
    return ErrorCurve("ball", "mm", (*AXES, IN_ALL), _std_with_sum(_in_left(rig, covariances)))


def _of_calibration(rig: StereoRig, places: Floats) -> ErrorCurve:
    """What the cameras' calibration adds to the errors of a ball, the same in all frames."""
    covariances = calibration_covariances(rig, places)
    covariances[~seen_by_both(rig, places)] = np.nan
    return ErrorCurve(
        "place, by the cameras' calibration", "mm", (*AXES, IN_ALL), _std_with_sum(_in_left(rig, covariances))
    )


def calibration_covariances(rig: StereoRig, points: Floats) -> Floats:
    """Return the covariance of points by the errors of the cameras' calibration, which are the same in all frames.

    Parameters
    ----------
    rig : StereoRig
        With the covariance of its numbers.
    points : ndarray, shape (n, 3), mm
        In the world, before both cameras.

    Returns
    -------
    ndarray, shape (n, 3, 3), mm^2

    Raises
    ------
    InputError
        If the rig does not know its covariance.
    """
    if rig.covariance is None:
        raise InputError("these cameras have no covariance: calibrate them again")
    to_left = rig.left.camera_from_world
    in_left = moved_points(to_left, points)
    cameras = replace(rig.left, camera_from_world=np.eye(4)), replace(rig.right, camera_from_world=rig.right_from_left)
    (by_left, left), (by_right, right) = (slopes_of_camera(camera, in_left) for camera in cameras)
    by_point = np.concatenate([left, right], axis=1)
    by_numbers = np.zeros((len(points), 4, len(rig.covariance)))
    by_numbers[:, :2, :N_CAMERA_STD], by_numbers[:, 2:, N_CAMERA_STD:] = by_left, by_right
    moved = to_left[:3, :3].T @ np.linalg.pinv(by_point) @ by_numbers
    return np.asarray(moved @ rig.covariance @ np.swapaxes(moved, 1, 2))


def _of_body(rig: StereoRig, body: BodyTarget, places: Floats, turns: Floats) -> list[ErrorCurve]:
    """Figure 6.2: position of the middle of a target's balls, and its orientation, along the left camera's axes."""
    centred = BodyTarget(body.name, body.points - body.points.mean(axis=0), body.std)
    covariances = _covariances_where_seen(rig, centred, _poses(turns, places, np.zeros(3)))
    shifts = _std_with_sum(_averaged(_in_left(rig, covariances[..., 3:, 3:])))
    turned = _std_with_sum(_averaged(_in_left(rig, covariances[..., :3, :3])))
    return [
        ErrorCurve(f"position of {body.name}", "mm", (*AXES, IN_ALL), shifts),
        ErrorCurve(f"orientation of {body.name}", "degrees", (*AXES, IN_ALL), np.degrees(turned)),
    ]


def _of_joint(
    rig: StereoRig, joint: TargetJoint, targets: Mapping[str, BodyTarget], places: Floats, turns: Floats
) -> ErrorCurve:
    """Figures 6.3 and 6.4: angles of a joint, each body posed alone, and both held together by the joint."""
    parents = _poses(turns, places, joint.parent_from_joint[:3, 3])
    bends = np.random.default_rng(0).uniform(-LARGEST_BEND, LARGEST_BEND, (len(turns), 3))
    bends *= [0.0, 0.0, 1.0] if joint.kind == HINGE else [1.0, 1.0, 1.0]
    bent = transform_from(matrix_from_vector(bends), np.zeros(3))
    children = parents @ joint.parent_from_joint @ bent @ np.linalg.inv(joint.child_from_joint)
    covariances = (
        _covariances_where_seen(rig, targets[joint.parent], parents),
        _covariances_where_seen(rig, targets[joint.child], children),
    )
    alone, joined = (
        _std_with_sum(_averaged(angle_covariance(joint, (parents, children), covariances, is_joined=is_joined)))
        for is_joined in (False, True)
    )
    columns = ("angle", JOINED) if joint.kind == HINGE else (*AXES, IN_ALL, JOINED)
    std = np.degrees(np.column_stack([alone if joint.kind != HINGE else alone[:, :1], joined[:, -1]]))
    return ErrorCurve(f"angle of {joint.name}", "degrees", columns, std)


def _poses(turns: Floats, places: Floats, arm: Floats) -> Floats:
    """Poses in all orientations with a point of the body at all places, shape (n_places, n_turns, 4, 4)."""
    shape = (len(places), len(turns), 3, 3)
    return transform_from(np.broadcast_to(turns, shape), places[:, np.newaxis] - turns @ arm)


def _covariances_where_seen(rig: StereoRig, target: BodyTarget, poses: Floats) -> Floats:
    """Covariances of a target's pose; NaN where one of its balls is outside an image."""
    points = moved_points(poses, target.points)
    covariances = pose_covariances(rig, target, poses)
    covariances[~seen_by_both(rig, points).all(axis=-1)] = np.nan
    return covariances


def _in_left(rig: StereoRig, covariances: Floats) -> Floats:
    turn = rig.left.camera_from_world[:3, :3]
    return np.asarray(turn @ covariances @ turn.T)


def _averaged(covariances: Floats) -> Floats:
    """Means over the orientations in which a thing is seen; NaN where that is fewer than half of them."""
    is_seen = np.isfinite(covariances[..., 0, 0])
    total = np.where(is_seen[..., np.newaxis, np.newaxis], covariances, 0.0).sum(axis=1)
    count = np.where(is_seen.mean(axis=1) >= 0.5, is_seen.sum(axis=1), np.nan)
    return np.asarray(total / count[:, np.newaxis, np.newaxis])


def _std_with_sum(covariances: Floats) -> Floats:
    """Standard deviations along the axes, and the root of the sum of their squares."""
    variances = np.diagonal(covariances, axis1=-2, axis2=-1)
    return np.asarray(np.sqrt(np.column_stack([variances, variances.sum(axis=-1)])))
