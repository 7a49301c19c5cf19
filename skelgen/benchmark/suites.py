"""The suites of `skelgen benchmark` in their order, and running them."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.benchmark import accuracy
from skelgen.benchmark.page import QUICK, Effort, Figure, Section, machine_line, write_benchmark_page
from skelgen.benchmark.people import measure_people
from skelgen.benchmark.speed import measure_speed
from skelgen.errors import Cancelled, InputError, SkelgenError
from skelgen.evaluation import Table
from skelgen.files import replacing
from skelgen.progress import SILENT, Monitor

Suite = Callable[[Effort, Monitor], Section]

SUITES: dict[str, Suite] = {
    "labels": accuracy.measure_labels,
    "exact": accuracy.measure_exact,
    "joints": accuracy.measure_joints,
    "tissue": accuracy.measure_tissue,
    "people": measure_people,
    "stereo": accuracy.measure_stereo,
    "exports": accuracy.measure_exports,
    "speed": measure_speed,
}
"""Every suite by its name, in the order of the page."""


SECONDS = {
    "labels": 150,
    "exact": 20,
    "joints": 40,
    "tissue": 15,
    "people": 180,
    "stereo": 40,
    "exports": 5,
    "speed": 240,
}
"""What each suite takes in full on one core of a machine in use [s]: how far the whole benchmark is."""


def run_benchmark(
    names: Sequence[str] = (),
    *,
    quick: bool = False,
    known: Sequence[Section] = (),
    arrived: Callable[[list[Section]], None] = lambda sections: None,
    monitor: Monitor = SILENT,
    suites: Mapping[str, Suite] | None = None,
) -> list[Section]:
    """Measure accuracy, speed and memory on this machine, on one core.

    Parameters
    ----------
    names : sequence of str
        Suites, see `SUITES`; all if left out.
    quick : bool
        Fewer seeds and frames: two to three minutes.
    known : sequence of Section
        Suites that were measured before, and are not measured again.
    arrived : callable (sections) -> None
        Called after each suite with all that are done so far, in the order of the page.
    monitor : Monitor
        Receives the percentage of the whole that is done.
    suites : mapping of str to callable, optional
        What there is to measure; `SUITES` if left out.

    Returns
    -------
    list of Section
        A suite that cannot be measured says why.

    Raises
    ------
    InputError
        If there is no suite of a name.
    """
    suites = SUITES if suites is None else suites
    done = {section.name: section for section in known}
    wanted = _chosen(names)
    missing = [name for name in wanted if name not in done]
    total, before = sum(SECONDS[name] for name in missing), 0
    monitor.begin("percent")
    with threadpool_limits(limits=1):
        for name in missing:
            part = _Part(monitor, 100.0 * before / total, 100.0 * SECONDS[name] / total)
            done[name] = _measured(name, suites[name], QUICK if quick else Effort(), part)
            before += SECONDS[name]
            arrived([done[one] for one in wanted if one in done])
    return [done[name] for name in wanted]


def measure_page(
    page: Path,
    names: Sequence[str] = (),
    *,
    quick: bool = False,
    resume: bool = False,
    monitor: Monitor = SILENT,
    suites: Mapping[str, Suite] | None = None,
) -> tuple[list[Section], str]:
    """Measure, and after each suite write a page of all that is done, with what it takes to go on beside it.

    Parameters
    ----------
    page : Path
        The page; it is written before anything is measured, as one that cannot be written shall not cost all figures.
    names, quick, monitor, suites
        As for `run_benchmark`.
    resume : bool
        Whether suites that are finished in the page are kept.

    Returns
    -------
    tuple of list of Section and str
        The suites, and when they were measured in how many seconds.

    Raises
    ------
    InputError
        If there is no suite of a name.
    WriteError
        If the page cannot be written.
    """
    words = ["skelgen benchmark", *(["--quick"] if quick else []), *(f"--suite {name}" for name in names)]
    chosen = _chosen(names)
    known, before = load_state(page, quick=quick) if resume else ([], 0.0)
    started = time.monotonic() - before

    def measured() -> str:
        return f"{time.strftime('%Y-%m-%d')}, {time.monotonic() - started:.0f} s"

    def write(sections: list[Section]) -> None:
        done = {section.name for section in sections}
        missing = [name for name in chosen if name not in done]
        save_state(sections, page, quick=quick, seconds=time.monotonic() - started)
        write_benchmark_page(sections, page, measured=measured(), command=" ".join(words), missing=missing)

    write(known)
    sections = run_benchmark(names, quick=quick, known=known, arrived=write, monitor=monitor, suites=suites)
    write(sections)
    return sections, measured()


def _chosen(names: Sequence[str]) -> list[str]:
    """Return the suites that are named, in the order of the page; all if none is, or an error if one is unknown."""
    for name in names:
        if name not in SUITES:
            raise InputError(f"there is no suite {name!r}; suites are {', '.join(SUITES)}")
    return [name for name in SUITES if not names or name in names]


def _measured(name: str, suite: Suite, effort: Effort, monitor: Monitor) -> Section:
    """A suite's section; what goes wrong in it must not cost the others."""
    try:
        return suite(effort, monitor)
    except Cancelled:
        raise
    except SkelgenError as error:
        monitor.notice(f"{name}: {error}")
        return Section(name, name.capitalize(), f"Not measured: {error}.", ())


