"""From two cameras' images to numbered pairs: which belong together, and how many were lost between."""

from __future__ import annotations

from dataclasses import dataclass

from skelgen.capture.frames import FramePair, Image
from skelgen.errors import CaptureError


@dataclass(frozen=True, eq=False)
class Shot:
    """One camera's image.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey values.
    time : float, s
        When it was taken, by a clock that both cameras share.
    number : int or None
        The camera's own count of its frames, lost ones included; None if it does not count.
    """

    image: Image
    time: float
    number: int | None = None


class PairCounter:
    """Gives pairs their time and index, and counts those that were lost before them.

    Lost pairs show as holes in the cameras' own count, or else as gaps between the times: libdc1394's count of
    frames that wait is always zero on Linux.

    Parameters
    ----------
    rate : float or None
        Pairs a second [Hz]; None counts by the cameras' numbers alone.
    """

    def __init__(self, rate: float | None) -> None:
        self.rate = rate
        self.n_dropped = 0
        self._index = -1
        self._first_time = 0.0
        self._last: Shot | None = None

    def pair(self, left: Shot, right: Shot) -> FramePair:
        """Return the next pair; its time is the left image's.

        Parameters
        ----------
        left, right : Shot
            Later than those of the pair before.
        """
        lost = 0 if self._last is None else self._lost_between(self._last, left)
        if self._last is None:
            self._first_time = left.time
        self._last = left
        self._index += 1 + lost
        self.n_dropped += lost
        left.image.flags.writeable = False
        right.image.flags.writeable = False
        return FramePair(left.image, right.image, left.time - self._first_time, self._index, lost)

    def _lost_between(self, before: Shot, now: Shot) -> int:
        if before.number is not None and now.number is not None:
            return max(now.number - before.number - 1, 0)
        if self.rate is None:
            return 0
        return max(round((now.time - before.time) * self.rate) - 1, 0)


def check_same_size(left: tuple[int, int], right: tuple[int, int], names: tuple[str, str]) -> tuple[int, int]:
    """Return the size [px] that both images share.

    Raises
    ------
    CaptureError
        If they differ.
    """
    if left != right:
        raise CaptureError(
            f"the images have different sizes: {names[0]} {left[0]} x {left[1]}, {names[1]} {right[0]} x {right[1]} "
            "pixels; a pair needs two cameras set to the same size"
        )
    return left


__all__ = ["PairCounter", "Shot", "check_same_size"]
