"""Numbers and names as a reader wants them: three digits, a unit, no noise."""

import math
from collections.abc import Sequence

_MINUS = "−"
_FIXED_SPACE = "\N{NO-BREAK SPACE}"  # between a number and its unit
_DIGITS = 3
_TINY = 1e-5  # mm: far below what any camera measures; what is smaller is said to be so
_HUGE = 1e6
_SHORTEST = 1e-3  # s
_SMALLEST_ANGLE = 1e-3  # deg


def digits(value: float, significant: int = _DIGITS) -> str:
    """Return a number with `significant` digits, but never fewer than its whole part has; a dash for NaN.

    Parameters
    ----------
    value : float
        The number.
    significant : int
        How many digits.

    Examples
    --------
    >>> digits(520.703), digits(1234.6), digits(0.00123), digits(0.0), digits(float("nan"))
    ('521', '1235', '0.00123', '0', '–')
    """
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size == 0:
        return "0"
    sign = _MINUS if value < 0 else ""
    if size < _TINY:
        return "< 10⁻⁵"
    if size >= _HUGE:
        return sign + _with_power(size, significant)
    decimals = max(0, significant - 1 - math.floor(math.log10(size)))
    return f"{sign}{size:.{decimals}f}"


def _with_power(size: float, significant: int) -> str:
    mantissa, power = f"{size:.{significant - 1}e}".split("e")
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}·10{raised}"


def millimetres(value: float) -> str:
    """Return a length with its unit."""
    return f"{digits(value)}{_FIXED_SPACE}mm"


def degrees(angle: float) -> str:
    """Return an angle, given in rad, as degrees without their sign; what is too small to be seen is 0."""
    value = math.degrees(angle)
    return "0" if abs(value) < _SMALLEST_ANGLE else digits(value)


def plain(value: float) -> str:
    """Return a round number, such as one at an axis or a parameter, without needless zeros; a dash for NaN.

    Examples
    --------
    >>> plain(2.50), plain(0.1 + 0.2), plain(1500.0)
    ('2.5', '0.3', '1500')
    """
    if not math.isfinite(value):
        return "–"
    if value and not _TINY <= abs(value) < _HUGE:
        return (_MINUS if value < 0 else "") + _with_power(abs(value), 2)
    return f"{value:.6g}".replace("-", _MINUS)


def shown(value: object) -> str:
    """Return the value of a parameter: yes or no, a number without needless zeros, or a text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain(value) if isinstance(value, float) else str(value)


def fixed(value: float, decimals: int) -> str:
    """Return a number with fixed decimals, a proper minus sign, and a dash for NaN.

    Parameters
    ----------
    value : float
        The number.
    decimals : int
        Digits behind the point.
    """
    if not math.isfinite(value):
        return "–"
    shown = f"{value:.{decimals}f}"
    return shown.replace("-", _MINUS) if float(shown) else shown.lstrip("-")


def percent(share: float) -> str:
    """Return a share of 1 as percent; what is not quite all or nothing does not read so.

    Examples
    --------
    >>> [percent(share).replace("\N{NO-BREAK SPACE}", " ") for share in (1.0, 0.9999, 0.123)]
    ['100 %', '99.9 %', '12.3 %']
    """
    if not math.isfinite(share):
        return "–"
    if share in (0.0, 1.0):
        return f"{100 * share:.0f}{_FIXED_SPACE}%"
    return f"{min(max(100 * share, 0.1), 99.9):.1f}{_FIXED_SPACE}%"


def whole_percent(probability: float) -> str:
    """Return a probability as whole percent; what is not quite sure or impossible does not read so.

    Examples
    --------
    >>> [whole_percent(probability) for probability in (1.0, 0.999, 0.55, 0.001)]
    ['100 %', '99 %', '55 %', '1 %']
    """
    return f"{100 * probability if probability in (0.0, 1.0) else min(max(100 * probability, 1), 99):.0f} %"


def as_many_as_fit(names: Sequence[str], room: int) -> str:
    """Return as many names as fit into `room` characters, and how many are left.

    Parameters
    ----------
    names : sequence of str
        At least one.
    room : int
        Characters.

    Examples
    --------
    >>> as_many_as_fit(["LANK", "LHEE", "LTOE"], 13), as_many_as_fit(["LANK", "LHEE", "LTOE"], 30)
    ('LANK, LHEE +1', 'LANK, LHEE, LTOE')
    """
    whole = ", ".join(names)
    if len(whole) <= room:
        return whole
    for shown in range(len(names) - 1, 1, -1):
        short = f"{', '.join(names[:shown])} +{len(names) - shown}"
        if len(short) <= room:
            return short
    rest = f" +{len(names) - 1}" if len(names) > 1 else ""
    return clipped(names[0], room - len(rest)) + rest


def clipped(name: str, room: int) -> str:
    """Return a name that fits into `room` characters; the middle goes, since names often differ at their end.

    Parameters
    ----------
    name : str
        The name.
    room : int
        Characters.

    Examples
    --------
    >>> clipped("right upper arm 2", 11)
    'right…arm 2'
    """
    if len(name) <= room:
        return name
    tail = room // 2
    return f"{name[: room - 1 - tail]}…{name[-tail:]}"


def duration(seconds: float) -> str:
    """Return a time span in the unit that suits it.

    Examples
    --------
    >>> [duration(span).replace("\N{NO-BREAK SPACE}", " ") for span in (0.0123, 4.2, 200.0)]
    ['12.3 ms', '4.20 s', '3 min 20 s']
    """
    if 0 < seconds < _SHORTEST:
        return f"< 1{_FIXED_SPACE}ms"
    if seconds < 1:
        return f"{digits(1000 * seconds)}{_FIXED_SPACE}ms"
    if seconds < 60:
        return f"{digits(seconds)}{_FIXED_SPACE}s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}{_FIXED_SPACE}min {rest}{_FIXED_SPACE}s"
