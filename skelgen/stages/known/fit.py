"""A take fitted by a known skeleton: labels, poses, and a verdict on markers and body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skelgen.model import Limbs, Motion, PointCloud, Project, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats
from skelgen.progress import SILENT, Monitor
from skelgen.stages.known.labels import KnownLabels, label_known
from skelgen.stages.known.looser import looser_joints, with_free_joints
from skelgen.stages.known.moved import PlaceTest, compare_places, place_errors, span_means
from skelgen.stages.known.posing import KnownPoses, known_motion, pose_known
from skelgen.stages.known.verdict import OTHER_BODY, is_other_body, sentences
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.skeleton.parameters import SkeletonParameters

TESTED_FRAMES = 1200
"""Frames in which places of markers are compared."""


@dataclass(frozen=True, eq=False)
class KnownFit:
    """A take of a known body.

    Attributes
    ----------
    trajectories : Trajectories
        The skeleton's markers by its names, those that the take does not show unseen in all frames; then new ones.
    skeleton : Skeleton
        The known one; moved and new markers at the places that this take tells.
    motion : Motion
        Its poses.
    labels : KnownLabels
        How points became markers.
    moved : tuple of int
        Markers that sit elsewhere on their limb than in the calibrated take.
    shifts : ndarray, shape (n_markers,), mm
        By how far, of all markers of the known skeleton.
    missing : tuple of int
        Markers that no frame shows.
    sentences : tuple of str
        What the user should know.
    is_other_body : bool
        Whether more than `OTHER_BODY` of the markers that could be tested sit elsewhere.
    """

    trajectories: Trajectories
    skeleton: Skeleton
    motion: Motion
    labels: KnownLabels
    moved: tuple[int, ...]
    shifts: Floats
    missing: tuple[int, ...]
    sentences: tuple[str, ...]
    is_other_body: bool

    @property
    def limbs(self) -> Limbs:
        """Limbs of all markers."""
        n_markers = self.trajectories.n_markers
        return Limbs(self.skeleton.limb_of_marker, np.full((n_markers, n_markers), np.nan))


def fit_known(
    take: PointCloud | Trajectories,
    known: Project,
    *,
    labelling: LabelParameters | None = None,
    posing: SkeletonParameters | None = None,
    monitor: Monitor = SILENT,
) -> KnownFit:
    """Label and pose a take by the skeleton of another take of the same body.

    Parameters
    ----------
    take : PointCloud or Trajectories
        The take.
    known : Project
        The calibrated take with its skeleton and motion.
    labelling : LabelParameters, optional
        How points without names are followed.
    posing : SkeletonParameters, optional
        What is an outlier.
    monitor : Monitor
        Told of progress; may cancel.

    Raises
    ------
    InputError
        If the skeleton explains too little of the take.
    """
    names, free = known.trajectories.names, with_free_joints(known.skeleton)
    labels = label_known(take, free, names, labelling, monitor)
    monitor.begin("poses of the known skeleton")
    all_names = _all_names(names, labels)
    positions = labels.points.positions(labels.marker_of_point, len(all_names))
    test, moved, looser = _compared(known, positions[:, : len(names)], [one.marker for one in labels.moved], posing)
    skeleton = _with_new(with_free_joints(known.skeleton, looser), labels)
    shifts = test.distances
    if moved:
        skeleton = _replaced(skeleton, pose_known(skeleton, _without(positions, moved), posing), positions, moved)
        shifts = np.linalg.norm(skeleton.marker_offsets[: len(names)] - known.skeleton.marker_offsets, axis=1)
    poses = pose_known(skeleton, positions, posing, monitor)
    skeleton = _with_errors_of(skeleton, poses, positions)
    trajectories = Trajectories(positions, all_names, take.rate, take.name, take.notices)
    seen = ~np.isnan(positions[:, : len(names), 0]).all(axis=0)
    missing = tuple(int(m) for m in np.flatnonzero(~seen & (known.skeleton.limb_of_marker >= 0)))
    return KnownFit(
        trajectories=trajectories,
        skeleton=skeleton,
        motion=known_motion(skeleton, poses, positions, take.rate),
        labels=labels,
        moved=moved,
        shifts=shifts,
        missing=missing,
        sentences=sentences(labels, all_names, test, skeleton, moved, shifts, missing, looser),
        is_other_body=is_other_body(moved, test),
    )


def _all_names(names: tuple[str, ...], labels: KnownLabels) -> tuple[str, ...]:
    """Names of the skeleton's markers, then of new ones."""
    every = list(names)
    for number, one in enumerate(labels.new, start=1):
        name = one.name or f"new {number}"
        while name in every:
            name += "'"
        every.append(name)
    return tuple(every)


