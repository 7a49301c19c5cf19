"""Images of balls as the two cameras of a rig take them, with their truth; or their noisy centres without rendering."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr, ndtri

from skelgen._kernels.rendering import N_NORMALS, SAMPLES, DrawnBall, Light, NearerBalls, Sensor, draw_ball, expose
from skelgen.capture.optics import in_image, project
from skelgen.capture.parameters import RenderParameters
from skelgen.capture.simulated_rig.scene import Scene
from skelgen.capture.simulated_rig.view import ViewTruth, background, corner_rays, look_at
from skelgen.capture.values import Balls, FramePair, Image
from skelgen.model.arrays import Bools, Floats, Ints, check_bools, check_floats
from skelgen.model.rig import Camera, StereoRig

_BLUR_REACH = 4.5  # standard deviations beyond which the blur leaves 1e-5
_AREA, _BRIGHTNESS = 30.0, 4000.0  # px, grey levels: of a ball at the distance of the reference rig


@dataclass(frozen=True, eq=False)
class PairTruth:
    """What is true of a rendered pair.

    Attributes
    ----------
    points : ndarray, shape (n_balls, 3), mm
        Centres of the balls in the rig's world.
    left, right : ViewTruth
        Where they are in both images.
    """

    points: Floats
    left: ViewTruth
    right: ViewTruth


def render_pair(
    rig: StereoRig,
    points: Floats,
    parameters: RenderParameters | None = None,
    *,
    hidden: Bools | None = None,
    seed: int = 0,
    index: int = 0,
) -> tuple[FramePair, PairTruth]:
    """Render balls into both images of a rig.

    Parameters
    ----------
    rig : StereoRig
        The cameras.
    points : ndarray, shape (n_balls, 3), mm
        Centres of the balls in the rig's world; NaN for balls that are not there.
    parameters : RenderParameters, optional
        Balls, light and sensors; by default those of the reference rig.
    hidden : ndarray of bool, shape (2, n_balls), optional
        Balls that something stands before, for the left and the right camera.
    seed : int
        Of the sensors' noise and of where dull metal is.
    index : int
        Number of the pair; each has a noise of its own.

    Returns
    -------
    FramePair
        The images, at the time 0.
    PairTruth
        What is true of them.

    Examples
    --------
    >>> from skelgen.capture.reference_rig import reference_rig
    >>> pair, truth = render_pair(reference_rig(), np.array([[130.0, 0.0, 1000.0]]))
    >>> pair.left.shape
    (480, 640)
    """
    settings = parameters or RenderParameters()
    places = check_floats(points, (None, 3), "points to render")
    covered = np.zeros((2, len(places)), dtype=np.bool_) if hidden is None else hidden
    covered = check_bools(covered, (2, len(places)), "hidden")
    views = [
        render_view(camera, np.where(covered[side, :, np.newaxis], np.nan, places), settings, seed, (index, side))
        for side, camera in enumerate((rig.left, rig.right))
    ]
    (left, left_truth), (right, right_truth) = views
    return FramePair(left, right, 0.0, index), PairTruth(places, left_truth, right_truth)


def render_view(
    camera: Camera, points: Floats, parameters: RenderParameters, seed: int = 0, noise_of: tuple[int, ...] = (0,)
) -> tuple[Image, ViewTruth]:
    """Render balls into one image.

    Parameters
    ----------
    camera : Camera
        What looks.
    points : ndarray, shape (n_balls, 3), mm
        Centres of the balls in the world; NaN for balls that are not there.
    parameters : RenderParameters
        Balls, light and sensor.
    seed : int
        Of the sensor's noise and of where dull metal is.
    noise_of : tuple of int
        Different noises of one seed: the number of the pair, and the side.
    """
    balls, truth = look_at(camera, points, parameters)
    light = background(camera, parameters, seed).copy()
    rays, blur = corner_rays(camera), _blur_of_samples(parameters.blur)
    radius, darkening = parameters.diameter / 2, parameters.limb_darkening
    for ball in range(len(balls.index)):
        mine, others = balls.windows[ball], balls.windows[:ball]  # of nearer balls
        overlap = (others[:, 0] < mine[1]) & (others[:, 1] > mine[0])
        covering = np.nonzero(overlap & (others[:, 2] < mine[3]) & (others[:, 3] > mine[2]))[0]
        nearer = NearerBalls(balls.places[covering], balls.scale[covering])
        scale, level = float(balls.scale[ball]), float(balls.light[ball])
        drawn = DrawnBall(mine, balls.places[ball], radius, scale, level, darkening)
        visible = draw_ball(light, rays, drawn, nearer, blur)
        truth.visible[balls.index[ball]] = min(visible / balls.areas[ball], 1.0)
    image = np.empty((camera.height, camera.width), dtype=np.uint8)
    key = np.random.SeedSequence([seed, *noise_of]).generate_state(1, np.uint64)[0]
    expose(light, _normal_quantiles(), Sensor(key, parameters.noise, parameters.shot_noise), image)
    image.flags.writeable = False
    return image, truth


@lru_cache(maxsize=1)
def _normal_quantiles() -> Light:
    """`N_NORMALS` evenly spread quantiles of the normal distribution, rising."""
    return np.asarray(ndtri((np.arange(N_NORMALS) + 0.5) / N_NORMALS), dtype=np.float32)


def _blur_of_samples(blur: float) -> Floats:
    """How much of a sample's light each pixel receives along one axis: the normal density summed over the pixel.

    Parameters
    ----------
    blur : float, px
        Standard deviation.

    Returns
    -------
    ndarray, shape ((2 reach + 1) `SAMPLES`,)
        For the samples from `reach` pixels before a pixel to as many behind it.
    """
    reach = math.ceil(_BLUR_REACH * blur)
    n_samples = (2 * reach + 1) * SAMPLES
    offsets = (np.arange(n_samples) + 0.5) / SAMPLES - reach - 0.5
    received = ndtr((offsets + 0.5) / blur) - ndtr((offsets - 0.5) / blur)
    return np.asarray(received / received.sum())


def projected_balls(
    scene: Scene, frame: int, rig: StereoRig, noise: float, rng: np.random.Generator
) -> tuple[tuple[Balls, Ints], tuple[Balls, Ints]]:
    """Return the balls that the left and the right image of a frame show, and which balls of the scene they are.

    Parameters
    ----------
    scene : Scene
        What moves.
    frame : int
        Which moment.
    rig : StereoRig
        The cameras.
    noise : float, px
        Standard deviation of a centre along one axis, also of balls that touch.
    rng : Generator
        Noise, and the order of the balls.
    """
    seen = []
    for side, camera in enumerate((rig.left, rig.right)):
        centres = project(camera, scene.points[frame])
        index = rng.permutation(np.flatnonzero(in_image(camera, centres) & ~scene.hidden[frame, side]))
        places = centres[index] + rng.normal(scale=noise, size=(len(index), 2))
        area, brightness, std = (np.full(len(index), value) for value in (_AREA, _BRIGHTNESS, noise))
        seen.append((Balls(places, area, brightness, std, np.zeros(len(index), dtype=np.bool_)), index))
    left, right = seen
    return left, right
