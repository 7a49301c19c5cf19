"""Commands that run stages: `run`, `demo`, and one per stage."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from skelgen.cli.options import (
    AsJson,
    Config,
    FormatName,
    Hierarchy,
    IdentitiesFile,
    InputFile,
    Jobs,
    KnownSkeleton,
    NLimbs,
    NMarkers,
    OutputFolder,
    Quiet,
    Root,
    Seed,
    given,
    stages_beginning,
)
from skelgen.cli.screen import Screen, show_evaluation, show_files, show_project
from skelgen.errors import ParameterError

if TYPE_CHECKING:
    from skelgen.app.configuration import Settings
    from skelgen.app.stage_names import StageName
    from skelgen.app.stages import Wishes
    from skelgen.model import Project
    from skelgen.parameters import StageParameters

Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="STAGE.NAME=VALUE", help="One parameter; may be repeated; `skelgen config` lists all."
    ),
]
FromStage = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="STAGE",
        help="First stage to run.",
        show_default="the first without a result",
        autocompletion=stages_beginning,
    ),
]
UntilStage = Annotated[
    str | None,
    typer.Option(
        "--until",
        metavar="STAGE",
        help="Last stage to run.",
        show_default="skeleton",
        autocompletion=stages_beginning,
    ),
]
OptionalInput = Annotated[
    Path | None,
    typer.Argument(metavar="TAKE", help="Take or .skelgen project.", show_default="the file named in config.xml"),
]

_DEFAULT_FILES = {
    "label": ("capture_file", "labels_file"),
    "cluster": ("labels_file", "limbs_file"),
    "joints": ("limbs_file", "joints_file"),
    "fit": ("joints_file", "result_file"),
}
"""Which of the configured file names a stage's command reads and writes when none is given."""

_WISHES: dict[str, tuple[str, ...]] = {
    "label": ("n_markers", "identities"),
    "cluster": ("n_limbs",),
    "joints": ("n_jobs", "hierarchy", "root"),
    "fit": ("skeleton",),
}
"""Which of the user's wishes a stage can heed."""

_WISH_OPTIONS = {
    name: inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
    for name, default, annotation in (
        ("n_markers", None, NMarkers),
        ("identities", None, IdentitiesFile),
        ("n_limbs", None, NLimbs),
        ("n_jobs", 1, Jobs),
        ("hierarchy", None, Hierarchy),
        ("root", None, Root),
        ("skeleton", None, KnownSkeleton),
    )
}

_DEMO_TABLES = 2  # overview and joints: the lengths and markers stand in the tables above and in the report


def run(
    take: InputFile,
    output: OutputFolder = None,
    n_markers: NMarkers = None,
    n_limbs: NLimbs = None,
    identities: IdentitiesFile = None,
    hierarchy: Hierarchy = None,
    root: Root = None,
    skeleton: KnownSkeleton = None,
    seed: Seed = None,
    jobs: Jobs = 1,
    config: Config = None,
    assignments: Assignments = None,
    from_stage: FromStage = None,
    until_stage: UntilStage = None,
    format_name: FormatName = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    **reader_values: Any,
) -> None:
    """Find the skeleton of a take and write every result: the main job."""
    from skelgen.app.configuration import Settings, settings_with
    from skelgen.app.files import open_input
    from skelgen.app.outputs import stem_of
    from skelgen.app.project_file.archive import find_result
    from skelgen.app.stages import Wishes

    screen = Screen(quiet, as_json)
    take = find_result(take)
    settings = settings_with(Settings(config), assignments or ())
    with screen.watching() as monitor:
        project = open_input(take, format_name, seed, identities, monitor=monitor, **given(reader_values))
    wishes = Wishes(n_markers, n_limbs, jobs, hierarchy_in(hierarchy), root)
    folder = output or _folder_for(take)
    if skeleton is not None:
        told = {"--n-markers": n_markers, "--n-limbs": n_limbs, "--identities": identities, "--hierarchy": hierarchy}
        refuse_beside_skeleton(told | {"--root": root, "--from": from_stage, "--until": until_stage})
        return _apply_and_write(screen, project, skeleton, settings, folder, stem_of(take))
    _run_and_write(screen, project, (from_stage, until_stage), settings, wishes, folder, stem_of(take))


