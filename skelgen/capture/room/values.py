"""What the steps of a capture by many cameras hand on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from skelgen.capture.values import Balls, Image, StereoPoints
from skelgen.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class FrameSet:
    """One moment seen by all cameras.

    Attributes
    ----------
    images : tuple of ndarray of uint8, shape (height, width), or None
        Grey images in the order of the cameras; None where one was lost.
    time : float, s
        Since the first set.
    index : int
        Number of the set since the source was opened, lost ones counted.
    dropped : int
        Sets that were lost before this one.
    """

    images: tuple[Image | None, ...]
    time: float
    index: int
    dropped: int = 0


class RoomSource(Protocol):
    """What delivers sets of images; a context manager, iterated once."""

    name: str
    rate: float | None
    cameras: tuple[str, ...]

    @property
    def n_frames(self) -> int | None:
        """Number of sets; None if it does not end by itself."""

    def __enter__(self) -> Self:
        """Open files or cameras."""

    def __exit__(self, *exception: object) -> None:
        """Close them."""

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver the sets in the order of their times."""


@dataclass(frozen=True, eq=False)
class RoomPoints:
    """Points in space from the images of one moment, the surest first; no ball belongs to two.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        In the rig's world.
    covariance : ndarray, shape (n_points, 3, 3), mm^2
        From the noise in all images.
    balls : ndarray of intp, shape (n_points, n_cameras)
        The ball of each camera that sees the point; -1 of the others.
    misfit : ndarray, shape (n_points,)
        Root mean square misfit of its balls by degree of freedom, in standard deviations: 1 on average.
    evidence : ndarray, shape (n_points,)
        How much more likely it is a marker than chance [nats].
    """

    points: Floats
    covariance: Floats
    balls: Ints
    misfit: Floats
    evidence: Floats

    def __len__(self) -> int:
        return len(self.points)

    @property
    def n_cameras(self) -> Ints:
        """How many cameras see each point, shape (n_points,)."""
        return np.asarray((self.balls >= 0).sum(axis=1))

    def of(self, chosen: Bools | Ints) -> "RoomPoints":
        """Return some of the points."""
        return RoomPoints(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def and_also(self, others: "RoomPoints") -> "RoomPoints":
        """Return these points, and others after them."""
        names = self.__dataclass_fields__
        return RoomPoints(*(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names))

    def as_stereo(self, noise: float) -> StereoPoints:
        """Return points of which no two share a ball, as the search for bodies needs them.

        Parameters
        ----------
        noise : float, px
            Of the balls, by which misfits are distances in images.
        """
        numbers, shared = np.arange(len(self)), np.zeros(len(self), dtype=np.bool_)
        return StereoPoints(self.points, self.covariance, numbers, numbers, noise * self.misfit, shared)


def balls_at(centres: Floats, std: float) -> Balls:
    """Return balls at known places, as a detection would find them.

    Parameters
    ----------
    centres : ndarray, shape (n_balls, 2), px
        Where they are.
    std : float, px
        Standard deviation of a centre along one axis.
    """
    n = len(centres)
    return Balls(centres, np.full(n, 30.0), np.full(n, 3900.0), np.full(n, std), np.zeros(n, dtype=np.bool_))


Views = Sequence[Balls]
"""What all cameras see at one moment, in their order."""
