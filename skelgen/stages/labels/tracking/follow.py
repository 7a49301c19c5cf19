"""Follow points from frame to frame into tracks, and cut the tracks into tracklets that can be trusted.

Tracklets are parts of tracks that are long enough, and trimmed (Marker Sets in Schönauer 2007, 3.3).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from skelgen._kernels.tracking import follow_frames
from skelgen._kernels.tracks import CROWDED, Rules, TrackedPoints, Tracks
from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import blocks_of
from skelgen.stages.labels.tracking.statistics import (
    LONGEST_PAUSE,
    Innovations,
    Trial,
    find_innovations,
    point_weights,
    supposed_innovations,
    time_steps,
    typical_spacing,
)

MOST_POINTS_PER_FRAME = 10_000
"""More points than this in a frame are no markers but a scanner's surface or noise; bounds the work per frame."""

PAIRS_PER_CHUNK = 2_000_000
"""Work between two calls of the monitor, in pairs of points: milliseconds."""

TRIAL_SPANS, TRIAL_FRAMES = 10, 60
"""The trial follows so many spans of so many frames, spread over the take: a take may begin at rest."""

TRIAL_PAIRS, LEAST_TRIAL_FRAMES, LEAST_TRIAL_SPANS = 100_000_000, 10, 3
"""Pairs of points that the trial may hold, and the least frames of a span and spans: the trial is followed several
times, so frames with thousands of points must be few."""

QUANTILE, MARGIN = 0.999, 1.5
"""Where nothing is known of innovations, the reach is `MARGIN` times what all but one in a thousand stay below."""

MOST_SPACINGS = 1.0
"""Bound of the reach in typical spacings: beyond one spacing an identity is a guess."""

NEWBORN_REACH = 2.0
"""A track that was seen once has only a neighbour's slope, so its next point may lie this many times farther off."""

OPEN_SPACINGS = 20.0
"""Reach in typical spacings where no marker is ever lost: every point has its track, so there is no need for one."""

MOST_BREAKS, MOST_WIDENINGS = 2.0, 4
"""Rules that cut the trial into this many times more tracks are too narrow, and are widened, but not more often
than this. Where markers outrun their spacing the trial breaks tracks, and its innovations are not those of markers."""

SQUARES = 1e9
"""Degrees of freedom, and prior weight of the take's own scale, with which gains are practically squared distances."""

DUPLICATE_SPACINGS = 0.05
"""Of the typical spacing: two points that are nearer are one marker, seen twice. Markers of 10 mm that stand 100 mm
apart cannot come nearer to each other than 10 mm, while doubles are a millimetre or two apart."""
STAND_ALONE_SHARE = 0.5
"""A tracklet that spans half of the take stands alone, however short the take."""


def follow_points(cloud: PointCloud, parameters: LabelParameters, monitor: Monitor = SILENT) -> tuple[Ints, float]:
    """Give each point the identity of the track that it belongs to.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    parameters : LabelParameters
        How to match, predict and bridge gaps.
    monitor : Monitor
        Receives progress and a notice of frames that are left out; may cancel.

    Returns
    -------
    track_of_point : ndarray of intp, shape (n_points,)
        Identity of each point, -1 for muted points, doubles of others, and points of frames that are left out.
    reach : float
        How far [mm] a point may lie from where a track that was just seen expected it.

    Raises
    ------
    InputError
        If all frames hold more than `MOST_POINTS_PER_FRAME` points.
    """
    kept, counts = _without_crowds(cloud, monitor)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
    take = _Take(cloud.points[kept], starts, time_steps(cloud, monitor), point_weights(cloud)[kept])
    spacing = typical_spacing(cloud)
    is_open = not parameters.max_jump and bool(np.ptp(counts) == 0)
    given = OPEN_SPACINGS * spacing if is_open else parameters.max_jump
    rules = _find_rules(take, spacing, given, parameters, monitor)
    if is_open:  # all points of all frames are somebody's: who is who is left to the best assignment of whole frames
        rules = rules._replace(exchange=0.0, duplicate=0.0, tails=np.full(3, SQUARES), prior_weight=SQUARES)
    followed, n_crowded = take.follow(rules, monitor)
    if n_crowded:
        one = "frame holds too many points close together to be followed, and is left out"
        several = "frames hold too many points close together to be followed, and are left out"
        monitor.notice(counted(n_crowded, one, several))
    if len(followed) == cloud.n_points:
        return followed, rules.reach
    track_of_point = np.full(cloud.n_points, -1, dtype=followed.dtype)
    track_of_point[kept] = followed
    return track_of_point, rules.reach


def rules_of(parameters: LabelParameters, reach: float) -> Rules:
    """Return the rules of following where nothing is known of innovations.

    Parameters
    ----------
    parameters : LabelParameters
        How to match, predict and bridge gaps.
    reach : float, mm
        How far a point may lie from where a track that was just seen expected it.
    """
    supposed = supposed_innovations(reach / MARGIN, QUANTILE, parameters.max_gap + 1, NEWBORN_REACH)
    return _rules(parameters, supposed, reach, is_given=True, spacing=reach)


