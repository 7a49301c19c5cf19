"""A pair of images and points that no camera has seen: what is compiled is loaded with them, before cameras run."""

from __future__ import annotations

import numpy as np

from skelgen.capture.blobs import StereoPoints
from skelgen.capture.frames import FramePair, Image
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget, Camera, StereoRig

DISTANCE = 1000.0
"""mm from the left camera to the balls: as good as any."""

BALLS = np.array([[-100.0, 0.0], [0.0, 0.0], [11.0, 0.0], [0.0, 80.0]])
"""mm; places of balls across the line of sight, of which two touch."""

RADIUS = 5.0
"""px; of a ball."""


def trial_pair(rig: StereoRig) -> FramePair:
    """Return images of a few bright discs, where balls before both cameras would be."""
    in_left = np.column_stack([BALLS, np.full((len(BALLS), 1), DISTANCE), np.ones((len(BALLS), 1))])
    world = in_left @ np.linalg.inv(rig.left.camera_from_world).T
    return FramePair(_image(rig.left, world[:, :3]), _image(rig.right, world[:, :3]), time=0.0, index=0)


def trial_points(target: BodyTarget) -> StereoPoints:
    """Return the balls of a target as points."""
    n = len(target.points)
    numbers, zeros = np.arange(n), np.zeros(n)
    return StereoPoints(target.points, np.tile(np.eye(3), (n, 1, 1)), numbers, numbers, zeros, zeros > 0)


def _image(camera: Camera, points: Floats) -> Image:
    from skelgen.capture.optics.projection import project  # noqa: PLC0415 - only when a capture begins

    rows, columns = np.indices((camera.height, camera.width))
    image = np.zeros((camera.height, camera.width), dtype=np.uint8)
    for x, y in project(camera, points).tolist():
        image[(columns - x) ** 2 + (rows - y) ** 2 <= RADIUS**2] = 255
    image.flags.writeable = False  # as those of sources are: functions are compiled anew for others
    return image
