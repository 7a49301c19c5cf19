"""Fill the gaps of markers from their limb, from joints, and from the frames around.

A moving frame is fitted to the predictors: the limb's other markers, or its joints where these are too few. In this
frame a marker moves only as skin does. A Gaussian process predicts that motion through the gap from the joints'
rotations, the neighbours' markers and the marker's own positions before and after. Where no predictor is seen, the same
is done in the frame of a neighbouring limb, or in the world.
"""

from __future__ import annotations

from dataclasses import replace

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
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled, Source
from skelgen.progress import SILENT, Monitor, with_progress

_FEWEST_TOGETHER = 25  # frames in which a marker and its predictors are seen, to learn from
_FEWEST_KNOWN = 10  # frames in which a marker is seen, to tell how far it strays from them
_OWN_VARIANCES = 20  # frames to fill, from which on variances are estimated for their own set of predictors


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
        Told of progress; may cancel.

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


class _Work:
    """The arrays that are being filled."""

    def __init__(self, trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> None:
        self.trajectories, self.skeleton, self.motion = trajectories, skeleton, motion
        self.own_poses = PosesByMarkers(trajectories, skeleton, motion)
        self.seen = trajectories.seen
        self.with_gaps = np.asarray(self.seen.any(axis=0) & ~self.seen.all(axis=0))
        self.positions = trajectories.positions.copy()
        self.source = np.where(self.seen, Source.MEASURED, Source.NONE).astype(np.intp)
        self.std = np.where(self.seen, 0.0, np.nan)
        self.clock = TimeCovariance(trajectories.n_frames, trajectories.rate)

    def put(self, marker: int, frames: Ints, world: Floats, std: Floats, source: Source) -> None:
        """Store filled values [mm]."""
        self.positions[frames, marker] = world
        self.std[frames, marker] = std
        self.source[frames, marker] = source


def _fill_limb(work: _Work, limb: int) -> None:
    """Fill the markers of a limb, one set of predictors at a time."""
    markers = work.skeleton.markers_of(limb)
    if not work.with_gaps[markers].any():
        return
    predictors = find_predictors(work.own_poses, limb)
    for index in np.flatnonzero(work.with_gaps[markers]).tolist():
        frames = np.flatnonzero(~work.seen[:, markers[index]])
        usable = predictors.usable[frames]
        usable[:, index] = False
        with_firm = usable[:, predictors.firm].any(axis=1)
        usable[with_firm] &= predictors.firm
        enough = predictors.posed_by(usable)
        usable[enough, predictors.n_markers :] = False
        patterns, pattern_of, counts = np.unique(usable, axis=0, return_inverse=True, return_counts=True)
        shares, which = None, (int(markers[index]), index)
        for number in np.argsort(-counts, kind="stable").tolist():
            of_pattern = pattern_of.ravel() == number
            if patterns[number].any():
                source = Source.LIMB if enough[of_pattern][0] else Source.JOINT
                chosen = np.flatnonzero(patterns[number])
                shares = _fill_from(work, which, predictors, chosen, frames[of_pattern], source, shares)


def _fill_from(
    work: _Work,
    which: tuple[int, int],
    predictors: Predictors,
    chosen: Ints,
    targets: Ints,
    source: Source,
    shares: Floats | None,
) -> Floats | None:
    """Fill one marker, given by its index in the take and on the limb; return the shares of its variance."""
    marker, index = which
    known = np.flatnonzero(predictors.usable[:, chosen].all(axis=1) & predictors.usable[:, index])
    if len(known) < _FEWEST_TOGETHER:  # too few to learn from: the place on the limb, with the marker's deviation
        base = MovingFrame(targets, chosen, *predictors.frames_through(chosen, targets))
        world = base.world(np.tile(predictors.places[index], (len(targets), 1)), np.arange(len(targets)))
        work.put(marker, targets, world, np.full(len(targets), work.skeleton.marker_std[marker]), source)
        return shares
    frames = needed_frames(known, targets, work.clock.rate)
    base = MovingFrame(frames, chosen, *predictors.frames_through(chosen, frames))
    values, std, shares = _predicted_in(work, marker, base, predictors, known, targets, shares)
    work.put(marker, targets, values, std, source)
    return shares


def _predicted_in(
    work: _Work,
    marker: int,
    base: MovingFrame,
    predictors: Predictors,
    known: Ints,
    targets: Ints,
    shares: Floats | None,
) -> tuple[Floats, Floats, Floats]:
    """World positions and deviations of a marker, learnt in a moving frame; and the shares of its variance."""
    features = features_of(work.trajectories, work.skeleton, work.motion, predictors, base)
    local = base.local(np.nan_to_num(work.trajectories.positions[base.frames, marker]))
    values, std, shares = _predicted(Series(base.frames, local, features), known, targets, work.clock, shares)
    return base.world(values, np.searchsorted(base.frames, targets)), std, shares


def _predicted(
    series: Series, known: Ints, targets: Ints, clock: TimeCovariance, shares: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """Values and deviations of a series in target frames, and the shares of its variance."""
    learnt = np.searchsorted(series.frames, learnt_frames(known))
    series = replace(series, features=series.features.scaled(learnt))
    if shares is None or len(targets) >= _OWN_VARIANCES:
        shares = fit_variances(series, learnt, clock)
    return *predict(series, known, targets, clock, shares), shares


def _fill_rest(work: _Work, marker: int) -> None:
    """Fill what nothing of the limb helps with, in the world or in the frame of the limb's reference."""
    targets, known = np.flatnonzero(work.source[:, marker] == Source.NONE), np.flatnonzero(work.seen[:, marker])
    if len(known) < _FEWEST_KNOWN or not len(targets):
        return
    frames = needed_frames(known, targets, work.clock.rate)
    series = Series(frames, np.nan_to_num(work.trajectories.positions[frames, marker]), Features())
    values, std, _ = _predicted(series, known, targets, work.clock, None)
    work.put(marker, targets, values, std, Source.INTERPOLATED)
    if work.skeleton.limb_of_marker[marker] >= 0:
        _fill_by_reference(work, marker, known, targets)


def _fill_by_reference(work: _Work, marker: int, known: Ints, targets: Ints) -> None:
    """Fill a marker in the frame of the nearest limb that its own markers pose, where this is surer."""
    limb = int(work.skeleton.limb_of_marker[marker])
    predictors = find_predictors(work.own_poses, limb)
    posed = work.motion.limb_seen[:, predictors.reference]
    known, targets = known[posed[known]], targets[posed[targets]]
    if predictors.reference == limb or len(known) < _FEWEST_TOGETHER or not len(targets):
        return
    frames = needed_frames(known, targets, work.clock.rate)
    origin = work.motion.world_from_limb[frames, predictors.reference, :3, 3]
    base = MovingFrame(frames, np.zeros(0, dtype=np.intp), predictors.guess[frames], origin)
    values, std, _ = _predicted_in(work, marker, base, predictors, known, targets, None)
    better = std < work.std[targets, marker]
    work.put(marker, targets[better], values[better], std[better], Source.INTERPOLATED)
