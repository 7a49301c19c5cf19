"""From unlabelled points to labelled markers (seed, 3.3 and 4.2).

Points are followed from frame to frame into Marker Sets; a marker that was lost and found again has several. They are
joined by rigidity (`by_rigidity`), or as the seed does (`by_sets`).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.corrections import Identities
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.confidence.label_quality import Origin, history_of, labelling_of_cloud
from skelgen.stages.labels.input_checks import guessed_identities, odd_times, too_few_wanted
from skelgen.stages.labels.merging.windows import MOST_KEPT, join_sets
from skelgen.stages.labels.model_fit.refine import refine_labels
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import (
    all_positions,
    counts_together,
    in_order_of_appearance,
    marker_names,
    renumbered,
)
from skelgen.stages.labels.tracking.follow import follow_points, typical_spacing
from skelgen.stages.labels.tracking.tracklets import (
    MarkerSets,
    count_markers,
    find_marker_sets,
    least_length,
    stand_alone_frames,
)
from skelgen.stages.labels.user_labels.constraints import obey
from skelgen.stages.labels.user_labels.statements import Fixed, fix_points

# Coordinates beyond a thousand kilometres are a wrong unit or a broken file, and their squares lose the millimetre.
_LARGEST_COORDINATE = 1e9
MOST_COMPARED = 600
"""Marker Sets up to which the seed's method is tried beside: its time grows with their square."""


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
        Number of physical markers; None finds it.
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
    """Do as `label_markers` does, and tell how sure the identities are and what the seed's method would have given."""
    trajectories, origin, sets = _labelled(cloud, parameters, n_markers, identities, seed, monitor)
    if parameters.method != "sets" and parameters.compare and len(sets) <= MOST_COMPARED:
        from skelgen.stages.classic.marker_sets import markers_by_sets  # noqa: PLC0415 - only where it is asked for

        theirs, _ = markers_by_sets(
            origin.cloud, sets, trajectories.rate, parameters, n_markers=n_markers, seed=seed, monitor=monitor
        )
        origin = dataclasses.replace(origin, by_sets=theirs)
    history = history_of(origin, trajectories.n_markers)
    del sets, origin  # of long takes they are large
    return trajectories, labelling_of_cloud(trajectories, history)


def _labelled(
    cloud: PointCloud,
    parameters: LabelParameters,
    n_markers: int | None,
    identities: Identities | None,
    seed: int,
    monitor: Monitor,
) -> tuple[Trajectories, Origin, MarkerSets]:
    _check(cloud, n_markers)
    cloud = _jittered(cloud, parameters, seed)
    rate, notices = _rate(cloud, parameters)
    monitor.begin("following points")
    owner, _ = follow_points(cloud, parameters, monitor)
    fixed = fix_points(cloud, owner, identities) if identities else None
    owner = fixed.owner if fixed else owner
    sets = _sets(cloud, owner, rate, parameters)
    n_removed = 0
    if parameters.method == "sets":
        from skelgen.stages.classic.marker_sets import markers_by_sets  # noqa: PLC0415 - only where it is asked for

        found, n_removed = markers_by_sets(
            cloud, sets, rate, parameters, n_markers=n_markers, seed=seed, monitor=monitor
        )
    else:
        found = markers_by_rigidity(
            cloud, owner, sets, rate, parameters, n_markers=n_markers, fixed=fixed, seed=seed, monitor=monitor
        )
    found = in_order_of_appearance(found)
    names = marker_names(int(found.max(initial=-1)) + 1)
    if identities and fixed is not None:
        found, names = obey(cloud, found, fixed, n_markers=n_markers)
        notices += (f"{len(identities.entries)} identities stated by hand are obeyed",)
    at_once = count_markers(sets, least_length(cloud.n_frames, rate, parameters))
    positions = all_positions(cloud, found, len(names))
    notices += _losses(found, len(names), n_removed, n_markers) + too_few_wanted(n_markers, at_once)
    notices += guessed_identities(positions, typical_spacing(cloud))
    for sentence in notices:
        monitor.notice(sentence)
    trajectories = Trajectories(positions, names, rate, cloud.name, cloud.notices + notices)
    return trajectories, Origin(cloud, owner, found, None, fixed.who >= 0 if fixed else None), sets


