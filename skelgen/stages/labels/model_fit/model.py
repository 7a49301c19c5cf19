"""A skeleton that predicts where markers are: it is fitted to sampled frames, and posed in any others.

A limb is posed by its own markers where three of them are seen. Elsewhere the chain poses it from the root outward; the
joints to posed neighbours then take the place of missing markers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.chain.chain import Chain
from skelgen.kinematics.inverse.root_outward import pose_by_own_markers, pose_outward
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.limbs import LimbParameters, draft_limbs
from skelgen.stages.skeleton import BodyOfTake, SkeletonParameters, StructuredTake, assemble

GATE_DEVIATIONS = 6.0
"""A point is explained by a marker that is nearer than this many typical residuals."""

BY_MOTION = LimbParameters(marker_set="none", nearness=0.0)
"""How limbs are found: a believed set, or nearness, holds markers on a limb that the model does not predict well."""

ROUGH_JOINTS = JointParameters(samples=100, n_nearest=4, max_iterations=10, max_fallback=0, known_neighbours=False)
"""How pairs of limbs are tried: the model is soon replaced, so its tree need not be finer."""

BLIND_GATE = 0.5
"""Of the typical spacing of points: a wider gate does not distinguish neighbours, and its prediction is not used."""

TINY_GATE = 1e-9
"""mm; keeps gates above zero for markers that all coincide."""

LEAST_GATE = 0.02
"""Of the markers' typical distance from the joint: the gate is no smaller, however exact the take."""

STEADINESS = 1.0
"""A marker keeps its place on a limb if it deviates from it by less than this part of a typical gate."""

MISPLACED = 4.0
"""A marker whose gate is this many times the median one does not belong on its limb; other limbs are tried."""

LEAST_SAMPLES = 10
"""Frames that must show a marker on a limb before its place there counts."""

STEADY_FRAMES = 5
"""A limb's pose is credible for this many frames around those that show it."""


@dataclass(frozen=True, eq=False)
class LimbPoses:
    """Where limbs are in some frames.

    Attributes
    ----------
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4)
        Poses of the limbs' frames.
    by_own : ndarray of bool, shape (n_frames, n_limbs)
        Whether the limb's own markers pose it.
    credible : ndarray of bool, shape (n_frames, n_limbs)
        Whether the pose rests on points of the frame or of one nearby.
    """

    world_from_limb: Floats
    by_own: Bools
    credible: Bools

    def at(self, frames: Ints) -> LimbPoses:
        """The poses in some frames."""
        return LimbPoses(self.world_from_limb[frames], self.by_own[frames], self.credible[frames])


class Tree(NamedTuple):
    """One tree of limbs: its limbs outward from the root, their chain, and the chain's markers among all."""

    limbs: Ints
    chain: Chain
    markers: Ints


class FoundStructure(NamedTuple):
    """Which marker of a core is on which limb, and how limbs are joined."""

    limbs: Limbs
    topology: Topology

    def of_markers(self, kept: Ints) -> FoundStructure | None:
        """The same limbs with some of their markers; None if a limb has none of these."""
        limb_of_marker = self.limbs.limb_of_marker[kept]
        if len(np.unique(limb_of_marker[limb_of_marker >= 0])) < self.limbs.n_limbs:
            return None
        deviation = self.limbs.distance_deviation[np.ix_(kept, kept)]
        limbs = replace(self.limbs, limb_of_marker=limb_of_marker, distance_deviation=deviation, membership=None)
        return self._replace(limbs=limbs)


