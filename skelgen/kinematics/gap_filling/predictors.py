"""What tells where an unseen marker of a limb is: the limb's other markers, its joints, and how the body is bent.

The limb's frame is laid anew through the points that are relied on, in every frame of the take, whether the marker is
seen or not: what is learnt where it is seen then holds where it is not. Where these points leave a turn open, as two
of them do about their line, it is that of the neighbouring limb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import fit_transform, rotation_by_svd
from skelgen.kinematics.bodies.shape import determines_pose
from skelgen.kinematics.gap_filling.gaussian_process import Features
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints

_OUTLIER = 10.0  # times the median error: labels that belong elsewhere
_LEAST_OUTLIER = 0.1  # mm: of exact markers even rounding is many times the median
_OWN_POSE_SHARE = 0.5  # of all frames in which a neighbour must be posed by its markers to place a joint by itself
_FIRM = 0.05  # of the square of a limb's size: across a line, from where on points tell the turn about it
_WEAK = 0.03  # of the square of a limb's size: weight of the neighbour's orientation
_MOST_BENDS, _MOST_PLACES = 12, 8  # principal directions of the body's bends and of the neighbours' markers
_PRINCIPAL_FRAMES = 500  # that these are found from


@dataclass(frozen=True, eq=False)
class Predictors:
    """The points of one limb: its markers, then its joints.

    Attributes
    ----------
    places : ndarray, shape (n_points, 3), mm
        In the limb's frame.
    world : ndarray, shape (n_frames, n_points, 3), mm
        Where they are; 0 where not `usable`.
    usable : ndarray of bool, shape (n_frames, n_points)
        Which can be relied on.
    firm : ndarray of bool, shape (n_points,)
        Which are known without the limb itself: not joints that only the motion as a whole places.
    n_markers : int
        How many of the points are markers.
    guess : ndarray, shape (n_frames, 3, 3)
        Orientation of the limb if it never moved against its reference.
    reference : int
        The nearest limb that its own markers pose; the limb itself if there is none.
    neighbours : tuple of int
        Limbs at its joints, and the reference.
    """

    places: Floats
    world: Floats
    usable: Bools
    firm: Bools
    n_markers: int
    guess: Floats
    reference: int
    neighbours: tuple[int, ...]

    def posed_by(self, usable: Bools) -> Bools:
        """Frames in which usable markers alone pose the limb; `usable` has shape (n_frames, n_points)."""
        return determines_pose(self.places[: self.n_markers], usable[:, : self.n_markers])

    def frames_through(self, chosen: Ints, frames: Ints) -> tuple[Floats, Floats]:
        """Rotation and origin of the limb laid through chosen points, shapes (n, 3, 3) and (n, 3), in some frames."""
        places, world = self.places[chosen], self.world[np.ix_(frames, chosen)]
        centre, middle = places.mean(axis=0), world.mean(axis=1)
        inner = places - centre
        moments = np.einsum("fpi,pj->fij", world - middle[:, np.newaxis], inner)
        rotations = rotation_by_svd(moments + _help_wanted(inner) * self.guess[frames])
        return rotations, middle - np.einsum("fij,j->fi", rotations, centre)


@dataclass(frozen=True, eq=False)
class MovingFrame:
    """A moving frame in which a marker is predicted, in those frames of the take that matter.

    Attributes
    ----------
    frames : ndarray of intp, shape (n,)
        Of the take, rising.
    chosen : ndarray of intp
        Points of the limb that it is laid through.
    rotations : ndarray, shape (n, 3, 3)
        World from base.
    origin : ndarray, shape (n, 3), mm
        In the world.
    """

    frames: Ints
    chosen: Ints
    rotations: Floats
    origin: Floats

    def local(self, world: Floats) -> Floats:
        """World positions [mm], shape (n, 3), in the base."""
        return np.asarray(np.einsum("fji,fj->fi", self.rotations, world - self.origin))

    def world(self, local: Floats, rows: Ints) -> Floats:
        """Positions in the base [mm], one for each of some rows, in the world."""
        return np.asarray(self.origin[rows] + np.einsum("fij,fj->fi", self.rotations[rows], local))


class PosesByMarkers:
    """Poses of limbs by their own markers alone, each found when it is first asked for.

    Parameters
    ----------
    trajectories, skeleton, motion : Trajectories, Skeleton, Motion
        Of the take.
    """

    def __init__(self, trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> None:
        self.trajectories, self.skeleton, self.motion = trajectories, skeleton, motion
        self._found: dict[int, tuple[Floats, Bools]] = {}

    def of(self, limb: int) -> tuple[Floats, Bools]:
        """World from limb, shape (n_frames, 4, 4), and where that is known, shape (n_frames,)."""
        if limb not in self._found:
            markers = self.skeleton.markers_of(limb)
            places, usable = (
                self.skeleton.marker_offsets[markers],
                reliable(self.trajectories, self.skeleton, self.motion, limb),
            )
            poses = fit_transform(places, self.trajectories.positions[:, markers], usable, rotation_by_svd)
            self._found[limb] = poses, determines_pose(places, usable)
        return self._found[limb]


def find_predictors(own_poses: PosesByMarkers, limb: int) -> Predictors:
    """Gather the points of a limb.

    A joint is where the neighbouring limb has it, posed by its own markers; where it rarely has the markers for that,
    where the motion has it.

    Parameters
    ----------
    own_poses : PosesByMarkers
        Of all limbs, with the take.
    limb : int
        Its index.
    """
    trajectories, skeleton, motion = own_poses.trajectories, own_poses.skeleton, own_poses.motion
    markers, joints = skeleton.markers_of(limb), skeleton.joints_of(limb)
    usable = reliable(trajectories, skeleton, motion, limb)
    places, firm = [skeleton.marker_offsets[markers]], [True] * len(markers)
    world, usables = [np.where(usable[..., np.newaxis], trajectories.positions[:, markers], 0.0)], [usable]
    for joint, place in joints:
        there, known, by_markers = _joint_by_neighbour(own_poses, joint, limb)
        places.append(place[np.newaxis])
        world.append(np.where(known[:, np.newaxis], there, 0.0)[:, np.newaxis])
        usables.append(known[:, np.newaxis])
        firm.append(by_markers)
    reference = _reference(trajectories, skeleton, limb)
    others = {_neighbour(skeleton, joint, limb) for joint, _ in joints} | {reference}
    return Predictors(
        np.concatenate(places),
        np.concatenate(world, axis=1),
        np.concatenate(usables, axis=1),
        np.array(firm, dtype=bool),
        len(markers),
        _guess(motion, limb, reference),
        reference,
        tuple(sorted(others - {limb})),
    )


def reliable(trajectories: Trajectories, skeleton: Skeleton, motion: Motion, limb: int) -> Bools:
    """Which markers of a limb are seen and not far off their places, shape (n_frames, n_markers of the limb)."""
    markers = skeleton.markers_of(limb)
    error = np.linalg.norm(trajectories.positions[:, markers] - motion.marker_positions[:, markers], axis=2)
    seen = trajectories.seen[:, markers]
    posed = motion.limb_seen[:, [limb]]
    limits = np.array(
        [np.median(column[use]) if use.any() else np.inf for column, use in zip(error.T, (seen & posed).T, strict=True)]
    )
    with np.errstate(invalid="ignore"):
        return np.asarray(seen & ((error <= np.maximum(_OUTLIER * limits, _LEAST_OUTLIER)) | ~posed))


def features_of(
    trajectories: Trajectories, skeleton: Skeleton, motion: Motion, predictors: Predictors, base: MovingFrame
) -> Features:
    """What a marker may follow: the shape of the chosen points, the neighbours' markers, the bends of the body.

    Parameters
    ----------
    trajectories, skeleton, motion : Trajectories, Skeleton, Motion
        Of the take.
    predictors : Predictors
        Of the limb.
    base : MovingFrame
        Where the marker is predicted.
    """
    near = np.ix_(base.frames, np.flatnonzero(np.isin(skeleton.limb_of_marker, predictors.neighbours)))
    seen = trajectories.seen[near][..., np.newaxis]
    measured = np.where(seen, trajectories.positions[near], motion.marker_positions[near])
    around = np.concatenate([predictors.world[np.ix_(base.frames, base.chosen)], measured], axis=1)
    local = np.einsum("fji,fpj->fpi", base.rotations, around - base.origin[:, np.newaxis])
    n_frames, n_chosen = len(base.frames), len(base.chosen)
    shape, places = local[:, :n_chosen].reshape(n_frames, -1), local[:, n_chosen:].reshape(n_frames, -1)
    others = motion.rotations[np.ix_(base.frames, np.array(predictors.neighbours, dtype=np.intp))]
    bends = np.einsum("fji,fnjk->fnik", base.rotations, others).reshape(n_frames, -1)
    return Features((shape, _principal(places, _MOST_PLACES)), (_principal(bends, _MOST_BENDS),))


def _help_wanted(inner: Floats) -> float:
    """Weight of the reference's orientation [mm^2]: none for centred points that are well off one line."""
    size = float((inner**2).sum())
    if size == 0.0:
        return 1.0
    across = np.linalg.svd(inner, compute_uv=False)[1] ** 2 / size if len(inner) > 1 else 0.0
    return 0.0 if across > _FIRM else _WEAK * size


