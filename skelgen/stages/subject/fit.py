"""A subject fitted to another take: labels, poses, and what differs from the calibrated take."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.statistics import spread_of_markers
from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.model import Limbs, Motion, PointCloud, Project, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, evenly_spread
from skelgen.model.corrections import Correction
from skelgen.model.limbs import body_and_limb, names_of_bodies
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.labels import (
    CorrectedLabels,
    LabelParameters,
    SkeletonPoses,
    apply_corrections,
    pose_skeleton,
    with_free_joints,
)
from skelgen.stages.skeleton import SkeletonParameters
from skelgen.stages.subject import changes as take_changes
from skelgen.stages.subject.labels import SubjectLabels, label_by_subject
from skelgen.stages.subject.points import PlacedTrack

TESTED_FRAMES = 1200
"""Frames in which places of markers are compared."""

OTHER_SUBJECT = 0.5
"""Part of the tested markers: if so many sit elsewhere, it is not the markers that moved, but another subject."""

BLOCK_FRAMES = 8_192
"""Frames whose deviations are found at once: a take of forty markers needs some 10 KB for each."""

MANY_LIMBS = 0.25
"""Part of the limbs: if more have moved markers, a notice says that this may be another subject."""


@dataclass(frozen=True, eq=False)
class SubjectFit:
    """A take of a subject.

    Attributes
    ----------
    trajectories : Trajectories
        The skeleton's markers by its names, those that the take does not show unseen in all frames; then new ones.
    skeleton : Skeleton
        The subject's; moved and new markers at their places in this take.
    motion : Motion
        Its poses.
    labels : SubjectLabels
        How points became markers.
    found : Trajectories
        The markers before the user's corrections.
    edits : CorrectedLabels
        What the corrections changed.
    moved : tuple of int
        Markers that sit elsewhere on their limb than in the calibrated take.
    shifts : ndarray, shape (n_markers,), mm
        By how far, of all markers of the subject.
    missing : tuple of int
        Markers that no frame shows.
    notices : tuple of str
        How the take differs from the calibrated one, in whole sentences.
    is_other_subject : bool
        Whether more than `OTHER_SUBJECT` of the markers that could be tested sit elsewhere.
    """

    trajectories: Trajectories
    skeleton: Skeleton
    motion: Motion
    labels: SubjectLabels
    found: Trajectories
    edits: CorrectedLabels
    moved: tuple[int, ...]
    shifts: Floats
    missing: tuple[int, ...]
    notices: tuple[str, ...]
    is_other_subject: bool

    @property
    def limbs(self) -> Limbs:
        """Limbs of all markers."""
        n_markers = self.trajectories.n_markers
        deviation = np.full((n_markers, n_markers), np.nan)
        return Limbs(self.skeleton.limb_of_marker, deviation, self.skeleton.limb_names)


def fit_subject(
    take: PointCloud | Trajectories,
    subject: Project,
    *,
    labelling: LabelParameters | None = None,
    posing: SkeletonParameters | None = None,
    corrections: tuple[Correction, ...] = (),
    monitor: Monitor = SILENT,
) -> SubjectFit:
    """Label and pose a take by the skeleton of another take of the same body.

    Parameters
    ----------
    take : PointCloud or Trajectories
        The take.
    subject : Project
        The calibrated take with its skeleton and motion.
    labelling : LabelParameters, optional
        How points without names are followed.
    posing : SkeletonParameters, optional
        What is an outlier.
    corrections : tuple of Correction
        What the user states; those of markers are applied to the labels before the skeleton is posed.
    monitor : Monitor
        Receives progress; may cancel.

    Raises
    ------
    InputError
        If the skeleton explains too little of the take.
    """
    names, calibrated = subject.trajectories.names, subject.skeleton
    free = with_free_joints(calibrated)
    labels = label_by_subject(take, free, subject.trajectories, labelling, monitor)
    monitor.begin("poses of the subject")
    found = _found(take, names, labels)
    edits = apply_corrections(found, corrections, by_subject=True)
    positions = edits.trajectories.positions
    new = (*labels.new, *(_of_no_limb(name) for name in edits.trajectories.names[found.n_markers :]))
    moved_tracks = [one.marker for one in labels.moved]
    test, moved, freer = _compared(subject, positions[:, : len(names)], moved_tracks, posing)
    skeleton = _with_new(with_free_joints(calibrated, freer), new)
    shifts = test.distances
    if moved:
        skeleton = _replaced(skeleton, pose_skeleton(skeleton, _without(positions, moved), posing), positions, moved)
        shifts = np.linalg.norm(skeleton.marker_offsets[: len(names)] - calibrated.marker_offsets, axis=1)
    poses = pose_skeleton(skeleton, positions, posing, monitor)
    skeleton = _with_deviations(skeleton, poses, positions)
    seen = ~np.isnan(positions[:, : len(names), 0]).all(axis=0)
    missing = tuple(np.flatnonzero(~seen & (calibrated.limb_of_marker >= 0)).tolist())
    size = take_changes.compare_sizes(calibrated, positions[:, : len(names)])
    fit = SubjectFit(
        trajectories=replace(edits.trajectories, notices=take.notices),
        skeleton=skeleton,
        motion=subject_motion(skeleton, poses, positions, take.rate),
        labels=labels,
        found=found,
        edits=edits,
        moved=moved,
        shifts=shifts,
        missing=missing,
        notices=(),
        is_other_subject=bool(moved) and len(moved) >= OTHER_SUBJECT * test.n_tested,
    )
    notices = (*_notices(fit, test, size, freer, new), *_renamed_notices(labels, found.names), *edits.notices)
    return replace(fit, notices=notices)


def reposed_subject(skeleton: Skeleton, trajectories: Trajectories) -> tuple[Skeleton, Motion]:
    """Pose the skeleton of a take of a subject anew, after the user corrected the take's markers.

    Parameters
    ----------
    skeleton : Skeleton
        As it was fitted to the take.
    trajectories : Trajectories
        The skeleton's markers, then those that the user split off: the skeleton does not know where they sit.
    """
    positions, n_known = trajectories.positions, len(skeleton.limb_of_marker)
    skeleton = _with_new(skeleton, tuple(_of_no_limb(name) for name in trajectories.names[n_known:]))
    poses = pose_skeleton(skeleton, positions)
    return _with_deviations(skeleton, poses, positions), subject_motion(skeleton, poses, positions, trajectories.rate)


def subject_motion(skeleton: Skeleton, poses: SkeletonPoses, measured: Floats, rate: float) -> Motion:
    """Return poses as a motion, with residuals of the measured markers and deviations of the joints.

    Parameters
    ----------
    skeleton : Skeleton
        What is posed.
    poses : SkeletonPoses
        Its poses.
    measured : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    rate : float, Hz
        Frame rate.
    """
    children = [joint.child for joint in skeleton.joints]
    markers = poses.markers(skeleton)
    motion = Motion(
        world_from_limb=poses.world_from_limb,
        joint_positions=poses.world_from_limb[:, children][..., :3, 3],
        marker_positions=markers,
        residuals=np.linalg.norm(measured - markers, axis=2),
        limb_seen=poses.seen,
        rate=rate,
        compute_angles=MotionAngles(skeleton, measured),
    )
    starts = range(0, len(measured), BLOCK_FRAMES)
    blocks = [np.arange(first, min(first + BLOCK_FRAMES, len(measured))) for first in starts]
    stds = [posture_of(skeleton, motion, poses.inliers, block).joint_std for block in blocks]
    return replace(motion, joint_std=np.concatenate(stds))


def _found(take: PointCloud | Trajectories, names: tuple[str, ...], labels: SubjectLabels) -> Trajectories:
    """The markers as they are labelled: the skeleton's, then new ones."""
    called = _all_names(names, labels)
    positions = labels.points.positions(labels.marker_of_point, len(called))
    return Trajectories(positions, called, take.rate, take.name, take.notices)


