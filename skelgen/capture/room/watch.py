"""Cameras whose images fit those of the others no more, from ordinary frames: moved, exchanged, mirrored, late."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.optics import in_image, project
from skelgen.capture.room.values import RoomPoints, Views
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, CameraRig

SAMPLE = 200
"""Frames that are kept to find out what is wrong."""

FEWEST_BALLS = 50
"""Balls of a camera, over all frames, without which it is not judged."""

LEAST_FIT, EXPLAINED = 0.3, 0.25
"""Parts of a camera's balls that fit points: below the one it is suspected, above the other something explains it, as
chance brings three in a hundred."""

NEAR = 3.0
"""px; how near a ball must be to where a point is expected."""

MOST_LATE = 20
"""Frames that a camera is tried to be late or early."""

FARTHEST, BIN = 120.0, 6.0
"""px; how far the images of a camera that was moved are looked for, and in which steps."""

_FLIPS = {
    "mirrored left to right": (-1.0, 1.0),
    "mirrored top to bottom": (1.0, -1.0),
    "upside down": (-1.0, -1.0),
}


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

    def notices(self) -> Iterator[str]:
        """Yield a sentence of each camera that does not fit the others."""
        share = self._fitting / np.maximum(self._balls, 1)
        bad = np.flatnonzero((share < LEAST_FIT) & (self._balls >= FEWEST_BALLS)).tolist()
        for camera in bad:
            yield self._why(camera, float(share[camera]))

    def _why(self, camera: int, share: float) -> str:
        eye, own = self._rig.cameras[camera], [views[camera] for views in self._views]
        name, middle = eye.name, (np.array(eye.size) - 1) / 2
        reasons = {
            f"{name} sends the images of {other.name}: exchange their cables, or their names in the settings": (
                self._explained(other, own)
            )
            for index, other in enumerate(self._rig.cameras)
            if index != camera
        }
        for how, signs in _FLIPS.items():
            flipped = [(balls - middle) * signs + middle for balls in own]
            why = f"the images of {name} are {how}: set its driver as it was when it was calibrated"
            reasons[why] = self._explained(eye, flipped)
        for late in range(-MOST_LATE, MOST_LATE + 1):
            word = "late" if late > 0 else "early"
            why = f"the images of {name} are {abs(late)} frames {word}: trigger all cameras by one line"
            reasons[why] = self._explained(eye, own, late) if late else 0.0
        best = max(reasons, key=lambda why: reasons[why])
        if reasons[best] > EXPLAINED:
            return best
        shift, part = self._shifted(eye, own)
        if part > LEAST_FIT:
            far = float(np.hypot(*shift))
            return f"{name} looks {far:.0f} px aside of where it was calibrated: it was moved; calibrate again"
        return (
            f"only {100 * share:.0f} % of the balls of {name} fit those of the other cameras: it was moved far, or its "
            "settings are those of another camera; calibrate again"
        )

    def _explained(self, eye: Camera, own: list[Floats], late: int = 0) -> float:
        """The part of the balls that lie where a camera would see points."""
        n_points = n_balls = n_seen = 0
        for frame, points in enumerate(self._points):
            if not 0 <= frame + late < len(own):
                continue
            expected, balls = _in_view(eye, points), own[frame + late]
            n_points, n_balls = n_points + len(expected), n_balls + len(balls)
            if len(expected) and len(balls):
                n_seen += int((cKDTree(expected).query(balls)[0] <= NEAR).sum())
        return n_seen / max(n_balls, 1) if min(n_points, n_balls) >= FEWEST_BALLS else 0.0

    def _shifted(self, eye: Camera, own: list[Floats]) -> tuple[Floats, float]:
        """By how much the balls lie aside of points [px], and which part of them does."""
        gaps, n_balls = [np.empty((0, 2))], 0
        for points, balls in zip(self._points, own, strict=True):
            expected = _in_view(eye, points)
            off = (balls[:, np.newaxis] - expected).reshape(-1, 2)
            gaps.append(off[(np.abs(off) <= FARTHEST).all(axis=1)])
            n_balls += len(balls)
        edges = np.arange(-FARTHEST, FARTHEST + BIN, BIN)
        across, down = np.concatenate(gaps).T
        counts = np.histogram2d(across, down, bins=(edges, edges))[0]
        best = np.unravel_index(counts.argmax(), counts.shape)
        nearby = counts[max(best[0] - 1, 0) : best[0] + 2, max(best[1] - 1, 0) : best[1] + 2].sum()
        shift = np.array([edges[best[0]], edges[best[1]]]) + BIN / 2
        return shift, float(nearby) / max(n_balls, 1)


def _in_view(eye: Camera, points: Floats) -> Floats:
    pixels = project(eye, points)
    return np.asarray(pixels[in_image(eye, pixels)])
