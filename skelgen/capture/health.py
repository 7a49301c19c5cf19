"""What goes wrong while capturing, in words: lost pairs, dark or glaring images, cameras unlike the settings."""

from collections import deque

from skelgen.capture.optics import match_and_triangulate
from skelgen.capture.values import Balls, FrameSet, StereoPoints
from skelgen.model.rig import StereoRig

WINDOW = 30
"""Frames with balls that show whether both images fit together: half a second."""

FEWEST_BALLS = 3
"""Balls in both images without which a frame does not count."""

LEAST_MATCHED = 0.3
"""Least part of the balls with a partner in the other image: nearly all if both images fit, few by chance."""


class RigWatch:
    """Watches pair after pair, and reports each trouble once, when it begins.

    Parameters
    ----------
    rig : StereoRig
        The cameras of the settings.
    """

    def __init__(self, rig: StereoRig) -> None:
        self._rig = rig
        self._known: set[str] = set()
        self._matched: deque[float] = deque(maxlen=WINDOW)
        self._swapped: deque[float] = deque(maxlen=WINDOW)

    def notices(self, pair: FrameSet, left: Balls, right: Balls, points: StereoPoints) -> tuple[str, ...]:
        """Return what went wrong with a pair, each lasting trouble only when it begins.

        Parameters
        ----------
        pair : FrameSet
            The images.
        left, right : Balls
            What was found in them.
        points : StereoPoints
            Points in space.
        """
        lost = "1 pair was" if pair.dropped == 1 else f"{pair.dropped} pairs were"
        notices = [f"{lost} lost before frame {pair.index}"] if pair.dropped else []
        lasting = [
            f"{side} image: {balls.notice}" for side, balls in (("left", left), ("right", right)) if balls.notice
        ]
        mismatch = self._mismatch(left, right, points)
        if mismatch:
            lasting.append(mismatch)
        new = [sentence for sentence in lasting if sentence not in self._known]
        self._known = set(lasting)
        return (*notices, *new)

    def _mismatch(self, left: Balls, right: Balls, points: StereoPoints) -> str:
        """What is wrong if hardly any ball has a partner: perhaps the cameras are exchanged."""
        fewer = min(len(left), len(right))
        if fewer >= FEWEST_BALLS:
            self._matched.append(matched_share(left, right, points))
        if len(self._matched) < WINDOW or sum(self._matched) / WINDOW >= LEAST_MATCHED:
            self._swapped.clear()
            return ""
        if fewer >= FEWEST_BALLS and len(self._swapped) < WINDOW:
            self._swapped.append(exchanged_share(left, right, self._rig))
        if len(self._swapped) < WINDOW:
            return ""
        return mismatch(sum(self._matched) / WINDOW, sum(self._swapped) / WINDOW)


def mismatch(matched: float, exchanged: float) -> str:
    """Return what is wrong with a rig, in words; empty if nothing is.

    Parameters
    ----------
    matched, exchanged : float
        Mean parts of the balls that have a partner in the other image, as the images are and if they are exchanged.
    """
    if matched >= LEAST_MATCHED:
        return ""
    if exchanged > 2 * LEAST_MATCHED:
        return "hardly any ball fits both images, but they do if exchanged: the cameras are swapped"
    return "hardly any ball fits both images: the cameras have moved, or the settings are of another rig"


def matched_share(left: Balls, right: Balls, points: StereoPoints) -> float:
    """Return the part of the balls that are part of a point, in the image with fewer balls.

    Parameters
    ----------
    left, right : Balls
        Of both images.
    points : StereoPoints
        Points in space that they make.
    """
    partners = min(len(set(points.left.tolist())), len(set(points.right.tolist())))
    return partners / max(min(len(left), len(right)), 1)


def exchanged_share(left: Balls, right: Balls, rig: StereoRig) -> float:
    """Return what `matched_share` would be if the cameras were exchanged.

    Parameters
    ----------
    left, right : Balls
        Of both images.
    rig : StereoRig
        The cameras.
    """
    return matched_share(right, left, match_and_triangulate(right, left, rig))