@dataclass(frozen=True, eq=False)
class MarkerModel:
    """Rigid limbs joined to trees, as the labelling uses them.

    Attributes
    ----------
    structure : FoundStructure
        Limbs of the core and their tree.
    trees : list of Tree
        Limbs with the markers of the core, posed by these.
    core : ndarray of intp, shape (n_core,)
        Markers that the limbs were fitted to.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of every marker, of the core or not; -1 for none.
    offsets : ndarray, shape (n_markers, 3), mm
        Places on the limbs.
    own_gates, chain_gates : ndarray, shape (n_markers,), mm
        Distance within which a marker explains a point, if its limb is posed by its own markers or by the chain.
    limits : ndarray, shape (n_limbs,), mm
        How far a marker may deviate from its place on each limb.
    widest : float, mm
        Predictions with wider gates are not used.
    """

    structure: FoundStructure
    trees: list[Tree]
    core: Ints
    limb_of_marker: Ints
    offsets: Floats
    own_gates: Floats
    chain_gates: Floats
    limits: Floats
    widest: float

    @property
    def n_markers(self) -> int:
        """Number of markers, those on no limb included."""
        return len(self.limb_of_marker)

    @property
    def gate(self) -> float:
        """A typical gate [mm]."""
        return float(np.median(self.own_gates[self.core]))

    @property
    def is_placed(self) -> Bools:
        """Whether markers have a place on a limb or belong to the core, (n_markers,); points of others are free."""
        placed = self.limb_of_marker >= 0
        placed[self.core] = True
        return np.asarray(placed)

    def pose(self, positions: Floats) -> LimbPoses:
        """Pose all limbs in successive frames by markers, shape (n_frames, n_markers, 3), NaN where unseen."""
        return _pose(self.trees, positions)

    def predict(self, poses: LimbPoses) -> tuple[Floats, Floats]:
        """Predicted markers [mm], (n_frames, n_markers, 3), NaN where unknown; gates [mm], (n_frames, n_markers)."""
        limb = np.maximum(self.limb_of_marker, 0)
        gates = np.where(poses.by_own[:, limb], self.own_gates, self.chain_gates)
        known = poses.credible[:, limb] & (self.limb_of_marker >= 0) & (gates <= self.widest)
        predicted = _placed(limb, self.offsets, poses.world_from_limb)
        predicted[~known] = np.nan
        return predicted, gates


def find_structure(markers: Trajectories, core: Ints, seed: int) -> FoundStructure | None:
    """Find limbs of the markers found so far, and how they are joined; None if they show no limb.

    Parameters
    ----------
    markers : Trajectories
        Sampled frames.
    core : ndarray of intp
        Markers that carry the limbs.
    seed : int
        Random seed of the stages that find them.
    """
    chosen = _of_core(markers, core)
    try:
        limbs = draft_limbs(chosen, BY_MOTION, seed=seed)
        return FoundStructure(limbs, find_joints(chosen, limbs, ROUGH_JOINTS, seed=seed))
    except InputError:
        return None


def _of_core(markers: Trajectories, core: Ints) -> Trajectories:
    return Trajectories(markers.positions[:, core], tuple(markers.names[index] for index in core), markers.rate)


def fit_model(markers: Trajectories, core: Ints, widest: float, structure: FoundStructure) -> MarkerModel:
    """Fit a skeleton to the markers found so far.

    Parameters
    ----------
    markers : Trajectories
        Sampled frames.
    core : ndarray of intp
        Markers to fit the skeleton to; the others are put on the limbs on which they keep a place.
    widest : float, mm
        Predictions with wider gates are not used.
    structure : FoundStructure
        Limbs of the core and their tree.
    """
    chosen = _of_core(markers, core)
    limbs = structure.limbs
    trees = [_tree(body, core) for body in StructuredTake(chosen, *structure).bodies()]
    poses = _pose(trees, markers.positions)
    limb_of_marker = np.full(markers.n_markers, -1, dtype=np.intp)
    limb_of_marker[core] = limbs.limb_of_marker
    offsets = np.full((markers.n_markers, 3), np.nan)
    for tree in trees:
        offsets[tree.markers] = tree.chain.offsets
    own, chain = _core_gates(chosen.positions, limbs.limb_of_marker, offsets[core], poses)
    gates = np.full((2, markers.n_markers), np.median(own))
    gates[0, core], gates[1, core] = own, np.maximum(own, chain)
    usual = np.median(gates[:, core], axis=1)
    limb_of_marker[gates[0] > MISPLACED * usual[0]] = -1
    sizes = np.append(np.bincount(limb_of_marker[limb_of_marker >= 0], minlength=limbs.n_limbs), 0)
    mostly_own = poses.by_own.mean(axis=0) > 0.5
    limits = STEADINESS * np.where(mostly_own, usual[0], min(usual[1], widest))  # farther on limbs that the chain poses
    for marker in np.flatnonzero(sizes[limb_of_marker] < 3):
        place = steadiest_place(markers.positions[:, marker], poses, limits)
        if place is not None and place[0] != limb_of_marker[marker]:
            limb_of_marker[marker], offsets[marker] = place
            gates[:, marker] = usual
    return MarkerModel(structure, trees, core, limb_of_marker, offsets, gates[0], gates[1], limits, widest)


