"""Parameters of a run: from defaults, ``config.xml`` and single values, checked before any stage starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from skelgen.app.stages import PIPELINE, find_stage, stage_names
from skelgen.errors import ParameterError
from skelgen.parameters import StageParameters, declare

Wanted = Mapping[str, StageParameters | Mapping[str, Any]] | Path | str | None
"""Parameters as a caller gives them: by stage, or a ``config.xml``."""


@dataclass(frozen=True)
class FileParameters(StageParameters):
    """Names of the files that the stage commands use when none is given (the seed's table 4.13)."""

    stage: ClassVar[str] = "files"
    config_section: ClassVar[str] = "GUI"

    capture_file: str = declare(
        "take.mfml", "Take that `skelgen label` reads when no file is given.", config_name="tempCorFileName"
    )
    labels_file: str = declare(
        "labels.skelgen",
        "Project with labelled markers, which `skelgen label` writes and `skelgen cluster` reads.",
        config_name="specCluFileName",
    )
    limbs_file: str = declare(
        "limbs.skelgen",
        "Project with clustered markers, which `skelgen cluster` writes and `skelgen joints` reads.",
        config_name="jointFinderFileName",
    )
    joints_file: str = declare(
        "joints.skelgen",
        "Project with the structure of the skeleton, which `skelgen joints` writes and `skelgen fit` reads.",
        config_name="skelFitFileName",
    )
    result_file: str = declare(
        "result.xml",
        "Results and evaluation of the whole program, which `skelgen fit` writes beside its project file.",
        config_name="saveFileName",
    )


class Settings:
    """The parameters of every stage; those that nobody mentions are made when they are asked for.

    Making them late keeps the modules of stages that do not run unloaded.

    Parameters
    ----------
    wanted : mapping, Path, str or None
        ``{"joints": {"alpha": 0.2}}``, ``{"joints": JointParameters(alpha=0.2)}``, or the path of a ``config.xml``.

    Raises
    ------
    ParameterError
        If a stage or a parameter is unknown or a value is out of bounds.
    """

    def __init__(self, wanted: Wanted = None) -> None:
        values = _from_file(Path(wanted)) if isinstance(wanted, Path | str) else dict(wanted or {})
        self._parameters = {name: _checked(name, value) for name, value in values.items()}

    def of(self, stage: str) -> StageParameters:
        """Return the parameters of one stage."""
        if stage not in self._parameters:
            self._parameters[stage] = parameters_class(stage)()
        return self._parameters[stage]

    def as_mapping(self) -> dict[str, dict[str, Any]]:
        """Return names and values by stage, of the stages that somebody mentioned or asked for."""
        return {stage: parameters.as_mapping() for stage, parameters in self._parameters.items()}

    def changed(self, stage: str, values: Mapping[str, Any], where: str = "") -> Settings:
        """Return settings with some values of one stage replaced."""
        old = self.of(stage).as_mapping()
        new = parameters_class(stage).from_mapping({**old, **values}, where)
        return Settings({**self._parameters, stage: new})


def parameters_class(stage: str) -> type[StageParameters]:
    """Return the class that declares a stage's parameters; ``files`` names the file names."""
    if stage == FileParameters.stage:
        return FileParameters
    if stage not in stage_names():
        known = ", ".join((*stage_names(), FileParameters.stage))
        raise ParameterError(f"there is no stage {stage!r}; stages are {known}")
    return find_stage(stage).parameters_class()


def all_parameter_classes() -> tuple[type[StageParameters], ...]:
    """Return the classes of everything that can be configured, in the order of ``config.xml``."""
    return (FileParameters, *(stage.parameters_class() for stage in PIPELINE))


def settings_with(settings: Settings, assignments: Iterable[str]) -> Settings:
    """Apply texts such as ``joints.alpha=0.2``.

    Parameters
    ----------
    settings : Settings
        What to change.
    assignments : iterable of str
        Each ``stage.name=value``.

    Raises
    ------
    ParameterError
        If a text has another form, or as for `Settings`.
    """
    for text in assignments:
        target, equals, value = text.partition("=")
        stage, dot, name = target.strip().partition(".")
        if not equals or not dot:
            raise ParameterError(f"--set {text}: it must have the form stage.name=value, e.g. joints.alpha=0.2")
        settings = settings.changed(stage, {name.replace("-", "_"): value.strip()}, f"--set {text}")
    return settings


def write_defaults(path: Path) -> None:
    """Write ``config.xml`` with every default, its help as comment."""
    from skelgen_formats.config_xml import write_config  # noqa: PLC0415 - lxml costs 50 ms

    write_config(path, all_parameter_classes())


def parameter_rows(settings: Settings) -> list[dict[str, Any]]:
    """Return one row per parameter: stage, name, value, default, unit, bounds, seed name, help."""
    return [
        {
            "stage": cls.stage,
            "name": declaration.name,
            "value": getattr(settings.of(cls.stage), declaration.name),
            "default": declaration.default,
            "unit": declaration.unit,
            "bounds": declaration.bounds,
            "config_name": declaration.config_name,
            "help": declaration.help,
        }
        for cls in all_parameter_classes()
        for declaration in cls.declarations()
    ]


def _from_file(path: Path) -> Mapping[str, StageParameters]:
    from skelgen_formats.config_xml import read_config  # noqa: PLC0415 - lxml costs 50 ms

    return read_config(path, list(all_parameter_classes()))


def _checked(stage: str, value: StageParameters | Mapping[str, Any]) -> StageParameters:
    cls = parameters_class(stage)
    if isinstance(value, StageParameters):
        if not isinstance(value, cls):
            raise ParameterError(f"the stage {stage!r} takes {cls.__name__}, not {type(value).__name__}")
        return value
    return cls.from_mapping(value, stage)
