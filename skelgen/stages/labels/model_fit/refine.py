r"""Identities from a skeleton: fitted to the markers found so far, it says where each marker must be.

A physical marker is a place on a limb. With the poses of the limbs, the best explanation of all points minimises

.. math::
    \sum_{p} w_p\, \rho\left(\frac{|x_p - T_{l(m)}(f_p)\, q_m|}{g_m}\right), \qquad \rho(u) = \min(u^2, 1),

over the assignment of points p to markers m (or to none, at the cost 1) and over places q and poses T, where whole
tracks of points vote together and a marker has one point in a frame. It is minimised in turns. First limbs, joints and
skeleton are fitted to the markers in sampled frames. Then, block of frames by block, tracks are assigned to markers by
their votes; markers that share a place are merged, and tracks that keep a place of their own become markers. The first
turn starts from the markers that the likelihood of distances gives (`merging.likelihood`).
"""

from dataclasses import dataclass, field
from hashlib import blake2b

import numpy as np

from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.progress import Monitor
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.explanations import Explanations, explain_points
from skelgen.stages.labels.merging.exchanges import exchange_markers
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.leftovers import label_leftovers
from skelgen.stages.labels.merging.markers import join_duplicates, merge_again
from skelgen.stages.labels.model_fit import assignment
from skelgen.stages.labels.model_fit.model import (
    BLIND_GATE,
    FoundStructure,
    LimbPoses,
    MarkerModel,
    find_structure,
    fit_model,
)
from skelgen.stages.labels.model_fit.symmetry import turned_limbs
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import stand_alone_frames
from skelgen.stages.labels.tracking.statistics import point_weights
from skelgen.stages.labels.user_labels.statements import PointConstraints, constrained, markers_of_names

MODEL_FRAMES = 600
"""Frames that the skeleton is fitted to, spread over the take."""

CORE_SHARE = 0.3
"""Markers seen in fewer frames than this part of the usual number do not carry the model."""

PRIOR_SCORE = 0.3
"""Score of the marker that a point has already, where its place is not known: less than any good explanation."""

FREE_MARKER_SHARE = 0.1
"""Of all frames in which a marker that no limb carries must be seen."""

SAME_CORE = 0.012
"""Part of the core's points that may have changed their marker for limbs and tree to be taken over; those of markers
that became parts of others do not count."""

UNCHANGED = 0.0005
"""Part of all points; when fewer change their marker, the turns end."""


@dataclass(frozen=True, eq=False)
class LabelTask:
    """What one run of the stage knows of its take when points have been followed.

    Attributes
    ----------
    take : FollowedCloud
        The unlabelled take; what the user states keeps its marker.
    parameters : LabelParameters
        How to label.
    n_markers : int or None
        Number of markers, if the user knows it.
    constraints : PointConstraints or None
        What the user states of some points.
    seed : int
        Random seed.
    structures : dict
        Limbs and trees found so far, by the positions that show them.
    """

    take: FollowedCloud
    parameters: LabelParameters
    n_markers: int | None = None
    constraints: PointConstraints | None = None
    seed: int = 0
    structures: dict[bytes, FoundStructure | None] = field(default_factory=dict)

    @property
    def least_alone(self) -> float:
        """Frames in which a marker that no limb carries must be seen."""
        n_frames = self.take.cloud.n_frames
        return max(stand_alone_frames(n_frames, self.take.rate, self.parameters), FREE_MARKER_SHARE * n_frames)


