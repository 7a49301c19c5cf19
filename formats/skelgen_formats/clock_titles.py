"""Titles of columns that say when a row was: frame numbers, times in any unit, seconds with their fraction beside them.

ROS 2 writes seconds and nanoseconds in two columns, ``header.stamp.sec`` and ``header.stamp.nanosec``. A title of time
may have words before it, ``Vicon_Timestamp``, ``CaptureTime``; those count where there is no plain one.
"""

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from skelgen_formats.text import is_number, seconds_of

_FRAME = re.compile(
    r"(?:[a-z]{1,20}_)?frames?(?:_?(?:number|no|nr|num|id|idx|index|count|#))?|fnum|ticks?"
    r"|bild(?:_?(?:nummer|nr)|ruta)?|beeld|trame|fotogram(?:as?|ma)|[cq]uadro|klatka|kare|кадр|帧|フレーム|프레임"
)
_UNIT = (
    r"(?:[ _]?[\[(/]? ?([mnuµ]?s|[mnuµ]?secs?|seconds?|milliseconds?|microseconds?|nanoseconds?|local|utc) ?[\])]?)?"
)
_TIME = re.compile(
    r"(?:%|_{1,2}|elapsed[ _])?(?:time|times|time[ _]?stamp|time[ _]?stamps|t|elapsed|zeit|temps|tempo|tiempo"
    r"|tijd|tid|czas|zaman|время|时间|時間|시간|seconds)" + _UNIT,
    re.IGNORECASE,
)
_NAMED_TIME = re.compile(r".{1,60}(?:[ _.]time|[a-z]Time|[ _.]?(?i:time[ _]?stamp))" + _UNIT)
_NO_MOMENT = re.compile(r"(?:delta|diff|start|end|begin|stop|reaction|response|duration|exposure|last)", re.IGNORECASE)
_SECONDS = {"s": 1.0, "ms": 1e-3, "mil": 1e-3, "mic": 1e-6, "us": 1e-6, "µs": 1e-6, "n": 1e-9}  # by how units begin
_WHOLE = re.compile(r"(.*?)(?:secs?|seconds)", re.IGNORECASE)
_PARTS = {"nanosec": 1e-9, "nsec": 1e-9, "nanoseconds": 1e-9, "nsecs": 1e-9, "usec": 1e-6, "usecs": 1e-6}


@dataclass(frozen=True)
class Clock:
    """The column of times, the seconds of its unit (0 if none is named), and that of the fractions of whole seconds."""

    column: int
    second: float
    fraction: int | None = None
    per_fraction: float = 0.0

    def moment(self, cells: Sequence[str]) -> str:
        """Return the time of a row, of a clock or calendar in seconds; an empty text if it is no number.

        Parameters
        ----------
        cells : sequence of str
            Of the row.
        """
        text = cells[self.column]
        if self.fraction is not None:
            with contextlib.suppress(ValueError):
                return repr(float(text) + float(cells[self.fraction]) * self.per_fraction)
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
                return Clock(column, 1.0, lower.index(whole[1] + part), seconds)
    for pattern in (_TIME, _NAMED_TIME):
        for column, title in enumerate(titles):
            if (match := pattern.fullmatch(title)) and not _NO_MOMENT.match(title):
                return Clock(column, _unit(match[1] or ("s" if title.lower() == "seconds" else "")))
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
