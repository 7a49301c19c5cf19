"""As much of cameras as the 3-D view shows: their frustums."""

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, CameraRig, StereoRig, check_pose
from skelgen_gui.model.viewpoint import DOWN

DEPTH = 1 / 3
"""Length of a camera's frustum, as part of its distance to what it looks at."""

_DISTANCE = 1000.0  # mm, to what is looked at, if nothing is seen


@dataclass(frozen=True, eq=False)
class ShownCamera:
    """As much of a camera as is shown.

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
    return np.asarray(lines @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])
