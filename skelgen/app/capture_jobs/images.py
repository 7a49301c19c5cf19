"""Images of a capture with what was found in them, and views of a chessboard that are collected for a calibration."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from skelgen.capture.calibration.chessboard import BoardView, uncovered
from skelgen.model.arrays import Floats, Ints

if TYPE_CHECKING:
    from skelgen.capture.calibration.chessboard import BoardView
    from skelgen.capture.live import Captured
    from skelgen.capture.values import Balls, FoundBody, Image

NO_BODY = -1
"""Group of balls that belong to no body."""

NOTHING = np.zeros((48, 64), dtype=np.uint8)
"""The picture of a camera that has sent none."""

NO_BODIES: Mapping[int, FoundBody] = MappingProxyType({})
NO_POINTS = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True)
class ImageLabel:
    """A text beside a place in an image.

    Attributes
    ----------
    text : str
        The text.
    x, y : float, px
        The place.
    group : int
        The body whose colour it has.
    """

    text: str
    x: float
    y: float
    group: int


@dataclass(frozen=True, eq=False)
class CameraImage:
    """What one camera sees, and what was found in it.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The picture; nobody else writes to it.
    places : ndarray, shape (n, 2), px
        Balls, or corners of a board.
    groups : ndarray of intp, shape (n,)
        The body of each ball, `NO_BODY` if it belongs to none.
    labels : tuple of ImageLabel
        Names of bodies.
    is_board : bool
        Whether the places are the corners of a board, in the order of its rows.
    """

    image: Image
    places: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    groups: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    labels: tuple[ImageLabel, ...] = ()
    is_board: bool = False

    @classmethod
    def of_balls(
        cls,
        image: Image | None,
        balls: Balls,
        bodies: Mapping[int, FoundBody] = NO_BODIES,
        ball_of_point: Ints = NO_POINTS,
    ) -> CameraImage:
        """Return a copy of an image with its balls, and those of bodies as groups.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width), or None
            The picture; None of a camera that has sent none.
        balls : Balls
            What was detected in it.
        bodies : mapping of int to FoundBody
            Bodies by their groups.
        ball_of_point : ndarray of intp, shape (n_points,)
            The ball in this image that each point in space rests on; -1 of those that it does not show.
        """
        groups = np.full(len(balls), NO_BODY, dtype=np.intp)
        labels = []
        for group, body in bodies.items():
            own = ball_of_point[body.points[body.points >= 0]]
            own = own[own >= 0]
            if not len(own):
                continue
            groups[own] = group
            x, y = float(balls.centres[own, 0].mean()), float(balls.centres[own, 1].min())
            labels.append(ImageLabel(body.name, x, y, group))
        return cls(NOTHING if image is None else image.copy(), balls.centres, groups, tuple(labels))

    @classmethod
    def of_board(cls, image: Image, view: BoardView | None) -> CameraImage:
        """Return an image with the corners of a board, if one was found in it.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width)
            The picture.
        view : BoardView or None
            The board.
        """
        return cls(image) if view is None else cls(image, view.corners, is_board=True)


def camera_images_of(captured: Captured, bodies: Mapping[int, FoundBody]) -> tuple[CameraImage, ...]:
    """Return what each camera sees, with what was found in it.

    Parameters
    ----------
    captured : Captured
        One moment.
    bodies : mapping of int to FoundBody
        Bodies by their groups.
    """
    seen = zip(captured.pair.images, captured.views, captured.balls.T, strict=True)
    return tuple(CameraImage.of_balls(image, balls, bodies, own) for image, balls, own in seen)


ENOUGH = 10
"""Views from which on a calibration can be good; 20 are better."""

STEADY = 0.003
"""Part of the width of the image by which the corners may move from one pair to the next: 2 of 640 px. More blurs."""

NEW = 0.06
"""Part of the width of the image by which corners must differ in the mean from all views that are there: 40 of 640."""


@dataclass(frozen=True, eq=False)
class CollectedView:
    """One pair of images of the board.

    Attributes
    ----------
    name : str
        What the user knows it by.
    left, right : BoardView or None
        What was found; None if no whole board is seen.
    size : tuple of int, px
        Width and height of the images.
    """

    name: str
    left: BoardView | None
    right: BoardView | None
    size: tuple[int, int]

    @property
    def is_whole(self) -> bool:
        """Whether both images show the whole board."""
        return self.left is not None and self.right is not None


class ViewCollection:
    """The views that were collected; the window and the thread that collects both use it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._views: tuple[CollectedView, ...] = ()
        self._n_added = 0

    @property
    def next_name(self) -> str:
        """A number that no view has had."""
        with self._lock:
            return str(self._n_added + 1)

    @property
    def views(self) -> tuple[CollectedView, ...]:
        """All views, in the order in which they came."""
        with self._lock:
            return self._views

    def add(self, view: CollectedView) -> None:
        """Keep one more."""
        with self._lock:
            self._views = (*self._views, view)
            self._n_added += 1

    def remove(self, views: Sequence[CollectedView]) -> None:
        """Forget some."""
        with self._lock:
            self._views = tuple(view for view in self._views if view not in views)

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._views = ()


def is_steady(before: CollectedView | None, now: CollectedView) -> bool:
    """Tell whether the board was held still from one pair to the next.

    Parameters
    ----------
    before : CollectedView or None
        The pair before, if there is one.
    now : CollectedView
        The pair.
    """
    if before is None or not (before.is_whole and now.is_whole):
        return False
    pairs = ((before.left, now.left), (before.right, now.right))
    return all(one is not None and two is not None and _moved(one, two) < STEADY * now.size[0] for one, two in pairs)


def is_new(view: CollectedView, others: Sequence[CollectedView]) -> bool:
    """Tell whether the board is elsewhere, or leans otherwise, than in all other views.

    Parameters
    ----------
    view : CollectedView
        The view.
    others : sequence of CollectedView
        The others.
    """
    return all(
        other.left is None or view.left is None or _moved(other.left, view.left) > NEW * view.size[0]
        for other in others
    )


def gaps(views: Sequence[CollectedView]) -> tuple[list[str], list[str]]:
    """Return the names of the ninths of both images where the board has never been."""
    whole = [view for view in views if view.is_whole]
    size = whole[0].size if whole else (1, 1)
    left, right = sides(whole)
    return uncovered(left, size), uncovered(right, size)


def sides(views: Sequence[CollectedView]) -> tuple[list[Floats], list[Floats]]:
    """Return the corners of the views that are whole, in the left and in the right images."""
    return (
        [view.left.corners for view in views if view.left is not None and view.right is not None],
        [view.right.corners for view in views if view.left is not None and view.right is not None],
    )


def _moved(one: BoardView, two: BoardView) -> float:
    """Mean distance [px] of the corners, however the detector has numbered them."""
    return float(
        min(np.linalg.norm(one.corners - corners, axis=1).mean() for corners in (two.corners, two.corners[::-1]))
    )
