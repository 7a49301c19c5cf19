"""What is drawn over a picture of a camera: numbers only, so that it can be made beside the window."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from skelgen.capture.calibration.board import BoardView
from skelgen.capture.values import Balls, FoundBody, Image, StereoPoints
from skelgen.model.arrays import Floats, Ints

NO_BODY = -1
"""Group of balls that belong to no body."""

_NO_PLACES = np.zeros((0, 2))
_NO_GROUPS = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True)
class Name:
    """A text beside a place.

    Attributes
    ----------
    text : str
        What is said.
    x, y : float, px
        Where, in the picture.
    group : int
        Whose colour it has.
    """

    text: str
    x: float
    y: float
    group: int


@dataclass(frozen=True, eq=False)
class Eye:
    """What one camera sees, and what was found in it.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The picture; nobody else writes to it.
    places : ndarray, shape (n, 2), px
        Balls, or corners of a board.
    groups : ndarray of intp, shape (n,)
        The body of each ball, `NO_BODY` if it belongs to none.
    names : tuple of Name
        Names of bodies.
    is_board : bool
        Whether the places are the corners of a board, in the order of its rows.
    """

    image: Image
    places: Floats = field(default_factory=lambda: _NO_PLACES)
    groups: Ints = field(default_factory=lambda: _NO_GROUPS)
    names: tuple[Name, ...] = ()
    is_board: bool = False


def eye_with_balls(image: Image, balls: Balls, bodies: list[tuple[int, FoundBody]], ball_of_point: Ints) -> Eye:
    """Return a picture with its balls, those of bodies in their groups.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        The picture.
    balls : Balls
        What was detected in it.
    bodies : list of tuple of int and FoundBody
        Bodies with their groups.
    ball_of_point : ndarray of intp, shape (n_points,)
        The ball in this image that each point in space rests on.
    """
    groups = np.full(len(balls), NO_BODY, dtype=np.intp)
    names = []
    for group, body in bodies:
        mine = ball_of_point[body.points[body.points >= 0]]
        groups[mine] = group
        x = float(balls.centres[mine, 0].mean())
        names.append(Name(body.name, x, float(balls.centres[mine, 1].min()), group))
    return Eye(image, balls.centres, groups, tuple(names))


def groups_of_points(points: StereoPoints, bodies: list[tuple[int, FoundBody]]) -> Ints:
    """Return the group of each point in space, `NO_BODY` for those of no body; bodies come with their groups."""
    groups = np.full(len(points), NO_BODY, dtype=np.intp)
    for group, body in bodies:
        groups[body.points[body.points >= 0]] = group
    return groups


def eye_with_board(image: Image, view: BoardView | None) -> Eye:
    """Return a picture with the corners of a board, if one was found in it."""
    return Eye(image) if view is None else Eye(image, view.corners, is_board=True)
