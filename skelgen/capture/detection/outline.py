"""From the middle of a ball's outline to the image of its centre, which is what a point in space is found from.

A ball off the axis is seen as an ellipse whose middle lies farther out than the image of the ball's centre, by the part
(radius / distance)^2 of its distance from the axis; and a lens that bends the outer edge more than the inner one shifts
it as much. At half a metre that is a tenth of a pixel, ten times what the camera's noise does.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import ModuleType

import numpy as np

from skelgen.capture.optics.projection import camera_numbers, distort, pixels_from_normalised, undistort
from skelgen.capture.values import Balls
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera

N_AROUND = 16  # corners of a polygon inscribed in an outline, whose middle is that of the ellipse


def centred(camera: Camera, balls: Balls, compiled: bool = True) -> Balls:
    """Return balls with their centres moved from the middles of their outlines to the images of their centres.

    Parameters
    ----------
    camera : Camera
        That saw them.
    balls : Balls
        As `detect_balls` finds them. Their brightness is the area of their outlines, as far as those are bright.
    compiled : bool
        Use the compiled twin; NumPy's is used in any case where numba cannot keep what it compiles.

    Returns
    -------
    Balls
        The same balls. Those that the lens sends no ray to stay where they are.
    """
    if not len(balls):
        return balls
    twin = _compiled_twin() if compiled else None
    if twin is None:
        return replace(balls, centres=balls.centres - _offsets(camera, balls))
    places, areas = (np.ascontiguousarray(part, dtype=np.float64) for part in (balls.centres, balls.brightness))
    return replace(balls, centres=balls.centres - twin.offsets(places, areas, camera_numbers(camera)))


@cache
def _compiled_twin() -> ModuleType | None:
    try:
        from skelgen.capture.detection import compiled_outline  # noqa: PLC0415 - numba takes a second to import
    except (ImportError, RuntimeError):
        return None
    return compiled_outline


def _offsets(camera: Camera, balls: Balls) -> Floats:
    """How far the middles of outlines lie from the images of their balls' centres [px], shape (n_balls, 2)."""
    rays = undistort(camera, balls.centres)
    focal = np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
    radii = np.sqrt(balls.brightness / np.pi) / focal
    offsets = _middles(_outlines(camera, rays, radii)) - pixels_from_normalised(camera, distort(camera, rays))
    return np.asarray(np.nan_to_num(offsets))


def _outlines(camera: Camera, rays: Floats, radii: Floats) -> Floats:
    """Outlines [px] of balls on rays x / z, y / z that are seen as large as discs on the plane z = 1.

    Returns
    -------
    ndarray, shape (n_balls, `N_AROUND`, 2)
    """
    sight = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    direction = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    aside = np.cross(direction, [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(direction, aside)
    turn = 2 * np.pi * np.arange(N_AROUND)[:, np.newaxis] / N_AROUND
    circle = np.cos(turn) * aside[:, np.newaxis] + np.sin(turn) * up[:, np.newaxis]
    # A cone of the half angle a about a ray that is t off the axis cuts an area of pi tan(a)^2 / cos(t)^3 from z = 1.
    angular = (radii * direction[:, 2] ** 1.5)[:, np.newaxis, np.newaxis]
    around = direction[:, np.newaxis] + angular * circle
    return pixels_from_normalised(camera, distort(camera, around[..., :2] / around[..., 2:]))


def _middles(outlines: Floats) -> Floats:
    """Centroids of the areas of polygons, shape (n, 2)."""
    outlines, first = outlines - outlines[:, :1], outlines[:, 0]  # areas of small things far off lose their digits
    following = np.roll(outlines, -1, axis=1)
    doubled = outlines[..., 0] * following[..., 1] - outlines[..., 1] * following[..., 0]
    moments = ((outlines + following) * doubled[..., np.newaxis]).sum(axis=1)
    return np.asarray(first + moments / (3 * doubled.sum(axis=1, keepdims=True)))
