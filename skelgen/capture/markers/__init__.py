"""From the images of a recording to unlabelled markers, image by image; only points are kept in memory."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np

from skelgen.capture.ball_tracks import BallTracks
from skelgen.capture.health import FEWEST_BALLS, LEAST_MATCHED, exchanged_share, matched_share, mismatch
from skelgen.capture.live import PointFinder
from skelgen.capture.markers.candidates import CandidateStore
from skelgen.capture.markers.correspondences import find_markers, noise_scale, track_pairs
from skelgen.capture.markers.one_camera import BallStore, points_of_one_camera
from skelgen.capture.values import Balls, FrameSet, FrameSource, StereoPoints, n_to_take
from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera, CaptureSettings, StereoRig
from skelgen.progress import SILENT, Monitor, counted, with_progress

N_BLOBS = 2
"""Balls of a marker that both cameras see."""


def markers_of(
    settings: CaptureSettings,
    source: FrameSource,
    *,
    n_frames: int | None = None,
    name: str = "",
    monitor: Monitor = SILENT,
) -> PointCloud:
    """Return the markers that both cameras see, or have seen and one still does, frame by frame and without labels.

    Parameters
    ----------
    settings : CaptureSettings
        The cameras, and the parameters of the detection.
    source : FrameSource
        Not yet entered.
    n_frames : int, optional
        Pairs of images at most; by default all of them.
    name : str
        What the take is called; by default as the source.
    monitor : Monitor
        Reports how many pairs are done; may cancel.

    Returns
    -------
    PointCloud
        In the rig's world, with the times of the pairs: lost ones leave a gap. Of each point ``reprojection_error``
        [mm] says how far the lines of sight of its balls are from meeting, ``std`` [mm] how uncertain it is in its
        worst direction, and ``n_blobs`` how many cameras see it; for points of one camera both deviations are that of
        the depth.

    Raises
    ------
    InputError
        If the source has no end, the images have another size than the settings say, no ball is seen in both, or
        hardly any ball of one image fits one of the other.
    SkelgenError
        What the source raises when it breaks off.
    """
    total = n_to_take(source.name, source.n_frames, n_frames, "pairs of images")
    monitor.begin("images")
    PointFinder(settings).load()
    with ThreadPoolExecutor(N_BLOBS, "images") as threads, source as pairs:
        recording = _Recording(settings, threads if (os.cpu_count() or 1) > 1 else None)
        for pair in with_progress(islice(pairs, n_frames), total, monitor):
            recording.add(pair)
    return recording.cloud(name or source.name, source.rate)


class _Recording:
    """What is kept of a recording: pairs of balls, tracks, times, what is wrong with images."""

    def __init__(self, settings: CaptureSettings, threads: ThreadPoolExecutor | None) -> None:
        self._rig, self._targets = settings.rig, settings.bodies
        self._finder = PointFinder(settings, threads)
        self._tracks = BallTracks(self._rig.left.size), BallTracks(self._rig.right.size)
        self._store, self._balls = CandidateStore(), (BallStore(), BallStore())
        self._times: list[float] = []
        self._health = ImageHealth(settings.rig)

    def add(self, pair: FrameSet) -> None:
        left, right, points = self._finder.find(pair)
        tracks = [one.follow(balls.centres, pair.time) for one, balls in zip(self._tracks, (left, right), strict=True)]
        self._store.add(points, *tracks)
        for store, balls, track in zip(self._balls, (left, right), tracks, strict=True):
            store.add(balls.centres, track)
        self._times.append(pair.time)
        self._health.look(pair, left, right, points)

    def cloud(self, name: str, rate: float | None) -> PointCloud:
        """Return the markers among all candidates."""
        self._health.check(name)
        candidates = self._store.all()
        pairs = track_pairs(candidates, *((follower.first, follower.last) for follower in self._tracks))
        step = float(np.median(np.diff(self._times))) if len(self._times) > 1 else 0.0
        kept = find_markers(candidates, pairs, self._rig.noise, step, self._targets)
        points, covariance = candidates.points[kept], candidates.covariance(np.flatnonzero(kept))
        balls = self._balls[0].all(), self._balls[1].all()
        scale = noise_scale(candidates, self._rig.noise)
        one = points_of_one_camera(candidates, kept, pairs, balls, self._rig, scale)
        misfit = misfit_in_space(points, candidates.misfit[kept].astype(np.float64), self._rig.left)
        frames = np.concatenate([candidates.frames[kept], one.frames])
        order = np.argsort(frames, kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(frames, minlength=len(self._times)))])
        attributes = {
            "reprojection_error": np.concatenate([misfit, scale * one.std])[order],
            "std": np.concatenate([np.sqrt(np.linalg.eigvalsh(covariance)[:, -1]), one.std])[order],
            "n_blobs": np.repeat([float(N_BLOBS), 1.0], [len(points), len(one.frames)])[order],
        }
        points = np.concatenate([points, one.points])[order]
        notices = (*self._health.notices(), *_notices(kept, len(one.frames), len(points), rate))
        return PointCloud(points, starts.astype(np.intp), np.array(self._times), attributes, name, notices)


class ImageHealth:
    """Counts over a whole recording what is wrong with images and settings.

    Parameters
    ----------
    rig : StereoRig
        The cameras of the settings.
    """

    def __init__(self, rig: StereoRig) -> None:
        self._rig = rig
        self._n_pairs = self._n_dropped = self._n_points = 0
        self._faulty: dict[str, tuple[int, int, str]] = {}  # by side: how many images, the first of them, its fault
        self._matched: list[float] = []
        self._exchanged: list[float] = []

    def look(self, pair: FrameSet, left: Balls, right: Balls, points: StereoPoints) -> None:
        """Take one more pair.

        Parameters
        ----------
        pair : FrameSet
            The images.
        left, right : Balls
            What was found in them.
        points : StereoPoints
            Points in space.
        """
        self._n_pairs += 1
        self._n_dropped += pair.dropped
        self._n_points += len(points)
        for side, balls in (("left", left), ("right", right)):
            if balls.notice:
                count, first, fault = self._faulty.get(side, (0, pair.index, balls.notice))
                self._faulty[side] = count + 1, first, fault
        if min(len(left), len(right)) >= FEWEST_BALLS:
            self._matched.append(matched_share(left, right, points))
            if self._matched[-1] < LEAST_MATCHED:
                self._exchanged.append(exchanged_share(left, right, self._rig))

    def check(self, name: str) -> None:
        """Refuse a recording that cannot give markers."""
        faults = "; ".join(self.notices())
        if not self._n_pairs:
            raise InputError(f"{name}: there is no pair of images")
        trouble = mismatch(_mean(self._matched, 1.0), _mean(self._exchanged, 0.0))
        if trouble:
            raise InputError(f"{name}: {trouble}")
        if not self._n_points:
            raise InputError(f"{name}: no ball is seen in both images of any pair" + (f"; {faults}" if faults else ""))

    def notices(self) -> tuple[str, ...]:
        """Return what the user should know of the images."""
        notices = [
            f"{side} image of {count} of {self._n_pairs} pairs, first of number {first}: {fault}"
            for side, (count, first, fault) in self._faulty.items()
        ]
        if self._n_dropped:
            share = f"({100 * self._n_dropped / (self._n_dropped + self._n_pairs):.1f} %)"
            one = f"pair of images was lost {share}; its time stays empty"
            several = f"pairs of images were lost {share}; their time stays empty"
            notices.append(counted(self._n_dropped, one, several))
        return tuple(notices)


def misfit_in_space(points: Floats, misfit: Floats, camera: Camera) -> Floats:
    """Return distances in an image as distances where the points are.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        In the world.
    misfit : ndarray, shape (n,), px
        Distances in the camera's image.
    camera : Camera
        One of the rig.

    Returns
    -------
    ndarray, shape (n,), mm
    """
    depths = points @ camera.camera_from_world[2, :3] + camera.camera_from_world[2, 3]
    return np.asarray(misfit * depths / camera.matrix[0, 0])


def _notices(kept: Bools, n_of_one_camera: int, n_points: int, rate: float | None) -> Iterator[str]:
    """What the user should know of the markers: what was left out, and what rests on less than two cameras."""
    n_left_out = int((~kept).sum())
    if n_left_out:
        share = 100 * n_left_out / len(kept)
        yield f"{n_left_out} of {len(kept)} pairs of balls ({share:.1f} %) fit only by chance and are left out"
    if n_of_one_camera:
        yield (
            f"{n_of_one_camera} of {n_points} points ({100 * n_of_one_camera / n_points:.1f} %) are seen by one camera "
            "only; constant distances to other markers give their depth"
        )
    if rate is None:
        yield "the number of images per second is unknown: one is assumed; give the source ?rate=60"


def _mean(values: list[float], if_none: float) -> float:
    return float(np.mean(values)) if values else if_none
