"""What the commands show: results on stdout, progress and notes on stderr."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

from skelgen.errors import printable
from skelgen.progress import SILENT, Monitor, SilentMonitor, counted

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from skelgen.app.first_look import TakeFacts
    from skelgen.app.tables import LabellingFacts, ProjectTables, Row
    from skelgen.evaluation import Table
    from skelgen.model import Project

_REDRAW_SECONDS = 0.1  # a bar that moves ten times a second looks smooth and costs nothing
_NOTE_SECONDS = 10.0  # between two lines in a log
_PIPED_WIDTH = 160  # columns of a table when nobody's terminal sets the width
_MISSING = "-"
_ROUNDING = 1e-9  # smaller values are what rounding leaves of 0


_X_PORT, _PATIENCE = 6000, 1.0  # of the first display of a machine; seconds until one is taken to be gone
_ON_DISPLAYS = ("xcb", "wayland")  # Qt's ways of drawing that need one


def has_display() -> bool:
    """Return whether windows can be seen: a session that has ended leaves the name of its display behind."""
    return sys.platform != "linux" or any(map(_answers, _display_addresses()))


def can_open_windows() -> bool:
    """Return whether Qt can open windows, on a display or where it is told to draw; it ends the program otherwise."""
    platform = os.environ.get("QT_QPA_PLATFORM", "")
    return has_display() if not platform or platform.startswith(_ON_DISPLAYS) else True


def _display_addresses() -> Iterator[str | tuple[str, int]]:
    """Sockets of the displays that the environment names: paths, or hosts with ports."""
    if wayland := os.environ.get("WAYLAND_DISPLAY"):
        yield str(Path(os.environ.get("XDG_RUNTIME_DIR", "")) / wayland)
    host, _, number = os.environ.get("DISPLAY", "").rpartition(":")
    number = number.partition(".")[0]
    if number.isdecimal() and host in {"", "unix"}:
        yield f"/tmp/.X11-unix/X{number}"
        yield f"\0/tmp/.X11-unix/X{number}"
    elif number.isdecimal():
        yield host, _X_PORT + int(number)


def _answers(address: str | tuple[str, int]) -> bool:
    import socket

    family = socket.AF_UNIX if isinstance(address, str) else socket.AF_INET
    try:
        with socket.socket(family) as opened:
            opened.settimeout(_PATIENCE)
            opened.connect(address)
    except (OSError, OverflowError, ValueError):  # the last two of an environment that names no display
        return False
    return True


class Screen:
    """One command's way of speaking.

    Parameters
    ----------
    quiet : bool
        Show neither progress nor notes.
    as_json : bool
        Print one JSON object on stdout and nothing else.
    """

    def __init__(self, quiet: bool = False, as_json: bool = False) -> None:
        self._quiet = quiet
        self.as_json = as_json

    @contextlib.contextmanager
    def watching(self, counted: bool = False) -> Iterator[Monitor]:
        """Yield a monitor: bars on a terminal, plain notes elsewhere, silence if quiet.

        Parameters
        ----------
        counted : bool
            Whether the work is in equal pieces: then it says how many are done, and when the rest will be.
        """
        if self._quiet or self.as_json:
            yield SILENT
        elif sys.stderr.isatty():
            with _bars(counted) as progress:
                yield _BarMonitor(progress)
        else:
            yield _CountingNotes() if counted else _NoteMonitor()

    def note(self, sentences: Iterable[str]) -> None:
        """Show notes on stderr unless told to be quiet."""
        if not (self._quiet or self.as_json):
            for sentence in sentences:
                _print_note(sentence)

    def say(self, text: str) -> None:
        """Print a line on stdout unless JSON is wanted."""
        if not self.as_json:
            print(*map(printable, text.split("\n")), sep="\n")

    def table(self, title: str, rows: Sequence[Mapping[str, object]]) -> None:
        """Print rows as a table on stdout unless JSON is wanted.

        Parameters
        ----------
        title : str
            Stands above the table.
        rows : sequence of mapping
            Cells by column; the keys of the first row are the columns.
        """
        if self.as_json or not rows:
            return
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        table = Table(title=Text(title), title_justify="left", title_style="bold")
        for name in rows[0]:
            numeric = all(isinstance(row.get(name), int | float | None) for row in rows)
            table.add_column(Text(_heading(name)), justify="right" if numeric else "left", overflow="fold")
        for row in rows:
            table.add_row(*(Text(printable(_cell(row.get(name)))) for name in rows[0]))
        Console(width=None if sys.stdout.isatty() else _PIPED_WIDTH).print(table)

    def json(self, data: Mapping[str, object]) -> None:
        """Print the one JSON object if JSON is wanted."""
        if self.as_json:
            print(json.dumps(data, indent=1, ensure_ascii=False))


class _NoteMonitor(SilentMonitor):
    """Prints notices, ignores progress: for logs and pipes."""

    def notice(self, sentence: str) -> None:
        _print_note(sentence)


class _CountingNotes(_NoteMonitor):
    """Prints now and then how many pieces are done, and when the rest will be."""

    def __init__(self) -> None:
        self._name = ""
        self._began = self._last_note = time.monotonic()

    def begin(self, name: str) -> None:
        self._name = name
        self._began = self._last_note = time.monotonic()

    def advance(self, done: float, total: float) -> None:
        now = time.monotonic()
        if 0 < done < total and now - self._last_note > _NOTE_SECONDS:
            self._last_note = now
            _print_note(f"{done:g} of {total:g} {self._name}, {remaining(done, total, now - self._began)} left")


class _BarMonitor:
    """One bar per piece of work."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task: TaskID | None = None
        self._drawn = 0.0

    def begin(self, name: str) -> None:
        if self._task is not None:
            self._progress.update(self._task, completed=1, total=1)
        self._task = self._progress.add_task(name, total=None)

    def advance(self, done: float, total: float) -> None:
        now = time.monotonic()
        if self._task is not None and (done >= total or now - self._drawn > _REDRAW_SECONDS):
            self._drawn = now
            self._progress.update(self._task, completed=done, total=total)

    def notice(self, sentence: str) -> None:
        self._progress.console.print(f"note: {printable(sentence)}", markup=False, highlight=False)


