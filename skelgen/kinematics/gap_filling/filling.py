"""Fill the gaps of markers from their limb, from joints, and from the frames around.

A moving frame is fitted to the predictors: the limb's other markers, or its joints where these are too few. In this
frame a marker moves only as skin does. A Gaussian process predicts that motion through the gap from the joints'
rotations, the neighbours' markers and the marker's own positions before and after. Where no predictor is seen, the same
is done in the frame of a neighbouring limb, or in the world.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.gap_filling.gaussian_process import (
    Features,
    Series,
    TimeCovariance,
    fit_variances,
    learnt_frames,
    needed_frames,
    predict,
)
from skelgen.kinematics.gap_filling.predictors import (
    MovingFrame,
    PosesByMarkers,
    Predictors,
    features_of,
    find_predictors,
)
from skelgen.kinematics.gap_filling.single_gaps import fill_marker
from skelgen.model import Motion, Project, Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.corrections import BY_SKELETON, Correction, named_marker
from skelgen.model.filled import Filled, PositionSource
from skelgen.progress import SILENT, Monitor, with_progress

_FEWEST_TOGETHER = 25  # frames in which a marker and its predictors are seen, to learn from
_FEWEST_KNOWN = 10  # frames in which a marker is seen, to tell how far it strays from them
_OWN_VARIANCES = 20  # frames to fill, from which on variances are estimated for each set of predictors


def fill_gaps(trajectories: Trajectories, skeleton: Skeleton, motion: Motion, monitor: Monitor = SILENT) -> Filled:
    """Fill the gaps of every marker.

    Parameters
    ----------
    trajectories : Trajectories
        The markers that the skeleton was fitted to.
    skeleton : Skeleton
        Limbs and joints.
    motion : Motion
        Their poses in every frame.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    Filled
        Measured positions as they are, filled ones with source and standard deviation. Markers that are never seen
        stay empty, and those seen in fewer than ten frames where nothing of their limb is seen.

    Raises
    ------
    InputError
        If trajectories, skeleton and motion do not belong together.
    """
    if motion.marker_positions.shape != trajectories.positions.shape:
        raise InputError(
            f"the motion has {motion.marker_positions.shape[:2]} frames and markers and the take "
            f"{trajectories.positions.shape[:2]}: give the motion that was fitted to this take"
        )
    work = _Work(trajectories, skeleton, motion)
    monitor.begin("filling gaps")
    for limb in with_progress(range(skeleton.n_limbs), skeleton.n_limbs, monitor, every=1):
        _fill_limb(work, limb)
    for marker in np.flatnonzero(work.with_gaps).tolist():
        _fill_rest(work, marker)
    return Filled(trajectories, work.positions, work.source, work.std)


@dataclass(frozen=True, eq=False)
class _Gaps:
    """One marker, the frames from which its motion is learnt, and the frames that are filled."""

    marker: int
    known: Ints
    targets: Ints


class _Work:
    """The arrays that are being filled."""

    def __init__(self, trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> None:
        self.trajectories, self.skeleton, self.motion = trajectories, skeleton, motion
        self.poses = PosesByMarkers(trajectories, skeleton, motion)
        self.seen = trajectories.seen
        self.with_gaps = np.asarray(self.seen.any(axis=0) & ~self.seen.all(axis=0))
        self.positions = trajectories.positions.copy()
        self.source = np.where(self.seen, PositionSource.MEASURED, PositionSource.NONE).astype(np.intp)
        self.std = np.where(self.seen, 0.0, np.nan)
        self.time_covariance = TimeCovariance(trajectories.n_frames, trajectories.rate)

    def store(self, gaps: _Gaps, world: Floats, std: Floats, source: PositionSource) -> None:
        """Store filled positions [mm] and their deviations [mm]."""
        self.positions[gaps.targets, gaps.marker] = world
        self.std[gaps.targets, gaps.marker] = std
        self.source[gaps.targets, gaps.marker] = source

    def needed_frames(self, gaps: _Gaps) -> Ints:
        """Frames that the prediction of gaps rests on."""
        return needed_frames(gaps.known, gaps.targets, self.trajectories.rate)


def _fill_limb(work: _Work, limb: int) -> None:
    """Fill the markers of a limb, one set of predictors at a time."""
    markers = work.skeleton.markers_of(limb)
    if not work.with_gaps[markers].any():
        return
    predictors = find_predictors(work.poses, limb)
    for index in np.flatnonzero(work.with_gaps[markers]).tolist():
        frames = np.flatnonzero(~work.seen[:, markers[index]])
        usable = predictors.usable[frames]
        usable[:, index] = False
        with_independent = usable[:, predictors.is_independent].any(axis=1)
        usable[with_independent] &= predictors.is_independent
        enough = predictors.fix_pose(usable)
        usable[enough, predictors.n_markers :] = False
        patterns, pattern_of, counts = np.unique(usable, axis=0, return_inverse=True, return_counts=True)
        variances = None
        for number in np.argsort(-counts, kind="stable").tolist():
            of_pattern = pattern_of.ravel() == number
            if patterns[number].any():
                source = PositionSource.LIMB if enough[of_pattern][0] else PositionSource.JOINT
                chosen = np.flatnonzero(patterns[number])
                known = np.flatnonzero(predictors.usable[:, chosen].all(axis=1) & predictors.usable[:, index])
                gaps = _Gaps(int(markers[index]), known, frames[of_pattern])
                if len(known) < _FEWEST_TOGETHER:
                    world = predictors.moving_frame(chosen, gaps.targets).world(predictors.offsets[index])
                    work.store(gaps, world, np.full(len(world), work.skeleton.marker_std[gaps.marker]), source)
                    continue
                frame = predictors.moving_frame(chosen, work.needed_frames(gaps))
                values, std, variances = _predicted_in(work, gaps, frame, predictors, variances)
                work.store(gaps, values, std, source)


def _predicted_in(
    work: _Work, gaps: _Gaps, frame: MovingFrame, predictors: Predictors, variances: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """World positions and deviations of a marker, learnt in a moving frame; and the variances of the process."""
    features = features_of(work.poses, predictors, frame)
    local = frame.local(np.nan_to_num(work.trajectories.positions[frame.frames, gaps.marker]))
    values, std, variances = _predicted(work, gaps, Series(frame.frames, local, features), variances)
    return frame.at(np.searchsorted(frame.frames, gaps.targets)).world(values), std, variances


def _predicted(work: _Work, gaps: _Gaps, series: Series, variances: Floats | None) -> tuple[Floats, Floats, Floats]:
    """Values and deviations of a series in the frames to fill, and the variances of the process."""
    learnt = np.searchsorted(series.frames, learnt_frames(gaps.known))
    series = replace(series, features=series.features.scaled(learnt))
    if variances is None or len(gaps.targets) >= _OWN_VARIANCES:
        variances = fit_variances(series, learnt, work.time_covariance)
    return *predict(series, gaps.known, gaps.targets, work.time_covariance, variances), variances


def _fill_rest(work: _Work, marker: int) -> None:
    """Fill frames that show nothing of the limb, in the world or in the frame of the nearest limb with a pose."""
    targets, known = np.flatnonzero(work.source[:, marker] == PositionSource.NONE), np.flatnonzero(work.seen[:, marker])
    if len(known) < _FEWEST_KNOWN or not len(targets):
        return
    gaps = _Gaps(marker, known, targets)
    frames = work.needed_frames(gaps)
    series = Series(frames, np.nan_to_num(work.trajectories.positions[frames, marker]), Features())
    values, std, _ = _predicted(work, gaps, series, None)
    work.store(gaps, values, std, PositionSource.INTERPOLATED)
    if work.skeleton.limb_of_marker[marker] >= 0:
        _fill_by_reference(work, gaps)


def _fill_by_reference(work: _Work, gaps: _Gaps) -> None:
    """Fill a marker in the frame of the nearest limb that has a pose, where this is surer."""
    limb = int(work.skeleton.limb_of_marker[gaps.marker])
    predictors = find_predictors(work.poses, limb)
    posed = work.motion.limb_seen[:, predictors.reference]
    gaps = _Gaps(gaps.marker, gaps.known[posed[gaps.known]], gaps.targets[posed[gaps.targets]])
    if predictors.reference == limb or len(gaps.known) < _FEWEST_TOGETHER or not len(gaps.targets):
        return
    frames = work.needed_frames(gaps)
    origin = work.motion.world_from_limb[frames, predictors.reference, :3, 3]
    frame = MovingFrame(frames, np.zeros(0, dtype=np.intp), predictors.default_rotations[frames], origin)
    values, std, _ = _predicted_in(work, gaps, frame, predictors, None)
    better = std < work.std[gaps.targets, gaps.marker]
    surer = replace(gaps, targets=gaps.targets[better])
    work.store(surer, values[better], std[better], PositionSource.INTERPOLATED)


_SOURCES = {"rigid": PositionSource.LIMB, "spline": PositionSource.INTERPOLATED, "pattern": PositionSource.PATTERN}


def fill_project(project: Project, monitor: Monitor = SILENT) -> Filled:
    """Fill the gaps of all markers.

    Parameters
    ----------
    project : Project
        With a skeleton, or with corrections that state how gaps are filled; without a skeleton no other gaps are
        filled.
    monitor : Monitor
        Receives progress, and a notice of each correction that is passed over; may cancel.

    Raises
    ------
    MissingResultError
        If the project has neither.
    """
    stated = [correction for correction in project.corrections if correction.kind == "fill"]
    if project.has("skeleton") or not stated:
        by_skeleton = fill_gaps(project.trajectories, project.skeleton, project.motion, monitor)
    else:
        by_skeleton = unfilled(project.trajectories)
    return with_stated(by_skeleton, stated, monitor)


def unfilled(trajectories: Trajectories) -> Filled:
    """Return markers of which no gap is filled."""
    seen = trajectories.seen
    source = np.where(seen, PositionSource.MEASURED, PositionSource.NONE).astype(np.intp)
    return Filled(trajectories, trajectories.positions, source, np.where(seen, 0.0, np.nan))


def with_stated(by_skeleton: Filled, stated: list[Correction], monitor: Monitor = SILENT) -> Filled:
    """Return filled markers with the gaps filled in other ways that the user states, the last statement first.

    Parameters
    ----------
    by_skeleton : Filled
        What the skeleton fills.
    stated : list of Correction
        Of the kind ``fill``; those whose markers are there no more are passed over.
    monitor : Monitor
        Receives a notice of each.
    """
    measured = by_skeleton.measured
    positions, source, std = by_skeleton.positions.copy(), by_skeleton.source.copy(), by_skeleton.std.copy()

    def row(frame: int) -> Floats:
        return measured.positions[frame] if frame < measured.n_frames else np.empty((0, 3))

    for correction in stated:
        try:
            marker, *donors = (
                named_marker(correction, which, measured.names, row) for which in range(len(correction.names))
            )
        except InputError as error:
            monitor.notice(str(error))
            continue
        first = correction.first_frame or 0
        last = measured.n_frames - 1 if correction.last_frame is None else correction.last_frame
        if correction.value == BY_SKELETON:
            frames = np.arange(first, last + 1)[~measured.seen[first : last + 1, marker]]
            found = (array[frames, marker] for array in (by_skeleton.positions, by_skeleton.source, by_skeleton.std))
            positions[frames, marker], source[frames, marker], std[frames, marker] = found
        else:
            fill = fill_marker(measured, marker, (first, last), correction.value, donors)
            positions[fill.frames, marker], std[fill.frames, marker] = fill.positions, fill.std
            source[fill.frames, marker] = _SOURCES[correction.value]
    return Filled(measured, positions, source, std)
