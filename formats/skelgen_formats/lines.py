"""Lines of text files as motion capture programs write them, in any encoding, with any line end; and samples.

A sample stands for all frames of a large file: `skelgen info` reads it, so that it answers within a second. Frames are
counted, not estimated; only the positions are those of some of them, evenly spread.
"""

import codecs
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import read_content
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
from skelgen_formats.text import words_of

_UTF8_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_TITLES = 1 << 14  # bytes in which they are sought
_PAIRS = 16  # bytes that tell UTF-16 without a mark
_LOOKED_AT = 1 << 20  # bytes looked at at once: what stays in the processor's cache
_LINE_END, _PARTING = 10, str.maketrans(",;", "  ")
_SHORT = 0.5  # of the usual length of a line: only shorter ones may hold nothing
_LEAST_LINE = 16  # bytes a line, line end included, in the mean: the index of shorter ones would outgrow the text


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
        for first in range(0, len(content), _LOOKED_AT):
            piece = np.frombuffer(content, np.uint8, min(_LOOKED_AT, len(content) - first), first)
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


_PIECE = 1 << 20  # bytes decoded at once
_LONGEST_LINE = 1 << 23  # bytes: a hundred thousand markers
_BLANK_LINES = re.compile(rb"[ \t\n]*\n")


class Lines(Sequence[str]):
    """The lines of a text file without their ends: held as the file's bytes, decoded one by one as they are read.

    A list of lines would take up to twenty times the file, where lines are short. Lines that are asked for in turn, or
    near the last one, are found at once.

    Parameters
    ----------
    path : Path
        The file, for errors.
    content : bytes
        Its content, with LF as the ends of lines.
    encoding : str
        Of the text.
    sample : Sample, optional
        Which `rows` are wanted; all if left out, or if lines are shorter than those of any table, as blank ones are.
    """

    def __init__(self, path: Path, content: bytes, encoding: str, sample: Sample | None = None) -> None:
        self._path, self._content, self._encoding = path, content, encoding
        self._length = content.count(b"\n") + 1
        self._sample = sample if self._length * _LEAST_LINE <= len(content) else None
        self._lines = LineIndex(content) if self._sample else None
        self._index, self._start = 0, 0  # of the line that was asked for last

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> list[str]: ...
    def __getitem__(self, index: int | slice) -> str | list[str]:
        """Return a line, or a list of some."""
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(self._length))]
        index = index + self._length if index < 0 else index
        if not 0 <= index < self._length:
            raise IndexError(index)
        if index < self._index // 2:
            self._index, self._start = 0, 0
        while self._index > index:
            self._start = self._content.rfind(b"\n", 0, self._start - 1) + 1
            self._index -= 1
        while self._index < index:
            self._start = self._content.index(b"\n", self._start) + 1
            self._index += 1
        end = self._content.find(b"\n", self._start)
        end = len(self._content) if end < 0 else end
        if end - self._start > _LONGEST_LINE:
            what = f"a line of {end - self._start} characters; the longest that can be read has {_LONGEST_LINE}"
            raise FormatError(self._path, index + 1, what)
        return self._content[self._start : end].decode(self._encoding)

    def whole(self) -> str:
        """Return all lines as one text, however long they are."""
        return self._content.decode(self._encoding)

    def numbered(self, first: int = 0, least: int = 0) -> Iterator[tuple[int, str]]:
        """Yield lines that are not blank, with their numbers, which begin with 1.

        Parameters
        ----------
        first : int
            Index of a line, the first.
        least : int
            Characters from which on a blank line is a row of empty cells, in which nothing is seen; 0 if none is.
        """
        index = first
        while index < self._length:
            line = self[index]
            if (line and not line.isspace()) or 0 < least <= len(line):
                yield index + 1, line
            elif not least and (blank := _BLANK_LINES.match(self._content, self._start)) is not None:
                self._index += self._content.count(b"\n", self._start, blank.end())  # a run of them at once
                self._start, index = blank.end(), self._index
                continue
            index += 1

    def rows(self, first: int, *, block: bool = False, least: int = 0) -> Iterator[tuple[int, str]]:
        """Yield lines as `numbered`; where a sample is wanted, evenly spread ones from the first to the last.

        Parameters
        ----------
        first : int
            Index of a line.
        block : bool
            Whether lines end at the first blank one after others.
        least : int
            As of `numbered`.
        """
        if self._lines is not None and self._sample is not None:
            for index in self._sample.of(self._lines.rows(first, least, block=block)).tolist():
                line = self._lines.line(index).decode(self._encoding)
                if not line.isspace() or 0 < least <= len(line):
                    yield index + 1, line
            return
        last = 0
        for number, line in self.numbered(first, least):
            if block and last and number > last + 1:
                return
            last = number
            yield number, line

    def few(self, n_bytes: int) -> Iterator[tuple[int, str]]:
        """Yield lines as `numbered`; where a sample is wanted, only those shorter than so many bytes."""
        if self._lines is None:
            yield from self.numbered()
            return
        for index in self._lines.shorter(n_bytes).tolist():
            if not self._lines.is_blank[index]:
                yield index + 1, self._lines.line(index).decode(self._encoding)

    @property
    def is_sampled(self) -> bool:
        """Whether `rows` yields some rows only."""
        return self._sample is not None

    def count(self, rows: Sequence[object] | Floats) -> int:
        """Return of how many rows these are those that were read."""
        return len(rows) + (self._sample.n_left_out if self._sample else 0)


