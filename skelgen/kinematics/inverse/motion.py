"""What follows from the poses of a motion: joint angles, their ranges, and in long takes everything else.

A long take keeps its poses, and computes transforms, carried markers and residuals when they are asked for: an hour of
forty markers at 200 Hz would take four gigabytes otherwise.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import matrix_from_quaternion, transform_from
from skelgen.kinematics.inverse.inverse_kinematics import Posture, posture_of
from skelgen.kinematics.joints.angles import angle_names, continued, turns_that_are_seen
from skelgen.model import JointAngles, Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, check_bools, check_floats, read_only, set_fields, spread_frames

CHUNK_FRAMES = 8_192

ANGLE_FRAMES = 8_192
"""Frames whose angles are computed together: their covariances take some 20 MB."""

_MOST_FRAMES = 5000  # from which ranges of angles are computed, evenly spread


class PosedMotion(Motion):
    """A `Motion` that holds quaternions and origins; its other arrays are computed at the first use, and then kept.

    Parameters
    ----------
    skeleton : Skeleton
        Whose motion it is.
    orientations_wxyz : ndarray, shape (n_frames, n_limbs, 4)
        Unit quaternions, world from limb.
    origins : ndarray, shape (n_frames, n_limbs, 3), mm
        World positions of the limbs' origins.
    trajectories : Trajectories
        Measured markers.
    limb_seen, joint_std
        See `Motion`.
    """

    skeleton: Skeleton
    orientations_wxyz: Floats
    origins: Floats
    measured: Floats

    def __init__(
        self,
        skeleton: Skeleton,
        orientations_wxyz: Floats,
        origins: Floats,
        trajectories: Trajectories,
        limb_seen: Bools,
        joint_std: Floats | None = None,
    ) -> None:
        n_frames, n_limbs = len(origins), skeleton.n_limbs
        wxyz = check_floats(orientations_wxyz, (n_frames, n_limbs, 4), "orientations", finite=True)
        origins = check_floats(origins, (n_frames, n_limbs, 3), "origins", finite=True)
        shape = (n_frames, len(skeleton.limb_of_marker), 3)
        measured = check_floats(trajectories.positions, shape, "measured markers")
        seen = check_bools(limb_seen, (n_frames, n_limbs), "limb_seen")
        if joint_std is not None:
            joint_std = check_floats(joint_std, (n_frames, skeleton.n_joints, 3), "joint_std", finite=True)
        angles = MotionAngles(skeleton, trajectories.positions)
        set_fields(self, skeleton=skeleton, orientations_wxyz=wxyz, origins=origins, measured=measured)
        set_fields(self, limb_seen=seen, rate=trajectories.rate, joint_std=joint_std, compute_angles=angles)

    @cached_property
    def world_from_limb(self) -> Floats:
        """Pose of every limb's frame, shape (n_frames, n_limbs, 4, 4)."""
        return read_only(transform_from(matrix_from_quaternion(self.orientations_wxyz), self.origins))

    @cached_property
    def joint_positions(self) -> Floats:
        """World positions of the joints [mm], shape (n_frames, n_joints, 3)."""
        return read_only(self.origins[:, [joint.child for joint in self.skeleton.joints]])

    @cached_property
    def marker_positions(self) -> Floats:
        """Markers carried by the skeleton [mm], shape (n_frames, n_markers, 3)."""
        placed = np.full(self.measured.shape, np.nan)
        for first in range(0, self.n_frames, CHUNK_FRAMES):
            part = slice(first, first + CHUNK_FRAMES)
            placed[part] = self._markers_in(part)
        return read_only(placed)

    @cached_property
    def residuals(self) -> Floats:
        """Distances of measured markers from carried ones [mm], shape (n_frames, n_markers)."""
        found = np.empty(self.measured.shape[:2])
        for first in range(0, self.n_frames, CHUNK_FRAMES):
            part = slice(first, first + CHUNK_FRAMES)
            found[part] = np.linalg.norm(self.measured[part] - self._markers_in(part), axis=2)
        return read_only(found)

    def _markers_in(self, frames: slice) -> Floats:
        limb = self.skeleton.limb_of_marker
        turns = matrix_from_quaternion(self.orientations_wxyz[frames])[:, limb]
        placed = np.einsum("fmij,mj->fmi", turns, self.skeleton.marker_offsets)
        return np.asarray(placed + self.origins[frames][:, limb])


