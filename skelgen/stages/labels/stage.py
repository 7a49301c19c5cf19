"""From unlabelled points to labelled markers (Schönauer 2007, 3.3 and 4.2), and the check of takes that carry labels.

Points are followed from frame to frame into tracks; a marker that was lost and found again has several. Their parts
that can be trusted, the tracklets, are merged into markers by the likelihood of the distances between them. A skeleton
is then fitted to these markers and says which marker every point is. The method of the thesis, which merges tracklets
over aligned poses (`skelgen.stages.classic`), runs only where it is asked for.
"""

from dataclasses import replace
from hashlib import blake2b

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.corrections import Identities
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.confidence import label_quality
from skelgen.stages.labels.input_checks import (
    check_cloud,
    frame_rate,
    guessed_identities,
    losses,
    thin_frames,
    too_few_wanted,
    with_jitter,
    without_computed,
)
from skelgen.stages.labels.merging.bridges import with_bridges
from skelgen.stages.labels.merging.fallen import without_fallen
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import better_labels, explains_more, has_too_many
from skelgen.stages.labels.merging.leftovers import label_rest
from skelgen.stages.labels.merging.limbs import PairTables, main_groups, measure_pairs, merge_on_limbs
from skelgen.stages.labels.merging.markers import may_be_incomplete
from skelgen.stages.labels.merging.turns import put_right, with_alike_apart
from skelgen.stages.labels.merging.windows import MOST_KEPT, merge_tracklets
from skelgen.stages.labels.model_fit.refine import LabelTask, complete_markers, refine_labels
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import find_tracklets, follow_points, least_length, stand_alone_frames
from skelgen.stages.labels.tracking.statistics import points_beside, typical_spacing
from skelgen.stages.labels.user_labels.constraints import apply_constraints, constrain_labelled
from skelgen.stages.labels.user_labels.statements import find_constraints
from skelgen.stages.repair import repair_take

PIECE_SECONDS = 0.1
"""Shortest tracks that are labelled limb by limb."""

MOST_PIECES = 2000
"""Most of them: memory and time grow with their square."""

MOST_COMPARED = 600
"""Tracklets up to which the classic method is compared: its time grows with their square."""


def label_markers(
    cloud: PointCloud,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    identities: Identities | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Trajectories, Labelling]:
    """Find the identity of each point over the whole take, and how sure it is.

    Parameters
    ----------
    cloud : PointCloud
        The unlabelled take.
    parameters : LabelParameters
        How to label.
    n_markers : int or None
        Number of physical markers; None finds it.
    identities : Identities or None
        What the user states of some points; the result obeys it.
    seed : int
        Random seed of the test jitter and of the clusterings.
    monitor : Monitor
        Receives progress and notices, and may cancel.

    Returns
    -------
    trajectories : Trajectories
        Markers ``M000``, ``M001``, ... in the order in which they are first seen; NaN where unseen. Points that belong
        to no marker are left out, and a notice says how many.
    labelling : Labelling
        Confidence, doubtful spans, tracklets and points left out; with ``parameters.compare`` also what the classic
        method gives.

    Raises
    ------
    InputError
        If there are no points, too many in a frame, impossible coordinates, or no marker that is seen long enough.
    """
    trajectories, points = _labelled(cloud, parameters, n_markers, identities, seed, monitor)
    history = label_quality.history_of(points, trajectories.n_markers)
    del points  # of long takes they are large
    return trajectories, label_quality.labelling_of_cloud(trajectories, history)


def check_labels(
    take: Trajectories,
    parameters: LabelParameters,
    *,
    identities: Identities | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Trajectories, Labelling]:
    """Look for errors in the labels of a take that carries some, repair them, and say how sure the labels are.

    Points that a model computed, by their names, are no markers, and are left out, unless the user asked for them.

    Parameters
    ----------
    take : Trajectories
        The labelled take.
    parameters : LabelParameters
        Which errors are looked for, and whether computed points stay.
    identities : Identities or None
        What the user states of some points; the result obeys it.
    seed : int
        Random seed of the test jitter.
    monitor : Monitor
        Receives notices, and may cancel.
    """
    if not (parameters.computed_points or take.are_all_wanted):
        take = without_computed(take, monitor)
    if parameters.add_random:
        take = replace(take, positions=with_jitter(take.positions, parameters, seed))
    repair = repair_take(take, parameters.repair_parameters, monitor=monitor)
    repaired = repair.trajectories
    if identities is not None:
        repaired = constrain_labelled(take, repaired, identities, parameters, monitor)
    if parameters.least_seen:
        thin, cleaned = thin_frames(repaired.seen, parameters.least_seen)
        positions = np.where(thin[:, np.newaxis, np.newaxis], np.nan, repaired.positions)
        repaired = replace(repaired, positions=positions, notices=repaired.notices + cleaned)
        for sentence in cleaned:
            monitor.notice(sentence)
    return repaired, label_quality.labelling_of_markers(repaired, take, repair.findings)


