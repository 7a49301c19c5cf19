"""Assemble a skeleton of rigid limbs: the mean shape of each limb, joined to the next from the root outward.

Markers and raw joints of a limb are brought into the limb's frame in every frame; their means, with outliers beyond one
standard deviation left out, are the limb's shape (Schönauer 2007, 3.8.1).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import fill_rotations
from skelgen.geometry.statistics import mean_of_known
from skelgen.kinematics.chain.chain import Chain
from skelgen.kinematics.rigid_bodies import LimbShape, fit_shape
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import outward_order
from skelgen.stages.skeleton.parameters import SkeletonParameters


@dataclass(frozen=True, eq=False)
class BodyOfTake:
    """One tree of limbs, cut out of the take.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_limbs,)
        Indices in the take's topology, outward from the root.
    parents : ndarray of intp, shape (n_limbs,)
        Parents by position in `limbs`.
    markers : ndarray of intp, shape (n_markers,)
        Indices of the body's markers in the take.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker by position in `limbs`.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers.
    raw_joints : ndarray, shape (n_frames, n_limbs, 3), mm
        Raw joint between each limb and its parent; NaN for the root.
    """

    limbs: Ints
    parents: Ints
    markers: Ints
    limb_of_marker: Ints
    positions: Floats
    raw_joints: Floats


@dataclass(frozen=True, eq=False)
class StructuredTake:
    """A take whose limbs and joints are known.

    Attributes
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.
    topology : Topology
        The trees and the raw joints.
    """

    trajectories: Trajectories
    limbs: Limbs
    topology: Topology

    def at(self, frames: Ints | slice) -> StructuredTake:
        """Return markers and raw joints in some frames."""
        if not isinstance(frames, slice) and len(frames) == self.trajectories.n_frames:
            return self
        some = replace(self.trajectories, positions=self.trajectories.positions[frames])
        raw = self.topology.raw_joint_positions[frames]
        return StructuredTake(some, self.limbs, replace(self.topology, raw_joint_positions=raw))

    def bodies(self) -> list[BodyOfTake]:
        """Return the trees, in the order of their roots; limbs of each in order outward from the root."""
        return [self._body(int(root)) for root in self.topology.roots]

    def _body(self, root: int) -> BodyOfTake:
        topology, limb_of_marker = self.topology, self.limbs.limb_of_marker
        tree = topology.limbs_of_tree(root)
        order = [limb for limb in outward_order(topology.parents).tolist() if limb in tree]
        index = {limb: position for position, limb in enumerate(order)}
        markers = np.flatnonzero(np.isin(limb_of_marker, order))
        raw = np.full((self.trajectories.n_frames, len(order), 3), np.nan)
        for column, child in enumerate(topology.children.tolist()):
            if child in index:
                raw[:, index[child]] = topology.raw_joint_positions[:, column]
        return BodyOfTake(
            limbs=np.array(order, dtype=np.intp),
            parents=np.array([index.get(int(topology.parents[limb]), -1) for limb in order], dtype=np.intp),
            markers=markers,
            limb_of_marker=np.array([index[int(limb)] for limb in limb_of_marker[markers]], dtype=np.intp),
            positions=self.trajectories.positions[:, markers],
            raw_joints=raw,
        )


def assemble(body: BodyOfTake, parameters: SkeletonParameters, frames: Ints) -> tuple[Chain, int]:
    """Make a chain of a body's mean limbs, whose axes are the world's in the reference frame.

    Parameters
    ----------
    body : BodyOfTake
        The tree with its markers and raw joints.
    parameters : SkeletonParameters
        Their `outlier`, `joints_for_poses`, `rotation` and `flatness`.
    frames : ndarray of intp
        Frames that are averaged.

    Returns
    -------
    tuple
        The chain, and the index of the reference frame: the first that shows as many markers as any.
    """
    reference = int(np.argmax((~np.isnan(body.positions[:, :, 0])).sum(axis=1)))
    offsets = np.zeros((len(body.markers), 3))
    joints = np.zeros((len(body.limbs), 3))
    for limb in range(len(body.limbs)):
        markers = np.flatnonzero(body.limb_of_marker == limb)
        children = np.flatnonzero(body.parents == limb)
        inner = [limb] if body.parents[limb] >= 0 else []
        attached = np.array([*inner, *children], dtype=np.intp)
        points = np.concatenate([body.positions[:, markers], body.raw_joints[:, attached]], axis=1)
        shape = _aligned(points, len(markers), frames, parameters)
        mean = _mean_points(points[frames], shape, frames, parameters.outlier) @ _rotation_at(shape, reference).T
        origin = mean[len(markers)] if inner else mean[: len(markers)].mean(axis=0)
        offsets[markers] = mean[: len(markers)] - origin
        joints[children] = mean[len(markers) + len(inner) :] - origin
    return Chain(body.parents, body.limb_of_marker, joints, offsets), reference


def _aligned(points: Floats, n_markers: int, frames: Ints, parameters: SkeletonParameters) -> LimbShape:
    """Pose the limb by its markers alone where they suffice to place all: raw joints are less certain.

    A marker that is split where it slipped is never seen with three others on a limb of three.
    """
    if not parameters.joints_for_poses:
        shape = fit_shape(points[:, :n_markers], frames, parameters.rotator, parameters.flatness)
        seen = ~np.isnan(points[:, :n_markers, 0])
        placed = (seen & shape.posed[:, np.newaxis]).any(axis=0) | ~seen.any(axis=0)
        if shape.has_pose and placed.all():
            return shape
    return fit_shape(points, frames, parameters.rotator, parameters.flatness)


def _rotation_at(shape: LimbShape, frame: int) -> Floats:
    if not shape.has_pose:
        return np.eye(3)
    turns, posed = shape.world_from_limb[:, :3, :3], shape.posed
    return np.asarray(turns[frame] if posed[frame] else fill_rotations(turns, posed)[frame])


def _mean_points(points: Floats, shape: LimbShape, frames: Ints, outlier: float) -> Floats:
    """Mean place of each point in the limb's frame [mm], outliers left out, shape (n_points, 3)."""
    poses = shape.world_from_limb[frames]
    if not shape.has_pose:
        # Points of a limb that never shows an orientation: on a line, as far apart as they are on average
        end = int(np.argmax(_mean_distances(points, 0)))  # the others are all on one side of it
        return np.asarray(_mean_distances(points, end)[:, np.newaxis] * np.array([0.0, 0.0, 1.0]))
    local = np.einsum("fji,fnj->fni", poses[:, :3, :3], points - poses[:, np.newaxis, :3, 3])
    known = ~np.isnan(local[:, :, 0])
    mean = _mean(local, known)
    distance = np.linalg.norm(np.where(known[..., np.newaxis], local - mean, 0.0), axis=2)
    spread = np.sqrt((distance**2).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
    rounding = np.finfo(np.float64).eps * np.abs(mean).max()
    return _mean(local, known & (distance <= outlier * spread + rounding))


def _mean(local: Floats, known: Bools) -> Floats:
    count = np.maximum(known.sum(axis=0), 1)[:, np.newaxis]
    return np.asarray(np.where(known[..., np.newaxis], local, 0.0).sum(axis=0) / count)


def _mean_distances(points: Floats, start: int) -> Floats:
    """Mean distance of each point from one of them [mm], shape (n_points,); 0 where they are never seen together."""
    return mean_of_known(np.linalg.norm(points - points[:, start, np.newaxis], axis=2))
