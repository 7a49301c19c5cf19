"""Cells of text files as motion capture programs write them: quoted, empty, with a comma for a point, no number."""

import contextlib
import csv
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import read_table
from skelgen.model.arrays import Floats
from skelgen.progress import counted
from skelgen_formats.cell_marks import may_be_grouped, no_number

_UNSEEN_WORDS = frozenset(
    {"", "nan", "null", "none", "-", "--", "---", "n/a", "n/d", "na", "#n/a", "<na>", ".", "missing", "undefined"}
    | {"?", "*", "\\n", "#value!", "#div/0!", "#num!", "#ref!"}
)
_UNSEEN_CELLS = {"occluded", "hidden", "lost", "unseen", "invalid", "dropout", "void", "err", "error"}  # titles, too
_NO_NUMBER = re.compile(r"-?(nan|1\.#(?:ind|qnan|snan)0*|nan\((?:ind|snan)\))")  # as programs of Windows print NaN
_DECIMAL_COMMA = re.compile(r"\s*[-+]?(?:0,\d+|\d+,(?!\d{3}\s*$)\d+)(?:e[-+]?\d+)?\s*", re.IGNORECASE)
_FORTRAN = re.compile(r"[-+]?[\d.]+D[-+]?\d+", re.IGNORECASE)
_QUOTED = re.compile(r'"([^"]*)"')  # a cell in quotes, which may hold what parts cells
_CLOCK = re.compile(r"(?:(\d+) days? |\S+[ T])?(\d{1,3}):(\d\d):(\d\d(?:[.,]\d+|:\d{3})?)(?: ?([AP])M)?", re.IGNORECASE)
_TIMECODE = re.compile(r"(\d\d:\d\d:\d\d)[:;.,](\d\d)(?:\.\d\d?)?")  # SMPTE, frames behind seconds
_LASTED = re.compile(r"(\d+(?:\.\d+)?(?:e-?\d+)?) ?(ms|s|sec|min)", re.IGNORECASE)
_SECONDS = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "min": 60.0}
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
_SHOWN_CHARACTERS = 40  # of a bad cell in an error: enough to find it, not a screenful


def words_of(name: str) -> dict[str, Any]:
    """Return what a table of words holds that stands as data beside the readers."""
    return read_table(__file__, name)


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


def unquoted(line: str, delimiter: str | None) -> str:
    """Return a line without the quotes around its cells, and blanks for what parts cells within them.

    Parameters
    ----------
    line : str
        Of a table.
    delimiter : str or None
        What separates cells, None for blanks.
    """
    return (
        _QUOTED.sub(lambda cell: _with_decimals(cell[1]).replace(delimiter or " ", " "), line) if '"' in line else line
    )


def _with_decimals(text: str) -> str:
    """Return the text of a cell in quotes with a decimal point for a comma, where that parts no thousands."""
    return text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text


def is_timecode(text: str) -> bool:
    """Whether a cell holds a timecode of films, such as 01:02:03:24, the last of which counts frames."""
    return _TIMECODE.fullmatch(text.strip()) is not None and text.count(":") + text.count(";") > 2


def seconds_of(text: str) -> str:
    """Return the seconds that a date, a time or a duration stands for, such as 2024-05-06T12:00:01.5 or 0.5 sec.

    Dates in other orders count by the time behind them; other texts are returned as they are. Of timecodes, hundredths
    of seconds are frames.

    Parameters
    ----------
    text : str
        A cell.
    """
    if lasted := _LASTED.fullmatch(text.strip()):
        return repr(float(lasted[1]) * _SECONDS[lasted[2].lower()])
    if ":" not in text:
        return text
    with contextlib.suppress(ValueError, TypeError, OverflowError):
        moment = datetime.fromisoformat(text.strip())
        return repr((moment.replace(tzinfo=UTC) - datetime(moment.year, 1, 1, tzinfo=UTC)).total_seconds())
    text = _TIMECODE.sub(r"\1.\2", text) if is_timecode(text) else text
    clock = _CLOCK.fullmatch(text.strip())
    if clock is None:
        return text
    days, hours, half = int(clock[1] or 0), int(clock[2]), clock[5]
    hours = hours % 12 + 12 * (half.upper() == "P") if half else hours
    return repr(60.0 * (60 * (24 * days + hours) + int(clock[3])) + float(clock[4].replace(",", ".").replace(":", ".")))


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


