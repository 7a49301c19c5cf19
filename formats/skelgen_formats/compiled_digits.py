"""Compiled loop that writes numbers as text; `digits` says what it returns.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats, Ints
from skelgen_formats.digits import plain_rows

_LARGEST = 2.0**51  # steps of the last digit: above, a double holds no half of one
_SPLITTER = 2.0**27 + 1.0  # parts a double into halves of 26 digits (Dekker 1971)
_LONGEST = 24  # characters of a number, with comma, sign and point
_COMMA, _MINUS, _POINT, _ZERO = (ord(character) for character in ",-.0")


def rows(numbers: Floats, decimals: int) -> list[str]:
    """Return each row as text; where a number is too large or none, Python does it."""
    text, ends = _written(np.ascontiguousarray(numbers), decimals)
    if len(ends) and ends[-1] < 0:
        return plain_rows(numbers, decimals)
    whole = text[: ends.max(initial=0)].tobytes().decode("ascii")
    return [whole[start:end] for start, end in pairwise([0, *ends.tolist()])]


@compile_function
def _written(numbers: Floats, decimals: int) -> tuple[NDArray[np.uint8], Ints]:
    """Text of all rows one after the other, and where each ends; the last end is -1 if a number cannot be written."""
    text = np.empty(numbers.size * _LONGEST, dtype=np.uint8)
    ends = np.empty(len(numbers), dtype=np.int64)
    place = 0
    for row in range(len(numbers)):
        for column in range(numbers.shape[1]):
            number = numbers[row, column]
            if not abs(number) * 10.0**decimals < _LARGEST:  # nor if it is NaN
                ends[-1] = -1
                return text, ends
            text[place] = _COMMA
            text[place + 1] = _MINUS
            place += 2 if math.copysign(1.0, number) < 0.0 else 1
            place = _put(text, place, _steps(abs(number), 10.0**decimals), decimals)
        ends[row] = place
    return text, ends


@compile_function
def _steps(number: float, scale: float) -> int:
    """Round number * scale to a whole number, halves to even, as if the product were exact."""
    product = number * scale
    high, low = _halves(number)
    high_scale, low_scale = _halves(scale)
    missing = ((high * high_scale - product) + high * low_scale + low * high_scale) + low * low_scale
    below = math.floor(product)
    beyond_half = (product - below - 0.5) + missing
    steps = int(below)
    return steps + 1 if beyond_half > 0.0 or (beyond_half == 0.0 and steps % 2 == 1) else steps


@compile_function
def _halves(number: float) -> tuple[float, float]:
    """Part a number into two with half as many digits each."""
    large = _SPLITTER * number
    high = large - (large - number)
    return high, number - high


@compile_function
def _put(text: NDArray[np.uint8], place: int, steps: int, decimals: int) -> int:
    """Write a number given in steps of its last digit, and return the place behind it."""
    n_digits, rest = 1, steps // 10
    while rest > 0:
        n_digits, rest = n_digits + 1, rest // 10
    n_digits = max(n_digits, decimals + 1)
    end = place + n_digits + (1 if decimals > 0 else 0)
    at, written = end - 1, 0
    while at >= place:
        if decimals > 0 and written == decimals:
            text[at] = _POINT
            at -= 1
        text[at] = _ZERO + steps % 10
        steps //= 10
        at, written = at - 1, written + 1
    return end
