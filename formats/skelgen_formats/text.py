"""Text files as motion capture programs write them: any line end, a byte order mark, latin-1, empty cells."""

import codecs
import contextlib
import csv
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import overload

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import read_content
from skelgen.model.arrays import Floats
from skelgen_formats.sample import LineIndex, Sample

_UTF8_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_UNSEEN_WORDS = frozenset({"", "nan", "null", "none", "-", "n/a"})
_PIECE = 1 << 20  # bytes decoded at once
_LONGEST_LINE = 1 << 23  # bytes: a hundred thousand markers
_BLANK_LINES = re.compile(rb"[ \t\n]*\n")
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
_SHOWN_CHARACTERS = 40  # of a bad cell in an error: enough to find it, not a screenful


class Lines(Sequence[str]):
    """The lines of a text file without their ends: held as the file's bytes, decoded one by one as they are read.

    A list of lines would take up to twenty times the file, where lines are short. Lines that are asked for in turn are
    found at once; one that lies before the last is searched from the beginning.

    Parameters
    ----------
    path : Path
        The file, for errors.
    content : bytes
        Its content, with LF as the ends of lines.
    encoding : str
        Of the text.
    sample : Sample, optional
        Which `rows` are wanted; all if left out.
    """

    def __init__(self, path: Path, content: bytes, encoding: str, sample: Sample | None = None) -> None:
        self._path, self._content, self._encoding, self._sample = path, content, encoding, sample
        self._lines = LineIndex(content) if sample else None
        self._length = content.count(b"\n") + 1
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
        if index < self._index:
            self._index, self._start = 0, 0
        while self._index < index:
            self._start = self._content.index(b"\n", self._start) + 1
            self._index += 1
        end = self._content.find(b"\n", self._start)
        end = len(self._content) if end < 0 else end
        if end - self._start > _LONGEST_LINE:
            what = f"a line of {end - self._start} characters; the longest that can be read has {_LONGEST_LINE}"
            raise FormatError(self._path, index + 1, what)
        return self._content[self._start : end].decode(self._encoding)

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

    UTF-8 with or without a byte order mark and UTF-16 with one are recognised; anything else is taken as latin-1,
    as older Windows programs write it. Lines may end with LF, CR LF or CR.

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
    if content[:2] in _UTF16_MARKS:
        content = _utf8_from_utf16(path, content)
    if b"\0" in content:
        raise FormatError(path, "", "holds zero bytes: it is a binary file or damaged; a text file was expected")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return Lines(path, content.removeprefix(_UTF8_MARK), "utf-8" if _is_utf8(content) else "latin-1", sample)


def decoded_head(head: bytes) -> str:
    """Return the beginning of a file as text for sniffing, without a byte order mark; never fails."""
    if head[:2] in _UTF16_MARKS:
        return head.decode("utf-16", errors="replace")
    return head.removeprefix(_UTF8_MARK).decode("latin-1")


def _utf8_from_utf16(path: Path, content: bytes) -> bytes:
    try:
        return content.decode("utf-16").encode()
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "is not UTF-16 text as its first bytes say") from error


def _is_utf8(content: bytes) -> bool:
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        for start in range(0, len(content), _PIECE):
            decoder.decode(content[start : start + _PIECE])
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return False
    return True


def split_cells(path: Path, line: str, number: int, delimiter: str) -> list[str]:
    """Return the stripped cells of a header line that may hold quoted cells.

    Parameters
    ----------
    path : Path
        The file, for errors.
    line : str
        The line.
    number : int
        Its number, for errors.
    delimiter : str
        What separates cells.
    """
    try:
        rows = list(csv.reader([line], delimiter=delimiter))
    except csv.Error as error:
        raise FormatError(path, number, f"the line cannot be split into cells: {error}") from error
    return [cell.strip() for cell in rows[0]] if rows else []


def defused(text: str) -> str:
    """Return the text of a cell so that a spreadsheet takes it as text: before what begins a formula stands a '."""
    return f"'{text}" if text.lstrip("'").startswith(_FORMULAS) else text


def undefused(text: str) -> str:
    """Return the text that `defused` was given."""
    return text[1:] if text.startswith("'") and text.lstrip("'").startswith(_FORMULAS) else text


def without_trailing_empty(cells: Sequence[str]) -> list[str]:
    """Return the cells up to the last one that is not blank."""
    end = len(cells)
    while end and not cells[end - 1].strip():
        end -= 1
    return list(cells[:end])


def number_in(path: Path, place: str | int, text: str, what: str) -> float:
    """Return a finite number that a header states, with a decimal point or comma, or raise `FormatError`.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    text : str
        What stands there.
    what : str
        What it is, for errors.
    """
    try:
        value = _parsed(_with_point(text))
    except ValueError as error:
        raise FormatError(path, place, f"{what} is {_shown(text)}; a number belongs there") from error
    if not math.isfinite(value):
        raise FormatError(path, place, f"{what} is {_shown(text)}; a finite number belongs there")
    return value


