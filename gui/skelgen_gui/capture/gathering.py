"""Gathers views of a chessboard from a source, on a thread of its own: no Qt here but the feed that it fills."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

from skelgen.capture.calibration.board import Board, BoardView, find_board
from skelgen.capture.calibration.stereo import absence
from skelgen.capture.images import opencv
from skelgen.capture.values import FrameSource, Image
from skelgen.errors import InputError
from skelgen.progress import Monitor
from skelgen_gui.capture.feed import Feed
from skelgen_gui.capture.messages import BoardShot, GatheringOrders
from skelgen_gui.capture.overlay import Eye, eye_with_board
from skelgen_gui.capture.running import source_of_text
from skelgen_gui.capture.views import View, ViewBook, is_new, is_steady


class Gathering:
    """Looks for a board in all pairs of a source, and keeps the views that are worth it.

    Pictures that were taken one by one (whose rate nobody knows) are all kept, so that the verdict can name those that
    show no board; of a stream, those on which the board is held still, and elsewhere than before.

    Parameters
    ----------
    text : str
        The source.
    board : Board
        What is looked for.
    book : ViewBook
        Where views are kept.
    orders : GatheringOrders
        What it is told while it runs.
    feed : Feed
        Where pictures go.
    """

    def __init__(self, text: str, board: Board, book: ViewBook, orders: GatheringOrders, feed: Feed[BoardShot]) -> None:
        self._text, self._board, self._book, self._orders, self._feed = text, board, book, orders, feed

    def run(self, title: str, monitor: Monitor) -> None:
        """Look until it is told to stop, or the source ends.

        Parameters
        ----------
        title : str
            What the user is told meanwhile.
        monitor : Monitor
            Is told how far it is.

        Raises
        ------
        SkelgenError
            If OpenCV is missing, or the source fails, or it shows no board at all; the views before are kept.
        """
        opencv()
        with ThreadPoolExecutor(2, "board") as threads, source_of_text(self._text) as source:
            monitor.begin(title)
            if any(view.size != source.size for view in self._book.views):
                raise InputError("these images have another size than those of the views before: clear the views first")
            names, total = _names(source), source.n_frames or 0
            before: View | None = None
            n_seen = 0
            for number, pair in enumerate(source):
                left, right = threads.map(partial(find_board, board=self._board), (pair.left, pair.right))
                name = names[number] if number < len(names) else self._book.next_name
                now = View(name, left, right, source.size)
                if source.rate is None or self._is_worth(now, before):
                    self._book.add(now)
                before = now
                n_seen += left is not None or right is not None
                self._feed.put(BoardShot(_copied(pair.left, left), _copied(pair.right, right)))
                monitor.advance(pair.index + 1 if total else 0, total or 1)
                if self._orders.stop.is_set():
                    return
            if before is not None and not n_seen:
                raise InputError(absence((pair.left, pair.right), self._board))

    def _is_worth(self, now: View, before: View | None) -> bool:
        """Whether a view of a stream is kept."""
        if not now.is_whole:
            return False
        if self._orders.take.is_set():
            self._orders.take.clear()
            return True
        return is_steady(before, now) and is_new(now, self._book.views)


def _copied(image: Image, view: BoardView | None) -> Eye:
    return eye_with_board(image.copy(), view)  # sources write the next image over this one


def _names(source: FrameSource) -> tuple[str, ...]:
    """Names of image files; others are counted."""
    names = getattr(source, "names", ())
    return names if isinstance(names, tuple) else ()
