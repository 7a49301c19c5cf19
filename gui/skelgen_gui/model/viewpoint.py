"""Where the viewer stands, and where cameras stand that the view shows, with their frustums. Numbers only.

The projection is perspective; orbit, pan, zoom and fit move the viewer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import moved_points
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, CameraRig, StereoRig, check_pose

# Vertical angle of view: that of a short telephoto lens, which distorts little and still shows depth
_FIELD_OF_VIEW = math.radians(32)

_NEAREST = 0.02  # part of the distance to the target before which nothing is drawn

_DISTANCES = (1.0, 1e7)  # bounds [mm] of the distance to the target

FIT_MARGIN = 0.9
"""Part of the window that what is fitted may take."""

BORDER = 34.0
"""Pixels above and below that what is fitted leaves free, as far as there is room: buttons and scales are there."""

_MOST_BORDER = 0.1  # of the height: in small pictures
_ALONE = 200.0  # mm, half the size of what is fitted if it has none: a single point

Point = tuple[float, float, float]

DOWN = 3
"""Added to a coordinate axis that points down: y of the world of a camera is 1 + 3."""


def level_axes(up: int) -> tuple[int, int]:
    """Return the two level coordinate axes; turning from the first to the second is turning left, seen from above.

    Parameters
    ----------
    up : int
        The coordinate axis that points up, 0 .. 2, or down, with `DOWN` added.
    """
    first, second = (up + 1) % 3, (up + 2) % 3
    return (second, first) if up >= DOWN else (first, second)


def sign_of(up: int) -> int:
    """Return 1 for an axis that points up, -1 for one that points down."""
    return -1 if up >= DOWN else 1


@dataclass(frozen=True)
class Viewpoint:
    """A viewer that looks at a target from a direction.

    Attributes
    ----------
    target : tuple of float, mm
        The point in the middle of the picture.
    azimuth, elevation : float, rad
        Direction from the target to the viewer; the elevation lies in -pi/2 .. pi/2.
    distance : float, mm
        From the target to the viewer.
    up : int
        Coordinate axis that points up, or with `DOWN` added down. Azimuths turn about it, from the first of the
        `level_axes` towards the second.
    """

    target: Point = (0.0, 0.0, 0.0)
    azimuth: float = 0.0
    elevation: float = 0.0
    distance: float = 3000.0
    up: int = 2

    @cached_property
    def basis(self) -> Floats:
        """Unit vectors to the right, up in the picture, and toward the viewer, shape (3, 3), one a row."""
        first, second, upward = np.eye(3)[[*level_axes(self.up), self.up % 3]]
        upward = sign_of(self.up) * upward
        level = math.cos(self.azimuth) * first + math.sin(self.azimuth) * second
        right = -math.sin(self.azimuth) * first + math.cos(self.azimuth) * second
        toward = math.cos(self.elevation) * level + math.sin(self.elevation) * upward
        return np.stack([right, np.cross(toward, right), toward])

    def focal(self, height: float) -> float:
        """Focal length [px] of a picture of some height [px]."""
        return max(height, 1.0) / 2 / math.tan(_FIELD_OF_VIEW / 2)

    def scale(self, height: float) -> float:
        """Pixels per mm at the target."""
        return self.focal(height) / self.distance

    def project(self, points: Floats, width: float, height: float) -> tuple[Floats, Floats]:
        """Project points into the picture.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            NaN allowed.
        width, height : float, px
            Size of the picture.

        Returns
        -------
        places : ndarray, shape (n, 2), px
            From the upper left corner, right and down; NaN where unknown or not before the viewer.
        depths : ndarray, shape (n,), mm
            Distances along the line of sight; NaN as the places.
        """
        relative = (points - np.array(self.target)) @ self.basis.T
        depths = self.distance - relative[:, 2]
        depths[~(depths > _NEAREST * self.distance)] = np.nan
        scales = self.focal(height) / depths
        places = np.stack([width / 2 + scales * relative[:, 0], height / 2 - scales * relative[:, 1]], axis=1)
        return places, depths

    def orbited(self, right: float, up: float) -> Viewpoint:
        """Turn about the target by two angles [rad]; the viewer stops above and below it.

        Parameters
        ----------
        right, up : float, rad
            How far the viewer goes to the right and up.
        """
        elevation = min(max(self.elevation + up, -math.pi / 2), math.pi / 2)
        return replace(self, azimuth=math.remainder(self.azimuth + right, math.tau), elevation=elevation)

    def panned(self, right: float, down: float, height: float) -> Viewpoint:
        """Shift the picture by pixels; what lies as deep as the target follows exactly.

        Parameters
        ----------
        right, down : float, px
            How far the picture is shifted.
        height : float, px
            Height of the picture.
        """
        across, upward, _ = self.basis
        shift = (down * upward - right * across) / self.scale(height)
        return self.looking_at(np.array(self.target) + shift)

    def zoomed(self, factor: float, right: float = 0.0, down: float = 0.0, height: float = 1.0) -> Viewpoint:
        """Come nearer by a factor; a place [px] from the middle of the picture stays where it is.

        Parameters
        ----------
        factor : float
            More than 1 comes nearer.
        right, down : float, px
            The place that stays, from the middle of the picture.
        height : float, px
            Height of the picture.
        """
        distance = min(max(self.distance / factor, _DISTANCES[0]), _DISTANCES[1])
        part = 1.0 - distance / self.distance
        return replace(self.panned(-right * part, -down * part, height), distance=distance)

    def looking_at(self, target: Floats) -> Viewpoint:
        """Look at another point [mm] from the same side and distance."""
        x, y, z = (float(value) for value in target)
        return replace(self, target=(x, y, z))

    def fitted(self, points: Floats, width: float, height: float) -> Viewpoint:
        """Look from the same side so that points fill the picture.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            NaN allowed; without any the viewpoint stays.
        width, height : float, px
            Size of the picture.
        """
        known = points[~np.isnan(points).any(axis=1)]
        if not len(known):
            return self
        seen = known @ self.basis.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        middle = (low + high) / 2
        away = seen - middle if (high - low).max() > 0 else np.full((1, 3), _ALONE)
        tangent = math.tan(_FIELD_OF_VIEW / 2) * FIT_MARGIN
        room = 1 - 2 * min(BORDER / max(height, 1.0), _MOST_BORDER)
        tangents = np.array([tangent * max(width, 1.0) / max(height, 1.0), tangent * room])
        distance = float((np.abs(away[:, :2]) / tangents + away[:, 2:]).max())
        nearest = float(away[:, 2].max()) / (1 - _NEAREST)
        distance = min(max(distance, nearest, _DISTANCES[0]), _DISTANCES[1])
        return replace(self, distance=distance).looking_at(middle @ self.basis)


DEPTH = 1 / 3
"""Length of a camera's frustum, as part of its distance to what it looks at."""

