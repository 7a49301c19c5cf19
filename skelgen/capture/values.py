"""What the steps of the capture hand on: images and their source, balls, points in space, bodies."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, Self, cast

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints, check_floats
from skelgen.model.rig import JOINT_TYPES


@dataclass(frozen=True, eq=False)
class Balls:
    """Bright balls in one image, largest first.

    Attributes
    ----------
    centres : ndarray, shape (n_balls, 2), px
        x and y; the centre of pixel (0, 0) is (0.0, 0.0).
    area : ndarray, shape (n_balls,), px
        Pixels above the lower threshold.
    brightness : ndarray, shape (n_balls,)
        Sum of the thresholded brightness.
    std : ndarray, shape (n_balls,), px
        Predicted standard deviation of a centre along one axis.
    touching : ndarray of bool, shape (n_balls,)
        Whether the ball was separated from another one, and is less certain for it.
    notice : str
        What the user should know of the image: black, over-exposed; empty if all is well.
    """

    centres: Floats
    area: Floats
    brightness: Floats
    std: Floats
    touching: Bools
    notice: str = ""

    def __len__(self) -> int:
        return len(self.centres)


@dataclass(frozen=True, eq=False)
class StereoPoints:
    """Points in space from one pair of images; candidates that share a ball are all kept.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        In the rig's world.
    covariance : ndarray, shape (n_points, 3, 3), mm^2
        From the noise in both images.
    left, right : ndarray of intp, shape (n_points,)
        The balls that each point rests on.
    epipolar_distance : ndarray, shape (n_points,), px
        How far the balls were from seeing one point, before the correction.
    ambiguous : ndarray of bool, shape (n_points,)
        Whether another candidate shares one of the balls.
    slack : ndarray, shape (n_points,), optional
        By how much larger the covariances are taken in the search for bodies than noise makes them, so that balls that
        are half hidden are found; not at all if not given.
    """

    points: Floats
    covariance: Floats
    left: Ints
    right: Ints
    epipolar_distance: Floats
    ambiguous: Bools
    slack: Floats | None = None

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class FoundBody:
    """A target found in one frame.

    Attributes
    ----------
    name : str
        Of the target.
    world_from_body : ndarray, shape (4, 4), translation in mm
        Its pose.
    covariance : ndarray, shape (6, 6)
        Of a small turn about the world's axes [rad] and a shift [mm], in this order; larger where the balls are off by
        more than noise explains.
    points : ndarray of intp, shape (n_target_points,)
        The point in space that each ball of the target is; -1 where none is.
    rms : float, mm
        Root mean square distance of the points from the posed target.
    noise : float
        The same in stated standard deviations, the pose's freedoms taken off: 1 where these are true.
    """

    name: str
    world_from_body: Floats
    covariance: Floats
    points: Ints
    rms: float
    noise: float = 1.0


Place = tuple[float, float, float]
"""x, y and z [mm]."""


@dataclass(frozen=True)
class JointRequest:
    """A joint that the user names.

    Attributes
    ----------
    name : str
        What it is called.
    parent, child : str
        Names of two targets.
    kind : str
        ``ball`` or ``hinge``; empty if it is to be found.
    start : tuple of tuple of float, mm, optional
        Where the search for its place begins, in the parent and in the child; by default at the closed form.
    """

    name: str
    parent: str
    child: str
    kind: str = ""
    start: tuple[Place, Place] | None = None

    def __post_init__(self) -> None:
        if self.start is not None:
            check_floats(np.array(self.start), (2, 3), f"start of joint {self.name!r}", finite=True)
        if self.kind not in (*JOINT_TYPES, ""):
            raise InputError(f"joint {self.name!r} is of type {self.kind!r}; types are {', '.join(JOINT_TYPES)}")


def start_from_text(text: str) -> tuple[Place, Place]:
    """Return the places [mm] of a joint in its parent and its child that a text states, as in ``0,0,-300:0,0,0``."""
    try:
        (a, b, c), (x, y, z) = ([float(word) for word in place.split(",")] for place in text.split(":"))
    except ValueError:
        raise InputError(
            f"{text!r} is not understood; it must be X,Y,Z:X,Y,Z in mm, in the parent and in the child"
        ) from None
    return (a, b, c), (x, y, z)


def numbers_from_text(text: str, what: str) -> tuple[float, ...]:
    """Return two or three numbers [mm] that a text states, as in ``0,180,500``.

    Parameters
    ----------
    text : str
        The numbers, with commas between them.
    what : str
        What they are of, for the error.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in {2, 3}:
        raise InputError(f"{what} is {text!r}; two or three numbers in mm belong there, with commas between them")
    return values


def frames_from_text(text: str) -> int | list[int] | None:
    """Return the number of frames that a text states, or indices as in ``0,10,20``; None where it is empty."""
    if not text.strip():
        return None
    try:
        indices = [int(word) for word in text.split(",") if word.strip()]
    except ValueError:
        indices = []
    if not indices:
        raise InputError(f"{text!r} is not understood; it must be a number of frames, or indices like 0,10,20")
    return indices if "," in text else indices[0]


Image = NDArray[np.uint8]

SIDES = ("left", "right")
"""What the cameras of a pair are called."""


@dataclass(frozen=True, eq=False)
class FrameSet:
    """One moment seen by all cameras, which are two or those of a room.

    Attributes
    ----------
    images : tuple of ndarray of uint8, shape (height, width), or None
        Grey images in the order of the cameras; not to be written to, and valid only until the next set unless copied.
        None where one was lost, which two cameras never deliver.
    time : float, s
        Since the first set.
    index : int
        Number of the set since the source was opened, lost ones counted.
    dropped : int
        Sets that were lost between the set before and this one.
    """

    images: tuple[Image | None, ...]
    time: float
    index: int
    dropped: int = 0

    @property
    def left(self) -> Image:
        """The image of the first of two cameras."""
        return cast(Image, self.images[0])

    @property
    def right(self) -> Image:
        """The image of the second of two cameras."""
        return cast(Image, self.images[1])


class FrameSource(Protocol):
    """What delivers images: cameras, files or what is simulated; a context manager, iterated once."""

    @property
    def name(self) -> str:
        """What it is, for messages and files."""

    @property
    def cameras(self) -> tuple[str, ...]:
        """What the cameras are called."""

    @property
    def rate(self) -> float | None:
        """Sets of images a second [Hz]; None if unknown."""

    @property
    def n_frames(self) -> int | None:
        """Number of sets; None if it does not end by itself."""

    def __enter__(self) -> Self:
        """Open cameras and files."""

    def __exit__(self, *exception: object) -> None:
        """Close cameras and files, whatever happened."""

    def __iter__(self) -> Iterator[FrameSet]:
        """Deliver sets in the order of their times.

        Raises
        ------
        SkelgenError
            If a camera breaks off or a file cannot be read; sets before it were delivered.
        """


class NothingToOpen:
    """What a source without cameras or open files is as a context manager."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        pass


def n_to_take(name: str, n_there: int | None, n_wanted: int | None, what: str) -> int:
    """Return how many moments of a source are recorded.

    Parameters
    ----------
    name : str
        Of the source.
    n_there : int or None
        How many it has; None if it goes on without end.
    n_wanted : int or None
        How many are wanted at most; None for all.
    what : str
        What it delivers at a moment, several of them.

    Raises
    ------
    InputError
        If nothing says when to end.
    """
    counts = [count for count in (n_wanted, n_there) if count is not None]
    if not counts:
        raise InputError(f"{name} goes on without end; say how many {what} are taken: --frames")
    return min(counts)
