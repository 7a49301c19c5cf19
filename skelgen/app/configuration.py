"""Parameters of a run: from defaults, ``config.xml`` and single values, checked before any stage starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

from skelgen_formats.config_xml import read_config, write_config

from skelgen.errors import ParameterError
from skelgen.model.project import STAGES
from skelgen.parameters import StageParameters, declare

if TYPE_CHECKING:
    from skelgen.stages.joints import JointParameters
    from skelgen.stages.labels import LabelParameters
    from skelgen.stages.limbs import LimbParameters
    from skelgen.stages.skeleton import SkeletonParameters

_P = TypeVar("_P", bound=StageParameters)

ParameterValues = Mapping[str, StageParameters | Mapping[str, Any]] | Path | str | None
"""Parameters as a caller gives them: by stage, or a ``config.xml``."""


@dataclass(frozen=True)
class FileParameters(StageParameters):
    """Names of the files that the stage commands use when none is given (Schönauer 2007, table 4.13)."""

    stage: ClassVar[str] = "files"
    config_section: ClassVar[str] = "GUI"

    capture_file: str = declare(
        "take.mfml", "Take that `skelgen labels` reads when no file is given.", config_name="tempCorFileName"
    )
    labels_file: str = declare(
        "labels.skelgen",
        "Project with labelled markers, which `skelgen labels` writes and `skelgen limbs` reads.",
        config_name="specCluFileName",
    )
    limbs_file: str = declare(
        "limbs.skelgen",
        "Project with markers grouped into limbs, which `skelgen limbs` writes and `skelgen joints` reads.",
        config_name="jointFinderFileName",
    )
    joints_file: str = declare(
        "joints.skelgen",
        "Project with the structure of the skeleton, which `skelgen joints` writes and `skelgen skeleton` reads.",
        config_name="skelFitFileName",
    )
    result_file: str = declare(
        "result.xml",
        "Results and evaluation of the whole program, which `skelgen skeleton` writes beside its project file.",
        config_name="saveFileName",
    )


class Settings:
    """The parameters of every stage.

    Those that nobody gave take their defaults when they are asked for, so that stages that do not run are not
    loaded.

    Parameters
    ----------
    wanted : mapping, Path, str or None
        ``{"joints": {"alpha": 0.2}}``, ``{"joints": JointParameters(alpha=0.2)}``, or the path of a ``config.xml``.

    Raises
    ------
    ParameterError
        If a stage or a parameter is unknown or a value is out of bounds.

    Examples
    --------
    >>> Settings({"joints": {"alpha": 0.2}}).joints.alpha
    0.2
    """

    def __init__(self, wanted: ParameterValues = None) -> None:
        values = _from_file(Path(wanted)) if isinstance(wanted, Path | str) else wanted or {}
        if not isinstance(values, Mapping):
            raise ParameterError(f"parameters are {wanted!r:.60}; they must map names of stages to their parameters")
        self._parameters = {name: _checked(name, value) for name, value in values.items()}

    @property
    def files(self) -> FileParameters:
        """Names of files that commands use when none is given."""
        return self._of(FileParameters)

    @property
    def labels(self) -> LabelParameters:
        """Parameters of the stage ``labels``."""
        from skelgen.stages.labels import LabelParameters  # noqa: PLC0415 - each stage is loaded when it is used

        return self._of(LabelParameters)

    @property
    def limbs(self) -> LimbParameters:
        """Parameters of the stage ``limbs``."""
        from skelgen.stages.limbs import LimbParameters  # noqa: PLC0415 - each stage is loaded when it is used

        return self._of(LimbParameters)

    @property
    def joints(self) -> JointParameters:
        """Parameters of the stage ``joints``."""
        from skelgen.stages.joints import JointParameters  # noqa: PLC0415 - each stage is loaded when it is used

        return self._of(JointParameters)

    @property
    def skeleton(self) -> SkeletonParameters:
        """Parameters of the stage ``skeleton``."""
        from skelgen.stages.skeleton import SkeletonParameters  # noqa: PLC0415 - each stage is loaded when it is used

        return self._of(SkeletonParameters)

    def of(self, stage: str) -> StageParameters:
        """Return the parameters of a stage by its name; ``files`` holds names of files.

        Raises
        ------
        ParameterError
            If there is no such stage.
        """
        known = (*STAGES, FileParameters.stage)
        if stage not in known:
            raise ParameterError(f"there is no stage {stage!r}; stages are {', '.join(known)}")
        return cast(StageParameters, getattr(self, stage))

    def as_mapping(self) -> dict[str, dict[str, object]]:
        """Return names and values by stage, of the stages that somebody gave or asked for."""
        return {stage: parameters.as_mapping() for stage, parameters in self._parameters.items()}

    def changed(self, stage: str, values: Mapping[str, Any], where: str = "") -> Settings:
        """Return settings with some values of one stage replaced.

        Parameters
        ----------
        stage : str
            Its name.
        values : mapping of str to value
            Parameters to replace.
        where : str
            Prefix for errors, e.g. ``--set joints.alpha=7``.
        """
        old = self.of(stage).as_mapping()
        new = parameters_class(stage).from_mapping({**old, **values}, where)
        return Settings({**self._parameters, stage: new})

    def _of(self, declared: type[_P]) -> _P:
        return cast(_P, self._parameters.setdefault(declared.stage, declared()))


def parameters_class(stage: str) -> type[StageParameters]:
    """Return the class that declares the parameters of a stage; the stage ``files`` holds names of files.

    Raises
    ------
    ParameterError
        If there is no such stage.
    """
    return type(Settings().of(stage))


def all_parameter_classes() -> tuple[type[StageParameters], ...]:
    """Return the classes of everything that can be configured, in the order of ``config.xml``."""
    return (FileParameters, *map(parameters_class, STAGES))


def settings_with(settings: Settings, assignments: Iterable[str]) -> Settings:
    """Return settings changed by texts such as ``joints.alpha=0.2``.

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
    """Write a ``config.xml`` with every default and its help as comment."""
    write_config(path, all_parameter_classes())


def parameter_rows(settings: Settings) -> list[dict[str, object]]:
    """Return one row per parameter: stage, name, value, default, unit, bounds, name in config.xml, help."""
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
    return read_config(path, list(all_parameter_classes()))


def _checked(stage: str, value: StageParameters | Mapping[str, Any]) -> StageParameters:
    cls = parameters_class(stage)
    if isinstance(value, StageParameters):
        if not isinstance(value, cls):
            raise ParameterError(f"the stage {stage!r} takes {cls.__name__}, not {type(value).__name__}")
        return value
    return cls.from_mapping(value, stage)