def remaining(done: float, total: float, seconds: float) -> str:
    """Return in words how long the rest takes if it goes on as it went.

    Parameters
    ----------
    done, total : float
        Pieces; some are done.
    seconds : float
        What they took.

    Examples
    --------
    >>> remaining(25, 100, 60.0)
    'about 3 min'
    """
    rest = seconds * (total - done) / done
    if rest < 100:
        return f"about {rest:.0f} s"
    return f"about {rest / 60:.0f} min" if rest < 6000 else f"about {rest / 3600:.1f} h"


@contextlib.contextmanager
def _bars(counted: bool = False) -> Iterator[Progress]:
    from rich import progress as rich
    from rich.console import Console

    columns = [rich.TextColumn("{task.description}", markup=False), rich.BarColumn(), rich.TimeElapsedColumn()]
    if counted:
        columns += [rich.MofNCompleteColumn(), rich.TextColumn("left:"), rich.TimeRemainingColumn()]
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield progress


def _print_note(sentence: str) -> None:
    print(f"note: {printable(sentence)}", file=sys.stderr)


def _heading(name: str) -> str:
    return name.replace("_mm2", " [mm²]").replace("_mm", " [mm]").replace("_deg", " [deg]").replace("_", " ")


def _cell(value: object) -> str:
    if value is None:
        return _MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        from skelgen.app.drawing.wording import digits

        return digits(0.0 if abs(value) <= _ROUNDING else value).replace("\N{MINUS SIGN}", "-")
    if isinstance(value, list | tuple):
        return ", ".join(f"{item:.4g}" if isinstance(item, float) else _cell(item) for item in value)
    return str(value)


_TITLES = {
    "bodies": "Bodies",
    "limbs": "Limbs",
    "joints": "Joints",
    "angles": "Joint angles",
    "joint_spans": "Joints that hold for a part of the take only",
    "closed_loops": "Joints that close loops",
    "lengths": "Lengths between the joints of a limb",
}
_KINDS = {"points": ("point",), "markers": ("marker",), "poses": ("body", "bodies")}
"""What one, and several, of what a take holds are called."""