def _of_no_limb(name: str) -> PlacedTrack:
    """A marker that the user split off another one: the skeleton does not know where it sits."""
    return PlacedTrack(np.zeros(0, dtype=np.intp), -1, np.full(3, np.nan), np.nan, -1, name)


def _all_names(names: tuple[str, ...], labels: SubjectLabels) -> tuple[str, ...]:
    """Names of the skeleton's markers, then of new ones."""
    every = list(names)
    for number, one in enumerate(labels.new, start=1):
        name = one.name or f"new {number}"
        while name in every:
            name += "'"
        every.append(name)
    return tuple(every)


def _with_new(skeleton: Skeleton, new: tuple[PlacedTrack, ...]) -> Skeleton:
    """The skeleton with new markers behind its own."""
    if not new:
        return skeleton
    spreads = [one.spread for one in new]
    stds = [np.full(3, one.spread / np.sqrt(max(len(one.points), 1))) for one in new]
    offset_std, noise = skeleton.offset_std, skeleton.marker_noise
    return replace(
        skeleton,
        limb_of_marker=np.append(skeleton.limb_of_marker, [one.limb for one in new]),
        marker_offsets=np.vstack([skeleton.marker_offsets, [one.place for one in new]]),
        marker_std=np.append(skeleton.marker_std, spreads),
        offset_std=None if offset_std is None else np.vstack([offset_std, stds]),
        marker_noise=None if noise is None else np.append(noise, spreads),
    )


