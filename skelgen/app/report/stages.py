"""What the report shows of the stages that ran: how long they took, and their parameters beside the defaults."""

from collections.abc import Mapping
from dataclasses import dataclass

from skelgen.app import STAGE_SUMMARIES
from skelgen.app.configuration import parameters_class
from skelgen.app.drawing.wording import duration, plain
from skelgen.model import Project, StageReport
from skelgen.parameters import Declaration


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of a stage, as the report words it.

    Attributes
    ----------
    name, value, unit, default, help : str
        Unit, default and help are empty where this version knows no such parameter.
    changed : bool
        Whether the value is not the default.
    """

    name: str
    value: str
    unit: str = ""
    default: str = ""
    help: str = ""
    changed: bool = False


@dataclass(frozen=True)
class StageRow:
    """A stage that ran, as the report words it.

    Attributes
    ----------
    name, summary, seconds : str
        What it is called, what it does, and how long it took.
    share : float
        Its part of the time of all stages.
    parameters : list of ParameterRow
        With which it ran; empty where they are not known.
    """

    name: str
    summary: str
    seconds: str
    share: float
    parameters: list[ParameterRow]


def stage_rows(project: Project) -> list[StageRow]:
    """Return the stages that have run, in the order of the pipeline."""
    whole = sum(report.seconds for report in project.reports.values())
    return [
        StageRow(
            name=stage,
            summary=STAGE_SUMMARIES[stage],
            seconds=duration(report.seconds) if report.seconds else "–",  # a batch keeps times apart
            share=report.seconds / whole if whole > 0 else 0.0,
            parameters=_parameters(stage, report),
        )
        for stage, report in ((stage, project.reports[stage]) for stage in STAGE_SUMMARIES if stage in project.reports)
    ]


def _parameters(stage: str, report: StageReport) -> list[ParameterRow]:
    if not report.parameters:
        return []
    declared = {each.name: each for each in parameters_class(stage).declarations()}
    return [_row(name, value, declared) for name, value in report.parameters.items()]


def _row(name: str, value: object, declared: Mapping[str, Declaration]) -> ParameterRow:
    if name not in declared:
        return ParameterRow(name, _shown(value))
    entry = declared[name]
    return ParameterRow(name, _shown(value), entry.unit, _shown(entry.default), entry.help, value != entry.default)


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain(value) if isinstance(value, float) else str(value)
