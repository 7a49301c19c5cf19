"""From the images of many cameras to balls, and to the unlabelled markers of a whole recording."""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from itertools import islice
from typing import NamedTuple, TypeVar

import numpy as np

from skelgen.capture.detection import correct_eccentricity, detect_balls
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.room.points import FrameSet, RoomPoints, RoomSource, Views, balls_at
from skelgen.capture.room.tracks import RoomTracker
from skelgen.capture.room.watch import FitCounter
from skelgen.capture.values import Balls, Image, n_to_take
from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import Camera, CameraRig, RoomSettings
from skelgen.progress import SILENT, Monitor, with_progress

MANY_LOST = 0.001
"""Part of a camera's images that are lost above which a notice says so."""

_Seen = TypeVar("_Seen")


class BallFinder:
    """Images of all cameras to balls.

    Parameters
    ----------
    settings : RoomSettings
        The cameras, and the parameters of the detection.
    executor : Executor, optional
        Threads for the images.
    """

    def __init__(self, settings: RoomSettings, executor: Executor | None = None) -> None:
        self.rig, self._executor = settings.rig, executor
        self._parameters = DetectionParameters.from_mapping(settings.detection, "detection")

    def find(self, frame: FrameSet) -> list[Balls]:
        """Return the balls that each camera shows; none where an image was lost.

        Raises
        ------
        InputError
            If there are not as many images as cameras, or one has another size than its camera.
        """
        cameras = self.rig.cameras
        if len(frame.images) != len(cameras):
            raise InputError(
                f"the source has {len(frame.images)} cameras, and the settings have {len(cameras)}: "
                f"{', '.join(self.rig.names)}"
            )
        run = map if self._executor is None else self._executor.map
        return list(run(self._balls, frame.images, cameras))

    def _balls(self, image: Image | None, camera: Camera) -> Balls:
        if image is None:
            return balls_at(np.empty((0, 2)), self.rig.noise)
        height, width = image.shape
        if (width, height) != camera.size:
            raise InputError(
                f"{camera.name} sends {width} x {height} pixels, and its calibration is for {camera.width} x "
                f"{camera.height}: set it to that size, or calibrate again"
            )
        return correct_eccentricity(camera, detect_balls(image, self._parameters))


def balls_of(source: RoomSource, monitor: Monitor = SILENT) -> tuple[list[list[Balls]], list[tuple[int, int]]]:
    """Return the balls of all images of a source before its cameras are calibrated, and the cameras' sizes.

    Parameters
    ----------
    source : RoomSource
        Not yet entered.
    monitor : Monitor
        Reports how many sets are done; may cancel.

    Raises
    ------
    InputError
        If a camera has no image at all, or images of two sizes.
    """
    return all_seen(source, seen_in(source, detected_balls, monitor))


_FrameSeen = tuple[list[_Seen], list[tuple[int, int] | None]]
"""What was found in the images of a moment, and their sizes."""


def all_seen(
    source: RoomSource, frames: Iterable[_FrameSeen[_Seen]]
) -> tuple[list[list[_Seen]], list[tuple[int, int]]]:
    """Return what was found in all images, and the cameras' sizes.

    Parameters
    ----------
    source : RoomSource
        Where they come from.
    frames : iterable
        From `seen_in`.

    Raises
    ------
    InputError
        If a camera has no image at all, or images of two sizes.
    """
    kept: list[list[_Seen]] = []
    found: list[set[tuple[int, int]]] = [set() for _ in source.cameras]
    for seen, sizes in frames:
        kept.append(seen)
        for sizes_of, size in zip(found, sizes, strict=True):
            if size is not None:
                sizes_of.add(size)
    for name, sizes_of in zip(source.cameras, found, strict=True):
        if len(sizes_of) != 1:
            what = "has no image" if not sizes_of else "has images of several sizes"
            raise InputError(f"{name} {what}: see that it is switched on and set to one size")
    return kept, [sizes_of.pop() for sizes_of in found]


def seen_in(
    source: RoomSource, look: Callable[[Image | None], _Seen], monitor: Monitor = SILENT
) -> Iterator[_FrameSeen[_Seen]]:
    """Yield what is found in the images of a source, camera by camera, and their sizes; Ctrl-C ends it.

    Parameters
    ----------
    source : RoomSource
        Not yet entered.
    look : callable
        Finds it in an image, which is None where it was lost.
    monitor : Monitor
        Reports how many sets are done; may cancel.
    """
    monitor.begin("images")
    n_seen = 0
    with ThreadPoolExecutor(os.cpu_count() or 1, "images") as threads, source as sets:
        try:
            for frame in with_progress(sets, source.n_frames or 0, monitor):
                sizes = [None if image is None else (image.shape[1], image.shape[0]) for image in frame.images]
                yield list(threads.map(look, frame.images)), sizes
                n_seen += 1
        except KeyboardInterrupt:
            if not n_seen or source.n_frames is not None:
                raise
            monitor.notice(f"stopped after {n_seen} sets of images; these are used")


def detected_balls(image: Image | None) -> Balls:
    """Return the balls in an image of a camera that is not calibrated; none where it was lost."""
    return balls_at(np.empty((0, 2)), 1.0) if image is None else detect_balls(image, DetectionParameters())