def refine_labels(task: LabelTask, marker_of_point: Ints, monitor: Monitor) -> Ints:
    """Improve identities by the skeleton that they imply, until nothing changes.

    Parameters
    ----------
    task : LabelTask
        The take; of its parameters, `rounds` limits the turns.
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none.
    monitor : Monitor
        Receives progress and may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    monitor.begin("identities by rigidity")
    take, cloud = task.take, task.take.cloud
    frames = spread_frames(cloud.n_frames, MODEL_FRAMES)
    model: MarkerModel | None = None
    modelled = marker_of_point
    for turn in range(task.parameters.rounds):
        merged = exchange_markers(take, merge_again(take, marker_of_point))
        if model and _n_changed(modelled, merged) <= UNCHANGED * cloud.n_points:
            break  # the same model would say the same
        positions = point_labels.sampled_positions(cloud, merged, frames)
        sample = Trajectories(
            positions, point_labels.marker_names(positions.shape[1]), take.rate * len(frames) / cloud.n_frames
        )
        core = core_markers(merged, task.n_markers)
        structure = None
        if model and (same := same_core(modelled, model.core, merged, core)) is not None:
            structure = model.structure.of_markers(np.flatnonzero(same >= 0))
            core = same[same >= 0] if structure else core
        structure = structure or _structure(task, sample, core)
        if structure is None:
            break
        model = fit_model(sample, core, BLIND_GATE * take.spacing, structure)
        merged = modelled = turned_limbs(cloud, merged, model, take.rate)
        better = _relabelled(task, merged, model, monitor)
        better = point_labels.with_unexplained(merged, better, task.least_alone)
        n_changed = _n_changed(marker_of_point, better)
        marker_of_point = better
        monitor.advance(turn + 1, task.parameters.rounds)
        if n_changed <= UNCHANGED * cloud.n_points:
            break
    return merge_again(take, marker_of_point)


def _structure(task: LabelTask, sample: Trajectories, core: Ints) -> FoundStructure | None:
    """Limbs of the core and their tree, found once for the same positions: other beginnings often lead to these."""
    key = blake2b(sample.positions[:, core].tobytes()).digest()
    if key not in task.structures:
        task.structures[key] = find_structure(sample, core, task.seed)
    return task.structures[key]


def complete_markers(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Join refined markers that were found twice, and give them the tracks that are theirs by distances alone.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    joined = join_duplicates(take, marker_of_point)
    return label_leftovers(take, joined)


def core_markers(marker_of_point: Ints, n_markers: int | None = None) -> Ints:
    """Find the markers that are seen often enough to carry a model.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int or None
        Most of them.

    Returns
    -------
    ndarray of intp
        Rising indices.
    """
    counts = np.bincount(marker_of_point[marker_of_point >= 0])
    order = np.sort(counts)
    usual = order[np.searchsorted(np.cumsum(order), order.sum() / 2)] if len(order) else 0
    core = np.argsort(-counts, kind="stable")[:n_markers]
    return np.sort(core[counts[core] >= max(CORE_SHARE * usual, 2)])


def same_core(before: Ints, old_core: Ints, after: Ints, core: Ints) -> Ints | None:
    """Find out which marker of a core each one of the core of other labels is.

    Parameters
    ----------
    before, after : ndarray of intp, shape (n_points,)
        Marker of each point by both labellings, -1 for none.
    old_core, core : ndarray of intp
        Their markers that carry a model.

    Returns
    -------
    ndarray of intp or None
        Of `core` the same marker as each of `old_core`, -1 for those that are no more; None if there are others, or too
        many points are another marker's.
    """
    if not 0 < len(core) <= len(old_core):
        return None
    together = point_labels.counts_together(before, after)[1:, 1:]
    common = together[np.ix_(old_core, core)]
    place = common.argmax(axis=1)
    is_same = common.argmax(axis=0)[place] == np.arange(len(old_core))
    if is_same.sum() < len(core):
        return None
    stays = np.ones(len(together), dtype=bool)
    stays[old_core[~is_same]] = False
    kept = common[np.flatnonzero(is_same), place[is_same]].sum()
    owned = together[old_core[is_same]].sum() + together[np.ix_(stays, core)].sum() - common[is_same].sum()
    return np.where(is_same, core[place], -1) if kept >= (1.0 - SAME_CORE) * owned else None


def _n_changed(before: Ints, after: Ints) -> int:
    """Number of points that changed their marker, whatever the markers' numbers are."""
    together = point_labels.counts_together(before, after)
    kept = int(together[1:, 1:].max(axis=1, initial=0).sum())
    return max(int(together[1:].sum()), int(together[:, 1:].sum())) - kept


def _relabelled(task: LabelTask, marker_of_point: Ints, model: MarkerModel, monitor: Monitor) -> Ints:
    """Assign all points anew by the model, block by block."""
    cloud, constraints, n_markers = task.take.cloud, task.constraints, model.n_markers
    target = None if constraints is None else markers_of_names(marker_of_point, constraints, n_markers)
    weights = point_weights(cloud)
    result = np.full(cloud.n_points, -1, dtype=np.int32)
    new_markers = assignment.NewMarkers(model.gate, model.limits)
    for block in point_labels.blocks_of(cloud):
        points = cloud.points[block.points]
        poses = model.pose(point_labels.marker_positions(cloud, marker_of_point, n_markers, block))
        explained = _explained(points, block, marker_of_point[block.points], poses, model)
        explained = explained.weighted(weights[block.points])
        if constraints is not None and target is not None:
            explained = constrained(explained, constraints.name_of_point[block.points], target)
        tracks = assignment.split_where_marker_changes(task.take.track_of_point[block.points], explained)
        marker = assignment.assign_tracks(tracks, block.frames, explained, block.n_frames)
        marker = assignment.fill_single_points(marker, block.frames, explained, block.n_frames)
        new_markers.add(points, block, np.flatnonzero(marker < 0), tracks, poses)
        result[block.points] = marker
        monitor.advance(block.first + block.n_frames, cloud.n_frames)
    together = point_labels.seen_together(cloud, result, n_markers)
    merged = assignment.same_places(together, model.offsets, model.limb_of_marker, model.limits)
    result = np.append(merged, -1).astype(np.int32)[result]
    for number, members in enumerate(new_markers.found(cloud.n_frames)):
        result[members] = n_markers + number
    result = point_labels.one_point_a_frame(cloud, result)
    return point_labels.renumbered(result, np.bincount(result[result >= 0], minlength=1) > 1)


def _explained(
    points: Floats, block: point_labels.Block, marker: Ints, poses: LimbPoses, model: MarkerModel
) -> Explanations:
    """Which markers explain the points of a block; points keep theirs where nothing is known of its place."""
    predicted, gates = model.predict(poses)
    known = ~np.isnan(predicted[..., 0]) | ~model.is_placed
    owned = np.flatnonzero(marker >= 0)
    lost = owned[~known[block.frames[owned], marker[owned]]]
    explained = explain_points(points, block.frames, predicted, gates)
    return explained.with_pairs(lost, marker[lost], PRIOR_SCORE)
