"""The simulated rig: what two cameras would see of moving balls, pair by pair, with its sub-pixel truth beside."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from skelgen._kernels.rendering import N_NORMALS, SAMPLES, DrawnBall, Light, NearerBalls, Sensor, draw_ball, expose
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig.scene import Scene, scene_of_structure, show_alone
from skelgen.capture.simulated_rig.view import RenderParameters, ViewTruth, background, corner_rays, look_at
from skelgen.capture.values import SIDES, FrameSet, Image, NothingToOpen
from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, check_bools, check_floats
from skelgen.model.rig import Camera, CaptureSettings, StereoRig

_SMALLEST_BALL = 7.0  # px across: half as much again as 4 x 4 px, with room for what is farther away


class RenderedPairs(NothingToOpen, ABC):
    """Pairs that two simulated cameras take, as fast as they are asked for or by the clock; a `FrameSource`.

    Parameters
    ----------
    name : str
        What stands before the cameras.
    rig : StereoRig
        The cameras.
    n_frames : int
        Pairs until it ends.
    rate : float, Hz
        Pairs a second.
    paced : bool
        Whether to wait until a pair is due, and to leave out and count those that nobody took in time.
    """

    def __init__(self, name: str, rig: StereoRig, n_frames: int, rate: float, paced: bool) -> None:
        self.name, self.cameras, self.rig, self.size = name, SIDES, rig, rig.left.size
        self.rate, self.n_frames, self.n_dropped, self._paced = rate, n_frames, 0, paced

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver the pairs in order."""
        begin, index = time.monotonic(), 0
        while index < self.n_frames:
            lost = 0
            if self._paced:
                ahead = begin + index / self.rate - time.monotonic()
                time.sleep(max(ahead, 0.0))
                lost = min(int(max(-ahead, 0.0) * self.rate), self.n_frames - 1 - index)
                index += lost
            self.n_dropped += lost
            yield self.render(index, lost)[0]
            index += 1

    @abstractmethod
    def render(self, index: int, dropped: int = 0) -> tuple[FrameSet, object]:
        """Return any pair with its truth; the same index gives the same pair.

        Parameters
        ----------
        index : int
            Which, from 0.
        dropped : int
            Number of pairs lost before it.
        """


class SimulatedRig(RenderedPairs):
    """Two cameras that need no hardware; a `FrameSource`.

    Parameters
    ----------
    scene : Scene
        What moves.
    rig : StereoRig, optional
        The cameras; by default those of `reference_rig`.
    parameters : RenderParameters, optional
        Balls, light and sensors; by default those of the reference rig.
    seed : int
        Of the sensors' noise and of where dull metal is.
    paced : bool
        Whether pairs come at the scene's rate by the clock, as from cameras: who is slow loses pairs, which are
        counted. Otherwise they come as fast as they are asked for, and none is lost.

    Examples
    --------
    >>> with simulated_rig("arm", n_frames=2) as source:
    ...     [pair.left.shape for pair in source]
    [(480, 640), (480, 640)]
    """

    def __init__(
        self,
        scene: Scene,
        rig: StereoRig | None = None,
        parameters: RenderParameters | None = None,
        *,
        seed: int = 0,
        paced: bool = False,
    ) -> None:
        super().__init__(f"simulated {scene.name}", rig or reference_rig(), scene.n_frames, scene.rate, paced)
        self.scene, self.parameters, self._seed = scene, parameters or RenderParameters(), seed
        if self.rig.left.size != self.rig.right.size:
            left, right = ("{} x {}".format(*camera.size) for camera in (self.rig.left, self.rig.right))
            raise InputError(f"the left camera takes {left} pixels and the right one {right}; a pair has one size")

    @property
    def settings(self) -> CaptureSettings:
        """The settings that a perfect calibration would find: rig, bodies and joints."""
        return CaptureSettings(self.rig, self.scene.bodies, self.scene.joints)

    def render(self, index: int, dropped: int = 0) -> tuple[FrameSet, PairTruth]:
        """Return any pair of the scene with its truth; the same index gives the same pair.

        Parameters
        ----------
        index : int
            Which, from 0.
        dropped : int
            Number of pairs lost before it.

        Raises
        ------
        InputError
            If the scene has no such frame.
        """
        if not 0 <= index < self.n_frames:
            raise InputError(f"frame {index} is asked for; the scene has frames 0 to {self.n_frames - 1}")
        points, hidden = self.scene.points[index], self.scene.hidden[index]
        pair, truth = render_pair(self.rig, points, self.parameters, hidden=hidden, seed=self._seed, index=index)
        return FrameSet(pair.images, index / self.rate, index, dropped), truth


def simulated_rig(
    structure: str = "arm",
    *,
    rig: StereoRig | None = None,
    seed: int = 0,
    paced: bool = False,
    show: Sequence[str] = (),
    **options: Any,
) -> SimulatedRig:
    """Return the simulated rig with a structure before it, its balls lit as `suited_parameters` says.

    Parameters
    ----------
    structure : str
        ``arm``, the reference arm, or what `skelgen.simulation.find_structure` knows.
    rig : StereoRig, optional
        The cameras; by default those of `reference_rig`.
    paced : bool
        Whether pairs come by the clock; see `SimulatedRig`.
    seed : int
        Of motion and noise.
    show : sequence of str
        Targets whose balls are seen; all of them if none is named.
    **options
        Of `scene_of_structure`: ``n_frames``, ``rate``, ``distance``, ``hide``, ...

    Raises
    ------
    ParameterError
        If there is no such structure or option.
    """
    cameras = rig or reference_rig()
    scene = scene_of_structure(structure, cameras, seed=seed, **options)
    suited = suited_parameters(scene, cameras)
    return SimulatedRig(show_alone(scene, show) if show else scene, cameras, suited, seed=seed, paced=paced)


def suited_parameters(scene: Scene, rig: StereoRig) -> RenderParameters:
    """Return the conditions of the reference rig, with longer exposure and larger balls for scenes farther away.

    Parameters
    ----------
    scene : Scene
        What is to be seen.
    rig : StereoRig
        The cameras.
    """
    parameters = RenderParameters()
    distance = float(np.nanmedian(np.linalg.norm(scene.points, axis=-1)))
    least = _SMALLEST_BALL * distance / rig.left.matrix[0, 0]
    return RenderParameters(max(parameters.diameter, least), bright_distance=max(parameters.bright_distance, distance))


_BLUR = 0.7  # px, of lens and sensor
_BLUR_REACH = 4.5  # standard deviations beyond which the blur leaves 1e-5


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
) -> tuple[FrameSet, PairTruth]:
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
    FrameSet
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
    return FrameSet((left, right), 0.0, index), PairTruth(places, left_truth, right_truth)


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
    rays, blur = corner_rays(camera), _blur_of_samples()
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


@lru_cache(maxsize=1)
def _blur_of_samples() -> Floats:
    """How much of a sample's light each pixel receives along one axis, shape ((2 reach + 1) `SAMPLES`,).

    It is the normal density summed over the pixel, for the samples from `reach` pixels before it to as many behind it.
    """
    reach = math.ceil(_BLUR_REACH * _BLUR)
    n_samples = (2 * reach + 1) * SAMPLES
    offsets = (np.arange(n_samples) + 0.5) / SAMPLES - reach - 0.5
    received = ndtr((offsets + 0.5) / _BLUR) - ndtr((offsets - 0.5) / _BLUR)
    return np.asarray(received / received.sum())
