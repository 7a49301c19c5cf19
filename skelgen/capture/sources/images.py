"""A frame source of image files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from skelgen.capture.frames import FramePair, Image
from skelgen.capture.image_files import read_image
from skelgen.capture.sources.names import ImagePair
from skelgen.capture.sources.options import FileOptions
from skelgen.capture.sources.pairs import check_same_size
from skelgen.errors import FormatError

_SECONDS_IF_UNKNOWN = 1.0  # from pair to pair, so that times at least grow


class ImagePairs:
    """A frame source of image files.

    Parameters
    ----------
    name : str
        For messages.
    pairs : list of ImagePair
        At least one, in the order of their times.
    options : FileOptions
        Rate and number of pairs.

    Raises
    ------
    CaptureError, FormatError
        If the first pair cannot be read or its sizes differ.
    """

    def __init__(self, name: str, pairs: list[ImagePair], options: FileOptions) -> None:
        self.name = name
        self.n_dropped = 0
        self._pairs = pairs[: options.frames or None]
        self.rate = options.rate or _rate_of(self._pairs)
        first = self._pairs[0]
        sizes = [_size(read_image(path)) for path in (first.left, first.right)]
        self.size = check_same_size(sizes[0], sizes[1], (str(first.left), str(first.right)))

    @property
    def n_frames(self) -> int | None:
        """Number of pairs that are there whole."""
        return len(self._pairs)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the left images, in the order of the pairs."""
        return tuple(pair.left.name for pair in self._pairs)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def __iter__(self) -> Iterator[FramePair]:
        """Read one pair after the other."""
        index = -1
        before = None
        for pair in self._pairs:
            lost = pair.lost if before is None else max(pair.lost, self._lost_between(before, pair))
            index += 1 + lost
            self.n_dropped += lost
            before = pair
            yield FramePair(self._read(pair.left), self._read(pair.right), self._time(pair, index), index, lost)

    def _lost_between(self, before: ImagePair, now: ImagePair) -> int:
        if self.rate is None or before.time is None or now.time is None:
            return 0
        return max(round((now.time - before.time) * self.rate) - 1, 0)

    def _time(self, pair: ImagePair, index: int) -> float:
        first = self._pairs[0].time
        if pair.time is not None and first is not None:
            return pair.time - first
        return index / self.rate if self.rate else index * _SECONDS_IF_UNKNOWN

    def _read(self, path: Path) -> Image:
        image = read_image(path)
        if _size(image) != self.size:
            raise FormatError(path, "", f"is {_by(_size(image))} pixels where the images before are {_by(self.size)}")
        return image


def _rate_of(pairs: list[ImagePair]) -> float | None:
    """Return the rate [Hz] at which most pairs of a list follow each other; None without times."""
    times = [pair.time for pair in pairs if pair.time is not None]
    return float(1 / np.median(np.diff(times))) if len(times) == len(pairs) > 1 else None


def _size(image: Image) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"


__all__ = ["ImagePairs"]
