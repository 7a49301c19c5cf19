"""Which views of a board are kept, and what they cover."""

from __future__ import annotations

import numpy as np

from skelgen.app.capture_jobs.images import CollectedView, ViewCollection, gaps, is_new, is_steady
from skelgen.capture.calibration.chessboard import BoardView

SIZE = (640, 480)
GRID = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(-1, 2)


def view_at(x, y, step=8.0, name="view"):
    board = BoardView(np.array([x, y]) + step * GRID, 3.0)
    return CollectedView(name, board, board, SIZE)


def test_a_board_that_moves_is_not_steady():
    here = view_at(100, 100)
    assert is_steady(here, view_at(100.5, 100.5))
    assert not is_steady(here, view_at(105, 100))
    assert not is_steady(None, here)
    assert not is_steady(here, CollectedView("lost", None, here.right, SIZE))


def test_a_board_that_was_numbered_from_its_other_end_is_the_same():
    here = view_at(100, 100)
    turned = BoardView(here.left.corners[::-1], 3.0)
    assert is_steady(here, CollectedView("turned", turned, turned, SIZE))
    assert not is_new(CollectedView("turned", turned, turned, SIZE), [here])


def test_a_view_is_new_elsewhere_or_nearer():
    others = [view_at(100, 100), view_at(300, 100)]
    assert not is_new(view_at(110, 100), others)
    assert is_new(view_at(100, 300), others)
    assert is_new(view_at(60, 60, step=30.0), others)


def test_gaps_are_told_for_each_image():
    left, right = view_at(20, 20), view_at(450, 350)
    mixed = CollectedView("mixed", left.left, right.right, SIZE)
    empty_left, empty_right = gaps([mixed])
    assert "upper left" not in empty_left
    assert "lower right" in empty_left
    assert "upper left" in empty_right
    assert "lower right" not in empty_right


def test_views_are_named_by_numbers_that_none_had():
    collection = ViewCollection()
    for _ in range(2):
        collection.add(view_at(10, 10, name=collection.next_name))
    collection.remove(collection.views[:1])
    collection.add(view_at(10, 10, name=collection.next_name))
    assert [view.name for view in collection.views] == ["2", "3"]
