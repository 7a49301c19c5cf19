"""Find gaps that a program filled: positions that lie exactly on a line or a curve of low degree.

Most takes that are published have no gaps: where a marker was hidden, the last position was held, or a straight line or
a spline was drawn through the frames around. Such positions say nothing of the body, and pairs of markers that move as
one limb seem not to. A measured path is never that smooth: the differences of some order, which vanish along such a
curve, are as large as its noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.statistics import median_of_known
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, runs_of
from skelgen.model.labelling import Finding
from skelgen.progress import counted

HELD, ORDERS = 1, (1, 2, 4, 6)
"""Differences that vanish where a position is held, on a straight line, on a cubic and on a quintic curve."""

LEAST_RUN = 3
"""So many differences in a row must vanish."""

SMALLER = 100.0
"""How many times smaller than half of all differences of the marker are those that vanish."""

CLEARLY = 10.0
"""How many times larger than these are half of all, those of other markers at that time, and those just before and
after."""

BETWEEN = 0.1
"""Part of the differences that may be neither: those of a path without noise come to rest by and by."""

DECIMALS = 6
"""mm; files are rounded to no more."""


@dataclass(frozen=True)
class Fill:
    """A marker with positions that are not measured or not its own: gaps that were filled, or spikes.

    Attributes
    ----------
    marker : int
        Index.
    name : str
        Its label.
    frames : ndarray of intp, shape (n_filled,)
        Where it was not seen.
    n_gaps : int
        In so many pieces.
    evidence : str
        What shows it.
    kind : str
        Of its `Finding`.
    """

    marker: int
    name: str
    frames: Ints
    n_gaps: int
    evidence: str = "exactly on straight lines or smooth curves, as programs fill gaps"
    kind: str = "filled"

    @property
    def finding(self) -> Finding:
        """Finding for the label quality."""
        pieces = f"{counted(len(self.frames), 'position')} in {counted(self.n_gaps, 'piece')}"
        evidence = f"{pieces} {self.evidence}"
        first, last = int(self.frames[0]), int(self.frames[-1])
        return Finding(self.kind, (self.name,), first, last, evidence, "taken as not seen there")


def find_fills(trajectories: Trajectories) -> tuple[Fill, ...]:
    """Find gaps of labelled markers that were filled before.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    """
    positions, found = trajectories.positions, []
    rounding = _rounding(positions)
    for marker, name in enumerate(trajectories.names):
        filled = _filled(positions, marker, rounding)
        if filled.any():
            found.append(Fill(marker, name, np.flatnonzero(filled), len(runs_of(filled))))
    return tuple(found)


def without_fills(trajectories: Trajectories, fills: tuple[Fill, ...]) -> Trajectories:
    """Return the take with gaps where they were filled.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    fills : tuple of Fill
        As they were found in it.
    """
    if not fills:
        return trajectories
    positions = trajectories.positions.copy()
    for fill in fills:
        positions[fill.frames, fill.marker] = np.nan
    return replace(trajectories, positions=positions)


def _filled(positions: Floats, marker: int, rounding: float) -> Bools:
    """Where a marker was filled, shape (n_frames,)."""
    filled = np.zeros(len(positions), dtype=np.bool_)
    for order in ORDERS:
        if len(positions) <= order + LEAST_RUN:
            break
        sizes, rounded = _differences(positions[:, marker], order), 2.0 ** (order - 1) * rounding
        known = ~np.isnan(sizes)
        usual = float(np.median(sizes[known])) if known.any() else 0.0
        limit = rounded if order == HELD else max(usual / SMALLER, rounded)  # who stands still is slow
        vanish, between = sizes <= limit, (sizes > limit) & (sizes <= CLEARLY * limit)
        if usual < CLEARLY * limit or between.sum() > BETWEEN * known.sum():
            continue
        for first, stop in runs_of(vanish):
            if stop - first < LEAST_RUN:
                continue
            at_most = CLEARLY * max(float(sizes[first:stop].max()), rounded)
            is_sharp = not (sizes[[first - 1, stop % len(sizes)]] <= at_most).any()
            if is_sharp and _is_alone(positions[first : stop + order], order, at_most):
                end = stop + order - (order != HELD and stop < len(sizes))  # what is held jumps to what is seen again
                filled[first + (first > 0) : end] = True
    return filled


def _is_alone(positions: Floats, order: int, limit: float) -> bool:
    """Whether most markers move on while one does as curves do."""
    sizes = _differences(positions, order).reshape(-1, 1)
    return bool(median_of_known(sizes)[0] > limit)


def _differences(positions: Floats, order: int) -> Floats:
    """The largest of the coordinates' differences of an order, shape (n_frames - order, ...)."""
    return np.asarray(np.abs(np.diff(positions, n=order, axis=0)).max(axis=-1))


def _rounding(positions: Floats) -> float:
    """mm; what the positions are rounded to, by as many decimals or as single precision has."""
    known = positions[:: max(1, len(positions) // 200)]
    known = known[~np.isnan(known)]
    if not len(known):
        return 0.0
    single = float(np.spacing(np.float32(np.abs(known).max())))
    for decimals in range(DECIMALS):
        scaled = known * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() <= single * 10.0**decimals < 0.1:
            return max(10.0**-decimals, single)
    return single
