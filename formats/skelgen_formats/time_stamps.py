"""Times of the rows of a table, in whichever unit they stand, and the frame rate that they tell."""

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.model.arrays import Floats
from skelgen.model.rates import rate_of
from skelgen.progress import counted

_SLOWEST, _FASTEST = 1.0, 1e5  # Hz, of times in seconds
_SLOW, _FAST = 5.0, 2000.0  # Hz, of cameras: times of which no title names the unit
_OTHER_UNITS = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "days": 86400.0, "ticks of 100 ns": 1e-7}  # s
_FRAMES = 100  # to which timecodes count within a second, at most
_EPOCH, _LONGEST = (1e9, 4e9), 2.0  # s since 1970, of clocks between 2001 and 2096, and of the steps of such times
_SINCE_1, _SINCE_1601 = 62135596800.0, 11644473600.0  # s until 1970, from where .NET and Windows count ticks
_FEW_BACK = 0.05  # of the steps between times, that may go back
_LONG = 1.5  # of the usual step, from which on one leaves frames out
_MOST = 0.75  # of the times, that must be there and rise: some repeat one, or write 0 where nothing is seen


@dataclass(frozen=True)
class Stamps:
    """Times since the first one, shape (n,), in seconds if it is known that they are."""

    since: Floats
    are_seconds: bool

    def notice_skipped(self, notices: list[str]) -> None:
        """Say in how many places times leave frames out, if most follow each other evenly.

        Parameters
        ----------
        notices : list of str
            Gets a sentence if they do.
        """
        rows = np.flatnonzero(np.isfinite(self.since) & (self.since >= 0.0))  # some have none, or 0
        steps = np.diff(self.since[rows]) / np.diff(rows)
        usual = float(np.median(steps)) if len(steps) else 0.0
        longer, is_even = steps > _LONG * usual, np.abs(steps - usual) < (_LONG - 1.0) * usual
        if usual > 0.0 and longer.any() and is_even.mean() >= _MOST:
            where = counted(int(longer.sum()), "place", "places")
            notices.append(f"times leave some out in {where}; rows are taken as if they followed each other")

    def rate(self, notices: list[str]) -> float:
        """Return the frame rate [Hz]; `AS_RECORDED_RATE` if they do not rise, or no unit makes it that of a camera.

        Parameters
        ----------
        notices : list of str
            Gets a sentence if their unit is assumed.
        """
        times = self.since[np.isfinite(self.since) & (self.since >= 0.0)]
        steps = np.diff(times)
        if (steps < 0).any() and (steps < 0).sum() <= _FEW_BACK * len(steps):  # takes follow each other
            steps = np.where(steps < 0, np.median(steps), steps)
            times = np.concatenate([times[:1], times[0] + np.cumsum(steps)])
        if not len(steps) or (steps < 0).any() or min(len(times), (steps > 0).sum() + 1) < _MOST * len(self.since):
            return AS_RECORDED_RATE
        rate = rate_of(times)
        if self.are_seconds or _SLOWEST < rate < _FASTEST:
            return rate
        for unit, seconds in _OTHER_UNITS.items():
            with np.errstate(over="ignore", invalid="ignore"):  # of infinite ones
                rate = rate_of(times * seconds)
            if _SLOW <= rate <= _FAST and np.median(steps) != 1.0:  # else they count frames
                taken = f"the times are taken as {unit}, which makes {rate:g} Hz"
                notices.append(f"{taken}; `--recorded-rate` states another")
                return rate
        return AS_RECORDED_RATE


def since_first(times: Floats, second: float, counts_frames: bool = False) -> Stamps:
    """Return times since the first one.

    Parameters
    ----------
    times : ndarray, shape (n,)
        As they stand in the file; as large as times since 1970 are in s, ms, µs or ns, or in ticks since the year 1
        or 1601, they are in that unit, unless it makes their steps long.
    second : float
        Seconds per unit; 0 if unknown.
    counts_frames : bool
        Whether hundredths of seconds are frames, of which the last within a second tells how many it has.
    """
    if counts_frames:
        return _of_timecodes(times)
    with np.errstate(invalid="ignore", over="ignore"):  # of infinite ones, which state no rate
        first, ticks = times[:1].sum(), [*_OTHER_UNITS.values()][-1]
        clocks = [(one, 0.0) for one in (1.0, *_OTHER_UNITS.values())] + [(ticks, _SINCE_1), (ticks, _SINCE_1601)]
        near = (one for one, ago in clocks if _EPOCH[0] < first * one - ago < _EPOCH[1])
        since_1970 = (one for one in near if (np.nanmax(times) - first) * one < _LONGEST * len(times))
        unit = second or next(since_1970, 0.0)
        return Stamps((times - times[:1]) * (unit or 1.0), unit > 0.0)


def _of_timecodes(times: Floats) -> Stamps:
    """Return when frames were that have timecodes: those of a second follow each other evenly, in the whole ones."""
    seconds, counts = np.unique(np.floor(times[np.isfinite(times)]), return_counts=True)
    whole = counts[1:-1]  # it may begin and end within one
    if len(whole):
        return Stamps(np.arange(len(times)) / np.median(whole), are_seconds=True)
    part = np.rint((times - np.floor(times)) * _FRAMES)
    per_second = np.nanmax(part, initial=0) + 1.0 if len(seconds) > 1 else np.nan  # the last one is there
    return Stamps((times - times[:1]) + (part - part[:1]) * (1.0 / per_second - 1.0 / _FRAMES), are_seconds=True)