@dataclass(frozen=True, eq=False)
class MotionAngles:
    """Computes the angles of a motion's joints, for `Motion.compute_angles`.

    Attributes
    ----------
    skeleton : Skeleton
        The skeleton.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """

    skeleton: Skeleton
    positions: Floats

    def __call__(self, motion: Motion) -> tuple[JointAngles, ...]:
        """Return the angles of every joint, in the order of the skeleton's joints."""
        starts = range(0, max(motion.n_frames, 1), ANGLE_FRAMES)
        blocks = [np.arange(start, min(start + ANGLE_FRAMES, motion.n_frames)) for start in starts]
        parts = list(successive_postures(self.skeleton, motion, self.positions, blocks))
        found = []
        for index, joint in enumerate(self.skeleton.joints):
            values = np.concatenate([part.angles[index] for part in parts])
            std = np.concatenate([part.angle_std[index] for part in parts])
            found.append(JointAngles(angle_names(joint), values, std))
        return tuple(found)


def successive_postures(
    skeleton: Skeleton, motion: Motion, positions: Floats, chunks: Iterable[Ints]
) -> Iterator[Posture]:
    """Yield the postures of successive frames; angles about axes go on without jumps of a full turn.

    Parameters
    ----------
    skeleton, motion, positions
        As for `posture_of`.
    chunks : iterable of ndarray of intp
        Frames of each posture, in the order of time.
    """
    before: tuple[Floats | None, ...] = (None,) * skeleton.n_joints
    for frames in chunks:
        posture = posture_of(skeleton, motion, positions, frames)
        angles = tuple(map(continued, skeleton.joints, posture.angles, before))
        before = tuple(one[-1] for one in angles) if len(frames) else before
        yield replace(posture, angles=angles)


def spread_posture(skeleton: Skeleton, motion: Motion, positions: Floats) -> tuple[Ints, Posture]:
    """Return frames that are evenly spread over a take, and their posture with the turns of all frames that show them.

    Parameters
    ----------
    skeleton, motion, positions
        As for `posture_of`.
    """
    frames = spread_frames(motion.n_frames, _MOST_FRAMES)
    posture = posture_of(skeleton, motion, positions, frames)
    pairs = zip(skeleton.joints, posture.angles, strict=True)
    angles = tuple(one if joint.axis is None else turns_that_are_seen(joint, motion)[frames] for joint, one in pairs)
    return frames, replace(posture, angles=angles)


@dataclass(frozen=True)
class AngleRange:
    """One angle of a joint.

    Attributes
    ----------
    name : str
        Which, see `skelgen.kinematics.joints.angles`.
    low, mean, high : float, rad
        Smallest, mean and largest value, from frames that show both limbs, of wheels over all their turns; NaN if there
        are none.
    std : float, rad
        Median of the standard deviations.
    """

    name: str
    low: float
    mean: float
    high: float
    std: float


def angle_ranges(skeleton: Skeleton, motion: Motion, positions: Floats) -> tuple[tuple[AngleRange, ...], ...]:
    """Return the range of every angle of every joint, in the order of the skeleton's joints.

    Parameters
    ----------
    skeleton, motion : Skeleton and Motion
        The skeleton and its motion.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    _, posture = spread_posture(skeleton, motion, positions)
    return tuple(_ranges(skeleton, posture, index) for index in range(skeleton.n_joints))


def _ranges(skeleton: Skeleton, posture: Posture, index: int) -> tuple[AngleRange, ...]:
    joint = skeleton.joints[index]
    shown = posture.limb_seen[:, [joint.parent, joint.child]].all(axis=1)
    angles, stds = posture.angles[index][shown], posture.angle_std[index][shown]
    if not len(angles):
        return tuple(AngleRange(name, np.nan, np.nan, np.nan, np.nan) for name in angle_names(joint))
    return tuple(
        AngleRange(name, float(angle.min()), float(angle.mean()), float(angle.max()), float(np.median(std)))
        for name, angle, std in zip(angle_names(joint), angles.T, stds.T, strict=True)
    )