def count_in(path: Path, place: str | int, text: str, what: str) -> int:
    """Return a whole number of at least 0 that a header states, or raise `FormatError`.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    text : str
        What stands there.
    what : str
        What it is, for errors.
    """
    value = number_in(path, place, text, what)
    if value < 0 or value != int(value):
        raise FormatError(path, place, f"{what} is {_shown(text)}; a whole number from 0 up belongs there")
    return int(value)


def rate_in(path: Path, place: str | int, text: str, what: str) -> float:
    """Return a frame rate above 0 [Hz] that a header states, or raise `FormatError`.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    text : str
        What stands there.
    what : str
        What it is, for errors.
    """
    value = number_in(path, place, text, what)
    if value <= 0:
        raise FormatError(path, place, f"{what} is {value:g} Hz; it must be above 0")
    return value


def whole_lines(
    numbered: Iterable[tuple[int, str]], n_lines: int, n_cells: int, delimiter: str, notices: list[str]
) -> Iterator[tuple[int, str]]:
    """Yield lines with their numbers; the last of a file that is cut off is left out.

    Parameters
    ----------
    numbered : iterable of (number, line)
        From `Lines.numbered`.
    n_lines : int
        Of the file.
    n_cells : int
        Cells that each must have.
    delimiter : str
        What separates them.
    notices : list of str
        Gets a sentence if the last line is cut off.
    """
    for number, line in numbered:
        if number == n_lines and line.count(delimiter) < n_cells - 1:
            notices.append(f"line {number}, the last, is cut off and left out")
            return
        yield number, line


def parse_rows(
    path: Path,
    lines: Iterable[tuple[int, str]],
    n_cells: int,
    delimiter: str | None,
    columns: Sequence[int] | None = None,
    leading: int = 0,
) -> Floats:
    """Return the numbers of lines; empty cells and words like NaN become NaN.

    Parameters
    ----------
    path : Path
        For errors.
    lines : iterable of (number, line)
        From `Lines.numbered`.
    n_cells : int
        Cells that each line must have; blank ones beyond them are ignored.
    delimiter : str or None
        What separates cells, None for blanks. Decimal commas are understood where it is not a comma itself.
    columns : sequence of int, optional
        Indices of the cells that are wanted, in the wanted order; all if left out.
    leading : int
        How many of these are checked but not returned, such as the number of the frame.

    Returns
    -------
    ndarray, shape (n_rows, n_columns)

    Raises
    ------
    FormatError
        If a line has the wrong number of cells or a cell that is not a number.
    """
    numbers = array("d")
    for number, line in lines:
        cells = line.split(delimiter)
        if len(cells) != n_cells:
            cells = _fitted(path, cells, number, n_cells, delimiter)
        wanted = cells if columns is None else [cells[column] for column in columns]
        row = _row(path, wanted, number, delimiter, is_plain="_" not in line)
        numbers.extend(row[leading:] if leading else row)
    return np.frombuffer(numbers).reshape(-1, (n_cells if columns is None else len(columns)) - leading)


def _fitted(path: Path, cells: list[str], number: int, n_cells: int, delimiter: str | None) -> list[str]:
    if len(cells) > n_cells and not any(cell.strip() for cell in cells[n_cells:]):
        return cells[:n_cells]
    hint = ""
    if delimiter == "," and len(cells) > n_cells:
        hint = "; if numbers have decimal commas, export with decimal points"
    elif len(cells) < n_cells:
        hint = "; the file may be cut off"
    found, wanted = (f"{len(cells)} cells", n_cells) if delimiter else (f"{len(cells)} numbers", f"{n_cells} numbers")
    raise FormatError(path, number, f"{found} where {wanted} belong{hint}")


def _row(path: Path, cells: Sequence[str], number: int, delimiter: str | None, *, is_plain: bool) -> list[float]:
    if is_plain:  # the slow way below understands more, or says which cell is wrong
        with contextlib.suppress(ValueError):
            return [float(cell) if cell else math.nan for cell in cells]
    return [_cell(path, cell, number, column, delimiter) for column, cell in enumerate(cells, start=1)]


def _cell(path: Path, cell: str, number: int, column: int, delimiter: str | None) -> float:
    text = cell.strip()
    if text.lower() in _UNSEEN_WORDS:
        return math.nan
    try:
        return _parsed(text if delimiter == "," else _with_point(text))
    except ValueError as error:
        raise FormatError(path, number, f"{_shown(cell)} in value {column} is not a number") from error


def _with_point(text: str) -> str:
    return text.strip() if "." in text else text.strip().replace(",", ".", 1)


def _parsed(text: str) -> float:
    if "_" in text:  # Python reads 1_000 as a number; no capture program writes that
        raise ValueError(text)
    return float(text)


def _shown(text: str) -> str:
    return repr(text if len(text) <= _SHOWN_CHARACTERS else text[:_SHOWN_CHARACTERS] + "...")
