"""Commands that run stages: `run`, `demo`, and one per stage."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from skelgen.cli import options
from skelgen.cli.options import option
from skelgen.cli.screen import Screen, show_evaluation, show_files, show_project, show_results
from skelgen.errors import ParameterError
from skelgen.parameters import ParameterValue

if TYPE_CHECKING:
    from skelgen.app.configuration import Settings
    from skelgen.app.constraints import RunOptions
    from skelgen.model import Project
    from skelgen.progress import Monitor

Assignments = Annotated[
    list[str] | None, option("--set", "STAGE.NAME=VALUE", "One parameter; may be repeated; `skelgen config` lists all.")
]
FromStage = Annotated[
    str | None, option("--from", "STAGE", "First stage to run.", "the first without a result", options.stages_beginning)
]
UntilStage = Annotated[
    str | None, option("--until", "STAGE", "Last stage to run.", "skeleton", options.stages_beginning)
]
OptionalInput = Annotated[
    Path | None,
    typer.Argument(metavar="TAKE", help="Take or .skelgen project.", show_default="the file named in config.xml"),
]

_DEFAULT_FILES = {
    "labels": ("capture_file", "labels_file"),
    "limbs": ("labels_file", "limbs_file"),
    "joints": ("limbs_file", "joints_file"),
    "skeleton": ("joints_file", "result_file"),
}
"""Which of the configured file names a stage's command reads and writes when none is given."""

_OPTION_NAMES: dict[str, tuple[str, ...]] = {
    "labels": ("n_markers", "identities"),
    "limbs": ("n_limbs",),
    "joints": ("n_jobs", "hierarchy", "root"),
    "skeleton": ("skeleton",),
}
"""Options beside its parameters that the command of a stage has."""

_RUN_OPTIONS = {
    name: inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
    for name, default, annotation in (
        ("n_markers", None, options.NMarkers),
        ("identities", None, options.IdentitiesFile),
        ("n_limbs", None, options.NLimbs),
        ("n_jobs", 1, options.Jobs),
        ("hierarchy", None, options.Hierarchy),
        ("root", None, options.Root),
        ("skeleton", None, options.SubjectFiles),
    )
}

_DEMO_FRAMES = 1000  # ten seconds: every joint bends several times
_DEMO_NOISE = 0.5  # mm, what a good optical tracker delivers
_DEMO_DROPOUTS = 0.05  # part of the positions: what a real suit loses
_DEMO_TABLES = 2  # overview and joints: the lengths and markers stand in the tables above and in the report


def run(
    take: options.InputFile,
    output: options.OutputFolder = None,
    n_markers: options.NMarkers = None,
    n_limbs: options.NLimbs = None,
    n_bodies: options.NBodies = None,
    identities: options.IdentitiesFile = None,
    hierarchy: options.Hierarchy = None,
    root: options.Root = None,
    names: options.NamesFile = None,
    marker_set: options.MarkerSetName = None,
    skeleton: options.SubjectFiles = None,
    seed: options.Seed = None,
    jobs: options.Jobs = 1,
    config: options.Config = None,
    methods: options.Methods = None,
    assignments: Assignments = None,
    from_stage: FromStage = None,
    until_stage: UntilStage = None,
    format_name: options.FormatName = None,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
    **reader_values: ParameterValue | None,
) -> None:
    """Find the skeleton of a take and write every result: the main job."""
    from skelgen.app.configuration import Settings, settings_with
    from skelgen.app.constraints import RunOptions
    from skelgen.app.files import NamedFile, open_input
    from skelgen.app.limb_names import read_limb_names, with_stated_names
    from skelgen.app.outputs import stem_of
    from skelgen.app.project_file.archive import find_result

    screen = Screen(quiet, as_json)
    take = find_result(take)
    worn = () if marker_set is None else (f"limbs.marker_set={marker_set}",)
    settings = settings_with(Settings(config, methods), (*(assignments or ()), *worn))
    if n_bodies is not None:
        settings = settings.changed("limbs", {"n_bodies": n_bodies}, "--n-bodies")
    with screen.watching() as monitor:
        file = NamedFile(take, format_name, options.given(reader_values))
        project = open_input(file, seed, identities, monitor=monitor)
    if names is not None:
        project = with_stated_names(project, read_limb_names(names))
    if skeleton:
        refuse_beside_skeleton(
            {"--n-markers": n_markers, "--n-limbs": n_limbs, "--identities": identities, "--hierarchy": hierarchy}
            | {"--root": root, "--from": from_stage, "--until": until_stage, "--n-bodies": n_bodies}
        )
        work = _subject_run(skeleton, settings)
    else:
        run_options = RunOptions(n_markers, n_limbs, jobs, hierarchy_in(hierarchy), root)
        work = _stages_run(from_stage, until_stage, settings, run_options)
    inputs = (take, identities, hierarchy, names, *(skeleton or ()), config)
    target = _Target(output or _folder_for(take), stem_of(take), inputs=inputs, overwrite=overwrite)
    _run_and_write(screen, project, work, target)


