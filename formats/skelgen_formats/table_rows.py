"""Rows of tables as scripts write them: quoted, too short, followed by another table, with times of a clock."""

import contextlib
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

from skelgen.progress import counted
from skelgen_formats.cell_marks import ThousandsError
from skelgen_formats.flags import Flag, is_answer, with_flags
from skelgen_formats.text import is_number, is_unseen, seconds_of, unquoted
from skelgen_formats.title_lines import Head

_RULED, _RULE = ("|-", "| ", "--", "==", "+-", "|:"), "-=|:+ "  # of tables in Markdown
_COMMENTS, _MARKS = ("#", "%", "//"), "<*["  # the latter are no numbers, either
_Rows = TypeVar("_Rows")
_LONG_STEP = 1000  # frames; where more are missing, it does not matter how many


FOLLOWING = "rows of several takes or people follow each other, and are taken as one; write each into a file of its own"
"""A notice of several takes in a table, behind what tells."""


AGAIN = "if several people take turns, write their names into a column `person`"
"""A notice of rows that repeat frame numbers, behind what tells."""


def until_other_table(numbered: Iterable[tuple[int, str]], head: Head) -> Iterator[tuple[int, str]]:
    """Yield the lines up to one that begins with a word behind a blank one: Mokka writes analogue data there.

    Parameters
    ----------
    numbered : iterable of (number, line)
        From `Lines.numbered`.
    head : Head
        Of the table; gets a notice.
    """
    last, counts = 0, False
    for number, line in numbered:
        first = line.split(head.delimiter, 1)[0].strip()
        if counts and last < number - 1 and first and not is_number(first):
            head.notices.append(f"another table, which begins in line {number}, is left out")
            return
        last, counts = number, bool(first) and is_number(first)
        yield number, line


def padded_rows(
    numbered: Iterable[tuple[int, str]], n_lines: int, n_cells: int, delimiter: str | None, notices: list[str]
) -> Iterator[tuple[int, str]]:
    """Yield lines with as many cells as titles, those that end earlier padded; the last, if it does, is left out.

    Parameters
    ----------
    numbered : iterable of (number, line)
        From `Lines.numbered`.
    n_lines : int
        Of the file.
    n_cells : int
        Of the titles.
    delimiter : str or None
        What parts cells; where blanks do, none are padded.
    notices : list of str
        Gets sentences.
    """
    padded, delimiter = 0, delimiter or ""
    for number, line in numbered:
        missing = n_cells - 1 - line.count(delimiter) if delimiter else 0
        if missing > 0 and number == n_lines and not line.endswith(delimiter):
            notices.append(f"line {number}, the last, is cut off and left out")
            break
        padded += missing > 0
        yield number, line + delimiter * missing
    if padded:
        rows = counted(padded, "row ends", "rows end")
        notices.append(f"{rows} before the last column; what has no cells is unseen there")


def unquoted_rows(lines: Iterable[tuple[int, str]], delimiter: str | None, least: int) -> Iterator[tuple[int, str]]:
    """Yield the lines with numbers, without quotes and what parts cells within them; blank ones are left out.

    Parameters
    ----------
    lines : iterable of (number, line)
        From `Lines.numbered`.
    delimiter : str or None
        What parts cells.
    least : int
        Characters from which on a blank line is a row of empty cells; 0 if none is.
    """
    parting = delimiter or " "
    for number, line in lines:
        if line.strip(parting + " ") or 0 < least <= len(line):
            yield number, unquoted(line, delimiter)


def with_plain_numbers(
    numbered: Iterable[tuple[int, str]], head: Head, columns: Iterable[int]
) -> Iterator[tuple[int, str]]:
    """Yield lines without the units that stand behind numbers in cells, and the marks between thousands of coordinates.

    Parameters
    ----------
    numbered : iterable of (number, line)
        Of rows.
    head : Head
        Of the table.
    columns : iterable of int
        Of coordinates.
    """
    unit = re.compile(rf"(?<=[\d.]) ?{head.unit_in_cells}\b") if head.unit_in_cells else None
    grouped, wanted = re.compile(rf"\s*[+-]?[1-9]\d{{0,2}}(?:{re.escape(head.mark)}\d{{3}})+(?!\d)"), {*columns}
    for number, line in numbered:
        plain = unit.sub("", line) if unit else line
        if head.mark:
            cells = plain.split(head.delimiter)
            marked = [at for at, cell in enumerate(cells) if at in wanted and head.mark in cell.strip()]
            for at in marked if all(grouped.match(cells[at]) for at in marked) else ():  # else it parts decimals, too
                cells[at] = cells[at].replace(head.mark, "")
            plain = (head.delimiter or " ").join(cells)
        yield number, plain


def reread_with_marks(head: Head, read: Callable[[], _Rows]) -> _Rows:
    """Return what is read of rows, from the first again where one of the later tells marks between thousands.

    Parameters
    ----------
    head : Head
        Of the table; gets the mark.
    read : callable
        Reads the rows, with the mark that `head` has.

    Raises
    ------
    FormatError
        As `read` raises it.
    """
    notices = [*head.notices]
    try:
        return read()
    except ThousandsError as error:
        if head.mark:
            raise
        head.mark, head.notices = error.mark, notices
        return read()


