"""Sizes that ruler, lanes and curves share, so that the same frame lies below itself."""

from __future__ import annotations

import math

from skelgen_gui.timeline.span import VisibleSpan

GUTTER = 140
"""px, at the left, for names and scales."""

MARGIN = 16
"""px, at the right, for a scroll bar."""

_ROUND_SECONDS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0)
_TICK_ROOM = 88.0  # px, between labels of the ruler


def plot_width(width: float) -> float:
    """Return how wide the part that shows frames is in a widget of some width [px]."""
    return max(width - GUTTER - MARGIN, 1.0)


def ruler_step(span: VisibleSpan, rate: float, width: float) -> float:
    """Return the time [s] between labels of a ruler over `width` pixels."""
    least = (span.end - span.first) / rate * _TICK_ROOM / width
    if least <= _ROUND_SECONDS[0]:
        power = 10.0 ** math.floor(math.log10(least))
        return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= least * (1 - 1e-9))
    return next((step for step in _ROUND_SECONDS if step >= least), _ROUND_SECONDS[-1] * math.ceil(least / 3600.0))


def clock(seconds: float, step: float) -> str:
    """Return a time as a ruler shows it whose labels are `step` seconds apart.

    Examples
    --------
    >>> clock(75.0, 5.0), clock(3.25, 0.05), clock(3725.0, 60.0)
    ('1:15', '0:03.25', '1:02:05')
    """
    decimals = min(max(0, math.ceil(-math.log10(step) - 1e-9)), 4)
    units = 10**decimals
    whole, rest = divmod(round(seconds * units), units)
    minutes, second = divmod(whole, 60)
    hours, minute = divmod(minutes, 60)
    shown = f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"
    return shown + (f".{rest:0{decimals}d}" if decimals else "")
