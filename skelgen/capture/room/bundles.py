"""What an adjustment of a room moves: cameras, and the places of a wand or of a board in every frame."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import moved_pose
from skelgen.geometry.rotations import cross_matrix, matrix_from_vector
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera


@dataclass(frozen=True, eq=False)
class RoomBundle(ABC):
    """Cameras that see a rigid thing in many frames.

    Attributes
    ----------
    cameras : tuple of Camera
        All of them; the first one stays where it is.
    seen : ndarray, shape (n_frames, n_cameras, n_points, 2), px
        Where its points were seen; NaN where one was not.
    """

    cameras: tuple[Camera, ...]
    seen: Floats

    n_own, fewest_cameras = 0, 1
    """Numbers of the thing in each frame, and cameras that determine them."""

    @property
    @abstractmethod
    def places(self) -> Floats:
        """Places of its points, shape (n_frames, n_points, 3), mm."""

    @abstractmethod
    def slopes(self) -> Floats:
        """Return how places change with the numbers of their frame, shape (n_frames, n_points, 3, n_own)."""

    @abstractmethod
    def moved(self, steps: Floats) -> Self:
        """Return the bundle after steps of each frame's numbers, shape (n_frames, n_own)."""

    @abstractmethod
    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""


@dataclass(frozen=True, eq=False)
class WandBundle(RoomBundle):
    """A wand: five numbers in a frame, its first ball and two of its direction.

    Attributes
    ----------
    distances : ndarray, shape (n_balls,), mm
        Of the balls along the wand, from the first one.
    first : ndarray, shape (n_frames, 3), mm
        Places of the first ball.
    direction : ndarray, shape (n_frames, 3)
        Along the wand, of length 1.
    """

    distances: Floats
    first: Floats
    direction: Floats

    n_own, fewest_cameras = 5, 2

    @property
    def places(self) -> Floats:
        """Places of all balls, shape (n_frames, n_balls, 3), mm."""
        return np.asarray(self.first[:, np.newaxis] + self.distances[:, np.newaxis] * self.direction[:, np.newaxis])

    def slopes(self) -> Floats:
        """Return how balls change with the first ball and with a tilt across the wand."""
        out = np.zeros((len(self.first), len(self.distances), 3, self.n_own))
        out[..., :3] = np.eye(3)
        out[..., 3:] = self.distances[:, np.newaxis, np.newaxis] * _tangents(self.direction)[:, np.newaxis]
        return out

    def moved(self, steps: Floats) -> Self:
        """Return the bundle after a shift and a tilt of each wand."""
        tilt = (_tangents(self.direction) @ steps[:, 3:, np.newaxis])[..., 0]
        turns = matrix_from_vector(np.cross(self.direction, tilt))
        direction = (turns @ self.direction[..., np.newaxis])[..., 0]
        return replace(self, first=self.first + steps[:, :3], direction=direction)

    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""
        return replace(self, first=self.first[frames], direction=self.direction[frames], seen=self.seen[frames])


@dataclass(frozen=True, eq=False)
class BoardBundle(RoomBundle):
    """A board: its pose in each frame.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Corners in the board's frame.
    poses : ndarray, shape (n_frames, 4, 4), mm
        world_from_board.
    """

    points: Floats
    poses: Floats

    n_own = 6

    @property
    def places(self) -> Floats:
        """Places of all corners, shape (n_frames, n_points, 3), mm."""
        return np.asarray(self._turned() + self.poses[:, np.newaxis, :3, 3])

    def slopes(self) -> Floats:
        """Return how corners change with a turn and a shift of the board."""
        turned = self._turned()
        shift = np.broadcast_to(np.eye(3), (*turned.shape, 3))
        return np.concatenate([-cross_matrix(turned), shift], axis=-1)

    def moved(self, steps: Floats) -> Self:
        """Return the bundle after a turn and a shift of each board."""
        return replace(self, poses=moved_pose(self.poses, steps))

    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""
        return replace(self, poses=self.poses[frames], seen=self.seen[frames])

    def _turned(self) -> Floats:
        return np.asarray(self.points @ np.swapaxes(self.poses[:, :3, :3], 1, 2))


def _tangents(direction: Floats) -> Floats:
    """Two directions across each, shape (n_frames, 3, 2)."""
    least = np.eye(3)[np.abs(direction).argmin(axis=1)]
    across = np.cross(direction, least)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(direction, across)], axis=2)