def markers_of_room(
    settings: RoomSettings,
    source: RoomSource,
    *,
    n_frames: int | None = None,
    name: str = "",
    monitor: Monitor = SILENT,
) -> PointCloud:
    """Return the markers that cameras see, frame by frame and without labels.

    A marker that only one camera sees is placed by those that keep their distance from it.

    Parameters
    ----------
    settings : RoomSettings
        The cameras, and the parameters of the detection.
    source : RoomSource
        Not yet entered.
    n_frames : int, optional
        Sets of images at most; by default all of them.
    name : str
        What the take is called; by default as the source.
    monitor : Monitor
        Reports how many sets are done; may cancel.

    Returns
    -------
    PointCloud
        In the rig's world. Of each point ``reprojection_error`` [mm] says how far its rays are from meeting, ``std``
        [mm] how uncertain it is in its worst direction, and ``n_blobs`` how many cameras see it.

    Raises
    ------
    InputError
        If the source has no end, other cameras than the settings, or nothing is seen by two of them.
    """
    total = n_to_take(source.name, source.n_frames, n_frames, "sets of images")
    monitor.begin("images")
    cores = os.cpu_count() or 1
    with ThreadPoolExecutor(cores, "images") as threads, source as sets:
        finder = BallFinder(settings, threads if cores > 1 else None)
        recording = RoomRecording(settings.rig)
        for frame in with_progress(islice(sets, n_frames), total, monitor):
            recording.add(finder.find(frame), frame.time, [image is None for image in frame.images])
    return recording.cloud(name or source.name, source.rate)


class _Found(NamedTuple):
    """What is kept of the points of a frame."""

    points: Floats
    std: Floats
    misfit: Floats
    n_cameras: Ints
    tracks: Ints


class RoomRecording:
    """Points of all frames, and what is wrong with cameras.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig, self._tracker = rig, RoomTracker(rig)
        self._fits = FitCounter(rig)
        self._found: list[_Found] = []
        self._times: list[float] = []
        self._lost: Counter[int] = Counter()
        self._faulty: dict[int, tuple[int, int, str]] = {}

    def add(self, views: Views, time: float, lost: list[bool] | None = None) -> RoomPoints:
        """Take the balls of the next moment; return their points.

        Parameters
        ----------
        views : sequence of Balls
            What each camera sees.
        time : float, s
            Of the moment.
        lost : list of bool, optional
            Which cameras' images were lost.
        """
        points, tracks = self._tracker.see(views, time)
        std = np.sqrt(np.linalg.eigvalsh(points.covariance)[:, -1]) if len(points) else np.empty(0)
        n_cameras = points.n_cameras.astype(np.int8)
        self._found.append(_Found(points.points, std, points.misfit, n_cameras, tracks))
        self._lost.update(index for index, is_lost in enumerate(lost or []) if is_lost)
        for index, balls in enumerate(views):
            if balls.notice:
                count, first, fault = self._faulty.get(index, (0, len(self._times), balls.notice))
                self._faulty[index] = count + 1, first, fault
        self._times.append(time)
        self._fits.add(views, points)
        return points

    def cloud(self, name: str, rate: float | None) -> PointCloud:
        """Return the markers, without what does not last.

        Parameters
        ----------
        name : str
            What the take is called.
        rate : float or None, Hz
            Sets a second; None if unknown.

        Raises
        ------
        InputError
            If nothing is seen by two cameras.
        """
        is_marker = [self._tracker.tracks.are_markers(found.tracks) for found in self._found]
        counts = [int(one.sum()) for one in is_marker]
        notices = tuple(self._notices(rate))
        if not sum(counts):
            raise InputError(f"{name}: no ball is seen by two cameras" + (f"; {'; '.join(notices)}" if notices else ""))
        kept = np.concatenate(is_marker)
        columns = [np.concatenate(column)[kept] for column in zip(*self._found, strict=True)]
        points, std, misfit, n_cameras, _ = columns
        attributes = {
            "reprojection_error": misfit * _noise_in_space(points, self._rig),
            "std": std,
            "n_blobs": n_cameras.astype(np.float64),
        }
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        return PointCloud(points, starts, np.array(self._times), attributes, name, notices)

    def _notices(self, rate: float | None) -> Iterator[str]:
        names, n_frames = self._rig.names, len(self._times)
        for index, count in sorted(self._lost.items()):
            if count > MANY_LOST * n_frames:
                share = 100 * count / n_frames
                yield f"{names[index]} lost {count} of {n_frames} images ({share:.1f} %); the others went on"
        for index, (count, first, fault) in sorted(self._faulty.items()):
            yield f"{names[index]}: {count} of {n_frames} images, the first of number {first}: {fault}"
        yield from self._fits.notices()
        n_ghosts = sum(int((~self._tracker.tracks.are_markers(found.tracks)).sum()) for found in self._found)
        if n_ghosts:
            yield f"{n_ghosts} crossings of two rays do not last and are left out"
        if rate is None:
            yield "the number of images per second is unknown: one is assumed; give the source ?rate=100"


def _noise_in_space(points: Floats, rig: CameraRig) -> Floats:
    """The noise of a ball where a point is [mm], by the middle distance of the cameras."""
    distances = np.linalg.norm(points[:, np.newaxis] - rig.places, axis=2).mean(axis=1)
    focal = np.mean([camera.matrix[0, 0] for camera in rig.cameras])
    return np.asarray(rig.noise * distances / focal)