class _Part:
    """Progress of one suite, as percent of the whole benchmark by what each usually takes."""

    def __init__(self, monitor: Monitor, first: float, share: float) -> None:
        self._monitor, self._first, self._share = monitor, first, share

    def begin(self, name: str) -> None:
        """Ignore steps within a suite."""

    def advance(self, done: float, total: float) -> None:
        """Tell the percent of the whole."""
        self._monitor.advance(round(self._first + self._share * done / max(total, 1)), 100)

    def notice(self, sentence: str) -> None:
        """Pass it on."""
        self._monitor.notice(sentence)


SUFFIX = ".json"

_FORMAT = "skelgen benchmark"


def _state_file(page: Path) -> Path:
    """Return the file beside a page that keeps what it shows."""
    return page.with_suffix(SUFFIX)


def save_state(sections: Sequence[Section], page: Path, *, quick: bool, seconds: float = 0.0) -> Path:
    """Write what is measured, whole or not at all.

    Parameters
    ----------
    sections : sequence of Section
        The suites that are done.
    page : Path
        The page that shows them.
    quick : bool
        Whether fewer seeds and frames were measured.
    seconds : float
        How long it took.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    state = _key(quick) | {"seconds": seconds, "sections": [_packed(section) for section in sections]}
    with replacing(_state_file(page)) as temporary:
        temporary.write_text(json.dumps(state, indent=1, ensure_ascii=False), encoding="utf-8")
    return _state_file(page)


def load_state(page: Path, *, quick: bool) -> tuple[list[Section], float]:
    """Return suites that are done already, and the seconds that they took; nothing if they do not fit.

    What another version, another machine or another effort measured is not believed.

    Parameters
    ----------
    page : Path
        The page.
    quick : bool
        Whether fewer seeds and frames are measured.
    """
    try:
        state = json.loads(_state_file(page).read_text(encoding="utf-8"))
        if {name: state[name] for name in _key(quick)} != _key(quick):
            return [], 0.0
        return [_unpacked(section) for section in state["sections"]], float(state["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return [], 0.0


def _key(quick: bool) -> dict[str, object]:
    return {"format": _FORMAT, "version": skelgen.__version__, "machine": machine_line(), "quick": quick}


def _packed(section: Section) -> dict[str, object]:
    tables = [vars(table) for table in section.tables]
    return vars(section) | {"tables": tables, "figures": [vars(figure) for figure in section.figures]}


def _unpacked(packed: dict[str, Any]) -> Section:
    tables = [
        Table(one["title"], tuple(one["columns"]), tuple(tuple(row) for row in one["rows"])) for one in packed["tables"]
    ]
    figures = [Figure(one["caption"], Markup(one["drawing"])) for one in packed["figures"]]
    return Section(packed["name"], packed["title"], packed["text"], tuple(tables), tuple(figures))
