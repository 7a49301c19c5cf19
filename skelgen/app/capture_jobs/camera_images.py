"""What one camera sees, and what was found in it, as a window draws it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from skelgen.model.arrays import Floats, Ints

if TYPE_CHECKING:
    from skelgen.capture.calibration.chessboard import BoardView
    from skelgen.capture.live import Captured
    from skelgen.capture.room.live import RoomCaptured
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


def camera_images_of(captured: Captured | RoomCaptured, bodies: Mapping[int, FoundBody]) -> tuple[CameraImage, ...]:
    """Return what each camera sees, with what was found in it.

    Parameters
    ----------
    captured : Captured or RoomCaptured
        One moment.
    bodies : mapping of int to FoundBody
        Bodies by their groups.
    """
    seen = zip(captured.images, captured.views, captured.balls.T, strict=True)
    return tuple(CameraImage.of_balls(image, balls, bodies, own) for image, balls, own in seen)
