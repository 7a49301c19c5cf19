"""What stands in cells with numbers beside these: units, and marks between thousands, such as 1,234.5 or 1'234.

Rows that are read without such marks are an error of their own, so that they can be read again.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from skelgen.errors import FormatError

_WITH_UNIT = re.compile(r"[-+]?[\d.,]+(?:e[-+]?\d+)? ?(mm|cm|m)", re.IGNORECASE)
_SURE_MARKS = r"'\u2019\u00a0\u2009\u202f"  # between thousands, and nowhere else in a number
_THOUSANDS = re.compile(rf"[-+]?\d{{1,3}}([., {_SURE_MARKS}]\d{{3}})+([.,]\d+)?")
_GROUPED = re.compile(
    rf"[-+]?\d{{1,3}}(?:([., {_SURE_MARKS}])\d{{3}}(?:\1\d{{3}})*(?!\1)[.,]\d+|([{_SURE_MARKS}])\d{{3}}(?:\2\d{{3}})*)"
)


class ThousandsError(FormatError):
    """A cell holds a number with marks between its thousands, which `mark` is."""

    mark = ""


def no_number(path: Path, place: str | int, what: str, text: str) -> FormatError:
    """Return the error of a cell that holds no number, a `ThousandsError` if marks between thousands are why.

    Parameters
    ----------
    path : Path
        The file.
    place : str or int
        Line, or another place in it.
    what : str
        What is wrong.
    text : str
        Of the cell.
    """
    if not (mark := mark_in([text.strip()])):
        return FormatError(path, place, what)
    error = ThousandsError(path, place, what)
    error.mark = mark
    return error


def unit_behind(cells: Iterable[str]) -> str:
    """Return the unit of length that stands behind numbers in cells, such as 12.3 mm; empty if none or several do."""
    units = {match[1] for match in map(_WITH_UNIT.fullmatch, cells) if match}
    return units.pop() if len(units) == 1 else ""


def mark_in(cells: Iterable[str]) -> str:
    """Return what parts thousands in numbers, such as 1,234.5 or 1'234; empty if nothing surely does, or several do.

    Parameters
    ----------
    cells : iterable of str
        Without blanks around them.
    """
    marks = {match[1] or match[2] for match in map(_GROUPED.fullmatch, cells) if match}
    return marks.pop() if len(marks) == 1 else ""


def may_be_grouped(text: str) -> bool:
    """Whether a cell may hold a number with marks between its thousands, which need not be told by it alone.

    Parameters
    ----------
    text : str
        Of the cell.
    """
    return _THOUSANDS.fullmatch(text.strip()) is not None