def _labelled(
    cloud: PointCloud,
    parameters: LabelParameters,
    n_markers: int | None,
    identities: Identities | None,
    seed: int,
    monitor: Monitor,
) -> tuple[Trajectories, label_quality.PointLabels]:
    check_cloud(cloud, n_markers)
    if parameters.add_random:
        cloud = replace(cloud, points=with_jitter(cloud.points, parameters, seed))
    rate, notices = frame_rate(cloud, parameters)
    monitor.begin("following points")
    tracks, _ = follow_points(cloud, parameters, monitor)
    constraints = find_constraints(cloud, tracks, identities) if identities else None
    tracks = constraints.track_of_point if constraints else tracks
    stated = constraints.name_of_point >= 0 if constraints else None
    take = FollowedCloud(cloud, tracks, rate, typical_spacing(cloud), stated)
    task = LabelTask(take, parameters, n_markers, constraints, seed)
    tracklets = _tracklets(take, parameters)
    n_tracklets, at_once = len(tracklets), tracklets.most_at_once(least_length(cloud.n_frames, rate, parameters))
    n_removed, classic = 0, None
    if parameters.method == "sets":
        found, n_removed = _classic_markers(task, tracklets, monitor)
    else:
        del tracklets  # of long takes they are large
        found, fallen = _markers(task, monitor)
        notices += fallen
        if parameters.compare and n_tracklets <= MOST_COMPARED:
            classic, _ = _classic_markers(task, _tracklets(take, parameters), monitor)
    found = point_labels.in_order_of_appearance(found)
    names = point_labels.marker_names(int(found.max(initial=-1)) + 1)
    if identities and constraints is not None:
        found, names = apply_constraints(cloud, found, constraints, n_markers=n_markers)
        notices += (f"{len(identities.entries)} identities stated by hand are obeyed",)
    positions = point_labels.all_positions(cloud, found, len(names))
    if parameters.least_seen:
        thin, cleaned = thin_frames(~np.isnan(positions[:, :, 0]), parameters.least_seen)
        found = np.where(np.repeat(thin, cloud.points_per_frame), -1, found)
        positions = np.where(thin[:, np.newaxis, np.newaxis], np.nan, positions)
        notices += cleaned
    notices += losses(found, len(names), n_removed, n_markers) + too_few_wanted(n_markers, at_once)
    notices += guessed_identities(positions, take.spacing)
    for sentence in notices:
        monitor.notice(sentence)
    trajectories = Trajectories(positions, names, rate, cloud.name, cloud.notices + notices)
    tracks = constraints.open_tracks if constraints else tracks
    return trajectories, label_quality.PointLabels(cloud, tracks, found, classic, stated)


def _tracklets(take: FollowedCloud, parameters: LabelParameters) -> TrackletPoints:
    """Tracklets that are long enough; there must be one."""
    tracklets = find_tracklets(take.cloud, take.track_of_point, take.rate, parameters)
    if len(tracklets) == 0:
        least = least_length(take.cloud.n_frames, take.rate, parameters)
        raise InputError(
            f"no point can be followed for {least} frames, so there is no marker; lower min_range, raise max_jump, or "
            "check the recording"
        )
    return tracklets


def _classic_markers(task: LabelTask, tracklets: TrackletPoints, monitor: Monitor) -> tuple[Ints, int]:
    """Marker of each point by the method of the thesis, and the number of tracklets that found no marker."""
    from skelgen.stages.classic.aligned_distances import Alignment  # noqa: PLC0415 - runs only where it is asked for
    from skelgen.stages.classic.marker_sets import SetMethod, markers_by_sets  # noqa: PLC0415

    how, take, n_frames = task.parameters, task.take, task.take.cloud.n_frames
    n_neighbours = how.n_neighbours if how.alignment == "local" else None
    method = SetMethod(
        Alignment(n_neighbours, how.misfit_weight, how.sampling),
        how.clustering,
        limit=how.remove_distance or take.spacing,
        least_length=least_length(n_frames, take.rate, how),
        stand_alone=stand_alone_frames(n_frames, take.rate, how),
        seed=task.seed,
        sigma=how.sigma,
    )
    return markers_by_sets(take.cloud, tracklets, task.n_markers, method, monitor)


def _markers(task: LabelTask, monitor: Monitor) -> tuple[Ints, tuple[str, ...]]:
    """Marker of each point, -1 for none: tracklets are merged by their distances, then a skeleton labels all points.

    Beside these, notices of markers that fell off, of which no points are followed from then on.

    Where more markers are found than are seen at once, shorter tracklets are merged limb by limb, too: from nothing,
    and by what the skeleton found if that leaves doubt. What gaps say of exchanges misleads where much is wrong, and is
    heard at last; in a take of few seconds all is sought with it, too. What explains the take best is kept.
    """
    monitor.begin("merging tracklets")
    take, fallen = without_fallen(with_bridges(task.take))
    task, tracklets = replace(task, take=take), _tracklets(take, task.parameters)
    group = merge_tracklets(take.cloud.points, tracklets, take.rate, take.spacing, monitor)
    start = _grouped(take, tracklets, group)
    at_once = tracklets.most_at_once(least_length(take.cloud.n_frames, take.rate, task.parameters))
    pieces = _pieces(task) if start.max(initial=-1) >= at_once else None
    if pieces:
        by_limbs = _on_limbs(take, pieces, np.full(take.cloud.n_points, -1))
        if at_once <= by_limbs.max() + 1 <= start.max() + 1:
            start = better_labels(take, start, by_limbs)
    found = _searched(task, start, pieces, at_once, monitor)
    if found.max(initial=-1) >= at_once and not take.is_very_long:
        heard = replace(take, exchanges_over_gaps=True)
        if take.has_few_moments:
            other = _searched(replace(task, take=heard), start, pieces, at_once, monitor)
        else:
            other = put_right(heard, found)
        found = better_labels(take, found, other)
    from skelgen.stages.labels.by_skeleton.again import label_again  # noqa: PLC0415 - it needs all stages

    found = label_again(take, label_rest(take, with_alike_apart(take, found)), task.seed, monitor)
    return found if task.n_markers is None else _most_seen(found, task.n_markers), fallen