def _without(positions: Floats, markers: tuple[int, ...]) -> Floats:
    if not markers:
        return positions
    left = positions.copy()
    left[:, list(markers)] = np.nan
    return left


def _compared(
    subject: Project, positions: Floats, at_first: list[int], posing: SkeletonParameters | None
) -> tuple[take_changes.PlaceTest, tuple[int, ...], tuple[int, ...]]:
    """Compare the places of all markers with free joints; markers that moved are taken out of the pose one by one.

    Returns the comparison, the markers that moved, and the joints with more freedoms than before.
    """
    skeleton = with_free_joints(subject.skeleton)
    every = subject.trajectories.positions
    shown = every[evenly_spread(np.arange(len(every)), TESTED_FRAMES)]
    calibrated = pose_skeleton(skeleton, shown, posing)
    before = take_changes.span_means(calibrated.local(skeleton, shown))
    some = positions[evenly_spread(np.arange(len(positions)), TESTED_FRAMES)]
    moved, errors = list(at_first), take_changes.place_errors(skeleton)
    while True:
        poses = pose_skeleton(skeleton, _without(some, tuple(moved)), posing)
        test = take_changes.compare_places(before, take_changes.span_means(poses.local(skeleton, some)), errors)
        candidates = np.where(test.is_moved, test.distances, 0.0)
        candidates[moved] = 0.0
        if not candidates.any() or len(moved) >= OTHER_SUBJECT * test.n_tested:
            return test, tuple(sorted(moved)), take_changes.freer_joints(subject.skeleton, calibrated, poses)
        moved.append(int(np.argmax(candidates)))


def _replaced(skeleton: Skeleton, poses: SkeletonPoses, positions: Floats, moved: tuple[int, ...]) -> Skeleton:
    """The skeleton with moved markers at their mean places in this take."""
    local = poses.local(skeleton, positions)[:, list(moved)]
    seen: Bools = ~np.isnan(local[:, :, 0])
    count = seen.sum(axis=0)
    means = np.where(seen[..., np.newaxis], local, 0.0).sum(axis=0) / np.maximum(count, 1)[:, np.newaxis]
    offsets = skeleton.marker_offsets.copy()
    offsets[list(moved)] = np.where(count[:, np.newaxis] > 0, means, offsets[list(moved)])
    return replace(skeleton, marker_offsets=offsets)


def _with_deviations(skeleton: Skeleton, poses: SkeletonPoses, positions: Floats) -> Skeleton:
    """The skeleton with the deviations of markers that this take shows."""
    spread = spread_of_markers(poses.local(skeleton, positions) - skeleton.marker_offsets)
    return replace(skeleton, marker_std=np.where(np.isnan(spread), skeleton.marker_std, spread))


