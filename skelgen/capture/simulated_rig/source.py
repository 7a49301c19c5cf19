"""The simulated rig as a source of frames: a scene rendered pair by pair, with its truth beside."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Self

import numpy as np

from skelgen.capture.parameters import RenderParameters
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig.render import PairTruth, render_pair
from skelgen.capture.simulated_rig.scene import Scene, scene_of_structure, show_alone
from skelgen.capture.values import FramePair
from skelgen.errors import InputError
from skelgen.model.rig import CaptureSettings, StereoRig

_SMALLEST_BALL = 7.0  # px across: half as much again as 4 x 4 px, with room for what is farther away


class RenderedPairs(ABC):
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
        self.name, self.rig, self.size = name, rig, rig.left.size
        self.rate, self.n_frames, self.n_dropped, self._paced = rate, n_frames, 0, paced

    def __enter__(self) -> Self:
        """Return itself: there is nothing to open."""
        return self

    def __exit__(self, *exception: object) -> None:  # noqa: B027 - what is rendered needs no closing
        """Do nothing: there is nothing to close."""

    def __iter__(self) -> Iterator[FramePair]:
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
    def render(self, index: int, dropped: int = 0) -> tuple[FramePair, object]:
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

    def render(self, index: int, dropped: int = 0) -> tuple[FramePair, PairTruth]:
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
        return FramePair(pair.left, pair.right, index / self.rate, index, dropped), truth


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
    return parameters.replace(
        bright_distance=max(parameters.bright_distance, distance), diameter=max(parameters.diameter, least)
    )