def steadiest_place(
    positions: Floats, poses: LimbPoses, limits: Floats, least: int = LEAST_SAMPLES
) -> tuple[int, Floats] | None:
    """The limb against which a marker moves least, and its mean place there.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        The marker in the frames of the poses, NaN where unseen.
    poses : LimbPoses
        Where limbs are.
    limits : ndarray, shape (n_limbs,), mm
        Root mean square deviation up to which a place on a limb counts as kept.
    least : int
        Number of frames that must show both.

    Returns
    -------
    tuple of int and ndarray, or None
        None if the marker moves too much on all limbs, or was seen too little.
    """
    seen = np.flatnonzero(~np.isnan(positions[:, 0]))
    known = poses.credible[seen]
    limbs = np.flatnonzero(known.sum(axis=0) >= max(least, 0.5 * len(seen)))
    if not len(limbs):
        return None
    pose = poses.world_from_limb[np.ix_(seen, limbs)]
    x, y, z = (positions[seen, axis, np.newaxis] - pose[..., axis, 3] for axis in range(3))
    local = np.stack(
        [x * pose[..., 0, k] + y * pose[..., 1, k] + z * pose[..., 2, k] for k in range(3)]
    )  # as `_placed`
    weight = known[:, limbs].astype(np.float64)
    total = weight.sum(axis=0)
    mean = (local * weight).sum(axis=1) / total
    spread = np.sqrt(((local - mean[:, np.newaxis]) ** 2 * weight).sum(axis=(0, 1)) / total)
    best = int(np.argmin(spread / limits[limbs]))
    return (int(limbs[best]), mean[:, best]) if spread[best] < limits[limbs[best]] else None


def _core_gates(positions: Floats, limb_of_marker: Ints, offsets: Floats, poses: LimbPoses) -> tuple[Floats, Floats]:
    """Gates of the core's markers where the limb's own markers pose it, and where the chain does [mm]."""
    limb = np.maximum(limb_of_marker, 0)
    residuals = np.linalg.norm(positions - _placed(limb, offsets, poses.world_from_limb), axis=2)
    by_own = poses.by_own[:, limb]
    places = offsets[limb_of_marker >= 0]
    least = LEAST_GATE * float(np.sqrt((places**2).sum(axis=1).mean())) if len(places) else 0.0
    return _gates(np.where(by_own, residuals, np.nan), least), _gates(np.where(by_own, np.nan, residuals), least)


def _gates(residuals: Floats, least: float) -> Floats:
    """Gate of each marker [mm] from its residuals and those of its neighbours, shape (n_markers,)."""
    known = ~np.isnan(residuals)
    if not known.any():
        return np.full(residuals.shape[1], max(least, TINY_GATE))
    usual = float(np.median(residuals[known]))
    seen = [column[~np.isnan(column)] for column in residuals.T]
    own = np.array([float(np.median(values)) if len(values) else usual for values in seen])
    return np.asarray(np.maximum(GATE_DEVIATIONS * np.maximum(own, usual), max(least, TINY_GATE)))


def _placed(limb: Ints, offsets: Floats, world_from_limb: Floats) -> Floats:
    """Markers on posed limbs [mm], shape (n_frames, n_markers, 3); NaN for those without a place."""
    placed = np.empty((len(world_from_limb), len(limb), 3))
    for axis in range(3):  # einsum takes six times as long
        rows = [world_from_limb[:, limb, axis, column] for column in range(4)]
        placed[..., axis] = rows[0] * offsets[:, 0] + rows[1] * offsets[:, 1] + rows[2] * offsets[:, 2] + rows[3]
    return placed


def _tree(body: BodyOfTake, core: Ints) -> Tree:
    """Fit rigid limbs and joints to one tree."""
    frames = np.flatnonzero((~np.isnan(body.positions[:, :, 0])).any(axis=1))
    chain, _ = assemble(body, SkeletonParameters(), frames)
    return Tree(body.limbs, chain, core[body.markers])


def _pose(trees: list[Tree], positions: Floats) -> LimbPoses:
    """Pose all limbs by markers, shape (n_frames, n_markers, 3), NaN where unseen."""
    n_limbs = sum(len(tree.limbs) for tree in trees)
    poses = np.tile(np.eye(4), (len(positions), n_limbs, 1, 1))
    by_own, posed = np.zeros((2, len(positions), n_limbs), dtype=bool)
    for tree in trees:
        places = positions[:, tree.markers]
        own, by_own[:, tree.limbs] = pose_by_own_markers(tree.chain, places)
        joints = own[..., :3, 3].copy()  # a limb's origin is the joint to its parent
        joints[:, 0] = np.nan
        found, posed[:, tree.limbs] = pose_outward(tree.chain, places, joints)
        chained = transform_from(found.rotations, found.origins(tree.chain))
        np.copyto(chained, own, where=by_own[:, tree.limbs, np.newaxis, np.newaxis])
        poses[:, tree.limbs] = chained
    known = np.pad(posed | by_own, ((STEADY_FRAMES + 1, STEADY_FRAMES), (0, 0))).cumsum(axis=0)
    window = 2 * STEADY_FRAMES + 1
    return LimbPoses(poses, by_own, credible=known[window:] > known[:-window])
