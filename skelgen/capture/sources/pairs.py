"""Numbered pairs from the images of two cameras: which belong together, how many were lost, the newest of live ones."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol, Self

from skelgen.capture.sources.options import CameraOptions
from skelgen.capture.values import FramePair, Image
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


def pair_of(cameras: Sequence[LiveCamera]) -> "OpenPair":
    """Return two cameras that run as a pair; errors as of `shared_rate`."""
    (left, right), rate = with_rate(cameras)
    return OpenPair(left, right, rate)


@dataclass(frozen=True)
class OpenPair:
    """Two cameras that run.

    Attributes
    ----------
    left, right : LiveCamera
        The cameras.
    rate : float or None, Hz
        Frames a second; None if unknown.
    """

    left: LiveCamera
    right: LiveCamera
    rate: float | None


class LivePairs:
    """The frame source of two cameras.

    Parameters
    ----------
    name : str
        For messages.
    open_pair : callable
        Opens and starts both cameras; the stack closes them.
    options : CameraOptions
        Order, time-out, allowed skew, number of pairs.
    """

    def __init__(self, name: str, open_pair: Callable[[ExitStack], OpenPair], options: CameraOptions) -> None:
        self.name = name
        self.n_frames = options.frames or None
        self.worst_skew = 0.0
        self._open_pair = open_pair
        self._options = options
        self._stack = ExitStack()
        self._pair: OpenPair | None = None
        self._counter = PairCounter(None)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]; known while the cameras are open."""
        return self._opened.left.size

    @property
    def rate(self) -> float | None:
        """Pairs a second [Hz]; known while the cameras are open."""
        return self._opened.rate

    @property
    def n_dropped(self) -> int:
        """Pairs lost so far."""
        return self._counter.n_dropped

    def __enter__(self) -> Self:
        """Open and start both cameras."""
        with ExitStack() as stack:
            pair = self._open_pair(stack)
            check_same_size(pair.left.size, pair.right.size, (pair.left.name, pair.right.name))
            self._stack = stack.pop_all()
        self._pair = pair
        self._counter = PairCounter(pair.rate)
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop both cameras and let go of them."""
        self._pair = None
        self._stack.close()

    def __iter__(self) -> Iterator[FramePair]:
        """Deliver pairs until the source is closed, or as many as were asked for.

        Raises
        ------
        CaptureError
            If a camera is unplugged or falls silent, or the images of a pair are further apart than allowed.
        """
        n_delivered = 0
        while self._pair is not None and (self.n_frames is None or n_delivered < self.n_frames):
            yield self._counter.pair(*self._next(self._pair))
            n_delivered += 1

    @property
    def _opened(self) -> OpenPair:
        if self._pair is None:
            raise CaptureError(f"{self.name} is not open; use it in a with block")
        return self._pair

    def _next(self, pair: OpenPair) -> tuple[Shot, Shot]:
        take = self._newest if self._options.order == "newest" else self._following
        left, right = take(pair.left), take(pair.right)
        allowed = self._options.skew * _MILLISECONDS
        same_frame = max(0.5 / pair.rate if pair.rate else 0.0, allowed)
        for _ in range(_TRIES):
            if abs(left.time - right.time) < same_frame:
                break
            if left.time < right.time:
                left = self._following(pair.left)
            else:
                right = self._following(pair.right)
        skew = abs(left.time - right.time)
        if skew > allowed:
            raise CaptureError(
                f"the images of {pair.left.name} and {pair.right.name} are {skew / _MILLISECONDS:.3g} ms apart, and "
                f"{self._options.skew:g} ms are allowed: give both cameras one bus or one trigger, or allow more by "
                "?skew=..."
            )
        self.worst_skew = max(self.worst_skew, skew)
        return left, right

    def _following(self, camera: LiveCamera) -> Shot:
        shot = camera.take(self._options.timeout)
        if shot is None:
            raise CaptureError(
                f"{camera.name} has sent no image for {self._options.timeout:g} s; check its cable and its trigger"
            )
        return shot

    def _newest(self, camera: LiveCamera) -> Shot:
        """Return the newest image; if all places were taken, those that came later were lost, and one is waited for."""
        shot, n_taken = self._following(camera), 1
        while (later := camera.take(0.0)) is not None:
            shot, n_taken = later, n_taken + 1
        was_full = camera.capacity is not None and n_taken >= camera.capacity
        return self._following(camera) if was_full else shot
