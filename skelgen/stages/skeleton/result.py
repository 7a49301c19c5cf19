"""Fitted bodies as the values that leave the stage."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.observability import range_of_motion, undetermined_place
from skelgen.model import Joint, Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Floats
from skelgen.stages.skeleton.fitting import FittedBody


def make_skeleton(fitted: list[FittedBody], limbs: Limbs, topology: Topology) -> Skeleton:
    """Join fitted bodies into one skeleton value."""
    offsets = np.full((limbs.n_markers, 3), np.nan)
    spread = np.full(limbs.n_markers, np.nan)
    reference = np.tile(np.eye(4), (topology.n_limbs, 1, 1))
    joint_above: dict[int, Joint] = {}
    for one in fitted:
        offsets[one.body.markers] = one.chain.offsets
        spread[one.body.markers] = _marker_spread(one)
        reference[one.body.limbs, :3, 3] = one.poses[np.array([one.reference])].origins(one.chain)[0]
        joint_above |= _joints(one)
    return Skeleton(
        parents=topology.parents,
        joints=tuple(joint_above[int(child)] for child in topology.children),
        limb_of_marker=limbs.limb_of_marker,
        marker_offsets=offsets,
        marker_std=spread,
        reference_pose=reference,
    )


def make_motion(fitted: list[FittedBody], trajectories: Trajectories, skeleton: Skeleton) -> Motion:
    """Gather the poses of all bodies."""
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
    )


def _marker_spread(one: FittedBody) -> Floats:
    error = one.body.positions - one.poses.markers(one.chain)
    seen = ~np.isnan(error[:, :, 0])
    squares = np.where(seen[..., np.newaxis], error, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=(0, 2)) / np.maximum(3 * seen.sum(axis=0), 1)))


def _joints(one: FittedBody) -> dict[int, Joint]:
    """Joint above each limb but the root, by the child's index in the take."""
    found = {}
    for limb in range(1, one.chain.n_limbs):
        kind = one.kinds[limb - 1]
        covariance = place_covariance(one, limb)
        child = int(one.body.limbs[limb])
        found[child] = Joint(
            parent=int(one.body.limbs[one.chain.parents[limb]]),
            child=child,
            position_in_parent=one.chain.joints[limb],
            position_in_child=np.zeros(3),
            kind=kind.kind,
            axis=kind.axis_in_parent if kind.kind in {"hinge", "universal"} else None,
            std=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
            second_axis=kind.axis_in_child if kind.kind == "universal" else None,
        )
    return found


def place_covariance(one: FittedBody, limb: int) -> Floats:
    """Covariance [mm^2] of the joint above a limb in its parent, places along hinges included, shape (3, 3)."""
    covariance = one.covariances[limb]
    if one.kinds[limb - 1].kind == "hinge":
        return np.asarray(covariance + one.freedom[limb] * _along_axis(one, limb))
    return np.asarray(covariance)


def places_not_determined(fitted: list[FittedBody]) -> list[str]:
    """Say which joints' places the motion leaves open."""
    found = []
    for one in fitted:
        for limb in range(1, one.chain.n_limbs):
            parent = int(one.chain.parents[limb])
            relative = one.poses.rotations[:, parent].swapaxes(1, 2) @ one.poses.rotations[:, limb]
            names = (int(one.body.limbs[parent]), int(one.body.limbs[limb]))
            motion, kind = range_of_motion(relative), one.kinds[limb - 1].kind
            found.append(undetermined_place(names, kind, motion, place_covariance(one, limb), limb_size(one, limb)))
    return [sentence for sentence in found if sentence]


def limb_size(one: FittedBody, limb: int) -> float:
    """Root mean square distance [mm] of a limb's markers from its joint; of all limbs' where it has none."""
    own = one.chain.limb_of_marker == limb
    offsets = one.chain.offsets[own] if own.any() else one.chain.offsets
    return float(np.sqrt((offsets**2).sum(axis=1).mean()))


def _along_axis(one: FittedBody, limb: int) -> Floats:
    """Nothing fixes a perfect hinge along its axis: its place there is uncertain by the size of the limb."""
    axis = one.kinds[limb - 1].axis_in_parent
    return np.asarray(limb_size(one, limb) ** 2 * np.outer(axis, axis))