_DISTANCE = 1000.0  # mm, to what is looked at, if nothing is seen


@dataclass(frozen=True, eq=False)
class ShownCamera:
    """A camera as the view draws it.

    Attributes
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Pose of the camera; it looks along its z, with x to the right and y down in its image.
    size, focal : tuple of float, px
        Size of its image, and focal lengths.
    """

    world_from_camera: Floats
    size: tuple[float, float]
    focal: tuple[float, float]

    def __post_init__(self) -> None:
        check_pose(self.world_from_camera, "the pose of a camera")
        if not all(0 < number < np.inf for number in (*self.size, *self.focal)):
            raise InputError("a camera needs sizes and focal lengths above 0")

    def lines(self, depth: float) -> Floats:
        """Return its frustum as `frustum` gives it."""
        return frustum(self.world_from_camera, self.size, self.focal, depth)

    def lines_to(self, points: Floats | None) -> Floats:
        """Return its frustum in a length that suits the points [mm], shape (n, 3), that it sees."""
        known = np.zeros((0, 3)) if points is None else points[np.isfinite(points).all(axis=-1)]
        distances = np.linalg.norm(known - self.world_from_camera[:3, 3], axis=1)
        return self.lines(DEPTH * (float(np.median(distances)) if len(known) else _DISTANCE))


def cameras_of(rig: StereoRig | CameraRig) -> tuple[ShownCamera, ...]:
    """Return the cameras of a rig."""
    return tuple(_shown(camera) for camera in rig.cameras)


def _shown(camera: Camera) -> ShownCamera:
    pose = np.asarray(np.linalg.inv(camera.camera_from_world), dtype=np.float64)
    focal = float(camera.matrix[0, 0]), float(camera.matrix[1, 1])
    return ShownCamera(pose, (float(camera.width), float(camera.height)), focal)


def up_axis(cameras: tuple[ShownCamera, ...]) -> int | None:
    """Return the coordinate axis that points up, or with `DOWN` added down, if cameras stand upright."""
    if not cameras:
        return None
    down = np.mean([camera.world_from_camera[:3, 1] for camera in cameras], axis=0)
    axis = int(np.argmax(np.abs(down)))
    return axis + DOWN if down[axis] > 0 else axis


def frustum(
    world_from_camera: Floats, size: tuple[float, float], focal: tuple[float, float], depth: float = 400.0
) -> Floats:
    """Return the edges of a camera's pyramid of sight.

    Parameters
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Pose of the camera, which looks along its z with x to the right and y down in its image.
    size : tuple of float, px
        Width and height of its image; the principal point is taken for the middle.
    focal : tuple of float, px
        Focal lengths along x and y.
    depth : float, mm
        How far before the camera the pyramid ends.

    Returns
    -------
    ndarray, shape (9, 2, 3), mm
        Both ends of: four edges from the camera's centre, four around the image, and a tick at its upper side.
    """
    half = np.array(size) / 2 / np.array(focal) * depth
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = np.column_stack([signs * half, np.full(4, depth)])
    centre = np.zeros((4, 3))
    above = np.array([[0.0, -half[1], depth], [0.0, -1.25 * half[1], depth]])
    lines = np.concatenate(
        [np.stack([centre, corners], axis=1), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), above[None]]
    )
    return moved_points(world_from_camera, lines)
