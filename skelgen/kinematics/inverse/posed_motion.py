"""The motion of a long take: poses are kept, and what follows from them is computed when it is asked for.

An hour of forty markers at 200 Hz would be four gigabytes otherwise.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import matrix_from_quaternion, transform_from
from skelgen.kinematics.inverse.inverse_kinematics import MotionAngles
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, check_bools, check_floats

CHUNK_FRAMES = 8_192


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
        shapes = {"orientations_wxyz": (n_frames, n_limbs, 4), "origins": (n_frames, n_limbs, 3)}
        values = {
            "skeleton": skeleton,
            "orientations_wxyz": check_floats(
                orientations_wxyz, shapes["orientations_wxyz"], "orientations", finite=True
            ),
            "origins": check_floats(origins, shapes["origins"], "origins", finite=True),
            "measured": check_floats(
                trajectories.positions, (n_frames, len(skeleton.limb_of_marker), 3), "measured markers"
            ),
            "limb_seen": check_bools(limb_seen, (n_frames, n_limbs), "limb_seen"),
            "rate": trajectories.rate,
            "joint_std": joint_std,
        }
        if joint_std is not None:
            values["joint_std"] = check_floats(joint_std, (n_frames, skeleton.n_joints, 3), "joint_std", finite=True)
        values["compute_angles"] = MotionAngles(skeleton, trajectories.positions)
        self.__dict__.update(values)  # the class is frozen

    @cached_property
    def world_from_limb(self) -> Floats:
        """Pose of every limb's frame, shape (n_frames, n_limbs, 4, 4)."""
        return _frozen(transform_from(matrix_from_quaternion(self.orientations_wxyz), self.origins))

    @cached_property
    def joint_positions(self) -> Floats:
        """World positions of the joints [mm], shape (n_frames, n_joints, 3)."""
        return _frozen(self.origins[:, [joint.child for joint in self.skeleton.joints]])

    @cached_property
    def marker_positions(self) -> Floats:
        """Markers carried by the skeleton [mm], shape (n_frames, n_markers, 3)."""
        placed = np.full(self.measured.shape, np.nan)
        for first in range(0, self.n_frames, CHUNK_FRAMES):
            part = slice(first, first + CHUNK_FRAMES)
            placed[part] = self._markers_in(part)
        return _frozen(placed)

    @cached_property
    def residuals(self) -> Floats:
        """Distances of measured markers from carried ones [mm], shape (n_frames, n_markers)."""
        found = np.empty(self.measured.shape[:2])
        for first in range(0, self.n_frames, CHUNK_FRAMES):
            part = slice(first, first + CHUNK_FRAMES)
            found[part] = np.linalg.norm(self.measured[part] - self._markers_in(part), axis=2)
        return _frozen(found)

    def _markers_in(self, frames: slice) -> Floats:
        limb = self.skeleton.limb_of_marker
        turns = matrix_from_quaternion(self.orientations_wxyz[frames])[:, limb]
        placed = np.einsum("fmij,mj->fmi", turns, self.skeleton.marker_offsets)
        return np.asarray(placed + self.origins[frames][:, limb])


def _frozen(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
