r"""Identities from rigidity: a skeleton of the markers found so far says where each marker must be.

A physical marker is a place on a limb. With the poses of the limbs, the best explanation of all points minimises

.. math::
    \sum_{p} \rho\left(\frac{|x_p - T_{l(m)}(f_p)\, q_m|}{g_m}\right), \qquad \rho(u) = \min(u^2, 1),

over the assignment of points p to markers m (or to none, at the cost 1) and over places q and poses T, where whole
tracks of points vote together and a marker has one point in a frame. It is minimised in turns: limbs, joints, skeleton
and its motion from the markers; then tracks to markers by their votes; markers that share a place are joined, tracks
that keep a place of their own become markers. The first turn starts from the markers that the aligned Marker Sets give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.shape import fit_shape
from skelgen.model import Limbs, Motion, PointCloud, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import Monitor
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.labels.by_hand import Fixed, fixed_scores, targets
from skelgen.stages.labels.follow import typical_spacing
from skelgen.stages.labels.judged import find_points
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.places import join_markers, new_markers
from skelgen.stages.labels.votes import assign_tracks, fill_single_points, point_scores, split_where_marker_changes
from skelgen.stages.limbs import find_limbs
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

GATE_DEVIATIONS = 6.0
"""A point is explained by a marker that is nearer than this many typical residuals."""

JOINT_SAMPLES = 100
"""Frames at which pairs of limbs are tried: the tree of a model that is soon replaced need not be finer."""

BLIND_GATE = 0.5
"""Of the typical spacing of points: a wider gate cannot tell neighbours apart, and its prediction is not followed."""

SHAPE_SAMPLES = 400
"""Frames from which the shape of a limb is estimated."""

TINY_GATE = 1e-9
"""mm; keeps gates above zero for markers that all coincide."""

HABIT = 0.3
"""Score of the marker that a point has already, where its place is not known: less than any good explanation."""

LEAST_GATE = 0.02
"""Of the markers' typical distance from the joint: the gate is no smaller, however exact the take."""

STEADY_FRAMES = 5
"""A limb's pose is trusted this many frames beyond those that show it."""


@dataclass(frozen=True, eq=False)
class Model:
    """A skeleton in motion, as the labelling uses it.

    Attributes
    ----------
    limbs : Limbs
        Limb of each marker.
    skeleton : Skeleton
        Rigid limbs.
    motion : Motion
        Poses of the chain.
    credible : ndarray of bool, shape (n_frames, n_limbs)
        Frames whose pose of a limb rests on points, or nearly.
    predicted : ndarray, shape (n_frames, n_markers, 3), mm
        Where markers must be: by their own limb where it is posed, else by the chain; NaN where neither is known.
    gates : ndarray, shape (n_frames, n_markers), mm
        Distance within which a marker explains a point.
    """

    limbs: Limbs
    skeleton: Skeleton
    motion: Motion
    credible: Bools
    predicted: Floats
    gates: Floats

    @property
    def gate(self) -> float:
        """A typical gate [mm]."""
        return float(np.median(self.gates))


def refine_labels(
    cloud: PointCloud,
    owner: Ints,
    markers: Trajectories,
    parameters: LabelParameters,
    *,
    n_markers: int | None,
    fixed: Fixed | None = None,
    seed: int,
    monitor: Monitor,
) -> Trajectories:
    """Improve identities by the skeleton that they imply, until nothing changes.

    Parameters
    ----------
    cloud : PointCloud
        The unlabelled take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    markers : Trajectories
        Markers found so far.
    parameters : LabelParameters
        Their `rounds`.
    n_markers : int or None
        Number of markers, if the user knows it.
    fixed : Fixed or None
        What the user states of some points.
    seed : int
        Seed of the stages that build the model.
    monitor : Monitor
        Hears of progress and may cancel.
    """
    monitor.begin("identities by rigidity")
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    widest = BLIND_GATE * typical_spacing(cloud)
    positions = markers.positions
    for turn in range(parameters.rounds):
        model = fit_model(Trajectories(positions, marker_names(positions.shape[1]), markers.rate), widest, seed)
        if model is None:
            break
        better = _relabelled(cloud, frame_of_point, owner, positions, model, n_markers, fixed)
        monitor.advance(turn + 1, parameters.rounds)
        if _n_seen(better) < _n_seen(positions) or _same(better, positions):
            break
        positions = better
    return Trajectories(positions, marker_names(positions.shape[1]), markers.rate, markers.name, markers.notices)


def fit_model(markers: Trajectories, widest: float, seed: int) -> Model | None:
    """Fit a skeleton to the markers found so far; None if they show no limb. Gates stay below `widest` [mm]."""
    try:
        limbs = find_limbs(markers, seed=seed)
        topology = find_joints(markers, limbs, JointParameters(samples=JOINT_SAMPLES), seed=seed)
        skeleton, motion = fit_skeleton(markers, limbs, topology, SkeletonParameters(fit="root-outward"))
    except InputError:
        return None
    credible = _widened(motion.limb_seen, STEADY_FRAMES)
    predicted, gates = _predictions(markers, limbs, skeleton, motion, credible, widest)
    return Model(limbs, skeleton, motion, credible, predicted, gates)


