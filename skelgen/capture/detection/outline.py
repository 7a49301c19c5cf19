"""From the middle of a ball's outline to the image of its centre, which is what a point in space is found from.

A ball off the axis is seen as an ellipse whose middle lies farther out than the image of the ball's centre, by the part
(radius / distance)^2 of its distance from the axis; and a lens that bends the outer edge more than the inner one shifts
it as much. At half a metre that is a tenth of a pixel, ten times what the camera's noise does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skelgen.capture.blobs import Balls
from skelgen.capture.optics.projection import distort, pixels_from_normalised, undistort
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera

_N_AROUND = 8  # points on a circle, whose mean is exact for what is quadratic


def centred(camera: Camera, balls: Balls) -> Balls:
    """Return balls with their centres moved from the middles of their outlines to the images of their centres.

    Parameters
    ----------
    camera : Camera
        That saw them.
    balls : Balls
        As `detect_balls` finds them. Their brightness is the area of their outlines, as far as those are bright.

    Returns
    -------
    Balls
        The same balls. Those that the lens sends no ray to stay where they are.
    """
    if not len(balls):
        return balls
    rays = undistort(camera, balls.centres)
    focal = np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
    angular = np.sqrt(balls.brightness / np.pi) / focal
    offsets = _middle_of_outline(camera, rays, angular) - pixels_from_normalised(camera, distort(camera, rays))
    return replace(balls, centres=balls.centres - np.nan_to_num(offsets))


def _middle_of_outline(camera: Camera, rays: Floats, angular: Floats) -> Floats:
    """Middles [px] of the outlines of balls on rays x / z, y / z that are seen under angles [rad], shape (n, 2).

    The mean of a quadratic function over a disc is that over the circle whose radius is smaller by the root of 2.
    """
    sight = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    direction = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    aside = np.cross(direction, [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(direction, aside)
    turn = 2 * np.pi * np.arange(_N_AROUND)[:, np.newaxis] / _N_AROUND
    # Off the axis the image of a right angle to the ray grows with 1 / cos: by it the angle is smaller there.
    cosine = direction[:, 2]
    reach = (angular * cosine**1.5 / np.sqrt(2))[:, np.newaxis, np.newaxis]
    around = direction[:, np.newaxis] + reach * (np.cos(turn) * aside[:, np.newaxis] + np.sin(turn) * up[:, np.newaxis])
    flat = around[..., :2] / around[..., 2:]
    return np.asarray(pixels_from_normalised(camera, distort(camera, flat)).mean(axis=1))
