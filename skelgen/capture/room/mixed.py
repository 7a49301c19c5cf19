"""Sources of several kinds as one: folders beside videos, cameras of one driver beside those of another."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from itertools import zip_longest
from typing import Protocol, Self

from skelgen.capture.room.live_sources import LiveSets, shared_rate
from skelgen.capture.room.values import FrameSet
from skelgen.capture.sources.pairs import LiveCamera, Shot


class _Recorded(Protocol):
    name: str
    rate: float | None
    cameras: tuple[str, ...]

    @property
    def n_frames(self) -> int | None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...

    def __iter__(self) -> Iterator[FrameSet]: ...


class RecordedTogether:
    """Recordings of several kinds, moment by moment; the first moments of all are one.

    Parameters
    ----------
    sources : sequence
        Of recordings, none of which runs.

    Raises
    ------
    CaptureError
        If a camera is in two of them, or their rates differ.
    """

    def __init__(self, sources: Sequence[_Recorded]) -> None:
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