def _predictions(
    markers: Trajectories, limbs: Limbs, skeleton: Skeleton, motion: Motion, credible: Bools, widest: float
) -> tuple[Floats, Floats]:
    """Predicted places of all markers and their gates; gates that reach `widest` tell nothing and close."""
    limb = np.maximum(limbs.limb_of_marker, 0)
    places = skeleton.marker_offsets[limbs.limb_of_marker >= 0]
    least = LEAST_GATE * float(np.sqrt((places**2).sum(axis=1).mean())) if len(places) else 0.0
    believed = credible[:, limb] & (limbs.limb_of_marker >= 0)
    predicted = np.where(believed[..., np.newaxis], motion.marker_positions, np.nan)
    gates = np.tile(_gate_of(motion.residuals, least), (markers.n_frames, 1))
    frames = np.arange(markers.n_frames)
    for one in range(limbs.n_limbs):
        own = limbs.markers_of(one)
        shape = fit_shape(markers.positions[:, own], frames[:: max(1, len(frames) // SHAPE_SAMPLES)])
        posed = np.flatnonzero(shape.posed)
        pose = shape.world_from_limb[posed]
        block = np.ix_(posed, own)
        predicted[block] = np.einsum("fij,mj->fmi", pose[:, :3, :3], shape.points) + pose[:, np.newaxis, :3, 3]
        gates[block] = _gate_of(np.linalg.norm(markers.positions[block] - predicted[block], axis=2), least)
    predicted[gates > widest] = np.nan
    return predicted, gates


def _gate_of(residuals: Floats, least: float) -> Floats:
    """Gate of each marker [mm] from its residuals and those of its neighbours, shape (n_markers,)."""
    known = ~np.isnan(residuals)
    if not known.any():
        return np.full(residuals.shape[1], max(least, TINY_GATE))
    usual = float(np.median(residuals[known]))
    heard = [column[~np.isnan(column)] for column in residuals.T]
    own = np.array([float(np.median(values)) if len(values) else usual for values in heard])
    return np.asarray(np.maximum(GATE_DEVIATIONS * np.maximum(own, usual), max(least, TINY_GATE)))


def _relabelled(
    cloud: PointCloud,
    frame_of_point: Ints,
    owner: Ints,
    positions: Floats,
    model: Model,
    n_markers: int | None,
    fixed: Fixed | None,
) -> Floats:
    """Assign all points anew by the model; return positions of the markers, shape (n_frames, n_markers, 3)."""
    scores = point_scores(cloud.points, frame_of_point, model.predicted, model.gates)
    scores = _with_habit(scores, cloud.points, frame_of_point, positions, model.predicted)
    if fixed is not None:
        scores = fixed_scores(scores, fixed, targets(find_points(cloud, positions), fixed, positions.shape[1]))
    pieces = split_where_marker_changes(owner, scores)
    marker_of_point = assign_tracks(pieces, frame_of_point, scores, cloud.n_frames)
    marker_of_point = fill_single_points(marker_of_point, frame_of_point, scores, cloud.n_frames)
    free = marker_of_point < 0
    added = new_markers(cloud.points, frame_of_point, pieces, free, model.motion, model.credible, model.gate)
    for number, members in enumerate(added):
        marker_of_point[members] = positions.shape[1] + number
    result = _gathered(cloud, frame_of_point, marker_of_point, positions.shape[1] + len(added))
    joined = join_markers(result[:, : positions.shape[1]], model.skeleton.marker_offsets, model.limbs, model.gate)
    everything = np.concatenate([joined, result[:, positions.shape[1] :]], axis=1)
    return _longest_seen(everything, n_markers)


def _with_habit(scores: Floats, points: Floats, frames: Ints, positions: Floats, predicted: Floats) -> Floats:
    """Let points keep the marker that they have where nothing is known of its place."""
    kept = scores.copy()
    for marker in range(positions.shape[1]):
        its_own = (positions[frames, marker] == points).all(axis=1)
        unknown = np.isnan(predicted[frames, marker, 0])
        kept[its_own & unknown, marker] = HABIT
    return kept


def _n_seen(positions: Floats) -> int:
    return int((~np.isnan(positions[:, :, 0])).sum())


def _same(first: Floats, second: Floats) -> bool:
    return first.shape == second.shape and bool(np.array_equal(first, second, equal_nan=True))


def _gathered(cloud: PointCloud, frame_of_point: Ints, marker_of_point: Ints, n_markers: int) -> Floats:
    positions = np.full((cloud.n_frames, n_markers, 3), np.nan)
    owned = marker_of_point >= 0
    positions[frame_of_point[owned], marker_of_point[owned]] = cloud.points[owned]
    return positions


def _longest_seen(positions: Floats, n_markers: int | None) -> Floats:
    """Markers that are seen at all, no more than asked for, in the order in which they are first seen."""
    seen = ~np.isnan(positions[:, :, 0])
    counts = seen.sum(axis=0)
    keep = np.flatnonzero(counts > 1)
    if n_markers is not None and len(keep) > n_markers:
        keep = keep[np.argsort(-counts[keep], kind="stable")[:n_markers]]
    return positions[:, keep[np.argsort(np.argmax(seen[:, keep], axis=0), kind="stable")]]


def _widened(known: Bools, frames: int) -> Bools:
    """True also within some frames of what is true, shape (n_frames, n)."""
    from scipy.ndimage import binary_dilation  # noqa: PLC0415 - heavy

    return np.asarray(binary_dilation(known, structure=np.ones((2 * frames + 1, 1))))


def marker_names(n_markers: int) -> tuple[str, ...]:
    """Return the names of markers that have no labels: ``M000``, ``M001``, ..."""
    return tuple(f"M{index:03d}" for index in range(n_markers))
