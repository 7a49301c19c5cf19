"""How a run went: parameters against their defaults, times, versions."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import metadata
from typing import Any

import skelgen
from skelgen.app.report.wording import duration, plain
from skelgen.app.stages import PIPELINE, Stage
from skelgen.model import Project, StageReport

Row = dict[str, Any]

_LIBRARIES = ("numpy", "scipy")


def stage_tables(project: Project) -> list[Row]:
    """Return, for each stage that has run: its name, purpose, time, share of the whole time, and parameters."""
    whole = sum(report.seconds for report in project.reports.values())
    ran = [(stage, project.reports[stage.name]) for stage in PIPELINE if stage.name in project.reports]
    return [
        {
            "name": stage.name,
            "summary": stage.summary,
            "seconds": duration(report.seconds) if report.seconds else "–",  # a batch keeps times apart
            "share": report.seconds / whole if whole > 0 else 0.0,
            "parameters": _parameters(stage, report),
        }
        for stage, report in ran
    ]


def versions() -> list[tuple[str, str]]:
    """Return the versions that the result depends on."""
    libraries = [(name, metadata.version(name)) for name in _LIBRARIES]
    return [("skelgen", skelgen.__version__), *libraries, ("Python", platform.python_version())]


def _parameters(stage: Stage, report: StageReport) -> list[Row]:
    if not report.parameters:
        return []
    declared = {each.name: each for each in stage.parameters_class().declarations()}
    return [_row(name, value, declared) for name, value in report.parameters.items()]


def _row(name: str, value: Any, declared: Mapping[str, Any]) -> Row:
    row: Row = {"name": name, "value": _shown(value), "unit": "", "default": "", "help": "", "changed": False}
    if name in declared:
        entry = declared[name]
        row |= {"unit": entry.unit, "default": _shown(entry.default), "help": entry.help}
        row["changed"] = value != entry.default
    return row


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain(value) if isinstance(value, float) else str(value)
