"""What of a benchmark is measured already, kept beside its page: an interrupted one goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

import skelgen
from skelgen.benchmark.machine import machine_line
from skelgen.benchmark.sections import Figure, Section
from skelgen.evaluation import Table
from skelgen.files import replacing

SUFFIX = ".json"

_FORMAT = "skelgen benchmark"


def state_file(page: Path) -> Path:
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
    with replacing(state_file(page)) as temporary:
        temporary.write_text(json.dumps(state, indent=1, ensure_ascii=False), encoding="utf-8")
    return state_file(page)


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
        state = json.loads(state_file(page).read_text(encoding="utf-8"))
        if {name: state[name] for name in _key(quick)} != _key(quick):
            return [], 0.0
        return [_unpacked(section) for section in state["sections"]], float(state["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return [], 0.0


def _key(quick: bool) -> dict[str, Any]:
    return {"format": _FORMAT, "version": skelgen.__version__, "machine": machine_line(), "quick": quick}


def _packed(section: Section) -> dict[str, Any]:
    tables = [vars(table) for table in section.tables]
    return vars(section) | {"tables": tables, "figures": [vars(figure) for figure in section.figures]}


def _unpacked(packed: dict[str, Any]) -> Section:
    tables = [
        Table(one["title"], tuple(one["columns"]), tuple(tuple(row) for row in one["rows"])) for one in packed["tables"]
    ]
    figures = [Figure(one["caption"], Markup(one["drawing"])) for one in packed["figures"]]
    return Section(packed["name"], packed["title"], packed["text"], tuple(tables), tuple(figures))
