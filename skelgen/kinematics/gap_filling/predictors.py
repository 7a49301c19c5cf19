"""What predicts where an unseen marker of a limb is: the limb's other markers, its joints, and the body's pose.

The limb's frame is fitted to the chosen points in every frame of the take, whether the marker is seen or not. So what
is learnt where the marker is seen holds where it is not. Where these points leave a rotation open, as two points do
about their line, it is that of the neighbouring limb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import fit_transform, rotation_by_svd
from skelgen.kinematics.gap_filling.gaussian_process import Features
from skelgen.kinematics.rigid_bodies import determines_pose
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints

_OUTLIER = 10.0  # times the median error: the label belongs to another marker
_LEAST_OUTLIER = 0.1  # mm: of exact markers even rounding is many times the median
_OWN_POSE_SHARE = 0.5  # of all frames in which a neighbour's markers must fix its pose, so that it gives the joint
_OFF_LINE = 0.05  # of the square of a limb's size: points this far off a line fix the rotation about it
_REFERENCE_WEIGHT = 0.03  # of the square of a limb's size: weight of the neighbour's orientation
_MOST_ROTATIONS, _MOST_POSITIONS = 12, 8  # principal directions of neighbours' rotations and of their markers
_PRINCIPAL_FRAMES = 500  # that these are found from


@dataclass(frozen=True, eq=False)
class Predictors:
    """The points of one limb: its markers, then its joints.

    Attributes
    ----------
    offsets : ndarray, shape (n_points, 3), mm
        In the limb's frame.
    world : ndarray, shape (n_frames, n_points, 3), mm
        In the world; 0 where not `usable`.
    usable : ndarray of bool, shape (n_frames, n_points)
        Whether a point is known in a frame, and no outlier.
    is_independent : ndarray of bool, shape (n_points,)
        Whether a point is known without the limb's own pose. Joints whose other limb has too few markers are not.
    n_markers : int
        How many of the points are markers.
    default_rotations : ndarray, shape (n_frames, 3, 3)
        World from limb, if the limb never rotated against its reference.
    reference : int
        The nearest limb whose own markers fix its pose; the limb itself if there is none.
    neighbours : tuple of int
        Limbs at its joints, and the reference.
    """

    offsets: Floats
    world: Floats
    usable: Bools
    is_independent: Bools
    n_markers: int
    default_rotations: Floats
    reference: int
    neighbours: tuple[int, ...]

    def fix_pose(self, usable: Bools) -> Bools:
        """Return in which frames usable markers alone fix the limb's pose; `usable` has shape (n_frames, n_points)."""
        return determines_pose(self.offsets[: self.n_markers], usable[:, : self.n_markers])

    def moving_frame(self, chosen: Ints, frames: Ints) -> MovingFrame:
        """Fit the limb's frame to chosen points.

        Parameters
        ----------
        chosen : ndarray of intp
            Points, usable in all of the frames.
        frames : ndarray of intp, rising
            Frames of the take.
        """
        offsets, world = self.offsets[chosen], self.world[np.ix_(frames, chosen)]
        centre, middle = offsets.mean(axis=0), world.mean(axis=1)
        inner = offsets - centre
        moments = np.einsum("fpi,pj->fij", world - middle[:, np.newaxis], inner)
        rotations = rotation_by_svd(moments + _reference_weight(inner) * self.default_rotations[frames])
        return MovingFrame(frames, chosen, rotations, middle - np.einsum("fij,j->fi", rotations, centre))


@dataclass(frozen=True, eq=False)
class MovingFrame:
    """A moving frame of reference in which a marker is predicted, in some frames of the take.

    Attributes
    ----------
    frames : ndarray of intp, shape (n,)
        Frames of the take, rising.
    chosen : ndarray of intp
        Points of the limb that it was fitted to.
    rotations : ndarray, shape (n, 3, 3)
        World from moving frame.
    origin : ndarray, shape (n, 3), mm
        In the world.
    """

    frames: Ints
    chosen: Ints
    rotations: Floats
    origin: Floats

    def local(self, world: Floats) -> Floats:
        """Return world positions [mm], shape (n, 3), in the moving frame."""
        return np.asarray(np.einsum("fji,fj->fi", self.rotations, world - self.origin))

    def world(self, local: Floats) -> Floats:
        """Return positions in the moving frame [mm], shape (n, 3) or (3,), in the world."""
        turned = np.einsum("fij,fj->fi", self.rotations, np.broadcast_to(local, self.origin.shape))
        return np.asarray(self.origin + turned)

    def at(self, rows: Ints) -> MovingFrame:
        """Return some of its rows."""
        return MovingFrame(self.frames[rows], self.chosen, self.rotations[rows], self.origin[rows])


