"""Labels by the skeleton of another take, completed and put right by what this take and the other one show together.

A skeleton of another take says which marker a point is. Where markers are when this body does what it does here, only
this take tells: a skeleton is fitted to it (`model_fit`). A marker that a joint alone holds has no place by either, but
distances that it keeps. And where several markers were hidden at once, the pose of a skeleton follows what was taken
for them wrongly, and proves it right. So moments of the other take stand before this one, with markers that are known
(`merging.followed`), and all that puts labels of a take right by their distances (`merging.turns`) does so here. A
triangle with two equal sides looks the same from behind, though: part by part, labels change only if the skeleton's
pose does not speak more against it than distances speak for it. Where much changes, the skeleton is posed by the new
labels, and it begins anew, until nothing is gained.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.statistics import lengths_of
from skelgen.model import PointCloud, Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.by_skeleton.matching import GATE, gates_of, pose_and_reassign, with_whole_tracks
from skelgen.stages.labels.by_skeleton.points import FollowedPoints
from skelgen.stages.labels.by_skeleton.posing import pose_skeleton
from skelgen.stages.labels.input_checks import frame_rate
from skelgen.stages.labels.merging.continuity import LONGEST
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import MOST_EXISTENCE, fused_labels, parts_that_differ
from skelgen.stages.labels.merging.leftovers import label_leftovers, label_rest
from skelgen.stages.labels.merging.likelihood import SAMPLE_SECONDS, sample_frames
from skelgen.stages.labels.merging.turns import put_right
from skelgen.stages.labels.model_fit.refine import LabelTask, complete_markers, refine_labels
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.statistics import typical_spacing

MOST_KNOWN = 200
"""Moments of the other take that are compared with, spread over it."""

MOST_TURNS = 4
"""A guard: most takes need one or two."""

EXPECTED = 1.18
"""nats; median misfit of a point to its place, half of that of the chi-squared distribution of three coordinates."""

_NO_LABEL = -2
"""In place of a limb; -1 is none."""

UNCHANGED = 0.01
"""Part of all points; when fewer change their marker, the turns end."""


def refit_labels(
    points: FollowedPoints,
    marker_of_point: Ints,
    skeleton: Skeleton,
    calibrated: Trajectories,
    parameters: LabelParameters,
    monitor: Monitor = SILENT,
) -> Ints:
    """Improve labels by a skeleton that is fitted to this take and by distances of both takes, until nothing is gained.

    What the fitted skeleton says is added; labels are changed by it only where that explains the take better by more
    than chance: distances within the take hardly tell two markers from each other that are exchanged on a limb that
    looks the same then, the other take does.

    Parameters
    ----------
    points : FollowedPoints
        The take, without names.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point by the labels so far, -1 for none.
    skeleton : Skeleton
        Calibrated on the other take.
    calibrated : Trajectories
        The same markers in the other take.
    parameters : LabelParameters
        How to label.
    monitor : Monitor
        Receives progress, and may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point by the same numbers, -1 for none.
    """
    rate, _ = frame_rate(points.cloud, parameters)
    take = FollowedCloud(points.cloud, points.tracks.astype(np.int32), rate, typical_spacing(points.cloud))
    task, takes = LabelTask(take, parameters), _TwoTakes.of(take, calibrated, skeleton)
    before, best, evidence = marker_of_point, marker_of_point, -np.inf
    for turn in range(MOST_TURNS):
        if turn > 0:
            before, _ = pose_and_reassign(points, best, skeleton, monitor)
        whole = with_whole_tracks(points, before, calibrated.n_markers)
        fitted = _fitted(task, takes.fused(before, whole), calibrated.n_markers, monitor)
        found, more = takes.confirmed(takes.put_right(fitted), fitted, points, skeleton)
        if more <= evidence:
            break
        best, evidence = found.astype(np.intp), more
        if (best != before).sum() <= UNCHANGED * len(best):
            break
    return best


def _fitted(task: LabelTask, best: Ints, n_markers: int, monitor: Monitor) -> Ints:
    """Labels with those of a skeleton that is fitted to them, added or instead."""
    take, refined = task.take, refine_labels(task, best, monitor)
    completed = point_labels.with_unexplained(best, complete_markers(take, refined), task.least_alone)
    found = point_labels.numbered_as(best, completed)
    evidence, chance = take.evidence(best)
    filled = point_labels.filled_labels(take.cloud, [best, found], n_markers)
    for labels, least in ((filled, 0.0), (found, chance)):
        if (more := take.evidence(labels)[0]) >= evidence + least:
            best, evidence = labels, more
    return best


@dataclass(frozen=True, eq=False)
class _TwoTakes:
    """Moments of a take in which all markers are known, a pause, and behind it a take that is labelled.

    Attributes
    ----------
    both : FollowedCloud
        Both as one.
    known : ndarray of int32, shape (n_known_points,)
        Marker of each point of those moments.
    """

    both: FollowedCloud
    known: Ints

    @classmethod
    def of(cls, take: FollowedCloud, calibrated: Trajectories, skeleton: Skeleton) -> "_TwoTakes":
        """Put moments of a calibrated take before another one.

        Bodies, which may be of takes of their own, stand one after the other; those that the skeleton does not carry
        are left out.
        """
        carried = [own for limbs in skeleton.bodies if (own := np.isin(skeleton.limb_of_marker, limbs)).any()]
        are_own = np.array(carried) if len(skeleton.bodies) > 1 else np.ones((1, calibrated.n_markers), dtype=bool)
        moments = sample_frames(calibrated.rate, 0, len(are_own) * calibrated.n_frames)
        body, moment = np.divmod(moments[spread_frames(len(moments), MOST_KNOWN)], calibrated.n_frames)
        positions = np.where(are_own[body][..., np.newaxis], calibrated.positions[moment], np.nan)
        frame, known = np.nonzero(~np.isnan(positions[:, :, 0]))
        pause = np.full(int(LONGEST * take.rate) + 1, len(known))
        starts = [np.searchsorted(frame, np.arange(len(positions))), pause, take.cloud.frame_starts + len(known)]
        frame_starts = np.concatenate(starts)
        points = np.concatenate([positions[frame, known], take.cloud.points])
        cloud = PointCloud(points, frame_starts, np.arange(len(frame_starts) - 1) / take.rate)
        tracks = np.concatenate([known + take.track_of_point.max(initial=-1) + 1, take.track_of_point])
        both = replace(take, cloud=cloud, track_of_point=tracks.astype(np.int32), n_known=len(positions))
        return cls(both, known.astype(np.int32))

    def evidence(self, marker_of_point: Ints) -> float:
        """How well labels of the take explain both, where moments count by how much the posture changes [nats]."""
        return replace(self.both, by_posture=True).evidence(self._with_known(marker_of_point))[0]

    def fused(self, found: Ints, other: Ints) -> Ints:
        """Marker of each point of the take by labels found or others, part by part, whichever explain both more."""
        return fused_labels(self.both, self._with_known(found), self._with_known(other))[len(self.known) :]

    def put_right(self, marker_of_point: Ints) -> Ints:
        """Marker of each point of the take when all that distances of both takes tell is put right."""
        both = self.both
        found = put_right(both, self._with_known(marker_of_point))
        found = label_leftovers(both, found, MOST_EXISTENCE)
        unknown = np.where(np.isin(marker_of_point, self.known), -1, marker_of_point)
        return point_labels.numbered_as(self._with_known(unknown), label_rest(both, found))[len(self.known) :]

    def confirmed(self, found: Ints, before: Ints, points: FollowedPoints, skeleton: Skeleton) -> tuple[Ints, float]:
        """Labels, and their evidence; parts stay as before where a pose speaks more for it than distances against."""
        had_label, evidence = (found >= 0) & (before >= 0), self.evidence(found)
        if not (had_label & (found != before)).any():
            return found, evidence
        misfits, others = _misfits(found, points, skeleton), _misfits(before, points, skeleton)
        agreed = np.append(misfits[had_label & (found == before)], EXPECTED)
        trusted = EXPECTED / max(float(np.median(agreed)), EXPECTED)  # skin may move more than it did there
        worse = trusted * (misfits - others) / (SAMPLE_SECONDS * self.both.rate)  # frames of a moment say the same
        limb = np.append(skeleton.limb_of_marker, _NO_LABEL)
        for part in parts_that_differ(self.both, self._with_known(found), self._with_known(before)):
            own = part - len(self.known)
            limbs = np.setdiff1d(limb[np.concatenate([found[own], before[own]])], _NO_LABEL)
            beside = np.isin(limb[found], limbs) | np.isin(limb[before], limbs)
            gain = worse[beside & np.isin(points.frames, points.frames[own])].sum()
            if gain > 0.0 and had_label[own].mean() > 0.5:  # what had no label is not taken away with others
                tried = found.copy()
                tried[own] = before[own]
                if (without := self.evidence(tried)) + gain > evidence:
                    found, evidence = tried, without
        return found, evidence

    def _with_known(self, marker_of_point: Ints) -> Ints:
        return np.concatenate([self.known, marker_of_point]).astype(np.int32)


def _misfits(marker_of_point: Ints, points: FollowedPoints, skeleton: Skeleton) -> Floats:
    """How badly each point suits its marker's place by the skeleton's pose [nats]; beyond its gate it has none."""
    poses = pose_skeleton(skeleton, points.positions(marker_of_point, len(skeleton.limb_of_marker)))
    own = np.maximum(marker_of_point, 0)
    away = lengths_of(points.cloud.points - poses.markers(skeleton)[points.frames, own]) / gates_of(skeleton)[own]
    is_there = (marker_of_point >= 0) & (away < 1.0)  # NaN where no limb carries the marker
    return np.asarray(GATE**2 / 2.0 * np.where(is_there, away, 1.0) ** 2)
