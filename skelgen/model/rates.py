"""The frame rate that time stamps tell."""

import numpy as np

from skelgen.model.arrays import Floats

_NTSC = 1.001  # rates of television are round numbers over this
_COARSEST, _FINEST = 2, 9  # decimals of a second that stamps are printed with
_NO_DIGIT = 0.01  # of the last decimal: what doubles lose of it
_MOST_OF_FRAME = 0.25  # stamps coarser than that tell no rate

_SHORTEST_STEP, _LONGEST_TIME = 1e-9, 1e12  # s


def rate_of(times: Floats) -> float:
    """Return the frame rate [Hz] of time stamps: the round number that all agree with, else that of the median step.

    Stamps are printed in milliseconds or microseconds; 100 Hz comes out of them as 100.00000000000213 or 120 as 125.
    A rate is round if it is a whole number, a half, one of television such as 30 / 1.001, or has two decimals.

    Parameters
    ----------
    times : ndarray, shape (n_frames,), s
        Never falling; frames may be missing. Without two different ones the rate is 1.

    Examples
    --------
    >>> rate_of(np.round(np.arange(100) / 120, 3))
    120.0
    """
    steps = np.diff(times)
    rising = steps[steps > 0]
    if not len(rising):
        return 1.0
    median = float(np.median(rising))
    if median < _SHORTEST_STEP or max(abs(float(times[0])), abs(float(times[-1]))) > _LONGEST_TIME:
        return 1.0 / median  # damaged numbers, in which no digits can be looked for
    far = min(_resolution(times), _MOST_OF_FRAME * median) + 1e-9 * median
    since = times - times[0]
    for rough in (len(rising) / float(since[-1]), 1.0 / median):
        for round_rate in (round(rough), round(2 * rough) / 2, round(rough * _NTSC) / _NTSC, round(rough, 2)):
            if round_rate > 0 and np.abs(since - np.round(since * round_rate) / round_rate).max() <= far:
                return float(round_rate)
    return 1.0 / median


def _resolution(times: Floats) -> float:
    """Return the step [s] that all stamps are multiples of."""
    for decimals in range(_COARSEST, _FINEST):
        scaled = times * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() < _NO_DIGIT:
            return float(10.0**-decimals)
    return float(10.0**-_FINEST)