def with_numbers(numbered: Iterable[tuple[int, str]], head: Head) -> Iterator[tuple[int, str]]:
    """Yield lines with numbers for words in the columns of flags, such as 1 and 0 for true and false.

    Parameters
    ----------
    numbered : iterable of (number, line)
        Of rows.
    head : Head
        Of the table.
    """
    flags = head.flags
    for number, line in numbered:
        yield number, with_flags(line, flags, head.delimiter) if flags else line


def without_remarks(numbered: Iterable[tuple[int, str]], head: Head, notices: list[str]) -> Iterator[tuple[int, str]]:
    """Yield the lines that are rows: no comments, titles that stand again, means or words below the table.

    A row has a number in the column that counts, if the first row has one there, else a number in any column, or an
    answer in one of flags.

    Parameters
    ----------
    numbered : iterable of (number, line)
        Below the titles.
    head : Head
        Of the table.
    notices : list of str
        Gets a sentence if lines are left out.
    """
    left_out, is_counted, count, flags = [], None, head.counts, head.flags
    for number, line in numbered:
        is_word = line[:1].isalpha() or line[:1] in _MARKS
        cells = [] if is_counted is not None and not is_word else line.split(head.delimiter)
        is_remark = line.startswith(_COMMENTS) or (line[:2] in _RULED and not line.strip(_RULE))
        if is_remark or (cells and not _is_row(cells, count if is_counted else None, flags)):
            left_out.append(f"{number}")
            continue
        if is_counted is None:
            is_counted = count is not None and _is_row(cells, count, {})
        yield number, line
    if left_out:
        lines = counted(len(left_out), "line is no row of the table", "lines are no rows of the table")
        notices.append(f"{lines} and left out: {', '.join(left_out[:8])}")


def _is_row(cells: Sequence[str], count: int | None, flags: Mapping[int, Flag]) -> bool:
    """Whether cells hold a number where one counts, or one anywhere, or an answer under a flag, or no words."""
    if count is not None:
        return count < len(cells) and is_number(seconds_of(cells[count]).strip())
    words = [cell for cell in map(str.strip, cells) if not is_unseen(cell)]
    answers = (is_answer(cells[column], flag) for column, flag in flags.items() if column < len(cells))
    return not words or any(map(is_number, words)) or any(answers)


def with_seconds(numbered: Iterable[tuple[int, str]], head: Head) -> Iterator[tuple[int, str]]:
    """Yield lines with seconds for dates, times of a clock and seconds in two columns, in the column of times.

    What is no time is left empty; where the first row has a number there, all are taken as they are.

    Parameters
    ----------
    numbered : iterable of (number, line)
        With all cells.
    head : Head
        Of the table.
    """
    clock, is_plain, is_first = head.clock, True, True
    for number, line in numbered:
        cells = line.split(head.delimiter) if clock and (is_first or not is_plain) else []
        if clock and len(cells) > clock.last:
            if is_first:
                head.clock = clock.told_by(cells[clock.column])
                is_plain = head.clock is clock
            cells[clock.column] = cells[clock.column] if is_plain else clock.moment(cells)
        is_first = False
        yield number, (head.delimiter or " ").join(cells) if cells else line


def in_order(numbered: Iterable[tuple[int, str]], frames: int, head: Head, *, every: bool) -> Iterator[tuple[int, str]]:
    """Yield lines; say once where frames or times go back, as takes follow each other, or leave some out.

    Parameters
    ----------
    numbered : iterable of (number, line)
        With all cells.
    frames : int
        The column of frame numbers, or of times.
    head : Head
        Of the table; gets notices.
    every : bool
        Whether these are all rows, not a sample.
    """
    last, steps, back, same = math.nan, Counter[int](), 0, 0
    for number, line in numbered:
        with contextlib.suppress(ValueError, IndexError, OverflowError):
            frame = float(line.split(head.delimiter, frames + 1)[frames])
            back = back or number * (frame < last)
            same += frame == last
            last, step = frame, frame - last
            steps[min(int(step), _LONG_STEP)] += 1
        yield number, line
    if frames == head.frames and 2 * same >= steps.total() > 0:
        head.notices.append(f"{same} rows have the frame number of the one before: {AGAIN}")
    if back:
        what = "frame numbers" if frames == head.frames else "times"
        head.notices.append(f"{what} go back in line {back}: {FOLLOWING}")
    elif every and frames == head.frames:
        notice_skipped(steps, head.notices)


def notice_skipped(steps: Counter[int], notices: list[str]) -> None:
    """Say in how many places frame numbers leave some out.

    Parameters
    ----------
    steps : Counter of int
        From each frame number to the next.
    notices : list of str
        Gets a sentence if there are longer steps than the usual one.
    """
    usual = max(steps, key=steps.__getitem__, default=0)
    if longer := sum(count for step, count in steps.items() if step > usual > 0):
        where = counted(longer, "place", "places")
        notices.append(f"frame numbers leave some out in {where}; rows are taken as if they followed each other")
