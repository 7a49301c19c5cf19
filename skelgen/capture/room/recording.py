"""The unlabelled markers of a whole recording, and which cameras fit the others no more: moved, exchanged, late."""

import os
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.detection import BallFinder
from skelgen.capture.optics import in_image, project
from skelgen.capture.room.points import RoomPoints, Views
from skelgen.capture.room.tracks import RoomTracker
from skelgen.capture.room.wand_and_ground import FEWEST_CAMERAS
from skelgen.capture.values import FrameSource, n_to_take
from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, CameraRig, RoomSettings
from skelgen.progress import SILENT, Monitor, with_progress

SAMPLE = 200
"""Frames that are kept to find out what is wrong."""

FEWEST_BALLS = 50
"""Balls of a camera, over all frames, without which it is not judged."""

LEAST_FIT, EXPLAINED = 0.3, 0.25
"""Parts of a camera's balls that fit points: below the first it is suspected; a cause explains it
if more than the second fit then, as chance makes three in a hundred fit."""

NEAR = 3.0
"""px; how near a ball must be to where a point is expected."""

MOST_LATE = 20
"""Frames that a camera is tried to be late or early."""

FARTHEST, BIN, WIDTH = 120.0, 6.0, 1280.0
"""px; largest shift of a moved camera's images that is tried, its steps, and the width of images that both hold for."""

_FLIPS = {"mirrored left to right": (-1.0, 1.0), "mirrored top to bottom": (1.0, -1.0), "upside down": (-1.0, -1.0)}


class FitCounter:
    """Counts of each camera how many of its balls are part of points.

    Parameters
    ----------
    rig : CameraRig
        The cameras of the settings.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self._balls, self._fitting = np.zeros(len(rig.cameras)), np.zeros(len(rig.cameras))
        self._views: list[list[Floats]] = []
        self._points: list[Floats] = []
        self._made_by: list[Bools] = []

    def add(self, views: Views, points: RoomPoints) -> None:
        """Count a frame.

        Parameters
        ----------
        views : sequence of Balls
            What each camera sees.
        points : RoomPoints
            What was made of it.
        """
        self._balls += [len(balls) for balls in views]
        self._fitting += (points.balls >= 0).sum(axis=0)
        if len(self._views) < SAMPLE:
            self._views.append([balls.centres for balls in views])
            self._points.append(points.points)
            self._made_by.append(np.asarray(points.balls >= 0))

    def notices(self) -> Iterator[str]:
        """Yield a sentence of each camera that does not fit the others."""
        share = self._fitting / np.maximum(self._balls, 1)
        bad = np.flatnonzero((share < LEAST_FIT) & (self._balls >= FEWEST_BALLS)).tolist()
        good = np.setdiff1d(np.arange(len(share)), bad)
        sure = [
            points[made_by[:, good].sum(axis=1) >= FEWEST_CAMERAS] if len(good) >= FEWEST_CAMERAS else points
            for points, made_by in zip(self._points, self._made_by, strict=True)
        ]
        for camera in bad:
            yield self._cause(camera, float(share[camera]), sure)

    def _cause(self, index: int, share: float, sure: list[Floats]) -> str:
        """What is wrong with a camera, judged by the points that the other cameras found."""
        camera, own = self._rig.cameras[index], [views[index] for views in self._views]
        name, middle = camera.name, (np.array(camera.size) - 1) / 2
        reasons = {
            f"{name} sends the images of {other.name}: exchange their cables, or their names in the settings": (
                _share_explained(other, own, sure)
            )
            for number, other in enumerate(self._rig.cameras)
            if number != index
        }
        for how, signs in _FLIPS.items():
            flipped = [(balls - middle) * signs + middle for balls in own]
            why = f"the images of {name} are {how}: set its driver as it was when it was calibrated"
            reasons[why] = _share_explained(camera, flipped, sure)
        for late in range(-MOST_LATE, MOST_LATE + 1):
            word = "late" if late > 0 else "early"
            why = f"the images of {name} are {abs(late)} frames {word}: trigger all cameras by one line"
            reasons[why] = _share_explained(camera, own, sure, late) if late else 0.0
        best = max(reasons, key=lambda why: reasons[why])
        if reasons[best] > EXPLAINED:
            return best
        shift, part = _shifted(camera, own, sure)
        if part > LEAST_FIT:
            far = float(np.hypot(*shift))
            return f"{name} looks {far:.0f} px aside of where it was calibrated: it was moved; calibrate again"
        return (
            f"only {100 * share:.0f} % of the balls of {name} fit those of the other cameras: it was moved far, or its "
            "settings are those of another camera; calibrate again"
        )


def _share_explained(camera: Camera, own: list[Floats], sure: list[Floats], late: int = 0) -> float:
    """How many of the balls lie where a camera would see points: 1 if all do exactly."""
    n_points = n_balls = 0
    fitting = 0.0
    for frame, points in enumerate(sure):
        if not 0 <= frame + late < len(own):
            continue
        expected, balls = _in_view(camera, points), own[frame + late]
        n_points, n_balls = n_points + len(expected), n_balls + len(balls)
        fitting += _fitting(balls, expected, NEAR)
    return fitting / min(n_points, n_balls) if min(n_points, n_balls) >= FEWEST_BALLS else 0.0


def _fitting(balls: Floats, expected: Floats, near: float) -> float:
    """How many balls are where points are expected; those that are off count for less."""
    if not len(expected) or not len(balls):
        return 0.0
    off = cKDTree(expected).query(balls)[0] / near
    return float(np.maximum(1.0 - off**2, 0.0).sum())


def _shifted(camera: Camera, own: list[Floats], sure: list[Floats]) -> tuple[Floats, float]:
    """By how much the balls lie aside of points [px], and which part of them does."""
    scale = camera.width / WIDTH
    farthest, step = FARTHEST * scale, BIN * scale
    gaps, expected = [np.empty((0, 2))], [_in_view(camera, points) for points in sure]
    for places, balls in zip(expected, own, strict=True):
        off = (balls[:, np.newaxis] - places).reshape(-1, 2)
        gaps.append(off[(np.abs(off) <= farthest).all(axis=1)])
    edges = np.arange(-farthest, farthest + step, step)
    across, down = np.concatenate(gaps).T
    counts = np.histogram2d(across, down, bins=(edges, edges))[0]
    best = np.unravel_index(counts.argmax(), counts.shape)
    shift = np.array([edges[best[0]], edges[best[1]]]) + step / 2
    fitting = sum(_fitting(balls - shift, places, 1.5 * step) for balls, places in zip(own, expected, strict=True))
    n_most = min(sum(map(len, own)), sum(map(len, expected)))
    return shift, fitting / max(n_most, 1)


def _in_view(camera: Camera, points: Floats) -> Floats:
    pixels = project(camera, points)
    return np.asarray(pixels[in_image(camera, pixels)])


MANY_LOST = 0.001
"""Part of a camera's images that are lost above which a notice says so."""


def markers_of_room(
    settings: RoomSettings,
    source: FrameSource,
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
    source : FrameSource
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
