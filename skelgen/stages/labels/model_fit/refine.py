r"""Identities from rigidity: a skeleton of the markers found so far says where each marker must be.

A physical marker is a place on a limb. With the poses of the limbs, the best explanation of all points minimises

.. math::
    \sum_{p} w_p\, \rho\left(\frac{|x_p - T_{l(m)}(f_p)\, q_m|}{g_m}\right), \qquad \rho(u) = \min(u^2, 1),

over the assignment of points p to markers m (or to none, at the cost 1) and over places q and poses T, where whole
tracks of points vote together and a marker has one point in a frame. It is minimised in turns: limbs, joints and
skeleton from the markers in sampled frames; then, block of frames by block, tracks to markers by their votes; markers
that share a place are joined, tracks that keep a place of their own become markers. The first turn starts from the
markers that the likelihood of distances gives (`likeness`).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import Monitor
from skelgen.stages.labels.merging.leftovers import seen_at_once, with_left_out
from skelgen.stages.labels.merging.likelihood import DistanceRecord, distance_sums, sample_frames
from skelgen.stages.labels.merging.pauses import join_everything
from skelgen.stages.labels.model_fit.assignment import (
    Newcomers,
    Scores,
    assign_tracks,
    fill_single_points,
    point_scores,
    same_places,
    split_where_marker_changes,
)
from skelgen.stages.labels.model_fit.model import BLIND_GATE, Model, Poses, fit_model
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import (
    Block,
    blocks_of,
    counts_together,
    marker_names,
    marker_positions,
    one_point_a_frame,
    renumbered,
    seen_together,
)
from skelgen.stages.labels.tracking.follow import typical_spacing
from skelgen.stages.labels.tracking.take import point_weights
from skelgen.stages.labels.user_labels.statements import Fixed, fixed_scores, targets

MODEL_FRAMES = 600
"""Frames that the skeleton is fitted to, spread over the take."""

CORE_SHARE = 0.3
"""Markers seen in fewer frames than this part of the usual number do not carry the model."""

HABIT = 0.3
"""Score of the marker that a point has already, where its place is not known: less than any good explanation."""

SETTLED = 0.0005
"""Part of all points; when fewer change their marker, the turns end."""


def refine_labels(
    cloud: PointCloud,
    owner: Ints,
    marker_of_point: Ints,
    rate: float,
    parameters: LabelParameters,
    *,
    n_markers: int | None,
    fixed: Fixed | None = None,
    seed: int,
    monitor: Monitor,
) -> Ints:
    """Improve identities by the skeleton that they imply, until nothing changes.

    Parameters
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none; the others are those of `by_rigidity.markers_by_rigidity`.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    monitor.begin("identities by rigidity")
    spacing = typical_spacing(cloud)
    frames = np.unique(np.linspace(0, cloud.n_frames - 1, MODEL_FRAMES).astype(np.intp))
    for turn in range(parameters.rounds):
        known = joined_again(cloud, owner, marker_of_point, rate, spacing)
        positions = _sampled(cloud, known, frames)
        sample = Trajectories(positions, marker_names(positions.shape[1]), rate * len(frames) / cloud.n_frames)
        model = fit_model(sample, core_markers(known, n_markers), BLIND_GATE * spacing, seed)
        if model is None:
            break
        better = _relabelled(cloud, owner, known, model, fixed, monitor)
        n_changed = _n_changed(marker_of_point, better)
        marker_of_point = better
        monitor.advance(turn + 1, parameters.rounds)
        if n_changed <= SETTLED * cloud.n_points:
            break
    return joined_again(cloud, owner, marker_of_point, rate, spacing)


def core_markers(marker_of_point: Ints, n_markers: int | None = None) -> Ints:
    """Find the markers that are seen often enough to carry a model, no more than `n_markers`; rising indices."""
    counts = np.bincount(marker_of_point[marker_of_point >= 0])
    order = np.sort(counts)
    usual = order[np.searchsorted(np.cumsum(order), order.sum() / 2)] if len(order) else 0
    core = np.argsort(-counts, kind="stable")[:n_markers]
    return np.sort(core[counts[core] >= max(CORE_SHARE * usual, 2)])