def read_lines(path: Path, sample: Sample | None = None) -> Lines:
    """Return the lines of a text file without their line ends.

    UTF-8 and UTF-16 are recognised, with or without a byte order mark; encodings of Chinese, Japanese, Korean and
    Russian Windows by titles of time or frames; anything else is taken as latin-1, as older Windows programs write it.
    Lines may end with LF, CR LF or CR.

    Parameters
    ----------
    path : Path
        The file.
    sample : Sample, optional
        Which rows are wanted; all if left out.

    Raises
    ------
    FormatError
        If the file cannot be read, is empty, or is not text.
    """
    content = read_content(path)
    if not content or content.isspace():
        raise FormatError(path, "", "the file is empty")
    if wide := _utf16_of(content):
        content = _utf8_from_utf16(path, content, wide)
    if b"\0" in content:
        raise FormatError(path, "", "holds zero bytes: it is a binary file or damaged; a text file was expected")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return Lines(path, content.removeprefix(_UTF8_MARK), _encoding_of(content, final=True), sample)


def decoded_head(head: bytes) -> str:
    """Return the beginning of a file as text for sniffing, without a byte order mark; never fails."""
    if wide := _utf16_of(head):
        return head.decode(wide, errors="replace")
    return head.removeprefix(_UTF8_MARK).decode(_encoding_of(head, final=False), errors="replace")


def _encoding_of(content: bytes, *, final: bool) -> str:
    """Return the encoding of a text, of which the end may be cut off, by what it holds and by words of its titles."""
    titles = content[:_TITLES]
    told = (
        kind
        for kind, words in words_of("times")["encodings"].items()
        if any(word.encode(kind) in titles for word in words)
    )
    return next((kind for kind in ("utf-8", *told) if _is_text(content, kind, final=final)), "latin-1")


def _utf16_of(content: bytes) -> str:
    """Return which UTF-16 a text is, by its mark or by Latin letters, of which every other byte is 0; else nothing."""
    if content[:2] in _UTF16_MARKS:
        return "utf-16"
    pairs = [content[at:_PAIRS:2] for at in (1, 0)]
    kinds = zip(("utf-16-le", "utf-16-be"), pairs, pairs[::-1], strict=True)
    return next((kind for kind, high, low in kinds if len(high) > 1 and not any(high) and b"\0" not in low), "")


def _utf8_from_utf16(path: Path, content: bytes, encoding: str) -> bytes:
    try:
        return content.decode(encoding).encode()
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "is not UTF-16 text as its first bytes say") from error


def _is_text(content: bytes, encoding: str, *, final: bool) -> bool:
    decoder = codecs.getincrementaldecoder(encoding)()
    try:
        for start in range(0, len(content), _PIECE):
            decoder.decode(content[start : start + _PIECE])
        decoder.decode(b"", final=final)
    except UnicodeDecodeError:
        return False
    return True
