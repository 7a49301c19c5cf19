"""What GigE Vision and GenTL cameras have in common: a clock of their own, a count of frames, formats of pixels."""

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.sources.options import GenicamOptions
from skelgen.capture.sources.pairs import LiveCamera
from skelgen.capture.values import Image
from skelgen.errors import CaptureError

_WINDOW = 300  # frames: long enough for one that came without delay, short enough to follow clocks that drift apart
_BLOCKS = 65535  # GigE Vision 1 numbers frames 1 .. 65535 and begins again at 1
WARM_UP = 10
"""Images after which a camera's clock is known to a part of a millisecond."""


@contextlib.contextmanager
def errors_in_words(who: str, *errors: type[Exception]) -> Iterator[None]:
    """Raise a library's errors as `CaptureError`, with the words for what it was done to."""
    try:
        yield
    except errors as error:
        raise CaptureError(f"{who}: {str(error).strip() or type(error).__name__}") from error


def close_at_the_end(stack: ExitStack, act: Callable[..., Any], *errors: type[Exception]) -> None:
    """Have a stack close something, which may be gone already.

    Parameters
    ----------
    stack : ExitStack
        Ends when the camera is no longer needed.
    act : callable ()
        Closes it.
    *errors
        What the library raises, which does not matter then.
    """

    def close() -> None:
        with contextlib.suppress(*errors):
            act()

    stack.callback(close)


class SharedClock:
    """Brings a camera's clock to the computer's, which both cameras then share.

    No image arrives before it was taken, and some arrive without delay: the smallest difference between arrival and
    the camera's time is the offset of the clocks, up to the delay that all images have.
    """

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=_WINDOW)

    def time(self, taken: float | None, arrived: float) -> float:
        """Return when an image was taken, by the computer's clock.

        Parameters
        ----------
        taken : float or None, s
            By the camera's clock; None if it has none, then the arrival counts.
        arrived : float, s
            By the computer's clock.
        """
        if taken is None:
            return arrived
        self._offsets.append(arrived - taken)
        return taken + min(self._offsets)


class FrameNumber:
    """Goes on counting where a camera begins again."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._rounds = 0

    def of(self, number: int) -> int:
        """Return a number that always grows."""
        if self._last is not None and number < self._last:
            self._rounds += 1
        self._last = number
        return number + self._rounds * _BLOCKS


def grey(values: NDArray[np.uint8] | NDArray[np.uint16], pixel_format: str, camera: str) -> Image:
    """Return a grey image of 8 bits, the highest ones of those that the camera sends.

    Parameters
    ----------
    values : ndarray, shape (height, width)
        As sent.
    pixel_format : str
        Its name, as ``Mono8`` or ``Mono12Packed``.
    camera : str
        For the sentence of an error.

    Raises
    ------
    CaptureError
        If the format is not grey.
    """
    bits = "".join(letter for letter in pixel_format.removeprefix("Mono")[:2] if letter.isdigit())
    if not pixel_format.startswith("Mono") or not bits or values.ndim != 2:
        raise CaptureError(f"{camera} sends {pixel_format} where grey is needed; set its PixelFormat to Mono8")
    if values.dtype == np.uint8:
        return np.array(values, np.uint8)
    return (values >> (int(bits) - 8)).astype(np.uint8)


def named(
    found: list[Any], known: Sequence[tuple[str, ...]], names: tuple[str, ...], no_camera: str, listed: str
) -> list[Any]:
    """Return the cameras of these names.

    Parameters
    ----------
    found : list
        All cameras.
    known : sequence of tuple of str
        What each may be called.
    names : tuple of str
        Those that are wanted.
    no_camera : str
        What is said before a name that none has.
    listed : str
        What was found, in words.

    Raises
    ------
    CaptureError
        If one is not there.
    """
    chosen = []
    for name in names:
        fitting = [device for device, called in zip(found, known, strict=True) if name in called]
        if not fitting:
            raise CaptureError(f"{no_camera} {name}; {listed}")
        chosen.append(fitting[0])
    return chosen


def first_size(camera: LiveCamera, options: GenicamOptions) -> tuple[int, int]:
    """Wait until the clock's offset is known, and return the images' size [px]; a trigger may delay the first image.

    Parameters
    ----------
    camera : LiveCamera
        It runs already.
    options : GenicamOptions
        How it is to run.

    Raises
    ------
    CaptureError
        If no image comes.
    """
    size = (0, 0)
    for _ in range(1 if options.trigger else WARM_UP):
        shot = camera.take(options.timeout)
        if shot is None:
            raise CaptureError(f"{camera.name} sends no image within {options.timeout:g} s; check its trigger")
        size = (shot.image.shape[1], shot.image.shape[0])
    return size