def _searched(task: LabelTask, start: Ints, pieces: PairTables | None, at_once: int, monitor: Monitor) -> Ints:
    """Marker of each point when a skeleton has labelled all, and pieces were merged by its limbs while that helps.

    While there are far too many markers, fewer help; from then on what explains more does, so that there is an end.
    """
    take, right, too_many = task.take, dict[bytes, Ints](), True
    found = _improved(task, start, right, monitor)
    while found.max(initial=-1) >= at_once and may_be_incomplete(take, found, PIECE_SECONDS):
        if (pieces := pieces or _pieces(task)) is None:
            break
        other = _improved(task, _filled(take, _on_limbs(take, pieces, found), found), right, monitor)
        too_many = too_many and has_too_many(take, found)
        if not explains_more(take, found, other, counts_markers=too_many):
            break
        found = other
    return found


def _on_limbs(take: FollowedCloud, pieces: PairTables, found: Ints) -> Ints:
    """Marker of each point, merged limb by limb; the markers found so far say which limbs there are."""
    known = main_groups(found[pieces.tracklets.points], pieces.tracklets.tracklet_of_point)
    return _grouped(take, pieces.tracklets, merge_on_limbs(pieces, known))


def _filled(take: FollowedCloud, labels: Ints, found: Ints) -> Ints:
    """Labels of pieces, with points between them as they were found: of the markers that have most in common."""
    between = point_labels.numbered_as(labels, found)
    return point_labels.one_point_a_frame(take.cloud, np.where(labels < 0, between, labels))


def _grouped(take: FollowedCloud, tracklets: TrackletPoints, group: Ints) -> Ints:
    """Marker of each point from groups of tracklets."""
    found = np.append(group, -1).astype(np.int32)[tracklets.tracklet_of_all_points(take.cloud.n_points)]
    return _most_seen(found, MOST_KEPT * points_beside(take.cloud))


def _improved(task: LabelTask, start: Ints, right: dict[bytes, Ints], monitor: Monitor) -> Ints:
    """Marker of each point by the skeleton that a first labelling implies, put right where the whole take says so.

    Other beginnings often lead to the same labels: what was put `right` is kept. In a take of few seconds, distances at
    few moments may say that two are one marker where the whole take does not: both are tried. What joins less must
    explain more than by chance.
    """
    take, refined = task.take, refine_labels(task, start, monitor)
    completed = _completed(task, start, refined)
    key = blake2b(np.ascontiguousarray(completed).data).digest()
    found = right[key] = right[key] if key in right else put_right(take, completed)
    if not take.has_few_moments:
        return found
    sparing = replace(task, take=replace(take, joins_sparingly=True))
    spared = _completed(sparing, start, refined)
    if np.array_equal(spared, completed):
        return found
    return better_labels(
        take, found, put_right(sparing.take, spared), replace(take, by_posture=True).evidence(found)[1]
    )


def _completed(task: LabelTask, start: Ints, refined: Ints) -> Ints:
    """Marker of each point from what the skeleton says, and of points that it does not explain from the beginning."""
    return point_labels.with_unexplained(start, complete_markers(task.take, refined), task.least_alone)


def _pieces(task: LabelTask) -> PairTables | None:
    """Tracklets that are long enough to be merged limb by limb; None if these are too many, or none."""
    take, tracks = task.take, task.take.track_of_point
    usual = least_length(take.cloud.n_frames, take.rate, task.parameters)
    least = max(1, round(min(PIECE_SECONDS * take.rate, usual))) + 2 * task.parameters.trim_range
    n_pieces = int((np.bincount(np.maximum(tracks, -1) + 1)[1:] >= least).sum())
    if not 0 < n_pieces <= MOST_PIECES:
        return None
    pieces = find_tracklets(take.cloud, tracks, take.rate, replace(task.parameters, min_range=least))
    return measure_pairs(take.cloud.points, pieces, take.rate, take.spacing) if len(pieces) else None


def _most_seen(found: Ints, n_markers: int) -> Ints:
    """The `n_markers` that are seen in the most frames."""
    counts = np.bincount(found[found >= 0], minlength=1)
    rank = np.argsort(np.argsort(-counts, kind="stable"))
    return point_labels.renumbered(found, (rank < n_markers) & (counts > 0))
