"""Cameras whose images fit those of the others no more, from ordinary frames: moved, exchanged, mirrored, late."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.optics import in_image, project
from skelgen.capture.room.points import RoomPoints, Views
from skelgen.capture.room.wand_and_ground import FEWEST_CAMERAS
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera, CameraRig

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
            yield self._why(camera, float(share[camera]), sure)

    def _why(self, camera: int, share: float, sure: list[Floats]) -> str:
        """What is wrong with a camera, judged by the points that the other cameras found."""
        eye, own = self._rig.cameras[camera], [views[camera] for views in self._views]
        name, middle = eye.name, (np.array(eye.size) - 1) / 2
        reasons = {
            f"{name} sends the images of {other.name}: exchange their cables, or their names in the settings": (
                _explained(other, own, sure)
            )
            for index, other in enumerate(self._rig.cameras)
            if index != camera
        }
        for how, signs in _FLIPS.items():
            flipped = [(balls - middle) * signs + middle for balls in own]
            why = f"the images of {name} are {how}: set its driver as it was when it was calibrated"
            reasons[why] = _explained(eye, flipped, sure)
        for late in range(-MOST_LATE, MOST_LATE + 1):
            word = "late" if late > 0 else "early"
            why = f"the images of {name} are {abs(late)} frames {word}: trigger all cameras by one line"
            reasons[why] = _explained(eye, own, sure, late) if late else 0.0
        best = max(reasons, key=lambda why: reasons[why])
        if reasons[best] > EXPLAINED:
            return best
        shift, part = _shifted(eye, own, sure)
        if part > LEAST_FIT:
            far = float(np.hypot(*shift))
            return f"{name} looks {far:.0f} px aside of where it was calibrated: it was moved; calibrate again"
        return (
            f"only {100 * share:.0f} % of the balls of {name} fit those of the other cameras: it was moved far, or its "
            "settings are those of another camera; calibrate again"
        )


def _explained(eye: Camera, own: list[Floats], sure: list[Floats], late: int = 0) -> float:
    """How many of the balls lie where a camera would see points: 1 if all do exactly."""
    n_points = n_balls = 0
    fitting = 0.0
    for frame, points in enumerate(sure):
        if not 0 <= frame + late < len(own):
            continue
        expected, balls = _in_view(eye, points), own[frame + late]
        n_points, n_balls = n_points + len(expected), n_balls + len(balls)
        fitting += _fitting(balls, expected, NEAR)
    return fitting / min(n_points, n_balls) if min(n_points, n_balls) >= FEWEST_BALLS else 0.0


def _fitting(balls: Floats, expected: Floats, near: float) -> float:
    """How many balls are where points are expected; those that are off count for less."""
    if not len(expected) or not len(balls):
        return 0.0
    off = cKDTree(expected).query(balls)[0] / near
    return float(np.maximum(1.0 - off**2, 0.0).sum())


def _shifted(eye: Camera, own: list[Floats], sure: list[Floats]) -> tuple[Floats, float]:
    """By how much the balls lie aside of points [px], and which part of them does."""
    scale = eye.width / WIDTH
    farthest, step = FARTHEST * scale, BIN * scale
    gaps, expected = [np.empty((0, 2))], [_in_view(eye, points) for points in sure]
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


def _in_view(eye: Camera, points: Floats) -> Floats:
    pixels = project(eye, points)
    return np.asarray(pixels[in_image(eye, pixels)])