_MOST_ASKED = 3  # questions; all are in the JSON and more in the report
_ELSEWHERE = {
    *("cost_mm2", "margin_mm2", "rival", "rival_probability", "child_std_mm", "axis", "axis_std_deg"),
    *("is_determined", "is_fully_determined", "is_placed_by_marker_set", "not_determined", "to_do"),
}
"""Columns that no terminal has room for: they stand in the JSON and in the report; sentences are said as notes, too."""


def show_take(screen: Screen, facts: TakeFacts) -> None:
    """Print one line about a take.

    Parameters
    ----------
    screen : Screen
        Where to print.
    facts : TakeFacts
        What is known of it.
    """
    count = counted(facts["count"], *_KINDS[facts["kind"]])
    screen.say(f"{facts['name']}: {count}, {counted(facts['frames'], 'frame')} at {facts['rate_hz']:g} Hz")


def show_project(screen: Screen, tables: ProjectTables) -> None:
    """Print what a project holds: take, limbs, joints, lengths, residuals, times.

    Parameters
    ----------
    screen : Screen
        Where to print.
    tables : ProjectTables
        All that it holds.
    """
    show_take(screen, tables["take"])
    if "labelling" in tables:
        _show_labelling(screen, tables["labelling"])
    found = cast("Mapping[str, Sequence[Row]]", tables)
    for key, title in _TITLES.items():
        rows = [{name: value for name, value in row.items() if name not in _ELSEWHERE} for row in found.get(key, ())]
        rows = [] if key == "bodies" and len(rows) == 1 else rows
        screen.table(title, rows)
    if "residuals" in tables:
        screen.table("Residuals of all markers", [tables["residuals"]])
    times = ", ".join(f"{row['stage']} {row['seconds']:.2f} s" for row in tables["stages"])
    screen.say(f"stages: {times or 'none has run'}")


def _show_labelling(screen: Screen, facts: LabellingFacts) -> None:
    """Print how sure the labels are in a line, and what could be done about it."""
    parts = [counted(facts["markers"], "marker")]
    if "tracklets" in facts:
        parts[0] += f" from {counted(facts['tracklets'], 'tracklet')}"
    spans = counted(facts["doubtful_spans"], "doubtful span")
    parts.append(f"{spans} ({100 * facts['doubtful_share']:.2g} % of the positions)")
    if "left_out" in facts:
        parts.append(f"{counted(facts['left_out'], 'point')} left out ({100 * facts['left_out_share']:.2g} %)")
    if "classic_markers" in facts:
        agreement = 100 * facts["classic_agreement"]
        parts.append(
            f"the classic method finds {facts['classic_markers']} and agrees in {agreement:.1f} % of the points"
        )
    screen.say(f"labels: {'; '.join(parts)}")
    for sentence in facts["advice"]:
        screen.say(f"  try: {sentence}")
    for sentence in facts["questions"][:_MOST_ASKED]:
        screen.say(f"  ask: {sentence}")


def show_results(screen: Screen, project: Project, files: Sequence[Path]) -> None:
    """Print what a run has found and written, as tables or as one JSON object.

    Parameters
    ----------
    screen : Screen
        Where to print.
    project : Project
        With results.
    files : sequence of Path
        What was written.
    """
    from skelgen.app.tables import project_tables

    tables = project_tables(project)
    show_project(screen, tables)
    show_files(screen, files)
    screen.json({**tables, "files": [str(file) for file in files]})


def show_files(screen: Screen, files: Sequence[Path]) -> None:
    """Print which files were written.

    Parameters
    ----------
    screen : Screen
        Where to print.
    files : sequence of Path
        The files.
    """
    screen.say("written: " + ", ".join(str(file) for file in files))


def show_evaluation(screen: Screen, tables: Iterable[Table]) -> None:
    """Print scores against the truth.

    Parameters
    ----------
    screen : Screen
        Where to print.
    tables : iterable of Table
        From `evaluation_tables`.
    """
    for table in tables:
        screen.table(table.title, [dict(zip(table.columns, row, strict=True)) for row in table.rows])