def demo(
    output: OutputFolder = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the simulation and the stages.")] = 0,
    jobs: Jobs = 1,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a human, find its skeleton, compare with the truth, write every file and a report."""
    from skelgen.app.demo import run_demo
    from skelgen.app.tables import project_tables
    from skelgen.evaluation import evaluation_tables

    screen = Screen(quiet, as_json)
    with screen.watching() as monitor:
        done = run_demo(output or Path("skelgen-demo"), seed=seed, n_jobs=jobs, monitor=monitor)
    tables = project_tables(done.project)
    show_project(screen, tables)
    show_evaluation(screen, evaluation_tables(done.evaluation)[:_DEMO_TABLES])
    show_files(screen, done.files)
    screen.json({**tables, "evaluation": done.evaluation.as_mapping(), "files": [str(file) for file in done.files]})


def stage_command(stage: StageName) -> Callable[..., None]:
    """Return the command that runs one stage; its parameters come as generated options."""

    def command(
        take: OptionalInput = None,
        output: OutputFolder = None,
        seed: Seed = None,
        config: Config = None,
        format_name: FormatName = None,
        quiet: Quiet = False,
        as_json: AsJson = False,
        **values: Any,
    ) -> None:
        from skelgen.app.configuration import Settings
        from skelgen.app.files import open_input
        from skelgen.app.outputs import stem_of
        from skelgen.app.project_file.archive import find_result
        from skelgen.app.stages import Wishes

        settings = Settings(config)
        source, target = _default_files(settings.of("files"), stage.command)
        take = find_result(take) if take else None
        wanted = {name: values.pop(name) for name in _WISHES[stage.command]}
        identities, skeleton = wanted.pop("identities", None), wanted.pop("skeleton", None)
        wishes = Wishes(**(wanted | {"hierarchy": hierarchy_in(wanted.get("hierarchy"))}))
        names = {entry.name for entry in parameters_of(stage).declarations()}
        chosen = given(values)
        settings = settings.changed(stage.name, {name: value for name, value in chosen.items() if name in names})
        reader_values = {name: value for name, value in chosen.items() if name not in names}
        screen = Screen(quiet, as_json)
        with screen.watching() as monitor:
            project = open_input(take or source, format_name, seed, identities, monitor=monitor, **reader_values)
        folder = output or (_folder_for(take) if take else Path())
        stem = stem_of(take or target)
        result_name = target.name if stage.command == "fit" and not take else ""
        if skeleton is not None:
            return _apply_and_write(Screen(quiet, as_json), project, skeleton, settings, folder, stem)
        span = (stage.name, stage.name)
        _run_and_write(screen, project, span, settings, wishes, folder, stem, result_name)

    command.__doc__ = stage.summary
    return command


def wish_options(stage: StageName) -> list[inspect.Parameter]:
    """Return the options beside its parameters that one stage understands."""
    return [_WISH_OPTIONS[name] for name in _WISHES[stage.command]]


def parameters_of(stage: StageName) -> type[StageParameters]:
    """Return the class that declares a stage's parameters; loads the stage's module."""
    from skelgen.app.stages import find_stage

    return find_stage(stage.name).parameters_class()


def _run_and_write(
    screen: Screen,
    project: Project,
    span: tuple[str | None, str | None],
    settings: Settings,
    wishes: Wishes,
    folder: Path,
    stem: str,
    result_name: str = "",
) -> None:
    from skelgen.app.outputs import write_outputs
    from skelgen.app.pipeline import run_stages
    from skelgen.app.tables import project_tables

    screen.note(project.take.notices)
    with screen.watching() as monitor:
        project = run_stages(project, *span, settings=settings, wishes=wishes, monitor=monitor)
        files = write_outputs(project, folder, stem, result_name=result_name, monitor=monitor)
    tables = project_tables(project)
    show_project(screen, tables)
    show_files(screen, files)
    screen.json({**tables, "files": [str(file) for file in files]})


def refuse_beside_skeleton(wishes: dict[str, Any]) -> None:
    """Raise `ParameterError` if something is told, by its flag, that a known skeleton tells."""
    for flag, wish in wishes.items():
        if wish is not None:
            raise ParameterError(f"{flag} cannot be told beside --skeleton, which tells markers, limbs and tree")


def _apply_and_write(
    screen: Screen, project: Project, skeleton: Path, settings: Settings, folder: Path, stem: str
) -> None:
    from skelgen.app.outputs import write_outputs
    from skelgen.app.subject import apply_skeleton, open_known
    from skelgen.app.tables import project_tables

    screen.note(project.take.notices)
    known = open_known(skeleton)
    with screen.watching() as monitor:
        project = apply_skeleton(project, known, settings=settings, monitor=monitor)
        files = write_outputs(project, folder, stem, monitor=monitor)
    tables = project_tables(project)
    show_project(screen, tables)
    show_files(screen, files)
    screen.json({**tables, "files": [str(file) for file in files]})


def hierarchy_in(path: Path | None) -> dict[str, str] | None:
    """Return the tree that a file states; None without a file."""
    from skelgen.app.hierarchy import read_hierarchy

    return None if path is None else read_hierarchy(path)


def _folder_for(take: Path) -> Path:
    """Return where results go when nobody says: a project grows in its place, a take gets a folder of its own."""
    from skelgen.app.outputs import stem_of
    from skelgen.app.project_file.archive import is_project_file

    return take.parent if is_project_file(take) else Path(f"{stem_of(take)}-skelgen")


def _default_files(files: Any, command: str) -> tuple[Path, Path]:
    source, target = _DEFAULT_FILES[command]
    return Path(getattr(files, source)), Path(getattr(files, target))