def _sampled(cloud: PointCloud, marker_of_point: Ints, frames: Ints) -> Floats:
    """Positions of markers in some frames [mm], NaN where unseen, shape (n_frames, n_markers, 3)."""
    starts, counts = cloud.frame_starts[frames], cloud.points_per_frame[frames]
    row = np.repeat(np.arange(len(frames)), counts)
    point = np.arange(int(counts.sum())) + np.repeat(starts - np.cumsum(counts) + counts, counts)
    marker = marker_of_point[point]
    owned = marker >= 0
    positions = np.full((len(frames), int(marker_of_point.max(initial=-1)) + 1, 3), np.nan)
    positions[row[owned], marker[owned]] = cloud.points[point[owned]]
    return positions


def joined_again(cloud: PointCloud, owner: Ints, marker_of_point: Ints, rate: float, spacing: float) -> Ints:
    """Join markers, and tracks without one, by the likelihood of their distances, of which each turn knows more.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    heard = with_left_out(cloud, owner, marker_of_point)
    n_heard = int(heard.max(initial=-1)) + 1
    frames = sample_frames(rate, 0, cloud.n_frames)
    sums = np.zeros((3, n_heard, n_heard))
    for start in range(0, len(frames), MODEL_FRAMES):
        sums += distance_sums(_sampled(cloud, heard, frames[start : start + MODEL_FRAMES]))
    apart = sums[0] > 0
    if n_heard > n_markers:  # short tracks may lie between the sampled frames
        meeting = seen_at_once(cloud, heard, n_heard)
        meeting[:n_markers, :n_markers] = False
        apart |= meeting
    joined = join_everything(DistanceRecord(sums[0], sums[1], sums[2], apart, spacing))
    joined[joined >= n_markers] = -1
    if (joined[:n_markers] == np.arange(n_markers)).all() and (joined[n_markers:] < 0).all():
        return marker_of_point
    found = one_point_a_frame(cloud, np.append(joined, -1).astype(np.int32)[heard])
    return renumbered(found, np.bincount(found[found >= 0], minlength=n_markers) > 0)


def _relabelled(
    cloud: PointCloud, owner: Ints, marker_of_point: Ints, model: Model, fixed: Fixed | None, monitor: Monitor
) -> Ints:
    """Assign all points anew by the model, block by block."""
    n_markers = model.n_markers
    target = targets(marker_of_point, fixed, n_markers) if fixed is not None else None
    weights = point_weights(cloud)
    result = np.full(cloud.n_points, -1, dtype=np.int32)
    newcomers = Newcomers(model.gate, model.limits)
    together = np.zeros((n_markers, n_markers))
    for block in blocks_of(cloud):
        points = cloud.points[block.points]
        poses = model.pose(marker_positions(cloud, marker_of_point, n_markers, block))
        scores = _scores(points, block, marker_of_point[block.points], poses, model)
        scores *= weights[block.points, np.newaxis]
        if fixed is not None and target is not None:
            part = dataclasses.replace(fixed, who=fixed.who[block.points], owner=fixed.owner[block.points])
            scores = fixed_scores(scores, part, target)
        pieces = split_where_marker_changes(owner[block.points], scores)
        marker = assign_tracks(pieces, block.frames, scores, block.n_frames)
        marker = fill_single_points(marker, block.frames, scores, block.n_frames)
        newcomers.look(points, block, np.flatnonzero(marker < 0), pieces, poses)
        result[block.points] = marker
        together += seen_together(block, marker, n_markers)
        monitor.advance(block.first + block.n_frames, cloud.n_frames)
    joined = same_places(together, model.offsets, model.limb_of_marker, model.limits)
    result = np.append(joined, -1).astype(np.int32)[result]
    for number, members in enumerate(newcomers.found(cloud.n_frames)):
        result[members] = n_markers + number
    result = one_point_a_frame(cloud, result)
    return renumbered(result, np.bincount(result[result >= 0], minlength=1) > 1)


def _scores(points: Floats, block: Block, marker: Ints, poses: Poses, model: Model) -> Scores:
    """How well each point of a block suits each marker; points keep theirs where nothing is known of its place."""
    predicted, gates = model.predict(poses)
    scores = point_scores(points, block.frames, predicted, gates)
    known = ~np.isnan(predicted[..., 0]) | ~model.is_placed
    owned = np.flatnonzero(marker >= 0)
    lost = owned[~known[block.frames[owned], marker[owned]]]
    scores[lost, marker[lost]] = HABIT
    return scores


def _n_changed(before: Ints, after: Ints) -> int:
    """Number of points that changed their marker, whatever the markers' numbers are."""
    together = counts_together(before, after)
    kept = int(together[1:, 1:].max(axis=1, initial=0).sum())
    return max(int(together[1:].sum()), int(together[:, 1:].sum())) - kept
