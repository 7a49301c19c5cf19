"""One tree of a calibrated skeleton as a chain, with covariances of its joints and the noise of its markers."""

import numpy as np

from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, observed
from skelgen.kinematics.inverse.loop_closure import KinematicLoops
from skelgen.model import Joint, Skeleton
from skelgen.model.arrays import Floats, Ints

LEAST_SHARE = 0.1
"""Of the root mean square noise: no marker counts as surer than this."""


class SkeletonTree:
    """One tree of a skeleton as a chain.

    Parameters
    ----------
    skeleton : Skeleton
        With its types of joints and axes.
    root : int
        Root of the tree.
    noise : float, mm, optional
        Standard deviation of a marker's coordinate; that of the skeleton's markers if not given.

    Attributes
    ----------
    limbs, markers : ndarray of intp
        Limbs and markers of the skeleton that belong to the tree, in the order of the chain.
    chain : Chain
        The limbs.
    articulation : Articulation
        What the joints allow.
    loops : KinematicLoops
        Joints of the tree that close loops.
    turns, places : ndarray, shape (n_limbs, 3, 3), rad^2 and mm^2
        Covariances of the joints' rotations and positions, see `Joint`; 0 where they were not estimated.
    noise : float, mm
        Median standard deviation of a marker's coordinate.
    weights : ndarray, shape (n_markers,)
        Of the markers' squared distances.
    """

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
        closing = [joint for joint in skeleton.loops if joint.parent in place and joint.child in place]
        pairs = np.array([[place[joint.parent], place[joint.child]] for joint in closing], dtype=np.intp).reshape(-1, 2)
        ends = [(joint.position_in_parent, joint.position_in_child) for joint in closing]
        self.loops = KinematicLoops(pairs, np.array(ends).reshape(-1, 2, 3))
        nothing = np.zeros((3, 3))
        turns = [joint.turn_covariance if joint else None for joint in joints]
        covariances = [joint.covariance if joint else None for joint in joints]
        self.turns = np.array([nothing if one is None else one for one in turns])
        self.places = np.array([nothing if one is None else one for one in covariances])
        deviations = noise_of_markers(skeleton, noise)[self.markers]
        self.noise = float(np.median(deviations)) if len(deviations) else 0.0
        self.weights: Floats = (self.noise / deviations) ** 2 if self.noise > 0 else np.ones(len(deviations))

    def observed(self, poses: ChainPoses, positions: Floats) -> ObservedChain:
        """Return the chain with what was measured, every marker with its weight.

        Parameters
        ----------
        poses : ChainPoses
            Poses of the chain.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            Measured markers of the tree, NaN where unseen.
        """
        weights = np.broadcast_to(self.weights, positions.shape[:2])
        return observed(self.chain, self.articulation, poses, positions, weights)


def noise_of_markers(skeleton: Skeleton, noise: float | None) -> Floats:
    """Return the standard deviation [mm] of each marker's coordinates, none far below the root mean square.

    Parameters
    ----------
    skeleton : Skeleton
        Its markers' noise counts.
    noise : float, mm, or None
        Counts instead for all markers, if given.
    """
    if noise is not None:
        return np.full(len(skeleton.limb_of_marker), noise)
    known = skeleton.marker_std if skeleton.marker_noise is None else skeleton.marker_noise
    valid = known[~np.isnan(known)]
    usual = float(np.sqrt((valid**2).mean())) if len(valid) else 0.0
    if skeleton.marker_noise is None:
        return np.full(len(known), usual)
    return np.where(np.isnan(known), usual, np.maximum(known, LEAST_SHARE * usual))


def _articulation(joints: list[Joint | None]) -> Articulation:
    free = Articulation.free(len(joints))
    in_parent, in_child, between = free.in_parent.copy(), free.in_child.copy(), free.between.copy()
    types = ["ball"] * len(joints)
    for index, joint in enumerate(joints):
        if joint is None:
            continue
        if joint.axis is not None:
            in_parent[index] = in_child[index] = joint.axis
        if joint.second_axis is not None and joint.axis is not None:
            in_child[index] = joint.second_axis
            between[index] = np.arccos(np.clip(joint.axis @ joint.second_axis, -1.0, 1.0))
        types[index] = joint.kind if joint.axis is not None or FREEDOMS[joint.kind] in {0, 3} else "ball"
    return Articulation(tuple(types), in_parent, in_child, between, np.tile(np.eye(3), (len(joints), 1, 1)))
