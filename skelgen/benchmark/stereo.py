"""Errors of the seed's rig: what chance makes of poses and joint angles, and what the error propagation predicts."""

from __future__ import annotations

import numpy as np

from skelgen.capture.blobs import Balls, FoundBody
from skelgen.capture.bodies.finder import find_bodies
from skelgen.capture.error_propagation.angles import angle_covariance
from skelgen.capture.error_propagation.by_distance import places_before, typical_joints, typical_pair
from skelgen.capture.error_propagation.poses import pose_covariances
from skelgen.capture.optics.matching import match_and_triangulate
from skelgen.capture.optics.projection import project
from skelgen.capture.optics.seed_rig import seed_rig
from skelgen.geometry.rotations import matrix_from_quaternion, matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget, JointModel, StereoRig

QUANTITIES = ("position", "orientation", "ball joint", "hinge")
"""What is measured: mm, then degrees."""

WANTED = {"position": 0.25, "orientation": 0.3, "ball joint": 0.4, "hinge": 0.3}  # mm, degrees
WANTED_AT = 1000.0  # mm, the distance that `WANTED` is for
WITHIN = 0.10  # of the prediction
SEED = 6

_Pair = tuple[float, float]


def rig_errors(distance: float, n_trials: int) -> dict[str, tuple[float, float]]:
    """Return root mean square errors and predictions: noisy projections, matched, found, posed, turned into angles.

    Parameters
    ----------
    distance : float, mm
        Of the bodies from the middle between the cameras.
    n_trials : int
        Poses by chance, for each of two joints.

    Returns
    -------
    dict of str to (float, float)
        Error and prediction, all axes together, by `QUANTITIES`.
    """
    rng, rig = np.random.default_rng(SEED), seed_rig()
    place = places_before(rig, np.array([distance]))[0]
    squares: dict[str, list[_Pair]] = {name: [] for name in QUANTITIES}
    for _ in range(n_trials):
        for name, joint in zip(("ball joint", "hinge"), typical_joints(), strict=True):
            trial = _trial_of(rig, joint, place, rng)
            if trial is not None:
                for what, pair in trial.items():
                    squares[name if what == "angle" else what].append(pair)
    return {name: tuple(np.sqrt(np.mean(pairs, axis=0))) for name, pairs in squares.items()}


def _trial_of(rig: StereoRig, joint: JointModel, place: Floats, rng: np.random.Generator) -> dict[str, _Pair] | None:
    """Squared errors and variances of one pose of both bodies; None if one was not found."""
    targets = typical_pair()
    turn = matrix_from_quaternion((q := rng.normal(size=4)) / np.linalg.norm(q))
    bend = rng.uniform(-0.8, 0.8, 3) * ([0.0, 0.0, 1.0] if joint.kind == "hinge" else [1.0, 1.0, 1.0])
    parent = transform_from(turn, place - turn @ joint.parent_from_joint[:3, 3])
    bent = transform_from(matrix_from_vector(bend), np.zeros(3))
    child = parent @ joint.parent_from_joint @ bent @ np.linalg.inv(joint.child_from_joint)
    seen = [_seen_body(rig, target, pose, rng) for target, pose in zip(targets, (parent, child), strict=True)]
    found = [body for body in seen if body is not None]
    if len(found) < len(seen):
        return None
    covariances = [pose_covariances(rig, target, pose) for target, pose in zip(targets, (parent, child), strict=True)]
    first = found[0].world_from_body
    tilt = np.degrees(vector_from_matrix(first[:3, :3] @ parent[:3, :3].T))
    angle = _angle_error(joint, [body.world_from_body for body in found], bend)
    variance = np.trace(angle_covariance(joint, (parent, child), (covariances[0], covariances[1])))
    degrees = np.degrees(1.0) ** 2
    return {
        "position": (((first[:3, 3] - parent[:3, 3]) ** 2).sum(), np.trace(covariances[0][3:, 3:])),
        "orientation": ((tilt**2).sum(), degrees * np.trace(covariances[0][:3, :3])),
        "angle": ((np.degrees(angle) ** 2).sum(), degrees * variance),
    }


def _seen_body(rig: StereoRig, target: BodyTarget, pose: Floats, rng: np.random.Generator) -> FoundBody | None:
    """A target found from noisy projections of its balls."""
    points = target.points @ pose[:3, :3].T + pose[:3, 3]
    left, right = (_noisy_balls(project(eye, points), rig.noise, rng) for eye in (rig.left, rig.right))
    return next(iter(find_bodies(match_and_triangulate(left, right, rig), [target])), None)


def _noisy_balls(centres: Floats, noise: float, rng: np.random.Generator) -> Balls:
    """Balls as the detection would find them."""
    n = len(centres)
    seen = centres + noise * rng.normal(size=centres.shape)
    return Balls(seen, np.full(n, 20.0), np.full(n, 10.0), np.full(n, noise), np.zeros(n, dtype=np.bool_))


def _angle_error(joint: JointModel, poses: list[Floats], bend: Floats) -> Floats:
    """What the angles of a joint, each body posed alone, are off [rad]."""
    frames = (joint.parent_from_joint, joint.child_from_joint)
    axes = [pose[:3, :3] @ at[:3, :3] for pose, at in zip(poses, frames, strict=True)]
    rotation = axes[0].T @ axes[1]
    if joint.kind == "hinge":
        found = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
        return np.array([found - bend[2]])
    return vector_from_matrix(rotation @ matrix_from_vector(bend).T)
