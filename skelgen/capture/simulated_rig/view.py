"""What one camera of the simulated rig sees before its sensor: where balls are, how bright, and what else shines."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.rendering import PADDING
from skelgen.capture.optics import project, undistort
from skelgen.geometry.rotations import frame_along, moved_points
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import Camera

_Key = tuple[int, int, bytes, bytes, bytes]  # a camera's numbers: cameras that are alike see alike

_OUTLINE_POINTS = 32  # of a polygon around a ball; its area is corrected for the corners cut off
_METAL_DISTANCES = (800.0, 2500.0)  # mm: the test rig and the room
_METAL_WIDTHS, _METAL_LENGTHS = (2.0, 5.0), (6.0, 30.0)  # px: edges that shine along a part of their length
METAL_LEVEL = 45.0
"""Grey levels of the brightest piece of dull metal."""

_LAMP_OFFSET, _LAMP_LOBE = 40.0, np.radians(4.0)  # mm from the lens; rad about the lamp in which balls send light back
_BORDER_FALLOFF = 5.0  # power of the cosine of the angle off the axis with which brightness falls


@dataclass(frozen=True)
class RenderParameters:
    """What balls, light and sensors of the simulated rig are like; the defaults are those of Gaschler (2011).

    Attributes
    ----------
    diameter : float, mm
        Of the balls.
    limb_darkening : float
        How much darker the rim of a ball is than its middle, as a part of it.
    brightness : float, grey levels
        Of a ball in the middle of the image at `bright_distance`; above 255 the sensor saturates.
    bright_distance : float, mm
        Distance at which a ball has that brightness.
    background : float, grey levels
        Brightness of what is dark.
    noise : float, grey levels
        Standard deviation of a dark pixel.
    shot_noise : float, grey levels
        Variance of a pixel that each grey level of light adds.
    reflections : int
        Pieces of dull metal in the scene.
    """

    diameter: float = 14.0
    limb_darkening: float = 0.4
    brightness: float = 400.0
    bright_distance: float = 1000.0
    background: float = 8.0
    noise: float = 1.5
    shot_noise: float = 0.02
    reflections: int = 3


@dataclass(frozen=True, eq=False)
class ViewTruth:
    """Where the balls truly are in one image.

    Attributes
    ----------
    centres : ndarray, shape (n_balls, 2), px
        Images of the balls' centres; NaN behind the camera. A ball's outline is an ellipse whose middle lies farther
        out, by the part (radius / distance)^2 of its distance from the image's middle.
    radii : ndarray, shape (n_balls,), px
        Radius of the circle that is as large as the outline; NaN behind the camera.
    visible : ndarray, shape (n_balls,)
        Part of the outline that is in the image and not covered by a nearer ball; 0 for a hidden ball.
    """

    centres: Floats
    radii: Floats
    visible: Floats


@dataclass(frozen=True, eq=False)
class SeenBalls:
    """Balls that can light a camera's image, nearest first.

    Attributes
    ----------
    index : ndarray of intp, shape (n,)
        Which of all balls each is.
    places : ndarray, shape (n, 3), mm
        Centres in the camera's frame.
    light : ndarray, shape (n,), grey levels
        Brightness of the middle of the ball.
    windows : ndarray of intp, shape (n, 4), px
        First and last + 1 column, first and last + 1 row of the outline, within `PADDING` of the image.
    scale : ndarray, shape (n,), px/mm
        Size of the image of a millimetre at the ball.
    areas : ndarray, shape (n,), px
        Area of the whole outline.
    """

    index: Ints
    places: Floats
    light: Floats
    windows: Ints
    scale: Floats
    areas: Floats


def look_at(camera: Camera, points: Floats, parameters: RenderParameters) -> tuple[SeenBalls, ViewTruth]:
    """Return the balls that can light an image, and where all of them are in it (nothing is hidden yet).

    Parameters
    ----------
    camera : Camera
        What looks.
    points : ndarray, shape (n_balls, 3), mm
        Centres of the balls in the world; NaN for balls that are not there.
    parameters : RenderParameters
        Size and brightness of the balls.
    """
    radius = parameters.diameter / 2
    places = moved_points(camera.camera_from_world, points)
    distances = np.linalg.norm(places, axis=1)
    centre = -camera.camera_from_world[:3, :3].T @ camera.camera_from_world[:3, 3]
    outlines = project(camera, _outlines(points, centre, radius))
    areas = _polygon_areas(outlines)
    windows = _windows(outlines, camera)
    with np.errstate(invalid="ignore"):
        is_seen = np.isfinite(areas) & (distances > radius) & (windows[:, 0] < windows[:, 1])
        is_seen &= windows[:, 2] < windows[:, 3]
    index = np.nonzero(is_seen)[0]
    index = index[np.argsort(distances[index], kind="stable")]
    radii = np.sqrt(areas / np.pi)
    truth = ViewTruth(project(camera, points), radii, np.zeros(len(points)))
    light = brightness(places[index], parameters)
    scale = radii[index] / radius
    return SeenBalls(index, places[index], light, windows[index].astype(np.intp), scale, areas[index]), truth


def brightness(places: Floats, parameters: RenderParameters) -> Floats:
    """Return how bright the middle of each ball is [grey levels], shape (n,).

    Light falls with the square of the distance. The ball sends it back to the lamp, not to the lens beside it: what the
    lens receives falls with the angle between both (Gaschler 2011, chapter 3.1.2: balls nearer than 0.5 m are darker).
    Lamps and lens are darker off their axis.

    Parameters
    ----------
    places : ndarray, shape (n, 3), mm
        Centres in the camera's frame.
    parameters : RenderParameters
        The light.
    """
    distances = np.linalg.norm(places, axis=1)
    cosines = np.clip(places[:, 2] / distances, 0.0, 1.0)
    reference = np.array(parameters.bright_distance)
    by_distance = (reference / distances) ** 2 * _lobe(distances) / _lobe(reference)
    return np.asarray(parameters.brightness * by_distance * cosines**_BORDER_FALLOFF)


def _lobe(distances: Floats) -> Floats:
    return np.asarray(np.exp(-((np.arctan2(_LAMP_OFFSET, distances) / _LAMP_LOBE) ** 2) / 2))


def _outlines(points: Floats, centre: Floats, radius: float) -> Floats:
    """Points [mm] on the circle where rays from a camera touch a ball, shape (n_balls, `_OUTLINE_POINTS`, 3)."""
    sight = points - centre
    distances = np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), radius)
    direction = sight / distances
    aside, up, _ = np.moveaxis(frame_along(direction), -1, 0)
    shrunk = 1 - (radius / distances) ** 2
    turn = 2 * np.pi * np.arange(_OUTLINE_POINTS)[:, np.newaxis] / _OUTLINE_POINTS
    circle = np.cos(turn) * aside[:, np.newaxis] + np.sin(turn) * up[:, np.newaxis]
    centres = centre + sight * shrunk
    return np.asarray(centres[:, np.newaxis] + radius * np.sqrt(shrunk)[:, np.newaxis] * circle)


def _polygon_areas(outlines: Floats) -> Floats:
    """Areas [px] of ellipses by polygons inscribed in them (shoelace formula), shape (n_balls,)."""
    following = np.roll(outlines, -1, axis=1)
    doubled = (outlines[..., 0] * following[..., 1] - outlines[..., 1] * following[..., 0]).sum(axis=1)
    cut = _OUTLINE_POINTS / (2 * np.pi) * np.sin(2 * np.pi / _OUTLINE_POINTS)
    return np.asarray(np.abs(doubled) / (2 * cut))


def _windows(outlines: Floats, camera: Camera) -> Floats:
    """Pixels that each outline reaches, cut to the padded image, shape (n_balls, 4); a margin holds the soft edge."""
    low, high = outlines.min(axis=1) - 1.0, outlines.max(axis=1) + 1.0
    limits = np.array([camera.width, camera.height]) + PADDING
    first, last = np.floor(low + 0.5), np.floor(high + 0.5) + 1
    first, last = np.maximum(first, -PADDING), np.minimum(last, limits)
    return np.stack([first[:, 0], last[:, 0], first[:, 1], last[:, 1]], axis=1)


def corner_rays(camera: Camera) -> Floats:
    """Return the rays x / z, y / z through the corners of all pixels of the padded image.

    Within a pixel rays are interpolated, which is exact to 1e-4 px for any real lens, and no pixel's ray need be
    searched twice.

    Returns
    -------
    ndarray, shape (height + 2 PADDING + 1, width + 2 PADDING + 1, 2)
        NaN where the lens sends no ray.
    """
    return _corner_rays(_key(camera, np.eye(4)))


@lru_cache(maxsize=8)
def _corner_rays(key: _Key) -> Floats:
    camera = _camera(key)
    x = np.arange(-PADDING, camera.width + PADDING + 1) - 0.5
    y = np.arange(-PADDING, camera.height + PADDING + 1) - 0.5
    rays = undistort(camera, np.stack(np.meshgrid(x, y), axis=-1))
    rays.flags.writeable = False
    return rays


def background(camera: Camera, parameters: RenderParameters, seed: int) -> NDArray[np.float32]:
    """Return what shines besides the balls [grey levels], shape (height, width): darkness and dull metal.

    The metal stands still in the world, so that both cameras see the same pieces.

    Parameters
    ----------
    camera : Camera
        What looks.
    parameters : RenderParameters
        Level of the background, number and level of reflections.
    seed : int
        Where the metal is.
    """
    return _background(_key(camera, camera.camera_from_world), parameters, seed)


@lru_cache(maxsize=8)
def _background(key: _Key, parameters: RenderParameters, seed: int) -> NDArray[np.float32]:
    camera, rng = _camera(key), np.random.default_rng([seed, parameters.reflections])
    image = np.full((camera.height, camera.width), parameters.background, dtype=np.float64)
    y, x = np.mgrid[: camera.height, : camera.width]
    for _ in range(parameters.reflections):
        slopes, distance = rng.uniform(-0.35, 0.35, size=2), rng.uniform(*_METAL_DISTANCES)
        width, length = rng.uniform(*_METAL_WIDTHS), rng.uniform(*_METAL_LENGTHS)
        level, turn = METAL_LEVEL * rng.uniform(0.5, 1.0), rng.uniform(0, np.pi)
        centre = project(camera, distance * np.append(slopes, 1.0))
        if not np.isfinite(centre).all():
            continue
        along = (x - centre[0]) * np.cos(turn) + (y - centre[1]) * np.sin(turn)
        across = (y - centre[1]) * np.cos(turn) - (x - centre[0]) * np.sin(turn)
        image += level * np.exp(-((along / length) ** 2 + (across / width) ** 2) / 2)
    light = image.astype(np.float32)
    light.flags.writeable = False
    return light


def _key(camera: Camera, pose: Floats) -> _Key:
    return camera.width, camera.height, camera.matrix.tobytes(), camera.distortion.tobytes(), pose.tobytes()


def _camera(key: _Key) -> Camera:
    matrix, distortion, pose = (np.frombuffer(part) for part in key[2:])
    return Camera(key[0], key[1], matrix.reshape(3, 3), distortion, pose.reshape(4, 4))