class PosesByMarkers:
    """Poses of limbs by their own markers alone, each computed when it is first asked for.

    Parameters
    ----------
    trajectories : Trajectories
        Measured markers.
    skeleton, motion : Skeleton and Motion
        What was fitted to them.
    """

    def __init__(self, trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> None:
        self.trajectories, self.skeleton, self.motion = trajectories, skeleton, motion
        self._found: dict[int, tuple[Floats, Bools]] = {}

    def of(self, limb: int) -> tuple[Floats, Bools]:
        """Return world from limb, shape (n_frames, 4, 4), and in which frames it is known, shape (n_frames,)."""
        if limb not in self._found:
            markers = self.skeleton.markers_of(limb)
            offsets, usable = self.skeleton.marker_offsets[markers], self.reliable(limb)
            poses = fit_transform(offsets, self.trajectories.positions[:, markers], usable, rotation_by_svd)
            self._found[limb] = poses, determines_pose(offsets, usable)
        return self._found[limb]

    def reliable(self, limb: int) -> Bools:
        """Return which markers of a limb are seen and no outliers, shape (n_frames, n_markers of the limb)."""
        markers = self.skeleton.markers_of(limb)
        measured, carried = self.trajectories.positions[:, markers], self.motion.marker_positions[:, markers]
        error = np.linalg.norm(measured - carried, axis=2)
        seen = self.trajectories.seen[:, markers]
        posed = self.motion.limb_seen[:, [limb]]
        pairs = zip(error.T, (seen & posed).T, strict=True)
        medians = [np.median(column[use]) if use.any() else np.inf for column, use in pairs]
        with np.errstate(invalid="ignore"):
            limits = np.maximum(_OUTLIER * np.array(medians), _LEAST_OUTLIER)
            return np.asarray(seen & ((error <= limits) | ~posed))


def find_predictors(poses: PosesByMarkers, limb: int) -> Predictors:
    """Gather the points of a limb.

    The position of a joint comes from the neighbouring limb, posed by its own markers. Where that limb rarely has the
    markers for a pose, it comes from the motion.

    Parameters
    ----------
    poses : PosesByMarkers
        Of all limbs, with the take.
    limb : int
        Its index.
    """
    trajectories, skeleton, motion = poses.trajectories, poses.skeleton, poses.motion
    markers, joints = skeleton.markers_of(limb), skeleton.joints_of(limb)
    usable = poses.reliable(limb)
    offsets, is_independent = [skeleton.marker_offsets[markers]], [True] * len(markers)
    world, usables = [np.where(usable[..., np.newaxis], trajectories.positions[:, markers], 0.0)], [usable]
    for joint, position in joints:
        there, known, by_markers = _joint_by_neighbour(poses, joint, limb)
        offsets.append(position[np.newaxis])
        world.append(np.where(known[:, np.newaxis], there, 0.0)[:, np.newaxis])
        usables.append(known[:, np.newaxis])
        is_independent.append(by_markers)
    reference = _reference(trajectories, skeleton, limb)
    others = {_neighbour(skeleton, joint, limb) for joint, _ in joints} | {reference}
    # World from limb, if the limb never rotated against its reference.
    both = motion.limb_seen[:, limb] & motion.limb_seen[:, reference]
    turns = np.einsum("fji,fjk->fik", motion.rotations[:, reference], motion.rotations[:, limb])
    at_rest = rotation_by_svd(turns[both if both.any() else slice(None)].mean(axis=0))
    return Predictors(
        offsets=np.concatenate(offsets),
        world=np.concatenate(world, axis=1),
        usable=np.concatenate(usables, axis=1),
        is_independent=np.array(is_independent, dtype=bool),
        n_markers=len(markers),
        default_rotations=motion.rotations[:, reference] @ at_rest,
        reference=reference,
        neighbours=tuple(sorted(others - {limb})),
    )


def features_of(poses: PosesByMarkers, predictors: Predictors, frame: MovingFrame) -> Features:
    """Return what a marker may follow: the shape of the chosen points, the neighbours' markers, their rotations.

    Parameters
    ----------
    poses : PosesByMarkers
        With the take.
    predictors : Predictors
        Of the limb.
    frame : MovingFrame
        In which the marker is predicted.
    """
    trajectories, skeleton, motion, rows = poses.trajectories, poses.skeleton, poses.motion, frame.frames
    near = np.ix_(rows, np.flatnonzero(np.isin(skeleton.limb_of_marker, predictors.neighbours)))
    seen = trajectories.seen[near][..., np.newaxis]
    measured = np.where(seen, trajectories.positions[near], motion.marker_positions[near])
    around = np.concatenate([predictors.world[np.ix_(rows, frame.chosen)], measured], axis=1)
    local = np.einsum("fji,fpj->fpi", frame.rotations, around - frame.origin[:, np.newaxis])
    n_frames, n_chosen = len(rows), len(frame.chosen)
    shape, positions = local[:, :n_chosen].reshape(n_frames, -1), local[:, n_chosen:].reshape(n_frames, -1)
    others = motion.rotations[np.ix_(rows, np.array(predictors.neighbours, dtype=np.intp))]
    relative = np.einsum("fji,fnjk->fnik", frame.rotations, others).reshape(n_frames, -1)
    return Features((shape, _principal(positions, _MOST_POSITIONS)), (_principal(relative, _MOST_ROTATIONS),))


def _reference_weight(inner: Floats) -> float:
    """Weight of the reference's orientation [mm^2]: 0 for centred points that are well off one line."""
    size = float((inner**2).sum())
    if size == 0.0:
        return 1.0
    across = np.linalg.svd(inner, compute_uv=False)[1] ** 2 / size if len(inner) > 1 else 0.0
    return 0.0 if across > _OFF_LINE else _REFERENCE_WEIGHT * size


def _principal(values: Floats, most: int) -> Floats:
    """Coordinates along the directions in which values vary most, shape (n_frames, up to `most`)."""
    centred = values - values.mean(axis=0)
    sample = centred[:: max(1, len(centred) // _PRINCIPAL_FRAMES)]
    _, directions = np.linalg.eigh(sample.T @ sample)
    return np.asarray(centred @ directions[:, ::-1][:, :most])


def _joint_by_neighbour(poses: PosesByMarkers, joint: int, limb: int) -> tuple[Floats, Bools, bool]:
    """World positions of a joint on the neighbouring limb, frames where known, and whether by its markers alone."""
    skeleton, motion = poses.skeleton, poses.motion
    neighbour = _neighbour(skeleton, joint, limb)
    if not _posed_by_markers(poses.trajectories, skeleton, neighbour):
        return motion.joint_positions[:, joint], motion.limb_seen[:, neighbour], False
    world_from_limb, known = poses.of(neighbour)
    position = dict(skeleton.joints_of(neighbour))[joint]
    there = np.einsum("fij,j->fi", world_from_limb[:, :3, :3], position) + world_from_limb[:, :3, 3]
    return there, known, True


def _posed_by_markers(trajectories: Trajectories, skeleton: Skeleton, limb: int) -> bool:
    """Whether a limb's own markers fix its pose in most frames."""
    markers = skeleton.markers_of(limb)
    share = determines_pose(skeleton.marker_offsets[markers], trajectories.seen[:, markers]).mean()
    return bool(share > _OWN_POSE_SHARE)


def _reference(trajectories: Trajectories, skeleton: Skeleton, limb: int) -> int:
    """The nearest limb, counted in joints, whose own markers fix its pose."""
    front, visited = [limb], {limb}
    while front:
        front = [_neighbour(skeleton, joint, one) for one in front for joint, _ in skeleton.joints_of(one)]
        front = [one for one in dict.fromkeys(front) if one not in visited]
        visited.update(front)
        for one in front:
            if _posed_by_markers(trajectories, skeleton, one):
                return one
    return limb


def _neighbour(skeleton: Skeleton, joint: int, limb: int) -> int:
    parent, child = skeleton.joints[joint].parent, skeleton.joints[joint].child
    return child if parent == limb else parent
