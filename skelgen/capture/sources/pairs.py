"""Cameras that run, moment by moment: what was lost between, and which images of two cameras belong together."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol, Self

from skelgen.capture.sources.options import CameraOptions
from skelgen.capture.values import SIDES, FrameSet, Image
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


def lost_between(before: float | None, now: float | None, rate: float | None) -> int:
    """Return how many moments are missing between two that were taken; 0 where that cannot be told.

    Parameters
    ----------
    before, now : float or None, s
        When both were taken.
    rate : float or None, Hz
        Moments a second.
    """
    return 0 if before is None or now is None or not rate else max(round((now - before) * rate) - 1, 0)


def check_same_size(left: tuple[int, int], right: tuple[int, int], names: tuple[str, str]) -> tuple[int, int]:
    """Return the size [px] that both images share.

    Parameters
    ----------
    left, right : tuple of int, px
        Width and height of the images.
    names : tuple of str
        What they are called in messages.

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


_MILLISECONDS = 1e-3
_SAME_RATE = 0.01  # of the largest
_TRIES = 100  # steps to find a partner: more than frames can be apart that were started together


class LiveCamera(Protocol):
    """What every driver offers.

    Attributes
    ----------
    name : str
        For messages.
    size : tuple of int, px
        Width and height.
    capacity : int or None
        Images that can wait before later ones are lost; None if later ones take the place of older ones.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def size(self) -> tuple[int, int]: ...  # noqa: D102

    @property
    def capacity(self) -> int | None: ...  # noqa: D102

    def take(self, timeout: float) -> Shot | None:
        """Return the oldest image that waits, or None if none comes within `timeout` seconds."""


def with_rate(cameras: Sequence[LiveCamera]) -> tuple[Sequence[LiveCamera], float | None]:
    """Return cameras with their rate [Hz]: the one that all have, else None."""
    rates = [(camera.name, getattr(camera, "rate", None)) for camera in cameras]
    return cameras, None if any(rate is None for _, rate in rates) else shared_rate(rates)


def shared_rate(rates: Sequence[tuple[str, float | None]]) -> float | None:
    """Return the rate that cameras or recordings have [Hz]; None if that of none is known.

    Parameters
    ----------
    rates : sequence of tuple of str and float or None, Hz
        What each is called, and its rate, if it is known.

    Raises
    ------
    CaptureError
        If their rates differ by more than a hundredth.
    """
    known = [rate for _, rate in rates if rate is not None]
    if known and max(known) - min(known) > _SAME_RATE * max(known):
        listed = ", ".join(f"{name} {rate:.4g} Hz" for name, rate in rates if rate is not None)
        raise CaptureError(f"images come at different rates: {listed}; give each the right one by ?rate=...")
    return known[0] if known else None


Opener = Callable[[ExitStack], tuple[Sequence[LiveCamera], float | None]]
"""Opens and starts all cameras; the stack closes them. Their rate [Hz], if it is known."""


class LiveCameras(ABC):
    """Cameras that run while they are entered.

    Parameters
    ----------
    name : str
        For messages.
    opener : callable
        Opens and starts them.
    options : CameraOptions
        Order, time-out, allowed skew, number of moments.

    Attributes
    ----------
    running : list of LiveCamera
        The cameras that run.
    rate : float or None, Hz
        Moments a second; known while the cameras run.
    worst_skew : float, s
        How far apart images of one moment were at most.
    n_dropped : int
        Moments lost so far: holes in the count of the first camera, or else gaps between the times, as libdc1394's
        count of frames that wait is always zero on Linux.
    """

    def __init__(self, name: str, opener: Opener, options: CameraOptions) -> None:
        self.name, self.opener, self.options = name, opener, options
        self.n_frames = options.frames or None
        self.rate: float | None = options.rate or None
        self.worst_skew, self._first_time = 0.0, 0.0
        self.n_dropped, self._index, self._before = 0, -1, list[Shot | None]()
        self._stack, self.running = ExitStack(), list[LiveCamera]()

    def __enter__(self) -> Self:
        """Open and start all cameras."""
        with ExitStack() as stack:
            cameras, self.rate = self.opener(stack)
            self._begin(cameras)
            self._stack = stack.pop_all()
        self.running, self.n_dropped, self._index, self._before = list(cameras), 0, -1, []
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop all cameras and let go of them."""
        self.running = []
        self._stack.close()

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver moments until the source is closed, or as many as were asked for; their times are the first camera's.

        Raises
        ------
        CaptureError
            If cameras are unplugged or fall silent, or images of one moment are further apart than allowed.
        """
        n_delivered = 0
        while self.running and n_delivered != self.n_frames:
            shots = self._next()
            time, lost = _time_of(shots), self._lost_before(shots)
            self._first_time = self._first_time if self._before else time
            self._before, self._index, self.n_dropped = shots, self._index + 1 + lost, self.n_dropped + lost
            images = tuple(None if shot is None else shot.image for shot in shots)
            yield FrameSet(images, time - self._first_time, self._index, lost)
            n_delivered += 1

    def _lost_before(self, now: list[Shot | None]) -> int:
        if not self._before:
            return 0
        one, other = self._before[0], now[0]
        if one is not None and other is not None and one.number is not None and other.number is not None:
            return max(other.number - one.number - 1, 0)
        return lost_between(_time_of(self._before), _time_of(now), self.rate)

    @abstractmethod
    def _begin(self, cameras: Sequence[LiveCamera]) -> None:
        """Check cameras that were just opened."""

    @abstractmethod
    def _next(self) -> list[Shot | None]:
        """Take the images of the next moment, None of cameras that lost theirs, which are not all."""

    @property
    def _allowed(self) -> float:
        """How far apart images of one moment may be [s]."""
        return self.options.skew * _MILLISECONDS

    @property
    def _same_moment(self) -> float:
        """Images that are less apart [s] are of one moment."""
        return max(0.5 / self.rate if self.rate else 0.0, self._allowed)


def _time_of(shots: Sequence[Shot | None]) -> float:
    return next(shot.time for shot in shots if shot is not None)


class LivePairs(LiveCameras):
    """The frame source of two cameras; see `LiveCameras`."""

    cameras = SIDES

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]; known while the cameras are open."""
        if not self.running:
            raise CaptureError(f"{self.name} is not open; use it in a with block")
        return self.running[0].size

    def _begin(self, cameras: Sequence[LiveCamera]) -> None:
        left, right = cameras
        check_same_size(left.size, right.size, (left.name, right.name))

    def _next(self) -> list[Shot | None]:
        left, right = self.running
        take = self._newest if self.options.order == "newest" else self._following
        first, second = take(left), take(right)
        for _ in range(_TRIES):
            if abs(first.time - second.time) < self._same_moment:
                break
            if first.time < second.time:
                first = self._following(left)
            else:
                second = self._following(right)
        skew = abs(first.time - second.time)
        if skew > self._allowed:
            raise CaptureError(
                f"the images of {left.name} and {right.name} are {skew / _MILLISECONDS:.3g} ms apart, and "
                f"{self.options.skew:g} ms are allowed: give both cameras one bus or one trigger, or allow more by "
                "?skew=..."
            )
        self.worst_skew = max(self.worst_skew, skew)
        for shot in (first, second):
            shot.image.flags.writeable = False
        return [first, second]

    def _following(self, camera: LiveCamera) -> Shot:
        shot = camera.take(self.options.timeout)
        if shot is None:
            raise CaptureError(
                f"{camera.name} has sent no image for {self.options.timeout:g} s; check its cable and its trigger"
            )
        return shot

    def _newest(self, camera: LiveCamera) -> Shot:
        """Return the newest image; if all places were taken, those that came later were lost, and one is waited for."""
        shot, n_taken = self._following(camera), 1
        while (later := camera.take(0.0)) is not None:
            shot, n_taken = later, n_taken + 1
        was_full = camera.capacity is not None and n_taken >= camera.capacity
        return self._following(camera) if was_full else shot