def is_unseen(text: str) -> bool:
    """Whether a cell without blanks around it is empty or a word for a number that is not there."""
    return text.lower() in _UNSEEN_WORDS or _NO_NUMBER.fullmatch(text.lower()) is not None


def _is_unseen_cell(text: str) -> bool:
    return is_unseen(text) or text.lower() in _UNSEEN_CELLS


def is_number(text: str) -> bool:
    """Whether a cell without blanks around it holds a number, with a decimal point or comma, or a word for none."""
    with contextlib.suppress(ValueError):
        return _parsed(_with_point(text)) is not None
    return is_unseen(text)


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
        raise no_number(path, place, f"{what} is {_shown(text)}; a number belongs there", text) from error
    if not math.isfinite(value):
        raise FormatError(path, place, f"{what} is {_shown(text)}; a finite number belongs there")
    return value


def number_or_nan(path: Path, place: str | int, text: str, what: str) -> float:
    """Return the number in a cell, NaN if it is empty or a word for none.

    Parameters
    ----------
    path, place, text, what
        See `number_in`, of which the errors are, too.
    """
    try:
        return _parsed(text)
    except ValueError:
        return math.nan if _is_unseen_cell(text.strip()) else number_in(path, place, text, what)


def stated_in(path: Path, header: Mapping[str, tuple[int, list[str]]], key: str) -> tuple[int, list[str]]:
    """Return the line of a key of a header and what stands there, or raise `FormatError`.

    Parameters
    ----------
    path : Path
        The file, for errors.
    header : mapping of str to (int, list of str)
        Lines and words by key.
    key : str
        What is wanted.
    """
    line, words = header.get(key, (0, []))
    if not words:
        raise FormatError(path, line or "", f"the header states no {key}: the line is missing or empty")
    return line, words


def first_in(path: Path, header: Mapping[str, tuple[int, list[str]]], key: str) -> tuple[int, str]:
    """Return the line of a key and the first word that stands there.

    Parameters
    ----------
    path, header, key
        See `stated_in`, of which the errors are, too.
    """
    line, words = stated_in(path, header, key)
    return line, words[0]


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
        fix = "if numbers have decimal commas, export with decimal points"
        hint = f"; {'write a title over each column' if any('.' in cell for cell in cells) else fix}"
    elif len(cells) < n_cells:
        hint = "; the file may be cut off"
    found, wanted = (
        (counted(len(cells), "cell"), n_cells) if delimiter else (counted(len(cells), "number"), f"{n_cells} numbers")
    )
    raise FormatError(path, number, f"{found} where {wanted} belong{hint}")


def _row(path: Path, cells: Sequence[str], number: int, delimiter: str | None, *, is_plain: bool) -> list[float]:
    if is_plain:  # the slow way below understands more, or says which cell is wrong
        with contextlib.suppress(ValueError):
            return [float(cell) if cell else math.nan for cell in cells]
    return [_cell(path, cell, number, column, delimiter) for column, cell in enumerate(cells, start=1)]


def _cell(path: Path, cell: str, number: int, column: int, delimiter: str | None) -> float:
    text = cell.strip()
    if _is_unseen_cell(text):
        return math.nan
    try:
        return _parsed(text if delimiter == "," else _with_point(text))
    except ValueError as error:
        raise no_number(path, number, f"{_shown(cell)} in value {column} is not a number", cell) from error


def _with_point(text: str) -> str:
    return text.strip() if "." in text else text.strip().replace(",", ".", 1)


def _parsed(text: str) -> float:
    if "_" in text:  # Python reads 1_000 as a number; no capture program writes that
        raise ValueError(text)
    try:
        return float(text)
    except ValueError:
        other = text.strip().replace("\u2212", "-")  # a minus as it is printed
        return float(other.upper().replace("D", "E") if _FORTRAN.fullmatch(other) else other)


def _shown(text: str) -> str:
    hint = " (export numbers without marks between thousands)" if may_be_grouped(text) else ""
    return repr(text if len(text) <= _SHOWN_CHARACTERS else text[:_SHOWN_CHARACTERS] + "...") + hint
