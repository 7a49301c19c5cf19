"""Titles of columns that say when a row was: frame numbers, times in any unit, parts of a time in several columns.

ROS 2 writes seconds and nanoseconds in two columns, ``header.stamp.sec`` and ``header.stamp.nanosec``, loggers of
trackers ``Hour``, ``Minute``, ``Second`` and perhaps ``Millisecond``. A title of time
may have words before it, ``Vicon_Timestamp``, ``CaptureTime``; those count where there is no plain one.
"""

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from skelgen.model.arrays import Floats
from skelgen_formats.text import is_number, is_timecode, seconds_of, words_of

_FRAME = re.compile("|".join(words_of("times")["frame"]))
_PLAIN_UNIT = r"[mnuµ]?s(?:ecs?)?|(?:milli|micro|nano)?seconds?"
_UNIT = rf"(?:(?: in |[ _-])?[\[(/]? ?((?i:{_PLAIN_UNIT}|min(?:utes?)?|100 ?ns|local|utc)) ?[\])]?)?"
_TIME = re.compile(rf"(?:%|_{{1,2}}|elapsed[ _])?(?:{'|'.join(words_of('times')['time'])}){_UNIT}", re.IGNORECASE)
_NO_MOMENT = r"(?i:(?!delta|diff|start|end|begin|stop|reaction|response|duration|exposure|last))"
_NAMED_TIME = re.compile(_NO_MOMENT + r".{1,60}(?:[ _.]time|[a-z]Time|[ _.]?(?i:time[ _]?stamp))" + _UNIT)
_SINCE_FIRST = re.compile("delta[ _]?time" + _UNIT, re.IGNORECASE)  # else steps, which do not rise
_UNIT_ALONE = re.compile(_PLAIN_UNIT, re.IGNORECASE)
_SECONDS = {"min": 60.0, "mil": 1e-3, "mic": 1e-6, "100": 1e-7}  # by how units begin
_SECONDS |= {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "s": 1.0, "n": 1e-9}
_WHOLE = re.compile(r"(.*?)(?:secs?|seconds)", re.IGNORECASE)
_PARTS = {"nanosec": 1e-9, "nsec": 1e-9, "nanoseconds": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "usecs": 1e-6}
_HOUR = 3600.0  # s
_OF_DAY = tuple(
    (re.compile(word), seconds)
    for word, seconds in (
        ("hours?|hrs?|hh?|stunden?", _HOUR),
        ("minutes?|mins?|mm|m", 60.0),
        ("seconds?|secs?|ss?|sekunden?", 1.0),
        ("milli_?seconds?|milli_?secs?|msecs?|ms", 1e-3),
    )
)

_Number = TypeVar("_Number", float, Floats)


@dataclass(frozen=True)
class Clock:
    """The column of times, the seconds of its unit (0 if none is named), and other columns that are added to it.

    `others` are columns of fractions of its seconds, or of hours and minutes, with the seconds of their units.
    `counts_frames` says that hundredths of seconds are frames within them, of timecodes of films (SMPTE).
    """

    column: int
    second: float
    others: tuple[tuple[int, float], ...] = ()
    counts_frames: bool = False

    @property
    def last(self) -> int:
        """The last of its columns."""
        return max(self.column, *(column for column, _ in self.others), 0)

    def told_by(self, cell: str) -> "Clock":
        """Return the clock that writes such a cell, in seconds if it is a date or a time of day.

        Parameters
        ----------
        cell : str
            Of the first row.
        """
        is_plain = not self.others and is_number(cell.strip())
        return self if is_plain else replace(self, second=1.0, counts_frames=is_timecode(cell))

    @np.errstate(invalid="ignore")  # of infinite ones, which state no rate
    def added(self, seconds: _Number, others: Sequence[_Number]) -> _Number:
        """Return the seconds that other columns add; none where hours and minutes are the same time as a whole again.

        Parameters
        ----------
        seconds : float or ndarray
            In its column.
        others : sequence of float or ndarray
            In the other columns.
        """
        total = seconds * 0.0
        for one, (_, unit) in zip(others, self.others, strict=True):
            total = total + one * unit
        if not self.others or self.others[0][1] != _HOUR:
            return total
        hours, minutes = others[:2]
        are_broken = (hours % 1.0 != 0.0) | (minutes % 1.0 != 0.0)
        is_minute = (seconds >= 60.0) & (hours * _HOUR + minutes * 60.0 == seconds // 60.0 * 60.0)
        are_more = (seconds >= 61.0) | is_minute  # else 60 s are rounded
        added: _Number = total * (1 - (are_broken | are_more))
        return added

    def moment(self, cells: Sequence[str]) -> str:
        """Return the time of a row, of a clock or calendar in seconds; an empty text if it is no number.

        Parameters
        ----------
        cells : sequence of str
            Of the row.
        """
        text = cells[self.column]
        if self.others:
            with contextlib.suppress(ValueError):
                seconds = float(text)
                return repr(seconds + self.added(seconds, [float(cells[column]) for column, _ in self.others]))
        moment = seconds_of(text)
        return moment if is_number(moment.strip()) else ""


def clock_of(titles: Sequence[str]) -> Clock | None:
    """Return where times stand, None if nowhere.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    lower = [title.lower() for title in titles]
    for column, title in enumerate(lower):
        whole = _WHOLE.fullmatch(title)
        for part, seconds in _PARTS.items() if whole else ():
            if whole and whole[1] + part in lower:
                return Clock(column, 1.0, ((lower.index(whole[1] + part), seconds),))
    of_day = _of_day(lower)
    for pattern in (_TIME, _NAMED_TIME, _SINCE_FIRST):
        for column, title in enumerate(titles):
            is_unit = _UNIT_ALONE.fullmatch(title) is not None  # may be a part of a time
            if (match := pattern.fullmatch(title)) and not (of_day and is_unit):
                return Clock(column, _unit(match[1] or (title if is_unit else "")))
        if of_day:
            return of_day
    return None


def _of_day(titles: Sequence[str]) -> Clock | None:
    """Return the clock of hours, minutes and seconds that stand side by side, if they do."""
    words = [title.strip("[]() ").replace(" ", "_") for title in titles]
    for first in range(len(words) - 2):
        parts = [*zip(words[first:], _OF_DAY, strict=False)]
        there = [bool(known.fullmatch(word)) for word, (known, _) in parts]
        if all(there[:3]):
            columns = [(first + at, seconds) for at, (_, (_, seconds)) in enumerate(parts) if there[at]]
            second = columns.pop(2)
            return Clock(second[0], 1.0, tuple(columns))
    return None


def is_frame(title: str) -> bool:
    """Whether a title is that of a column of frame numbers, such as ``Frame#`` or ``frame_idx``.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    return _FRAME.fullmatch(title.lower().replace(" ", "_")) is not None


def _unit(word: str) -> float:
    """Return the seconds of a unit, 0 of none."""
    unit = word.lower()
    return next((_SECONDS[key] for key in (unit[:3], unit[:2], unit[:1]) if key in _SECONDS), 0.0)
