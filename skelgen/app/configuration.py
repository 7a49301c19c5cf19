"""Parameters of a run: from defaults, ``config.xml`` and single values, checked before any stage starts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeVar, cast

from skelgen_formats.config_xml import read_config, write_config

from skelgen.errors import ParameterError
from skelgen.model.project import STAGES
from skelgen.parameters import ParameterValue, StageParameters, declare

if TYPE_CHECKING:
    from skelgen.stages.joints import JointParameters
    from skelgen.stages.labels import LabelParameters
    from skelgen.stages.limbs import LimbParameters
    from skelgen.stages.skeleton import SkeletonParameters

_P = TypeVar("_P", bound=StageParameters)

METHODS = ("default", "classic")
"""Which methods a run takes, where single parameters do not say it."""

ParameterValues = Mapping[str, StageParameters | Mapping[str, object]] | Path | str | None
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

    Parameters of a stage that are not given are made when they are asked for, so that stages that do not run are not
    loaded.

    Parameters
    ----------
    wanted : mapping, Path, str or None
        ``{"joints": {"alpha": 0.2}}``, ``{"joints": JointParameters(alpha=0.2)}``, or the path of a ``config.xml``.
        A file that sets nothing but what the classic program has chooses its methods, for the stages that it sets
        something of.
    methods : str, optional
        ``classic`` chooses the methods of the thesis for all stages, ``default`` keeps those of this program whatever
        a file sets.

    Raises
    ------
    ParameterError
        If a stage, a parameter or a method is unknown or a value is out of bounds.

    Examples
    --------
    >>> Settings({"joints": {"alpha": 0.2}}).joints.alpha
    0.2
    """

    def __init__(self, wanted: ParameterValues = None, methods: str | None = None) -> None:
        if methods not in (None, *METHODS):
            raise ParameterError(f"methods are {methods!r}; they must be {' or '.join(METHODS)}")
        self._notices: dict[str, list[str]] = {}
        if isinstance(wanted, Path | str):
            self._parameters = self._read(Path(wanted), methods)
        elif isinstance(wanted or {}, Mapping):
            self._parameters = {name: _checked(name, value) for name, value in (wanted or {}).items()}
        else:
            raise ParameterError(f"parameters are {wanted!r:.60}; they must map names of stages to their parameters")
        if methods == METHODS[1]:
            stated = wanted if isinstance(wanted, Mapping) else {}
            for stage in STAGES:
                given = stated.get(stage, {})
                self._parameters[stage] = _made_classic(self.of(stage), given if isinstance(given, Mapping) else ())

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

    def as_mapping(self) -> dict[str, dict[str, ParameterValue]]:
        """Return names and values by stage, of the stages that somebody gave or asked for."""
        return {stage: parameters.as_mapping() for stage, parameters in self._parameters.items()}

    def changed(self, stage: str, values: Mapping[str, object], where: str = "") -> Settings:
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
        settings = Settings({**self._parameters, stage: new})
        settings._notices = dict(self._notices)
        retired = [name for name in values if name in new.retired]
        if retired:
            settings._notices[stage] = [*self._notices.get(stage, ()), _retired_notice(retired)]
        return settings

    def is_changed(self, stage: str) -> bool:
        """Return whether a parameter of a stage differs from its default."""
        return stage in self._parameters and self._parameters[stage] != type(self._parameters[stage])()

    def notices(self, stage: str, run: Mapping[str, object]) -> list[str]:
        """Return sentences on what the user set: methods that a file chose, and parameters without an effect.

        Parameters
        ----------
        stage : str
            Its name.
        run : mapping of str to value
            What is known of the run, as in `skelgen.parameters.Declaration.acts_with`.
        """
        idle = [
            f"{entry.name} = {getattr(self.of(stage), entry.name)} has no effect: it acts with {entry.acts_with}"
            for entry in self.of(stage).idle(run)
        ]
        return [*self._notices.get(stage, ()), *idle]

    def all_notices(self) -> list[str]:
        """Return what can be said of all stages before a take is known."""
        return [sentence for stage in STAGES for sentence in self.notices(stage, {})]

    def _read(self, path: Path, methods: str | None) -> dict[str, StageParameters]:
        config = read_config(path, list(all_parameter_classes()))
        parameters = dict(config.parameters)
        for stage, retired in config.retired.items():
            self._notices[stage] = [_retired_notice(retired)] if retired else []
            sets_something = bool(config.given[stage] or retired)
            if methods is None and config.is_classic and sets_something and parameters[stage].classic:
                parameters[stage] = _made_classic(parameters[stage], config.given[stage])
                chosen = ", ".join(f"{name} = {getattr(parameters[stage], name)}" for name in parameters[stage].classic)
                self._notices[stage].insert(
                    0,
                    f"{path.name} sets nothing but what the program of the thesis has: its method is used for "
                    f"{stage} ({chosen}); --methods default keeps the usual one",
                )
        return parameters

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


def write_settings(settings: Settings, path: Path) -> None:
    """Write a ``config.xml`` with the parameters of all stages, their help as comments.

    Parameters
    ----------
    settings : Settings
        What to write.
    path : Path
        The file, replaced as a whole.
    """
    write_config(path, [settings.of(cls.stage) for cls in all_parameter_classes()])


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


def _made_classic(parameters: StageParameters, given: Collection[str]) -> StageParameters:
    """Return parameters with the methods of the thesis, but for those that were given."""
    return parameters.replace(**{name: value for name, value in parameters.classic.items() if name not in given})


def _retired_notice(names: Sequence[str]) -> str:
    have = "has" if len(names) == 1 else "have"
    return f"{', '.join(names)} {have} no effect: the methods used here need no such number"


def _checked(stage: str, value: StageParameters | Mapping[str, object]) -> StageParameters:
    cls = parameters_class(stage)
    if isinstance(value, StageParameters):
        if not isinstance(value, cls):
            raise ParameterError(f"the stage {stage!r} takes {cls.__name__}, not {type(value).__name__}")
        return value
    return cls.from_mapping(value, stage)
