"""What a suite hands back: tables of what is wanted and what is reached, and figures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from markupsafe import Markup

from skelgen.evaluation import Table

REACHED, MISSED = "reached", "MISSED"


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes
    ----------
    seeds : tuple of int
        One take for each, of every case.
    n_frames : int
        Of the takes whose accuracy is measured.
    n_label_frames : int
        Of the takes without labels.
    n_trials : int
        Poses by chance of the stereo rig, at every distance.
    distances : tuple of float, mm
        From the rig.
    frames : tuple of int
        Lengths of the takes whose time is measured.
    cloud_frames : tuple of int
        Lengths of the takes without names.
    limbs : tuple of int
        Sizes of the random trees whose time is measured.
    """

    seeds: tuple[int, ...] = (0, 1, 2)
    n_frames: int = 1000
    n_label_frames: int = 1500
    n_trials: int = 400
    distances: tuple[float, ...] = (1000.0, 1500.0, 2000.0, 3000.0)
    frames: tuple[int, ...] = (500, 1000, 2000, 6000, 24_000, 72_000)
    cloud_frames: tuple[int, ...] = (500, 1000, 2000, 6000)
    limbs: tuple[int, ...] = (5, 10, 20, 30)


QUICK = Effort(
    seeds=(0,),
    n_frames=500,
    n_label_frames=500,
    n_trials=200,
    distances=(1000.0, 2000.0),
    frames=(500, 1000, 2000),
    cloud_frames=(500, 1000),
    limbs=(5, 10, 20),
)
"""Two to three minutes of one core: fewer seeds and frames, so that single figures are less certain."""


@dataclass(frozen=True)
class Figure:
    """A drawing and what it shows."""

    caption: str
    drawing: Markup


@dataclass(frozen=True)
class Section:
    """What one suite measured.

    Attributes
    ----------
    name, title, text : str
        Name on the command line, heading, and what is measured how.
    tables : tuple of Table
        The last column of each says `REACHED`, `MISSED` or nothing.
    figures : tuple of Figure
        Drawings.
    """

    name: str
    title: str
    text: str
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...] = ()

    def count(self, what: str) -> int:
        """Return how many rows are `REACHED` or `MISSED`."""
        return sum(row[-1] == what for table in self.tables for row in table.rows)


def table(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> Table:
    """Return a table whose last column, without a heading, is the verdict."""
    return Table(title, (*columns, ""), tuple(tuple(row) for row in rows))


def verdict(is_reached: bool) -> str:
    """Return what the last column says."""
    return REACHED if is_reached else MISSED


def figure_text(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"