@dataclass(frozen=True, eq=False)
class _Take:
    """Points that are followed: where they are, where frames begin, time steps between frames, weights of points."""

    points: Floats
    starts: Ints
    steps: Ints
    weights: Floats

    def follow(self, rules: Rules, monitor: Monitor, states: Floats | None = None) -> tuple[Ints, int]:
        """Track of each point, and the number of frames left out.

        `states`, shape (n_points, 5), receives the slope and the recent error of each point's track.
        """
        counts = np.diff(self.starts)
        tracks = Tracks((rules.max_gap + 2) * int(counts.max(initial=1)))
        track_of_point = np.full(len(self.points), -1, dtype=np.int32)  # short, as an hour holds millions of points
        state = (tracks.motion, tracks.counters, tracks.totals)
        # Cut frames into spans of about equal work
        work = np.cumsum(counts.astype(np.float64) ** 2 + 1.0)
        cuts = np.flatnonzero(np.diff(work // PAIRS_PER_CHUNK)) + 1
        for first, last in itertools.pairwise(np.unique([0, *cuts, len(counts)]).tolist()):
            starts = self.starts[first : last + 1]
            span = slice(int(starts[0]), int(starts[-1]))
            found, surprise = np.empty(span.stop - span.start, dtype=np.intp), np.empty(span.stop - span.start)
            # Copies, so that the kernel is compiled once, for arrays that may be written to.
            points, weights = self.points[span].copy(), self.weights[span].copy()
            received = np.empty((0, 5)) if states is None else states[span]
            steps = self.steps[first:last]
            span_points = TrackedPoints(points, weights, found, surprise, received)
            follow_frames(span_points, starts - span.start, steps, state, rules)
            track_of_point[span] = found
            monitor.advance(last, len(counts))
        return track_of_point, int(tracks.totals[CROWDED])

    def sampled(self) -> _Take:
        """Some spans of frames, with pauses between them; the whole take if it is short."""
        n_frames = len(self.steps)
        pairs = float((np.diff(self.starts).astype(np.float64) ** 2).mean()) if n_frames else 0.0
        wanted = min(TRIAL_SPANS * TRIAL_FRAMES, int(TRIAL_PAIRS / max(pairs, 1.0)))
        wanted = max(wanted, LEAST_TRIAL_SPANS * LEAST_TRIAL_FRAMES)
        if n_frames <= wanted:
            return self
        length = max(wanted // TRIAL_SPANS, LEAST_TRIAL_FRAMES)
        begins = np.linspace(0, n_frames - length, wanted // length).astype(int)
        frames = (begins[:, np.newaxis] + np.arange(length)).ravel()
        steps = self.steps[frames]
        steps[::length] = LONGEST_PAUSE
        kept = np.concatenate([np.arange(self.starts[frame], self.starts[frame + 1]) for frame in frames])
        starts = np.concatenate([[0], np.cumsum(np.diff(self.starts)[frames])]).astype(np.intp)
        return _Take(self.points[kept], starts, steps, self.weights[kept])


def _without_crowds(cloud: PointCloud, monitor: Monitor) -> tuple[Bools | slice, Ints]:
    """Points of frames that can be followed, and how many there are in each frame."""
    counts = cloud.points_per_frame
    crowded = counts > MOST_POINTS_PER_FRAME
    if not crowded.any():
        return slice(None), counts
    frame = int(np.argmax(crowded))
    what = (
        f"frame {frame} holds {counts[frame]} points, more than the {MOST_POINTS_PER_FRAME} that can be told apart as "
        "markers"
    )
    if crowded.all():
        raise InputError(f"{what}, and so do all others; raise the tracker's threshold or remove stray points")
    monitor.notice(f"{counted(int(crowded.sum()), 'frame is', 'frames are')} left out: {what}")
    return np.repeat(~crowded, counts), np.where(crowded, 0, counts)


def _find_rules(take: _Take, spacing: float, given: float, parameters: LabelParameters, monitor: Monitor) -> Rules:
    """Find the rules of a take from how well a trial predicts.

    The trial has the `given` reach [mm], or a wide one if that is 0.
    """
    sample = take.sampled()
    supposed = rules_of(parameters, given or MOST_SPACINGS * spacing)
    wide = supposed._replace(mute=0, evidence=0.0, exchange=0.0, duplicate=DUPLICATE_SPACINGS * spacing)
    states = np.full((len(sample.points), 5), np.nan)
    track_of_point, _ = sample.follow(wide, monitor, states)
    recent_errors = states[:, 3:] * [wide.scales[0, 0] ** 2, 1.0]
    trial = Trial(sample.points, sample.starts, sample.steps, track_of_point, states[:, :3], recent_errors)
    found = find_innovations(trial, spacing, parameters.max_gap + 1)
    if found is None:
        return supposed._replace(duplicate=wide.duplicate)
    most = given or MOST_SPACINGS * spacing
    rules = _rules(parameters, found, most, is_given=given > 0, spacing=spacing)
    n_expected = MOST_BREAKS * track_of_point.max(initial=0)
    for _ in range(0 if given else MOST_WIDENINGS):
        tried, _ = sample.follow(rules._replace(mute=0, evidence=0.0, exchange=0.0), monitor)
        if tried.max(initial=0) <= n_expected:
            break
        found = found.widened()
        rules = _rules(parameters, found, most, is_given=False, spacing=spacing)
    return rules


def _rules(
    parameters: LabelParameters, innovations: Innovations, most: float, *, is_given: bool, spacing: float
) -> Rules:
    """Rules by innovations, with reaches of at most (or, if given, exactly) `most` [mm]."""
    widest = most * np.array([[1.0], [NEWBORN_REACH], [NEWBORN_REACH]])
    likely = innovations.reaches(parameters.link_evidence)[0, 1]
    return Rules(
        most if is_given else float(min(likely, most)),
        parameters.mute,
        parameters.max_gap,
        *parameters.update_gains,
        optimal=parameters.assignment == "optimal",
        evidence=parameters.link_evidence,
        tails=innovations.tails,
        exchange=float(np.exp(2.0 * parameters.link_evidence / (innovations.tails[0] + 3.0))),
        relative=innovations.relative,
        prior_weight=innovations.prior_weight,
        reaches=np.tile(widest, (1, parameters.max_gap + 2)),
        scales=innovations.scales,
        gains=innovations.odds - parameters.link_evidence,
        is_given=is_given,
        duplicate=DUPLICATE_SPACINGS * spacing,
    )


LEAST_SECONDS, LEAST_SHARE = 0.5, 0.25
"""s, and part of the take: shorter tracklets are removed. The thesis removes those below half a second; a take of less
than two seconds would lose all of them, hence the share."""


def find_tracklets(cloud: PointCloud, track_of_point: Ints, rate: float, parameters: LabelParameters) -> TrackletPoints:
    """Gather the points of each track, trim them, and drop what is too short.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `min_range` and `trim_range`.
    """
    sizes = np.bincount(np.maximum(track_of_point, -1) + 1)[1:]
    is_long = sizes >= least_length(cloud.n_frames, rate, parameters)
    # Cut `trim` frames off both ends, but not where the take itself begins or ends
    tracklets = _gathered(cloud, track_of_point, sizes, is_long)
    start = np.where(tracklets.first > 0, parameters.trim_range, 0)
    lengths = tracklets.lengths - start - np.where(tracklets.last < tracklets.n_frames - 1, parameters.trim_range, 0)
    left = lengths > 0
    return tracklets.parts((tracklets.starts[:-1] + start)[left], lengths[left])


def _gathered(cloud: PointCloud, track_of_point: Ints, sizes: Ints, wanted: Bools) -> TrackletPoints:
    """Gather the points of some tracks, of which the lengths are known; block by block, as that needs less memory."""
    starts = np.concatenate([[0], np.cumsum(sizes[wanted])]).astype(np.intp)
    points, frames = np.empty((2, starts[-1]), dtype=np.int32)
    following = np.full(len(sizes), -1, dtype=np.intp)  # where a track's next point goes
    following[wanted] = starts[:-1]
    for block in blocks_of(cloud):
        tracks = track_of_point[block.points]
        used = np.flatnonzero(np.append(wanted, False)[tracks])
        used = used[np.argsort(tracks[used], kind="stable")]
        tracks = tracks[used]
        begins = np.flatnonzero(np.diff(tracks, prepend=-1))
        counts = np.diff(begins, append=len(tracks))
        place = np.arange(len(tracks)) + np.repeat(following[tracks[begins]] - begins, counts)
        points[place], frames[place] = block.points.start + used, block.first + block.frames[used]
        following[tracks[begins]] += counts
    return TrackletPoints(points, frames, starts, cloud.n_frames)


def least_length(n_frames: int, rate: float, parameters: LabelParameters) -> int:
    """Return the number of frames below which a tracklet is removed.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `min_range`.
    """
    return parameters.min_range or max(1, int(min(LEAST_SECONDS * rate, LEAST_SHARE * n_frames)))


def stand_alone_frames(n_frames: int, rate: float, parameters: LabelParameters) -> float:
    """Number of frames from which a tracklet needs no partner to be trusted.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    rate : float, Hz
        Frame rate.
    parameters : LabelParameters
        `stand_alone`.
    """
    return min(parameters.stand_alone * rate, STAND_ALONE_SHARE * n_frames)
