"""Numbered pairs from the images of two cameras: which belong together, how many were lost, the newest of live ones."""

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

    def pair(self, left: Shot, right: Shot) -> FrameSet:
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
        return FrameSet((left.image, right.image), left.time - self._first_time, self._index, lost)

    def _lost_between(self, before: Shot, now: Shot) -> int:
        if before.number is not None and now.number is not None:
            return max(now.number - before.number - 1, 0)
        return lost_between(before.time, now.time, self.rate)


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


class LiveCameras:
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
    """

    def __init__(self, name: str, opener: Opener, options: CameraOptions) -> None:
        self.name, self.opener, self.options = name, opener, options
        self.n_frames = options.frames or None
        self.rate: float | None = options.rate or None
        self.worst_skew = 0.0
        self._stack, self.running = ExitStack(), list[LiveCamera]()

    def __enter__(self) -> Self:
        """Open and start all cameras."""
        with ExitStack() as stack:
            cameras, self.rate = self.opener(stack)
            self._begin(cameras)
            self._stack = stack.pop_all()
        self.running = list(cameras)
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop all cameras and let go of them."""
        self.running = []
        self._stack.close()

    def _begin(self, cameras: Sequence[LiveCamera]) -> None:
        """Check cameras that were just opened."""

    @property
    def _allowed(self) -> float:
        """How far apart images of one moment may be [s]."""
        return self.options.skew * _MILLISECONDS

    @property
    def _same_moment(self) -> float:
        """Images that are less apart [s] are of one moment."""
        return max(0.5 / self.rate if self.rate else 0.0, self._allowed)


class LivePairs(LiveCameras):
    """The frame source of two cameras; see `LiveCameras`."""

    cameras = SIDES
    _counter = PairCounter(None)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]; known while the cameras are open."""
        if not self.running:
            raise CaptureError(f"{self.name} is not open; use it in a with block")
        return self.running[0].size

    @property
    def n_dropped(self) -> int:
        """Pairs lost so far."""
        return self._counter.n_dropped

    def _begin(self, cameras: Sequence[LiveCamera]) -> None:
        left, right = cameras
        check_same_size(left.size, right.size, (left.name, right.name))
        self._counter = PairCounter(self.rate)

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver pairs until the source is closed, or as many as were asked for.

        Raises
        ------
        CaptureError
            If a camera is unplugged or falls silent, or the images of a pair are further apart than allowed.
        """
        n_delivered = 0
        while self.running and (self.n_frames is None or n_delivered < self.n_frames):
            yield self._counter.pair(*self._next(*self.running))
            n_delivered += 1

    def _next(self, left: LiveCamera, right: LiveCamera) -> tuple[Shot, Shot]:
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
        return first, second

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
