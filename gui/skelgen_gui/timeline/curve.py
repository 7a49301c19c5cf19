"""A curve over the frames of a take, prepared so that any stretch of it can be drawn at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats

_BLOCK = 64  # frames whose extremes are kept: an hour at 100 Hz is 6000 blocks


@dataclass(frozen=True, eq=False)
class Extremes:
    """The lowest and highest value of every stretch of a curve, quickly.

    Attributes
    ----------
    low, high : ndarray, shape (n_frames,)
        Lower and upper edge of what is drawn; the same array for a line, NaN where unknown.
    block_low, block_high : ndarray, shape (n_blocks,)
        Extremes of every 64 frames.
    """

    low: Floats
    high: Floats
    block_low: Floats
    block_high: Floats

    @classmethod
    def of(cls, low: Floats, high: Floats | None = None) -> Extremes:
        """Prepare a line, or a band between two lines."""
        low = np.ascontiguousarray(low)
        high = low if high is None else np.ascontiguousarray(high)
        starts = np.arange(0, len(low), _BLOCK)
        if not len(low):
            return cls(low, high, low, high)
        return cls(low, high, np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts))

    def columns(self, first: float, end: float, n_columns: int) -> tuple[Floats, Floats]:
        """Return the extremes in each column of a picture.

        Where columns are narrower than frames, values between frames are interpolated.

        Parameters
        ----------
        first, end : float
            The stretch [frames] that the picture shows; frame f lies from f to f + 1.
        n_columns : int
            Columns of the picture.

        Returns
        -------
        low, high : ndarray, shape (n_columns,)
            NaN where nothing is known.
        """
        edges = np.linspace(first, end, n_columns + 1)
        per_column = (end - first) / n_columns
        if per_column <= 1:
            places = (edges[1:] + edges[:-1]) / 2 - 0.5
            return _between(self.low, places), _between(self.high, places)
        if per_column >= 2 * _BLOCK:
            return _reduced(self.block_low, self.block_high, edges / _BLOCK)
        return _reduced(self.low, self.high, edges)


def _between(values: Floats, places: Floats) -> Floats:
    """Interpolate; unknown beside an unknown frame."""
    return np.asarray(np.interp(places, np.arange(len(values)), values))


def _reduced(low: Floats, high: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Extremes between edges that are more than one value apart."""
    starts = np.clip(edges.astype(np.intp), 0, len(low) - 1)
    last = min(int(np.ceil(edges[-1])), len(low))
    return np.fmin.reduceat(low[:last], starts[:-1]), np.fmax.reduceat(high[:last], starts[:-1])


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve of a panel.

    Attributes
    ----------
    name : str
        For the legend.
    line : Extremes
        The values.
    band : Extremes or None
        Between which values the truth lies.
    limb : int or None
        Drawn in the colour of this limb.
    shade : int
        How many curves before it have the same limb.
    component : int or None
        Drawn in the colour of this component; without limb and component, in that of texts.
    """

    name: str
    line: Extremes
    band: Extremes | None = None
    limb: int | None = None
    shade: int = 0
    component: int | None = None


class Columns(NamedTuple):
    """Lowest and highest values of a curve, and of its band, in each column of a picture."""

    line: tuple[Floats, Floats]
    band: tuple[Floats, Floats] | None


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves with one scale.

    Attributes
    ----------
    title, unit : str
        What is shown.
    curves : tuple of Curve
        At least one.
    note : str
        A few words below the legend.
    about : str
        What the curves and bands mean, for who asks.
    from_zero : bool
        Whether the scale begins at 0.
    """

    title: str
    unit: str
    curves: tuple[Curve, ...]
    note: str = ""
    about: str = ""
    from_zero: bool = True

    def columns(self, first: float, end: float, n_columns: int) -> list[Columns]:
        """Return what each curve has in the columns of a picture of a stretch [frames]."""
        return [
            Columns(
                curve.line.columns(first, end, n_columns),
                None if curve.band is None else curve.band.columns(first, end, n_columns),
            )
            for curve in self.curves
        ]

    def scale(self, columns: list[Columns]) -> tuple[float, float]:
        """Return the lowest and highest value of columns; 0 and 1 where nothing is known."""
        parts = [part for one in columns for part in (one.line, one.band) if part is not None]
        values = np.concatenate([extreme for part in parts for extreme in part])
        values = values[~np.isnan(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        low = min(low, 0.0) if self.from_zero else low
        return (low, high) if high > low else (low, low + 1.0)