def demo(
    output: options.OutputFolder = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation and the stages.")] = 0,
    jobs: options.Jobs = 1,
    overwrite: options.Overwrite = False,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Simulate a human, find its skeleton, compare with the truth, write every file and a report."""
    from skelgen.app.face import reconstruct
    from skelgen.app.outputs import check_run, write_outputs
    from skelgen.app.tables import project_tables
    from skelgen.evaluation import evaluate, evaluation_tables
    from skelgen.simulation import TRUTH_SUFFIX, simulate, write_truth

    screen, folder = Screen(quiet, as_json), output or Path("skelgen-demo")
    check_run(folder, ("demo", ""), (), overwrite=overwrite)
    with screen.watching() as monitor:
        monitor.begin("simulating")
        simulated = simulate("human", seed=seed, n_frames=_DEMO_FRAMES, noise=_DEMO_NOISE, dropouts=_DEMO_DROPOUTS)
        project = reconstruct(simulated.take, seed=seed, monitor=monitor, n_jobs=jobs)
        evaluation = evaluate(project, simulated.truth)
        files = write_outputs(project, folder, "demo", monitor=monitor)
        files.append(write_truth(simulated.truth, folder / f"demo{TRUTH_SUFFIX}"))
    tables = project_tables(project)
    show_project(screen, tables)
    show_evaluation(screen, evaluation_tables(evaluation)[:_DEMO_TABLES])
    show_files(screen, files)
    screen.json({**tables, "evaluation": evaluation.as_mapping(), "files": [str(file) for file in files]})


def stage_command(stage: str, summary: str) -> Callable[..., None]:
    """Return the command that runs one stage; its parameters come as generated options.

    Parameters
    ----------
    stage : str
        Name of the stage.
    summary : str
        Help of the command.
    """

    def command(
        take: OptionalInput = None,
        output: options.OutputFolder = None,
        seed: options.Seed = None,
        config: options.Config = None,
        methods: options.Methods = None,
        format_name: options.FormatName = None,
        overwrite: options.Overwrite = False,
        quiet: options.Quiet = False,
        as_json: options.AsJson = False,
        **values: Any,
    ) -> None:
        from skelgen.app.configuration import Settings, parameters_class
        from skelgen.app.constraints import RunOptions
        from skelgen.app.files import NamedFile, open_input
        from skelgen.app.outputs import stem_of
        from skelgen.app.project_file.archive import find_result
        from skelgen.model import Trajectories

        settings = Settings(config, methods)
        source, target = (Path(getattr(settings.files, file)) for file in _DEFAULT_FILES[stage])
        take = find_result(take) if take else None
        files = values.get("identities"), values.get("hierarchy"), *(values.get("skeleton") or ())
        inputs = (take or source, *files, config)
        wanted = {name: values.pop(name) for name in _OPTION_NAMES[stage]}
        identities, skeleton = wanted.pop("identities", None), wanted.pop("skeleton", None)
        run_options = RunOptions(**(wanted | {"hierarchy": hierarchy_in(wanted.get("hierarchy"))}))
        names = {entry.name for entry in parameters_class(stage).declarations()}
        chosen = options.given(values)
        settings = settings.changed(stage, {name: value for name, value in chosen.items() if name in names})
        reader_values = {name: value for name, value in chosen.items() if name not in names}
        screen = Screen(quiet, as_json)
        with screen.watching() as monitor:
            file = NamedFile(take or source, format_name, reader_values)
            project = open_input(file, seed, identities, monitor=monitor)
        is_named = isinstance(project.take, Trajectories) and not project.has("labels")
        first = "labels" if stage == "limbs" and is_named else stage  # names need no more than a look at them
        work = _subject_run(skeleton, settings) if skeleton else _stages_run(first, stage, settings, run_options)
        folder = output or (_folder_for(take) if take else Path())
        result_name = target.name if stage == "skeleton" and not take and not skeleton else ""
        where = _Target(folder, stem_of(take or target), result_name, inputs, overwrite)
        _run_and_write(screen, project, work, where)

    command.__doc__ = summary
    return command


def stage_options(stage: str) -> list[inspect.Parameter]:
    """Return the generated options of a stage's command: its own, those of its parameters, those of readers."""
    from skelgen.app.configuration import parameters_class

    own = [_RUN_OPTIONS[name] for name in _OPTION_NAMES[stage]]
    return [*own, *options.parameter_options(parameters_class(stage)), *options.reader_options()]


def refuse_beside_skeleton(values: Mapping[str, object]) -> None:
    """Raise `ParameterError` if an option is given that the skeleton of another take determines.

    Parameters
    ----------
    values : mapping of str to object
        Values by flag; None where an option is not given.
    """
    for flag, value in values.items():
        if value is not None:
            raise ParameterError(f"{flag} cannot be given beside --skeleton, which determines markers, limbs and tree")


def hierarchy_in(path: Path | None) -> dict[str, str] | None:
    """Return the tree that a file states; None without a file."""
    from skelgen.app.limb_names import read_hierarchy

    return None if path is None else read_hierarchy(path)


def _folder_for(take: Path) -> Path:
    """Return where results go by default: a project grows in its place, a take gets a folder of its own."""
    from skelgen.app.outputs import stem_of
    from skelgen.app.project_file.archive import is_project_file

    return take.parent if is_project_file(take) else Path(f"{stem_of(take)}-skelgen")


@dataclass(frozen=True)
class _Target:
    """Where the files of a run go: folder, beginning of their names, name of the XML file if that is another one.

    None of them replaces an input; of others, those that no earlier run wrote only where `overwrite` says so.
    """

    folder: Path
    stem: str
    result_name: str = ""
    inputs: tuple[Path | None, ...] = ()
    overwrite: bool = False


_Work = Callable[["Project", "Monitor"], "Project"]


def _stages_run(first: str | None, last: str | None, settings: Settings, run_options: RunOptions) -> _Work:
    from skelgen.app.pipeline import run_stages

    return lambda project, monitor: run_stages(
        project, first, last, settings=settings, options=run_options, monitor=monitor
    )


def _subject_run(skeletons: Sequence[Path], settings: Settings) -> _Work:
    from skelgen.app.subject import joined_subjects, run_with_subject

    subject = joined_subjects(skeletons)
    return lambda project, monitor: run_with_subject(project, subject, settings=settings, monitor=monitor)


def _run_and_write(screen: Screen, project: Project, work: _Work, target: _Target) -> None:
    from skelgen.app.outputs import check_run, recording_of, write_outputs

    inputs = (*target.inputs, recording_of(project))
    check_run(target.folder, (target.stem, target.result_name), inputs, overwrite=target.overwrite)
    screen.note(() if project.reports else project.take.notices)  # a project with results has told them before
    with screen.watching() as monitor:
        project = work(project, monitor)
        files = write_outputs(project, target.folder, target.stem, result_name=target.result_name, monitor=monitor)
    show_results(screen, project, files)
