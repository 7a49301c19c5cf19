"""One tree of a known skeleton as a chain with what its joints allow, how sure it is, and the noise of its markers."""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain
from skelgen.kinematics.inverse.loop_closure import Rings
from skelgen.model import Joint, Skeleton
from skelgen.model.arrays import Floats, Ints

LEAST_SHARE = 0.1
"""Of the usual noise: no marker counts as surer than this."""


class SkeletonTree:
    """One tree of a skeleton as a chain."""

    def __init__(self, skeleton: Skeleton, root: int, noise: float | None) -> None:
        below = {root}
        for limb in skeleton.outward.tolist():
            if int(skeleton.parents[limb]) in below:
                below.add(limb)
        self.limbs: Ints = np.array([limb for limb in skeleton.outward.tolist() if limb in below], dtype=np.intp)
        place = {int(limb): index for index, limb in enumerate(self.limbs)}
        self.markers: Ints = np.flatnonzero([int(limb) in place for limb in skeleton.limb_of_marker])
        above = {joint.child: joint for joint in skeleton.joints}
        parents = np.array([place.get(int(skeleton.parents[limb]), -1) for limb in self.limbs], dtype=np.intp)
        places = [np.zeros(3) if limb == root else above[int(limb)].position_in_parent for limb in self.limbs]
        limb_of_marker = np.array([place[int(skeleton.limb_of_marker[one])] for one in self.markers], dtype=np.intp)
        self.chain = Chain(parents, limb_of_marker, np.array(places), skeleton.marker_offsets[self.markers])
        joints = [above.get(int(limb)) for limb in self.limbs]
        self.articulation = _articulation(joints)
        loops = [joint for joint in skeleton.loops if joint.parent in place and joint.child in place]
        pairs = np.array([[place[joint.parent], place[joint.child]] for joint in loops], dtype=np.intp).reshape(-1, 2)
        ends = [(joint.position_in_parent, joint.position_in_child) for joint in loops]
        self.rings = Rings(pairs, np.array(ends).reshape(-1, 2, 3))
        self.turns = np.array([_or_zero(joint, "turn_covariance") for joint in joints])
        self.places = np.array([_or_zero(joint, "covariance") for joint in joints])
        deviations = noise_of_markers(skeleton, noise)[self.markers]
        self.noise = float(np.median(deviations)) if len(deviations) else 0.0
        self.weights: Floats = (self.noise / deviations) ** 2 if self.noise > 0 else np.ones(len(deviations))


def _or_zero(joint: Joint | None, name: str) -> Floats:
    """A covariance of a joint, 0 where it was not estimated."""
    value = None if joint is None else getattr(joint, name)
    return np.zeros((3, 3)) if value is None else value


def noise_of_markers(skeleton: Skeleton, noise: float | None) -> Floats:
    """Standard deviation [mm] of each marker's coordinates, none far below the usual one."""
    if noise is not None:
        return np.full(len(skeleton.limb_of_marker), noise)
    known = skeleton.marker_std if skeleton.marker_noise is None else skeleton.marker_noise
    heard = known[~np.isnan(known)]
    usual = float(np.sqrt((heard**2).mean())) if len(heard) else 0.0
    if skeleton.marker_noise is None:
        return np.full(len(known), usual)
    return np.where(np.isnan(known), usual, np.maximum(known, LEAST_SHARE * usual))


def _articulation(joints: list[Joint | None]) -> Articulation:
    free = Articulation.free(len(joints))
    kinds, in_parent, in_child, between = (
        ["ball"] * len(joints),
        free.in_parent.copy(),
        free.in_child.copy(),
        free.between.copy(),
    )
    for index, joint in enumerate(joints):
        if joint is None:
            continue
        if joint.axis is not None:
            in_parent[index] = in_child[index] = joint.axis
        if joint.second_axis is not None and joint.axis is not None:
            in_child[index] = joint.second_axis
            between[index] = np.arccos(np.clip(joint.axis @ joint.second_axis, -1.0, 1.0))
        kinds[index] = joint.kind if joint.axis is not None or FREEDOMS[joint.kind] in {0, 3} else "ball"
    return Articulation(tuple(kinds), in_parent, in_child, between, np.tile(np.eye(3), (len(joints), 1, 1)))