def _with_new(skeleton: Skeleton, labels: KnownLabels) -> Skeleton:
    """The skeleton with new markers behind its own."""
    if not labels.new:
        return skeleton
    changes: dict[str, Any] = {
        "limb_of_marker": np.append(skeleton.limb_of_marker, [one.limb for one in labels.new]),
        "marker_offsets": np.vstack([skeleton.marker_offsets, [one.place for one in labels.new]]),
        "marker_std": np.append(skeleton.marker_std, [one.spread for one in labels.new]),
    }
    if skeleton.offset_std is not None:
        unknown = [np.full(3, one.spread / np.sqrt(max(len(one.points), 1))) for one in labels.new]
        changes["offset_std"] = np.vstack([skeleton.offset_std, unknown])
    if skeleton.marker_noise is not None:
        changes["marker_noise"] = np.append(skeleton.marker_noise, [one.spread for one in labels.new])
    return replace(skeleton, **changes)


def _without(positions: Floats, markers: tuple[int, ...]) -> Floats:
    if not markers:
        return positions
    left = positions.copy()
    left[:, list(markers)] = np.nan
    return left


def _compared(
    known: Project, positions: Floats, at_first: list[int], posing: SkeletonParameters | None
) -> tuple[PlaceTest, tuple[int, ...], tuple[int, ...]]:
    """Compare the places of all markers with joints free, markers that moved taken out of the pose one by one.

    Returns the comparison, the markers that moved, and the joints that turn in more ways than before.
    """
    skeleton = with_free_joints(known.skeleton)
    calibrated = pose_known(skeleton, _some(known.trajectories.positions, TESTED_FRAMES), posing)
    before = span_means(calibrated.local(skeleton, _some(known.trajectories.positions, TESTED_FRAMES)))
    some = _some(positions, TESTED_FRAMES)
    moved, errors = list(at_first), place_errors(skeleton)
    while True:
        poses = pose_known(skeleton, _without(some, tuple(moved)), posing)
        test = compare_places(before, span_means(poses.local(skeleton, some)), errors)
        candidates = np.where(test.is_moved, test.distances, 0.0)
        candidates[moved] = 0.0
        if not candidates.any() or len(moved) >= OTHER_BODY * test.n_tested:
            return test, tuple(sorted(moved)), looser_joints(known.skeleton, calibrated, poses)
        moved.append(int(np.argmax(candidates)))


def _some(values: Floats, count: int) -> Floats:
    """At most `count` frames, spread."""
    if len(values) <= count:
        return values
    return values[np.linspace(0, len(values) - 1, count).astype(np.intp)]


def _replaced(skeleton: Skeleton, poses: KnownPoses, positions: Floats, moved: tuple[int, ...]) -> Skeleton:
    """The skeleton with moved markers at their mean places in this take."""
    local = poses.local(skeleton, positions)[:, list(moved)]
    seen: Bools = ~np.isnan(local[:, :, 0])
    count = seen.sum(axis=0)
    means = np.where(seen[..., np.newaxis], local, 0.0).sum(axis=0) / np.maximum(count, 1)[:, np.newaxis]
    offsets = skeleton.marker_offsets.copy()
    offsets[list(moved)] = np.where(count[:, np.newaxis] > 0, means, offsets[list(moved)])
    return replace(skeleton, marker_offsets=offsets)


def _with_errors_of(skeleton: Skeleton, poses: KnownPoses, positions: Floats) -> Skeleton:
    """The skeleton with the deviations of markers that this take shows."""
    error = poses.local(skeleton, positions) - skeleton.marker_offsets
    seen = ~np.isnan(error[:, :, 0])
    squares = np.where(seen[..., np.newaxis], error, 0.0) ** 2
    spread = np.sqrt(squares.sum(axis=(0, 2)) / np.maximum(3 * seen.sum(axis=0), 1))
    return replace(skeleton, marker_std=np.where(seen.any(axis=0), spread, skeleton.marker_std))
