"""Synchronised pairs of images, and the one protocol that everything which delivers them follows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import InputError

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class FramePair:
    """One moment seen by both cameras.

    Attributes
    ----------
    left, right : ndarray of uint8, shape (height, width)
        Grey images; not to be written to, and valid only until the next pair unless copied.
    time : float, s
        Since the first pair.
    index : int
        Number of the pair since the source was opened, lost ones counted.
    dropped : int
        Pairs that were lost between the pair before and this one.
    """

    left: Image
    right: Image
    time: float
    index: int
    dropped: int = 0

    def __post_init__(self) -> None:
        for side, image in (("left", self.left), ("right", self.right)):
            if image.ndim != 2 or image.dtype != np.uint8:
                raise InputError(
                    f"the {side} image of frame {self.index} has shape {image.shape} and type {image.dtype}; "
                    "grey images of 8 bits are needed"
                )


class FrameSource(Protocol):
    """What delivers pairs: cameras, files or the simulated rig; a context manager, iterated once."""

    @property
    def name(self) -> str:
        """What it is, for messages and files."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px] of both images."""

    @property
    def rate(self) -> float | None:
        """Pairs a second [Hz]; None if nobody knows."""

    @property
    def n_frames(self) -> int | None:
        """Number of pairs; None if it does not end by itself."""

    @property
    def n_dropped(self) -> int:
        """Pairs lost so far."""

    def __enter__(self) -> Self:
        """Open cameras and files."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close cameras and files, whatever happened."""

    def __iter__(self) -> Iterator[FramePair]:
        """Deliver pairs in the order of their times.

        Raises
        ------
        SkelgenError
            If a camera breaks off or a file cannot be read; pairs before it were delivered.
        """