def _principal(values: Floats, most: int) -> Floats:
    """Coordinates along the directions in which values vary most, shape (n_frames, up to `most`)."""
    centred = values - values.mean(axis=0)
    sample = centred[:: max(1, len(centred) // _PRINCIPAL_FRAMES)]
    _, directions = np.linalg.eigh(sample.T @ sample)
    return np.asarray(centred @ directions[:, ::-1][:, :most])


def _joint_by_neighbour(own_poses: PosesByMarkers, joint: int, limb: int) -> tuple[Floats, Bools, bool]:
    """Where the neighbouring limb has a joint, where that is known, and if by its markers alone."""
    skeleton, motion = own_poses.skeleton, own_poses.motion
    neighbour = _neighbour(skeleton, joint, limb)
    if not _posed_by_markers(own_poses.trajectories, skeleton, neighbour):
        return motion.joint_positions[:, joint], motion.limb_seen[:, neighbour], False
    poses, known = own_poses.of(neighbour)
    place = dict(skeleton.joints_of(neighbour))[joint]
    there = np.einsum("fij,j->fi", poses[:, :3, :3], place) + poses[:, :3, 3]
    return there, known, True


def _posed_by_markers(trajectories: Trajectories, skeleton: Skeleton, limb: int) -> bool:
    """Whether a limb's own markers pose it in most frames."""
    markers = skeleton.markers_of(limb)
    share = determines_pose(skeleton.marker_offsets[markers], trajectories.seen[:, markers]).mean()
    return bool(share > _OWN_POSE_SHARE)


def _reference(trajectories: Trajectories, skeleton: Skeleton, limb: int) -> int:
    """The nearest limb, counted in joints, that its own markers pose."""
    front, visited = [limb], {limb}
    while front:
        front = [_neighbour(skeleton, joint, one) for one in front for joint, _ in skeleton.joints_of(one)]
        front = [one for one in dict.fromkeys(front) if one not in visited]
        visited.update(front)
        for one in front:
            if _posed_by_markers(trajectories, skeleton, one):
                return one
    return limb


def _guess(motion: Motion, limb: int, reference: int) -> Floats:
    """Orientation of a limb that never moved against its reference."""
    both = motion.limb_seen[:, limb] & motion.limb_seen[:, reference]
    turns = np.einsum("fji,fjk->fik", motion.rotations[:, reference], motion.rotations[:, limb])
    mean = rotation_by_svd(turns[both if both.any() else slice(None)].mean(axis=0))
    return np.asarray(motion.rotations[:, reference] @ mean)


def _neighbour(skeleton: Skeleton, joint: int, limb: int) -> int:
    parent, child = skeleton.joints[joint].parent, skeleton.joints[joint].child
    return child if parent == limb else parent
