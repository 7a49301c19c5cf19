"""The whole capture of a room, moment by moment: images of all cameras to balls, points, bodies and joint angles."""

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import Self

import numpy as np

from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.detection import BallFinder
from skelgen.capture.live import Captured, Recogniser
from skelgen.capture.room.recording import FEWEST_BALLS, LEAST_FIT
from skelgen.capture.room.tracks import RoomTracker
from skelgen.capture.values import FrameSet
from skelgen.model.rig import RoomSettings

WINDOW = 100
"""Frames over which a camera is judged."""

LASTING = 4
"""Frames that a point of two cameras lasts before it is handed on."""


class RoomCapture(Recogniser):
    """Images of all cameras to joint angles; a context manager, because it holds threads.

    Parameters
    ----------
    settings : RoomSettings
        Cameras, targets, joints, parameters of the detection and of the search for targets.
    prediction : PredictionParameters, optional
        Predict and smooth poses; they are as found if it is left out.
    """

    def __init__(self, settings: RoomSettings, prediction: PredictionParameters | None = None) -> None:
        cores = os.cpu_count() or 1
        executor = ThreadPoolExecutor(cores, "capture") if cores > 1 else None
        super().__init__(settings, prediction, executor)
        self.settings = settings
        self._balls, self._tracker = BallFinder(settings, executor), RoomTracker(settings.rig)
        self._fits: deque[tuple[list[int], list[int]]] = deque(maxlen=WINDOW)
        self._known: set[str] = set()

    def __enter__(self) -> Self:
        """Load the kernels, which takes a second: cameras that already run would lose images meanwhile."""
        cameras = self.settings.rig.cameras
        self._balls.find(FrameSet(tuple(np.zeros(camera.size[::-1], dtype=np.uint8) for camera in cameras), 0.0, 0))
        self._tracker.load()
        self.load()
        return self

    def see(self, pair: FrameSet) -> Captured:
        """Return what is found in one set of images."""
        start = perf_counter()
        views = self._balls.find(pair)
        found, tracks = self._tracker.see(views, pair.time)
        points = found.of(self._tracker.tracks.are_markers(tracks, LASTING))
        self._fits.append(([len(balls) for balls in views], (found.balls >= 0).sum(axis=0).tolist()))
        stereo = points.as_stereo(self.settings.rig.noise)
        bodies, angles = self.recognise(stereo, pair.time)
        notices = self._notices(pair, [balls.notice for balls in views])
        latency = perf_counter() - start
        return Captured(stereo, bodies, angles, notices, latency, pair, tuple(views), points.balls)

    def _notices(self, frame: FrameSet, faults: list[str]) -> tuple[str, ...]:
        names = self.settings.rig.names
        lasting = [f"{name}: {fault}" for name, fault in zip(names, faults, strict=True) if fault]
        lasting += [f"{name} sends no images" for name, image in zip(names, frame.images, strict=True) if image is None]
        n_balls, n_fitting = np.array(self._fits).sum(axis=0)
        if len(self._fits) == WINDOW:
            lasting += [
                f"hardly any ball of {name} fits those of the others: it was moved, exchanged or is late"
                for name, balls, fitting in zip(names, n_balls, n_fitting, strict=True)
                if balls >= FEWEST_BALLS and fitting < LEAST_FIT * balls
            ]
        new = tuple(sentence for sentence in lasting if sentence not in self._known)
        self._known = set(lasting)
        lost = (f"{frame.dropped} sets of images were lost before number {frame.index}",) if frame.dropped else ()
        return (*lost, *new)