def _notices(
    fit: SubjectFit,
    test: take_changes.PlaceTest,
    size: take_changes.SizeTest,
    freer: tuple[int, ...],
    new: tuple[PlacedTrack, ...],
) -> Iterator[str]:
    """Say in whole sentences how a take differs from the calibrated one."""
    labels, skeleton = fit.labels, fit.skeleton
    how = "its names and the subject's skeleton" if labels.by_name else "the subject's skeleton"
    yield f"labelled by {how}, which explains {100 * labels.explained:.1f} % of the positions that it could"
    yield from _moved_notices(fit, test.n_tested)
    if size.is_other_size:
        what = "larger" if size.factor > 1.0 else "smaller"
        yield (
            f"{size.n_alike} of {size.n_limbs} limbs are {what} than in the calibrated take, by "
            f"{100 * abs(size.factor - 1.0):.1f} % in the median: this is another body; calibrate this take by itself"
        )
    yield from _missing_notices(fit)
    yield from labels.alike_bodies
    if freer:
        parts = ", ".join(skeleton.joint_name(skeleton.joints[index]) for index in freer)
        yield f"joints that turn in more ways than the calibrated take showed, ball joints here: {parts}"
    if new:
        parts = ", ".join(
            f"{name} on {fit.limbs.called(one.limb) if one.limb >= 0 else 'no limb'}"
            for name, one in zip(fit.trajectories.names[len(fit.shifts) :], new, strict=True)
        )
        yield f"markers that the skeleton does not know: {parts}"
    n_left = int((labels.marker_of_point < 0).sum())
    if n_left:
        part = f"({100 * n_left / len(labels.marker_of_point):.1f} %)"
        one, several = "belongs to no marker and is left out", "belong to no marker and are left out"
        yield counted(n_left, f"point {part} {one}", f"points {part} {several}")


def _missing_notices(fit: SubjectFit) -> Iterator[str]:
    """Which bodies and markers of the skeleton no frame shows."""
    skeleton, missing = fit.skeleton, set(fit.missing)
    bodies = skeleton.bodies
    for name, limbs in zip(names_of_bodies(bodies, skeleton.limb_names), bodies, strict=True):
        own = set(np.flatnonzero(np.isin(skeleton.limb_of_marker, limbs)).tolist())
        if len(bodies) > 1 and own <= missing:
            missing -= own
            yield f"no frame shows {name}: leave its skeleton out"
    if missing:
        parts = ", ".join(fit.trajectories.names[marker] for marker in sorted(missing))
        yield f"markers of the skeleton that no frame shows: {parts}"


def _moved_notices(fit: SubjectFit, n_tested: int) -> Iterator[str]:
    moved, shifts, names = fit.moved, fit.shifts, fit.trajectories.names
    if fit.is_other_subject:
        yield (
            f"{len(moved)} of {n_tested} markers sit elsewhere on their limbs than in the calibrated take "
            f"(Hotelling's test, all together at a level of {take_changes.LEVEL:g}): this is another body, or the "
            "markers were put on anew; calibrate this take by itself"
        )
    elif moved:
        largest_first = sorted(moved, key=lambda marker: -shifts[marker])
        parts = ", ".join(f"{names[marker]} by {shifts[marker]:.1f} mm" for marker in largest_first)
        yield f"moved on their limbs since the calibrated take, and placed anew: {parts}"
        limbs = fit.skeleton.limb_of_marker
        n_limbs, n_touched = len(np.unique(limbs[limbs >= 0])), len(np.unique(limbs[list(moved)]))
        if n_touched > MANY_LIMBS * n_limbs:
            yield (
                f"that concerns {n_touched} of {n_limbs} limbs: unless so many markers can have slipped, this is "
                "another body"
            )


def _renamed_notices(labels: SubjectLabels, names: tuple[str, ...]) -> Iterator[str]:
    """Which markers of the take have other names in the skeleton; the name of a body before them is no other name."""
    given = labels.points.names
    if not given:
        return
    owned = labels.marker_of_point >= 0
    counts = np.zeros((len(given), len(names)), dtype=np.intp)
    np.add.at(counts, (labels.points.tracks[owned], labels.marker_of_point[owned]), 1)
    found = [names[marker] for marker in counts.argmax(axis=1).tolist()]
    pairs = [
        f"{name} is {other}"
        for name, other, row in zip(given, found, counts, strict=True)
        if row.any() and name not in {other, body_and_limb(other)[1]}
    ]
    if pairs:
        yield f"named otherwise than in the skeleton: {', '.join(pairs)}"
