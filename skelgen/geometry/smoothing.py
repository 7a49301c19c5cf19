"""Low-pass filtering of the paths of markers, which leaves their phase as it is."""

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.labelling import seen_runs

_ORDER = 2  # of the filter, which runs forward and back: fourth order in all


def smoothed(positions: Floats, rate: float, cutoff: float) -> Floats:
    """Filter a path by a Butterworth low-pass of fourth order, forward and back, each stretch between gaps by itself.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        The path; NaN where unseen, which stays. Stretches too short for the filter stay as they are.
    rate : float, Hz
        Frames per second.
    cutoff : float, Hz
        Frequency at which half of the power passes; below half of the rate.

    References
    ----------
    Winter, Biomechanics and Motor Control of Human Movement, 4th edition 2009, section 2.2.4.
    """
    if not 0 < cutoff < rate / 2:
        raise InputError(f"smoothing at {cutoff:g} Hz; take more than 0 and less than half of the take's {rate:g} Hz")
    from scipy.signal import butter, filtfilt  # noqa: PLC0415 - heavy

    single = cutoff / (2**0.5 - 1) ** (1 / (2 * _ORDER))  # each of both passes lets more through
    if single >= rate / 2:
        raise InputError(f"smoothing at {cutoff:g} Hz needs more than the {rate:g} Hz of the take; choose a lower one")
    numerator, denominator = butter(_ORDER, single, fs=rate)
    pad = 3 * max(len(numerator), len(denominator))
    found = np.array(positions)
    _, starts, ends = seen_runs(~np.isnan(found[:, :1]))
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        if last - first + 1 > pad:
            found[first : last + 1] = filtfilt(numerator, denominator, found[first : last + 1], axis=0, padlen=pad)
    return found
