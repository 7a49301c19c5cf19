"""What a suite hands back: tables of what is wanted and what is reached, and figures."""

import contextlib
import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from markupsafe import Markup

import skelgen
from skelgen.app.drawing import svg
from skelgen.app.drawing.svg import Axes
from skelgen.app.files import write_html
from skelgen.evaluation import Table
from skelgen.progress import counted

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
    structures : tuple of str
        What moves in the takes whose accuracy is measured.
    n_people, n_animals : int
        Simulated people, each of another size, with another marker set or motion; and animals.
    """

    seeds: tuple[int, ...] = (0, 1, 2)
    n_frames: int = 1000
    n_label_frames: int = 1500
    n_trials: int = 400
    distances: tuple[float, ...] = (1000.0, 1500.0, 2000.0, 3000.0)
    frames: tuple[int, ...] = (500, 1000, 2000, 6000, 24_000, 72_000)
    cloud_frames: tuple[int, ...] = (500, 1000, 2000, 6000)
    limbs: tuple[int, ...] = (5, 10, 20, 30)
    structures: tuple[str, ...] = ("human", "classic-human", "quadruped", "rods", "tree:8")
    n_people: int = 50
    n_animals: int = 20


QUICK = Effort(
    seeds=(0,),
    n_frames=500,
    n_label_frames=500,
    n_trials=200,
    distances=(1000.0, 2000.0),
    frames=(500, 1000, 2000),
    cloud_frames=(500, 1000),
    limbs=(5, 10, 20),
    n_people=5,
    n_animals=2,
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
    """Return a table whose last column, without a heading, is the verdict.

    Parameters
    ----------
    title : str
        What the table shows and what is wanted.
    columns : iterable of str
        Headings of all columns but the last.
    rows : iterable of iterable of str
        Cells, the verdict last.
    """
    return Table(title, (*columns, ""), tuple(tuple(row) for row in rows))


def verdict(is_reached: bool) -> str:
    """Return what the last column says."""
    return REACHED if is_reached else MISSED


def figure_text(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; a dash where there is none.

    Parameters
    ----------
    value : float or None
        The number.
    digits : int
        Digits behind the point.
    """
    return "-" if value is None else f"{value:.{digits}f}"


_WIDTH, _HEIGHT, _BOTTOM = 620.0, 300.0, 36.0
_LEGEND_WIDTH, _LEGEND_TOP, _LEGEND_STEP = 200.0, 30.0, 18.0  # px: beside the axes, so that it hides no point
_HEADROOM = 1.08
_RADIUS = 4.0


@dataclass(frozen=True)
class Series:
    """Points of one kind.

    Attributes
    ----------
    name : str
        For the legend.
    x, y : sequence of float
        The points.
    is_line : bool
        Whether a line joins them.
    has_points : bool
        Whether they are drawn one by one.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    is_line: bool = True
    has_points: bool = True


def draw(title: str, x_title: str, y_title: str, series: Sequence[Series]) -> Markup:
    """Draw series over axes that begin at zero, each in its colour, with a legend.

    Parameters
    ----------
    title : str
        For those who do not see the drawing.
    x_title, y_title : str
        With units.
    series : sequence of Series
        At most six; empty ones are left out.
    """
    shown = [one for one in series if len(one.x)]
    last_x = max((max(one.x) for one in shown), default=1.0) * _HEADROOM
    last_y = max((max(one.y) for one in shown), default=1.0) * _HEADROOM
    axes = Axes(_WIDTH, _HEIGHT, _BOTTOM, last_x or 1.0, last_y or 1.0)
    drawn = [_drawn(axes, one, f"series{index}") for index, one in enumerate(shown)]
    legend = [_legend(axes, one, f"series{index}", index) for index, one in enumerate(shown)]
    return svg.drawing(_WIDTH + _LEGEND_WIDTH, _HEIGHT, title, axes.frame(y_title, x_title), *drawn, *legend)


def _drawn(axes: Axes, one: Series, cls: str) -> Markup:
    across, down = [axes.x(value) for value in one.x], [axes.y(value) for value in one.y]
    parts = []
    if one.is_line:
        parts.append(svg.tag("path", d=svg.path_through(np.array(across), np.array(down)), cls=f"{cls} curve"))
    if one.has_points:
        hints = [f"{one.name}: {x:.4g}, {y:.4g}" for x, y in zip(one.x, one.y, strict=True)]
        parts += [
            svg.circle(x, y, _RADIUS, f"{cls} point", hint) for x, y, hint in zip(across, down, hints, strict=True)
        ]
    return svg.group(*parts)


def _legend(axes: Axes, one: Series, cls: str, index: int) -> Markup:
    x, y = axes.width + _RADIUS, _LEGEND_TOP + _LEGEND_STEP * index
    sign = svg.line(x, y, x + 18, y, f"{cls} curve") if one.is_line else svg.circle(x + 9, y, _RADIUS, f"{cls} point")
    return svg.group(sign, svg.text(x + 24, y + 4, one.name, "small"))


def write_benchmark_page(
    sections: Sequence[Section], path: Path, *, measured: str = "", command: str = "", missing: Sequence[str] = ()
) -> Path:
    """Write the page.

    Parameters
    ----------
    sections : sequence of Section
        From `run_benchmark`.
    path : Path
        The HTML file.
    measured : str
        When, and how long it took.
    command : str
        What repeats it.
    missing : sequence of str
        Suites that are not measured yet.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    return write_html(
        __name__.rpartition(".")[0],
        path,
        sections=sections,
        machine=machine_line(),
        measured=measured,
        command=command,
        sentence=counts_sentence(sections),
        missing=", ".join(missing),
        missed=MISSED,
    )


def counts_sentence(sections: Sequence[Section]) -> str:
    """Return in words how many of the figures that are wanted were reached."""
    reached, missed = (sum(section.count(what) for section in sections) for what in (REACHED, MISSED))
    return f"{reached} of {counted(reached + missed, 'wanted figure')} reached"


PACKAGES = ("numpy", "scipy", "scikit-learn")
_CPU_FACTS = Path("/proc/cpuinfo")  # of Linux


def machine_line() -> str:
    """Return processor, cores, system, and versions of what computes."""
    versions = ", ".join([f"skelgen {skelgen.__version__}", *(f"{name} {version(name)}" for name in PACKAGES)])
    system = f"{platform.system()} {platform.machine()}"
    return f"{_processor_name()}, {os.cpu_count()} cores, {system}, Python {platform.python_version()}, {versions}"


def _processor_name() -> str:
    """Return the processor's name as the system tells it."""
    with contextlib.suppress(OSError):
        for line in _CPU_FACTS.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