def _sets(cloud: PointCloud, owner: Ints, rate: float, parameters: LabelParameters) -> MarkerSets:
    """Marker Sets that are long enough; there must be one."""
    sets = find_marker_sets(cloud, owner, rate, parameters)
    if len(sets) == 0:
        raise InputError(
            f"no point can be followed for {least_length(cloud.n_frames, rate, parameters)} frames, so there is no "
            "marker; lower min_range, raise max_jump, or check the recording"
        )
    return sets


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


def _losses(found: Ints, n_found: int, n_removed: int, n_markers: int | None) -> tuple[str, ...]:
    """Say what was left out."""
    notices = []
    left_out = int((found < 0).sum())
    if left_out:
        sentence = (
            f"{left_out} of {len(found)} points ({100.0 * left_out / len(found):.1f} %) belong to no marker and are "
            "left out"
        )
        notices.append(
            f"{sentence}, among them {n_removed} Marker Sets that were long enough" if n_removed else sentence
        )
    if n_markers is not None and n_found < n_markers:
        notices.append(f"{n_markers} markers were asked for, but only {n_found} can be told apart")
    return tuple(notices)


STRANGER_SHARE = 0.1
"""Of all frames in which a marker that no limb carries must be seen."""

FREE_SHARE = 0.8
"""Sets of which the skeleton explains less than the rest are markers that it does not know."""


def markers_by_rigidity(
    cloud: PointCloud,
    owner: Ints,
    sets: MarkerSets,
    rate: float,
    parameters: LabelParameters,
    *,
    n_markers: int | None = None,
    fixed: Fixed | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Ints:
    """Find the marker of each point.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    sets : MarkerSets
        What the tracks that are long enough gathered.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        Their `rounds` and `stand_alone`.
    n_markers : int or None
        Number of markers, if the user knows it.
    fixed : Fixed or None
        What the user states of some points.
    seed : int
        Seed of the stages that build the model.
    monitor : Monitor
        Hears of progress and may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    monitor.begin("joining Marker Sets")
    group = join_sets(cloud.points, sets, rate, typical_spacing(cloud), monitor)
    by_distances = np.append(group, -1).astype(np.int32)[sets.set_of_points(cloud.n_points)]
    by_distances = _most_seen(by_distances, MOST_KEPT * max(1, int(np.median(cloud.points_per_frame))))
    found = refine_labels(
        cloud,
        owner,
        by_distances,
        rate,
        parameters,
        n_markers=n_markers,
        fixed=fixed,
        seed=seed,
        monitor=monitor,
    )
    least = max(stand_alone_frames(cloud.n_frames, rate, parameters), STRANGER_SHARE * cloud.n_frames)
    found = _with_strangers(found, by_distances, least)
    return found if n_markers is None else _most_seen(found, n_markers)


def _with_strangers(found: Ints, by_distances: Ints, least: float) -> Ints:
    """Add markers that distances found, were seen for long, and of which the skeleton explains next to nothing."""
    together = counts_together(by_distances, found)[1:]
    free = together[:, 0]
    strangers = (free >= least) & (free >= FREE_SHARE * together.sum(axis=1))
    number = np.full(len(free) + 1, -1, dtype=np.int32)
    number[:-1][strangers] = found.max(initial=-1) + 1 + np.arange(int(strangers.sum()))
    return np.where(found < 0, number[by_distances], found)


def _most_seen(found: Ints, n_markers: int) -> Ints:
    """The `n_markers` that are seen in the most frames."""
    counts = np.bincount(found[found >= 0], minlength=1)
    keep = np.zeros(len(counts), dtype=bool)
    keep[np.argsort(-counts, kind="stable")[:n_markers]] = True
    return renumbered(found, keep & (counts > 0))
