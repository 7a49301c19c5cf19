"""Cameras that run: the images of one moment, by their times; a camera that lost one does not stop the others.

Sources of several kinds run as one: folders beside videos, cameras of one driver beside those of another.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib import import_module
from itertools import zip_longest
from typing import Self

from skelgen.capture.sources.options import CameraOptions, SourceText
from skelgen.capture.sources.pairs import LiveCamera, LiveCameras, Opener, Shot, shared_rate
from skelgen.capture.values import FrameSet, FrameSource
from skelgen.errors import CaptureError

EXAMPLES = {
    "firewire": "firewire:GUID1,GUID2,GUID3",
    "gige": "gige:10.0.0.2,10.0.0.3,10.0.0.4",
    "gentl": "gentl:producer.cti,one,two,three",
}
"""How cameras of each driver are named."""


class LiveSets(LiveCameras):
    """The images of cameras that run.

    Every camera's oldest image waits. Those that were taken at the time of the oldest of all are one moment; a camera
    whose image is later lost the one of this moment.

    A camera that has fallen silent is waited for once; after that the others go on at their rate.

    Parameters
    ----------
    name : str
        For messages.
    cameras : tuple of str
        What the cameras are called.
    opener : callable
        Opens and starts them.
    options : CameraOptions
        Rate, time-out, allowed skew, number of sets.
    """

    def __init__(self, name: str, cameras: tuple[str, ...], opener: Opener, options: CameraOptions) -> None:
        super().__init__(name, opener, options)
        self.cameras = cameras
        self._waiting: list[Shot | None] = []
        self._silent: set[int] = set()

    def _begin(self, cameras: Sequence[LiveCamera]) -> None:
        self._waiting = [None] * len(cameras)

    def _next(self) -> list[Shot | None]:
        """The images of the next moment, None of the cameras that lost theirs."""
        for place, camera in enumerate(self.running):
            if self._waiting[place] is None:
                shot = self._waiting[place] = camera.take(0.0 if place in self._silent else self.options.timeout)
                if shot is None and len(self._silent) < len(self.running) - 1:
                    self._silent.add(place)
                elif shot is not None:
                    self._silent.discard(place)
        there = [shot.time for shot in self._waiting if shot is not None]
        if not there:
            raise CaptureError(
                f"no camera of {self.name} has sent an image for {self.options.timeout:g} s; check cables and trigger"
            )
        oldest = min(there)
        out: list[Shot | None] = []
        for place, shot in enumerate(self._waiting):
            is_now = shot is not None and shot.time - oldest < self._same_moment
            out.append(shot if is_now else None)
            if is_now:
                self._waiting[place] = None
        self._check_skew(out, oldest)
        return out

    def _check_skew(self, shots: list[Shot | None], oldest: float) -> None:
        for camera, shot in zip(self.running, shots, strict=True):
            skew = 0.0 if shot is None else shot.time - oldest
            self.worst_skew = max(self.worst_skew, skew)
            if skew > self._allowed:
                raise CaptureError(
                    f"the images of {camera.name} are {1e3 * skew:.3g} ms later than those of others, and "
                    f"{self.options.skew:g} ms are allowed: trigger all cameras by one line, or allow more: ?skew=..."
                )


def open_live_sets(text: SourceText, options: CameraOptions) -> LiveSets:
    """Return cameras of one driver; they are opened when the source is entered.

    Parameters
    ----------
    text : SourceText
        Names each camera, in their order.
    options : CameraOptions
        How they are to run.

    Raises
    ------
    CaptureError
        If the text names no camera, or one twice.
    """
    driver, count = import_module(f"skelgen.capture.sources.{text.kind}"), len(set(text.cameras))
    if count != len(text.cameras) or not count:
        raise CaptureError(f"{text}: names {count} cameras; name each once, in their order, as {EXAMPLES[text.kind]}")
    return LiveSets(str(text), text.cameras, driver.opener(text.places, options), options)


class RecordedTogether:
    """Recordings of several kinds, moment by moment; the first moments of all are one.

    Parameters
    ----------
    sources : sequence of FrameSource
        Recordings, none of which runs.

    Raises
    ------
    CaptureError
        If a camera is in two of them, or their rates differ.
    """

    def __init__(self, sources: Sequence[FrameSource]) -> None:
        self._sources = tuple(sources)
        self.name = " + ".join(source.name for source in sources)
        self.cameras = _names([source.cameras for source in sources])
        self.rate = shared_rate([(source.name, source.rate) for source in sources])

    @property
    def n_frames(self) -> int | None:
        """Moments of the longest one."""
        return max((source.n_frames or 0 for source in self._sources), default=0) or None

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._open = [stack.enter_context(source) for source in self._sources]
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver moments until all have ended."""
        for index, sets in enumerate(zip_longest(*self._open)):
            images = tuple(
                image
                for source, one in zip(self._open, sets, strict=True)
                for image in (one.images if one is not None else (None,) * len(source.cameras))
            )
            yield FrameSet(images, index / self.rate if self.rate else float(index), index)


def run_together(sources: Sequence[LiveSets]) -> LiveSets:
    """Return running cameras of several drivers as one source.

    Drivers have clocks of their own: the first images of each are taken as one moment, so the trigger must begin after
    all have started.

    Parameters
    ----------
    sources : sequence of LiveSets
        Not yet entered. The options are those of the first one.
    """
    names = _names([source.cameras for source in sources])

    def opener(stack: ExitStack) -> tuple[Sequence[LiveCamera], float | None]:
        cameras: list[LiveCamera] = []
        rates: list[tuple[str, float | None]] = []
        for source in sources:
            own, rate = source.opener(stack)
            clock: list[float] = []
            cameras += [_FromFirstImage(camera, clock) for camera in own]
            rates.append((source.name, rate))
        return cameras, shared_rate(rates)

    return LiveSets(" + ".join(source.name for source in sources), names, opener, sources[0].options)


class _FromFirstImage:
    """A camera whose times count from the first image of its driver."""

    def __init__(self, camera: LiveCamera, clock: list[float]) -> None:
        self._camera, self._clock = camera, clock
        self.name, self.size, self.capacity = camera.name, camera.size, camera.capacity

    def take(self, timeout: float) -> Shot | None:
        """Return the oldest image that waits."""
        shot = self._camera.take(timeout)
        if shot is None:
            return None
        if not self._clock:
            self._clock.append(shot.time)
        return Shot(shot.image, shot.time - self._clock[0], shot.number)


def _names(cameras: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """The names of all cameras; those of one name are told apart by the number of their source."""
    every = [name for names in cameras for name in names]
    return tuple(
        name if every.count(name) == 1 else f"{name} of {number}"
        for number, names in enumerate(cameras, 1)
        for name in names
    )
