"""Views of a chessboard that are collected for a calibration: which are worth keeping, and what they cover."""

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.capture.calibration.chessboard import BoardView, uncovered
from skelgen.model.arrays import Floats

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
