"""Frames of a large file that stand for all: what `skelgen info` reads, so that it answers within a second.

Frames are counted, not estimated; only the positions are those of some of them, evenly spread.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Ints, evenly_spread

_PIECE = 1 << 20  # bytes looked at at once: what stays in the processor's cache
_LINE_END, _PARTING = 10, str.maketrans(",;", "  ")
_SHORT = 0.5  # of the usual length of a line: only shorter ones may hold nothing


@dataclass
class Sample:
    """The wish for a sample of a large file, and what its reader says of it; of a smaller file all is read.

    Attributes
    ----------
    most : int
        Frames that are read.
    above : int
        Bytes from which on a file is large.
    n_left_out : int
        Frames of the file that were counted and not read, set by the reader.
    rate : float, Hz, or None
        Frame rate of the file, set by a reader whose frames tell it by their times.
    """

    most: int = 2000
    above: int = 1 << 24
    n_left_out: int = 0
    rate: float | None = None

    def of(self, frames: Ints) -> Ints:
        """Return the frames to read out of those that are there; the others are counted."""
        chosen = evenly_spread(frames, self.most)
        self.n_left_out = len(frames) - len(chosen)
        return chosen


class LineIndex:
    """Where the lines of a text begin and end, found without decoding them.

    Parameters
    ----------
    content : bytes
        The text, with LF as the ends of lines.
    """

    def __init__(self, content: bytes) -> None:
        self._content, found = content, []
        for first in range(0, len(content), _PIECE):
            piece = np.frombuffer(content, np.uint8, min(_PIECE, len(content) - first), first)
            found.append(np.flatnonzero(piece == _LINE_END) + first)
        self.ends: Ints = np.concatenate([*found, [len(content)]]).astype(np.intp)
        self.starts: Ints = np.concatenate(([0], self.ends[:-1] + 1)).astype(np.intp)
        self.is_blank = self._blank()

    def line(self, index: int) -> bytes:
        """Return one line."""
        return self._content[self.starts[index] : self.ends[index]]

    def shorter(self, n_bytes: int) -> Ints:
        """Return the lines that are shorter than so many bytes."""
        return np.flatnonzero(self.ends - self.starts < n_bytes)

    def rows(self, first: int, least: int, *, block: bool) -> Ints:
        """Return the lines from one on that are not blank.

        Parameters
        ----------
        first : int
            Index of a line.
        least : int
            Bytes from which on a blank line is a row of empty cells; 0 if none is.
        block : bool
            Whether only those before the next blank line.
        """
        is_row = ~self.is_blank | ((self.ends - self.starts >= least) & (least > 0))
        filled = first + np.flatnonzero(is_row[first:])
        if not block or not len(filled):
            return filled
        return filled[: int(np.argmax(np.diff(filled, append=filled[-1] + 2) > 1)) + 1]

    def _blank(self) -> Bools:
        """Which lines hold nothing; only short ones are looked at."""
        lengths = self.ends - self.starts
        blank: Bools = lengths == 0
        for index in self.shorter(int(_SHORT * np.median(lengths))).tolist():
            blank[index] = not self.line(index).decode("latin-1").translate(_PARTING).strip()
        return blank
