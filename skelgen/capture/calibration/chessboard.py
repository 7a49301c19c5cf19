"""The chessboard: its inner corners in an image, how sharp they are, and which parts of an image it has been in."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from skelgen.capture.images import opencv
from skelgen.capture.values import Image
from skelgen.errors import ParameterError
from skelgen.geometry.orientation import fit_transform
from skelgen.model.arrays import Floats, Ints

REFINING_PART = 0.3
"""Half the window in which a corner is refined, as part of the shortest side of a square: at 0.4 the windows of boards
that lean reach the next corner, and errors of a pixel appear; below 0.2 noise grows."""

SMALLEST_WINDOW, LARGEST_WINDOW = 2, 15
"""Bounds of that half window [px]: fewer pixels hold no corner, more take time and follow the lens's bend."""

_LEAST_CORNERS = 3  # in each direction; OpenCV finds no smaller board
_MISCOUNTED = 2  # corners in a row or in a column, at most


@dataclass(frozen=True)
class Board:
    """A chessboard.

    Attributes
    ----------
    columns, rows : int
        Inner corners, where four squares meet.
    square : float, mm
        Side of a square.
    """

    columns: int = 9
    rows: int = 6
    square: float = 25.0

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < _LEAST_CORNERS:
            raise ParameterError(
                f"a board of {self.columns}x{self.rows} inner corners is too small; at least 3 each way are needed"
            )
        if not np.isfinite(self.square) or self.square <= 0:
            raise ParameterError(f"squares of {self.square:g} mm; their side must be above 0")

    @property
    def points(self) -> Floats:
        """Corners in the board's frame, row by row, shape (n_corners, 3), mm."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return self.square * np.stack([column, row, np.zeros_like(row)], axis=1).astype(np.float64)

    @property
    def orders(self) -> tuple[Ints, ...]:
        """Ways to number the corners that look alike to a detector: turned by half, square boards by quarters."""
        grid = np.arange(self.columns * self.rows).reshape(self.rows, self.columns)
        quarters = range(4) if self.columns == self.rows else (0, 2)
        return tuple(np.rot90(grid, quarter).ravel() for quarter in quarters)


def turned_boards(points: Floats, orders: Sequence[Ints]) -> Floats:
    """Return board_from_board of all ways to number corners that look alike, shape (n_ways, 4, 4), mm.

    Parameters
    ----------
    points : ndarray, shape (n_corners, 3), mm
        The corners in the board's frame.
    orders : sequence of ndarray of intp, shape (n_corners,)
        Those ways.
    """
    every = np.ones(len(points), dtype=np.bool_)
    return np.stack([fit_transform(points, points[order], every) for order in orders])


def board_from_text(text: str, square: float) -> Board:
    """Return the board that a text names.

    Parameters
    ----------
    text : str
        Its inner corners in a row and in a column, e.g. ``9x6``.
    square : float, mm
        Side of a square.

    Raises
    ------
    ParameterError
        If the text does not look like that.
    """
    match = re.fullmatch(r"\s*(\d+)\s*[x×*]\s*(\d+)\s*", text)
    if match is None:
        raise ParameterError(f"{text!r} is no board; give its inner corners as in 9x6")
    return Board(int(match[1]), int(match[2]), square)


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board found in an image.

    Attributes
    ----------
    corners : ndarray, shape (n_corners, 2), px
        In the order of the board's points.
    edge : float, px
        Width over which its edges rise from black to white, in the direction in which they rise slowest: 2 to 4 px in
        sharp images.
    """

    corners: Floats
    edge: float


def find_board(image: Image, board: Board) -> BoardView | None:
    """Return the board in an image, or None if it is not seen whole.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey.
    board : Board
        What is looked for.
    """
    cv2, size = opencv(), _size(board)
    found, corners = cv2.findChessboardCorners(image, size)
    if not found:
        return None
    window = int(np.clip(REFINING_PART * shortest_side(corners, board), SMALLEST_WINDOW, LARGEST_WINDOW))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    corners = cv2.cornerSubPix(image, corners, (window, window), (-1, -1), criteria)
    edges = [cv2.estimateChessboardSharpness(image, size, corners, 0.8, across)[0][0] for across in (False, True)]
    return BoardView(corners.reshape(-1, 2).astype(np.float64), float(max(edges)))


def board_that_is_there(images: Sequence[Image], board: Board) -> Board | None:
    """Return the board that images show if its corners were miscounted by up to two in a row or in a column.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width)
        Grey images in which the board was not found.
    board : Board
        What was looked for.

    Returns
    -------
    Board or None
        The largest one; None if there is none.
    """
    seen = {size for image in images for size in _sizes_seen(image, board)}
    nearby = (size for size in seen if all(abs(a - b) <= _MISCOUNTED for a, b in zip(size, _size(board), strict=True)))
    for columns, rows in sorted(nearby, key=lambda size: (size[0] * size[1], size), reverse=True):
        other = Board(columns, rows, board.square)
        if any(find_board(image, other) is not None for image in images):
            return other
    return None


def _size(board: Board) -> tuple[int, int]:
    return board.columns, board.rows


def _sizes_seen(image: Image, board: Board) -> set[tuple[int, int]]:
    """Columns and rows, both ways round, of boards or parts of them that an image may show, except `board`."""
    cv2, found = opencv(), set()
    least = [max(count - _MISCOUNTED, _LEAST_CORNERS) for count in _size(board)]
    for how in (cv2.CALIB_CB_NORMALIZE_IMAGE, cv2.CALIB_CB_EXHAUSTIVE):
        is_seen, _, kinds = cv2.findChessboardCornersSBWithMeta(image, least, flags=how | cv2.CALIB_CB_LARGER)
        if is_seen:
            one, other = kinds.shape
            found |= {(one, other), (other, one)}
    return found - {_size(board)}


def shortest_side(corners: Any, board: Board) -> float:
    """Return the shortest side [px] of a square.

    Parameters
    ----------
    corners : ndarray, shape (n_corners, 2) or alike, px
        Where the board's corners are in an image.
    board : Board
        What is seen.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    return float(min(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)))


PARTS = (
    ("upper left", "upper middle", "upper right"),
    ("middle left", "centre", "middle right"),
    ("lower left", "lower middle", "lower right"),
)
"""Names of the ninths of an image."""

LEAST_CORNERS = 4
"""Corners in a part from which on it counts as covered: fewer may come from one board's edge."""


def coverage(corners: Sequence[Floats], size: tuple[int, int]) -> Ints:
    """Return how many corners of all views lie in each ninth of the image, shape (3, 3), row by row.

    Parameters
    ----------
    corners : sequence of ndarray, shape (n_corners, 2), px
        One for each view.
    size : tuple of int, px
        Width and height of the image.
    """
    every = np.concatenate([np.empty((0, 2)), *corners])
    across, down = np.clip(every / size * 3, 0, 2).astype(np.intp).T
    return np.bincount(3 * down + across, minlength=9).reshape(3, 3)


def uncovered(corners: Sequence[Floats], size: tuple[int, int]) -> list[str]:
    """Return the names of the ninths of an image where the board has never been.

    Parameters
    ----------
    corners : sequence of ndarray, shape (n_corners, 2), px
        One for each view.
    size : tuple of int, px
        Width and height of the image.
    """
    counts = coverage(corners, size).ravel().tolist()
    return [name for name, count in zip(chain(*PARTS), counts, strict=True) if count < LEAST_CORNERS]
