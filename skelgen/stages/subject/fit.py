"""A take fitted by a known skeleton: labels, poses, and a verdict on markers and body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skelgen.model import Limbs, Motion, PointCloud, Project, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import LabelParameters
from skelgen.stages.skeleton import SkeletonParameters
from skelgen.stages.subject.changes import (
    LEVEL,
    PlaceTest,
    compare_places,
    looser_joints,
    place_errors,
    span_means,
    with_free_joints,
)
from skelgen.stages.subject.labels import KnownLabels, label_known
from skelgen.stages.subject.posing import KnownPoses, known_motion, pose_known

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


OTHER_BODY = 0.5
"""Part of the markers that sit elsewhere from which on it is not the markers that moved, but the body that differs."""

MANY_LIMBS = 0.25
"""Part of the limbs with moved markers from which on the user is told that the body may be another one."""


def is_other_body(moved: tuple[int, ...], test: PlaceTest) -> bool:
    """Return whether so many markers sit elsewhere that these are not the body and the markers of the skeleton."""
    return bool(moved) and len(moved) >= OTHER_BODY * test.n_tested


def sentences(
    labels: KnownLabels,
    names: tuple[str, ...],
    test: PlaceTest,
    skeleton: Skeleton,
    moved: tuple[int, ...],
    shifts: Floats,
    missing: tuple[int, ...],
    looser: tuple[int, ...],
) -> tuple[str, ...]:
    """Say in whole sentences how a take differs from what its skeleton knows.

    Parameters
    ----------
    labels : KnownLabels
        How points became markers.
    names : tuple of str
        Of the skeleton's markers, then of new ones.
    test : PlaceTest
        Where markers sit.
    skeleton : Skeleton
        With the limbs of all markers.
    moved, missing : tuple of int
        Markers that sit elsewhere, and that no frame shows.
    shifts : ndarray, shape (n_known,), mm
        How far markers are from where they sat.
    looser : tuple of int
        Joints that turn in more ways than before.
    """
    how = "its names and the known skeleton" if labels.by_name else "the known skeleton"
    said = [f"labelled by {how}, which explains {100 * labels.explained:.1f} % of the positions that it could"]
    if is_other_body(moved, test):
        said.append(
            f"{len(moved)} of {test.n_tested} markers sit elsewhere on their limbs than in the calibrated take "
            f"(Hotelling's test, all together at a level of {LEVEL:g}): this is another body, or the markers were put "
            "on anew; calibrate this take by itself"
        )
    elif moved:
        parts = ", ".join(f"{names[m]} by {shifts[m]:.1f} mm" for m in sorted(moved, key=lambda m: -shifts[m]))
        said.append(f"moved on their limbs since the calibrated take, and placed anew: {parts}")
        limbs = skeleton.limb_of_marker
        n_limbs, n_touched = len(np.unique(limbs[limbs >= 0])), len(np.unique(limbs[list(moved)]))
        if n_touched > MANY_LIMBS * n_limbs:
            said.append(
                f"that concerns {n_touched} of {n_limbs} limbs: unless so many markers can have slipped, this is "
                "another body"
            )
    if missing:
        said.append(f"markers of the skeleton that no frame shows: {', '.join(names[m] for m in missing)}")
    if looser:
        joints = [skeleton.joints[index] for index in looser]
        parts = ", ".join(f"limb{joint.parent}-limb{joint.child}" for joint in joints)
        said.append(f"joints that turn in more ways than the calibrated take showed, balls here: {parts}")
    if labels.new:
        parts = ", ".join(
            f"{name} on limb {one.limb}" if one.limb >= 0 else f"{name} on no limb"
            for name, one in zip(names[len(shifts) :], labels.new, strict=True)
        )
        said.append(f"markers that the skeleton does not know: {parts}")
    n_left = int((labels.marker_of_point < 0).sum())
    if n_left:
        said.append(
            f"{n_left} points ({100 * n_left / len(labels.marker_of_point):.1f} %) are no marker's and are left out"
        )
    said += _renamed(labels, names)
    return tuple(said)


def _renamed(labels: KnownLabels, names: tuple[str, ...]) -> list[str]:
    """Which markers of the take have other names in the skeleton."""
    given = labels.points.names
    if not given:
        return []
    owned = labels.marker_of_point >= 0
    counts = np.zeros((len(given), len(names)), dtype=np.intp)
    np.add.at(counts, (labels.points.tracks[owned], labels.marker_of_point[owned]), 1)
    usual: Ints = counts.argmax(axis=1)
    pairs = [
        f"{name} is {names[usual[track]]}"
        for track, name in enumerate(given)
        if counts[track].any() and names[usual[track]] != name
    ]
    return [f"named otherwise than in the skeleton: {', '.join(pairs)}"] if pairs else []
