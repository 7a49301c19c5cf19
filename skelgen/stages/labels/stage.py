"""From unlabelled points to labelled markers (seed, 3.3 and 4.2).

Points are followed from frame to frame into Marker Sets; a marker that was lost and found again has several, and those
that meet when the poses in which they are seen are aligned are joined (Kirk, O'Brien and Forsyth 2005).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Trajectories
from skelgen.model.arrays import Bools, Floats
from skelgen.model.identities import Identities
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.articulated import marker_names, refine_labels
from skelgen.stages.labels.by_hand import fix_points
from skelgen.stages.labels.follow import follow_points, typical_spacing
from skelgen.stages.labels.grouping import group_sets
from skelgen.stages.labels.judged import SEED_METHOD, Origin, labelling_of_cloud, markers_of_points
from skelgen.stages.labels.marker_sets import MarkerSets, count_markers, find_marker_sets, least_length
from skelgen.stages.labels.obedience import obey
from skelgen.stages.labels.oddities import guessed_identities, odd_times, too_few_wanted
from skelgen.stages.labels.parameters import LabelParameters

# Coordinates beyond a thousand kilometres are a wrong unit or a broken file, and their squares lose the millimetre.
_LARGEST_COORDINATE = 1e9
# Bounds time and memory, which grow with the square of the number of sets.
_MOST_SETS = 3000
# A set that spans half of the take stands alone, however short the take.
_STAND_ALONE_SHARE = 0.5


def label_markers(
    cloud: PointCloud,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    identities: Identities | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Trajectories:
    """Find the identity of each point over the whole take.

    Parameters
    ----------
    cloud : PointCloud
        The unlabelled take.
    parameters : LabelParameters
        How to label.
    n_markers : int or None
        Number of physical markers; None takes the largest number of Marker Sets seen at once.
    identities : Identities or None
        What the user states of some points; the result obeys it.
    seed : int
        Seed of the test jitter and of spectral clustering.
    monitor : Monitor
        Hears of progress and notices, and may cancel.

    Returns
    -------
    Trajectories
        Markers ``M000``, ``M001``, ... in the order in which they are first seen; NaN where unseen. Points that belong
        to no marker are left out, and a notice says how many.

    Raises
    ------
    InputError
        If there are no points, too many in a frame, impossible coordinates, or no marker that is seen long enough.
    """
    return _labelled(cloud, parameters, n_markers, identities, seed, monitor)[0]


def label_and_judge(
    cloud: PointCloud,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    identities: Identities | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> tuple[Trajectories, Labelling]:
    """Do as `label_markers` does, and tell how sure the identities are."""
    trajectories, origin = _labelled(cloud, parameters, n_markers, identities, seed, monitor)
    return trajectories, labelling_of_cloud(cloud, trajectories, origin)


def _labelled(
    cloud: PointCloud,
    parameters: LabelParameters,
    n_markers: int | None,
    identities: Identities | None,
    seed: int,
    monitor: Monitor,
) -> tuple[Trajectories, Origin]:
    _check(cloud, n_markers)
    cloud = _jittered(cloud, parameters, seed)
    rate, notices = _rate(cloud, parameters)
    monitor.begin("following points")
    owner, _ = follow_points(cloud, parameters, monitor)
    fixed = fix_points(cloud, owner, identities) if identities else None
    owner = fixed.owner if fixed else owner
    sets = _longest(find_marker_sets(cloud, owner, rate, parameters))
    if len(sets) == 0:
        raise InputError(
            f"no point can be followed for {least_length(cloud.n_frames, rate, parameters)} frames, so there is no "
            "marker; lower min_range, raise max_jump, or check the recording"
        )
    at_once = count_markers(sets, least_length(cloud.n_frames, rate, parameters))
    wanted = n_markers or at_once
    limit = parameters.remove_distance or typical_spacing(cloud)
    group, nearest = group_sets(cloud.points, sets, wanted, limit, parameters, seed, monitor)
    markers = sets.merged(group)
    stand_alone = min(parameters.stand_alone * rate, _STAND_ALONE_SHARE * cloud.n_frames)
    kept = _chosen(markers, (markers.lengths >= stand_alone) | (nearest <= limit), wanted)
    result = markers.chosen(kept)
    trajectories = Trajectories(_positions(cloud, result), marker_names(len(result)), rate, cloud.name)
    stated = fixed.who >= 0 if fixed else None
    by_sets = markers_of_points(result, cloud.n_points) if parameters.method != SEED_METHOD else None
    origin = Origin(cloud, owner, by_sets, stated)
    if parameters.method == "rigidity":
        trajectories = refine_labels(
            cloud, owner, trajectories, parameters, n_markers=n_markers, fixed=fixed, seed=seed, monitor=monitor
        )
    if fixed is not None:
        positions, names = obey(cloud, trajectories.positions, fixed, n_markers=n_markers)
        trajectories = Trajectories(positions, names, rate, cloud.name)
        notices += (f"{len(identities.entries)} identities stated by hand are obeyed",) if identities else ()
    notices += _losses(cloud, trajectories, int((~kept)[group].sum()), n_markers)
    notices += too_few_wanted(n_markers, at_once) + guessed_identities(trajectories, typical_spacing(cloud))
    for sentence in notices:
        monitor.notice(sentence)
    return dataclasses.replace(trajectories, notices=cloud.notices + notices), origin


def _check(cloud: PointCloud, n_markers: int | None) -> None:
    """Refuse what cannot be labelled."""
    if n_markers is not None and n_markers < 1:
        raise InputError(f"{n_markers} markers were asked for; there must be at least 1")
    if cloud.n_points == 0:
        raise InputError(f"{cloud.name or 'the take'} holds no points in its {cloud.n_frames} frames")
    largest = float(np.abs(cloud.points).max())
    if largest > _LARGEST_COORDINATE:
        raise InputError(f"a coordinate is {largest:g} mm, more than a thousand kilometres; check the unit of the file")


def _jittered(cloud: PointCloud, parameters: LabelParameters, seed: int) -> PointCloud:
    """Add the test jitter, if asked for."""
    if not parameters.add_random:
        return cloud
    largest = parameters.max_jitter
    jitter = np.random.default_rng(seed).uniform(-largest, largest, cloud.points.shape)
    return dataclasses.replace(cloud, points=cloud.points + jitter)


def _rate(cloud: PointCloud, parameters: LabelParameters) -> tuple[float, tuple[str, ...]]:
    """Frame rate [Hz], and what to say about it."""
    if cloud.n_frames < 2 or cloud.times[-1] > cloud.times[0]:
        return cloud.rate, odd_times(cloud)
    rate = 1000.0 / parameters.time_one_frame
    return rate, (f"the time stamps do not rise; {parameters.time_one_frame} ms a frame are assumed",)


def _longest(sets: MarkerSets) -> MarkerSets:
    """Bound the number of sets by leaving the shortest out."""
    order = np.argsort(-sets.lengths, kind="stable")
    keep = np.zeros(len(sets), dtype=np.bool_)
    keep[order[:_MOST_SETS]] = True
    return sets.chosen(keep)


def _chosen(markers: MarkerSets, trusted: Bools, wanted: int) -> Bools:
    """The `wanted` markers that are seen longest, after all trusted ones."""
    keep = np.zeros(len(markers), dtype=np.bool_)
    keep[np.lexsort((-markers.lengths, ~trusted))[:wanted]] = True
    return keep


def _positions(cloud: PointCloud, markers: MarkerSets) -> Floats:
    """Positions [mm] of markers in the order in which they are first seen, shape (n_frames, n_markers, 3)."""
    rank = np.empty(len(markers), dtype=np.intp)
    rank[np.argsort(markers.points[markers.starts[:-1]])] = np.arange(len(markers))
    positions = np.full((cloud.n_frames, len(markers), 3), np.nan)
    positions[markers.frames, rank[markers.set_of_point]] = cloud.points[markers.points]
    return positions


def _losses(cloud: PointCloud, markers: Trajectories, n_removed: int, n_markers: int | None) -> tuple[str, ...]:
    """Say what was left out."""
    notices = []
    left_out = cloud.n_points - int(markers.seen.sum())
    if left_out:
        share = 100.0 * left_out / cloud.n_points
        notices.append(
            f"{left_out} of {cloud.n_points} points ({share:.1f} %) belong to no marker and are left out, among them "
            f"{n_removed} Marker Sets that were long enough"
        )
    if n_markers is not None and markers.n_markers < n_markers:
        notices.append(f"{n_markers} markers were asked for, but only {markers.n_markers} can be told apart")
    return tuple(notices)
