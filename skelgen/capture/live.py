"""The whole capture, pair by pair: images to balls, points, bodies and joint angles (Gaschler 2011, figure 2.1).

Each image and each body has a thread of its own where there is more than one core. Lost pairs are always counted.
Before cameras run, a trial pair of images loads all kernels.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Self

import numpy as np

from skelgen.capture.ball_tracks import BallPairs
from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.prediction import CentreNoise, Prediction, PredictionParameters
from skelgen.capture.chain_filter import chain_filters
from skelgen.capture.detection import BallFinder
from skelgen.capture.health import RigWatch
from skelgen.capture.optics import match_and_triangulate, project
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.target_joints import JointAngle, find_angles, pose_error, turned_and_shifted
from skelgen.capture.values import Balls, FoundBody, FrameSet, Image, StereoPoints
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import AnySettings, BodyTarget, Camera, CaptureSettings, StereoRig

DISTANCE = 1000.0
"""mm from the left camera to the balls: as good as any."""

BALLS = np.array([[-100.0, 0.0], [0.0, 0.0], [11.0, 0.0], [0.0, 80.0]])
"""mm; places of balls across the line of sight, of which two touch."""

RADIUS = 5.0
"""px; of a ball."""


@dataclass(frozen=True, eq=False)
class Captured:
    """All that was found in the images of one moment.

    Attributes
    ----------
    points : StereoPoints
        Points in space; of a room without crossings of two rays that do not last.
    bodies : dict of str to FoundBody
        The targets that were found, by name.
    angles : dict of str to JointAngle
        The joints of which both bodies were found, by name.
    notices : tuple of str
        What the user should know; each trouble is reported once, when it begins.
    latency : float, s
        From the images to the angles.
    pair : FrameSet
        The images, with their time and number.
    views : tuple of Balls
        Balls in all images.
    balls : ndarray of intp, shape (n_points, n_cameras)
        The ball of each point in all images, -1 of cameras that do not see it.
    """

    points: StereoPoints
    bodies: dict[str, FoundBody]
    angles: dict[str, JointAngle]
    notices: tuple[str, ...]
    latency: float
    pair: FrameSet
    views: tuple[Balls, ...]
    balls: Ints


class PointFinder:
    """Images to points: what calibrations need, and the first half of a capture.

    Parameters
    ----------
    settings : CaptureSettings
        Its rig and the parameters of the detection.
    executor : Executor, optional
        Threads for the two images.
    """

    def __init__(self, settings: CaptureSettings, executor: Executor | None = None) -> None:
        self.rig, self._balls = settings.rig, BallFinder(settings, executor)

    def load(self) -> None:
        """Load the kernels, which takes a second: a camera that already runs would lose pairs meanwhile."""
        self.find(trial_pair(self.rig))

    def find(self, pair: FrameSet) -> tuple[Balls, Balls, StereoPoints]:
        """Return the balls of both images and the points that they may be.

        Raises
        ------
        InputError
            If an image has another size than the camera that was calibrated.
        """
        left, right = self._balls.find(pair)
        return left, right, match_and_triangulate(left, right, self.rig)


class Recogniser(ABC):
    """Images of all cameras to joint angles; a context manager that loads the kernels, before cameras run.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        Targets, joints, parameters of the search for targets.
    prediction : PredictionParameters, optional
        Predict and smooth poses; they are as found if it is left out.
    executor : Executor, optional
        Threads for the bodies; they end with the block of `with`.
    """

    def __init__(
        self,
        settings: AnySettings,
        prediction: PredictionParameters | None,
        executor: Executor | None,
    ) -> None:
        self._executor, self._targets, self._joints = executor, settings.bodies, settings.joints
        self._bodies = BodyFinder(settings.bodies, search_parameters(settings), executor)
        names = [body.name for body in settings.bodies]
        self._prediction = None if prediction is None else Prediction(names, prediction)
        self._chains = chain_filters(settings, prediction) if prediction is not None and prediction.joints else ()
        self._raw: list[FoundBody] = []  # of the last frame, as they were found

    @abstractmethod
    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None:
        """End the threads."""
        if self._executor is not None:
            self._executor.shutdown()

    def run(self, source: Iterable[FrameSet]) -> Iterator[Captured]:
        """Yield what is found in each set of images of an open source, in order.

        Raises
        ------
        SkelgenError
            What the source raises when it breaks off, after all sets that came before.
        """
        for pair in source:
            yield self.see(pair)

    @abstractmethod
    def see(self, pair: FrameSet) -> Captured:
        """Return what is found in one set of images."""

    def load(self) -> None:
        """Load the kernels, which takes a second: cameras that already run would lose images meanwhile."""
        for body in self._targets:
            self._bodies.find(trial_points(body))
        exact = {body.name: FoundBody(body.name, np.eye(4), np.eye(6), np.arange(0), 0.0) for body in self._targets}
        for joint in self._joints:
            find_angles(joint, exact)
        if self._prediction is not None:
            self._prediction.load()
        if self._chains:
            turned_and_shifted(np.eye(4), pose_error(np.eye(4), np.eye(4)))

    def recognise(self, points: StereoPoints, time: float) -> tuple[dict[str, FoundBody], dict[str, JointAngle]]:
        """Return the bodies and joint angles from the points of one frame, by name: the second half of a capture.

        Parameters
        ----------
        points : StereoPoints
            Of the frame.
        time : float, s
            Of the frame, for the prediction.
        """
        expected = None if self._prediction is None else dict(self._prediction.expected(time))
        for chain in self._chains:
            expected = (expected or {}) | chain.expected(time)
        raw = self._raw = self._bodies.find(points, expected)
        found = raw if self._prediction is None else self._prediction.corrected(time, raw)
        bodies = {body.name: body for body in found}
        for chain in self._chains:
            bodies |= {body.name: body for body in chain.corrected(time, raw, points) or ()}
        bodies = {body.name: bodies[body.name] for body in self._targets if body.name in bodies}
        angles = {joint.name: find_angles(joint, bodies) for joint in self._joints}
        for chain in self._chains:
            angles |= chain.angles
        return bodies, {name: angle for name, angle in angles.items() if angle is not None}


class MotionCapture(Recogniser):
    """Images to joint angles; a context manager, because it holds threads.

    Parameters
    ----------
    settings : CaptureSettings
        Cameras, targets, joints, parameters of the detection and of the search for targets.
    prediction : PredictionParameters, optional
        Predict and smooth poses; they are as found if it is left out.
    threads : bool, optional
        Whether each image and each body has a thread of its own; by default where there are several cores.

    Raises
    ------
    InputError
        If the targets are ambiguous, or a parameter of the detection is unknown.

    Examples
    --------
    >>> import skelgen
    >>> with skelgen.simulated_rig("arm", n_frames=2) as source, MotionCapture(source.settings) as capture:
    ...     for captured in capture.run(source):
    ...         print(sorted(captured.angles))
    ['lower arm', 'upper arm']
    ['lower arm', 'upper arm']
    """

    def __init__(
        self, settings: CaptureSettings, prediction: PredictionParameters | None = None, threads: bool | None = None
    ) -> None:
        wanted = (os.cpu_count() or 1) > 1 if threads is None else threads
        n_threads = max(2, len(settings.bodies))
        executor = ThreadPoolExecutor(n_threads, "capture") if wanted else None
        super().__init__(settings, prediction, executor)
        self.settings = settings
        self._points = PointFinder(settings, executor)
        sizes = settings.rig.left.size, settings.rig.right.size
        self._pairs = BallPairs(*sizes) if prediction is not None and prediction.balls else None
        self._watch, self._noise = RigWatch(settings.rig), CentreNoise(settings.rig.noise)

    def __enter__(self) -> Self:
        """Load the kernels before cameras run; see `PointFinder.load`."""
        self._points.load()
        self.load()
        return self

    def see(self, pair: FrameSet) -> Captured:
        """Return what is found in one pair."""
        start = perf_counter()
        left, right, points = self._points.find(pair)
        notices = self._watch.notices(pair, left, right, points)
        if self._pairs is not None:
            points = self._pairs.resolved(left, right, points, pair.time)
        bodies, angles = self.recognise(points, pair.time)
        self._measure_noise()
        balls = np.stack([points.left, points.right], axis=1)
        return Captured(points, bodies, angles, notices, perf_counter() - start, pair, (left, right), balls)

    def _measure_noise(self) -> None:
        """Weigh balls by the noise that targets show, where the filters use it and the rig states more."""
        if self._prediction is None:
            return
        factor = self._noise.seen(self._raw)
        if factor != 1.0:
            self._points.rig = replace(self._points.rig, noise=self._noise.used)
            self._prediction.in_units_of(factor)
            for chain in self._chains:
                chain.in_units_of(factor)


def search_parameters(settings: AnySettings) -> BodyParameters:
    """Return the limits of the search for targets that settings state."""
    return BodyParameters.from_mapping(settings.search, "search")


def trial_pair(rig: StereoRig) -> FrameSet:
    """Return images of a few bright discs, where balls before both cameras would be."""
    in_left = np.column_stack([BALLS, np.full((len(BALLS), 1), DISTANCE), np.ones((len(BALLS), 1))])
    world = in_left @ np.linalg.inv(rig.left.camera_from_world).T
    return FrameSet(tuple(_image(camera, world[:, :3]) for camera in (rig.left, rig.right)), time=0.0, index=0)


def trial_points(target: BodyTarget) -> StereoPoints:
    """Return the balls of a target as points."""
    n = len(target.points)
    numbers, zeros = np.arange(n), np.zeros(n)
    return StereoPoints(target.points, np.tile(np.eye(3), (n, 1, 1)), numbers, numbers, zeros, zeros > 0)


def _image(camera: Camera, points: Floats) -> Image:
    rows, columns = np.indices((camera.height, camera.width))
    image = np.zeros((camera.height, camera.width), dtype=np.uint8)
    for x, y in project(camera, points).tolist():
        image[(columns - x) ** 2 + (rows - y) ** 2 <= RADIUS**2] = 255
    image.flags.writeable = False  # as those of sources are: functions are compiled anew for others
    return image
