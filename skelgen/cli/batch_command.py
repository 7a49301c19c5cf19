"""The command `batch`: the stages are run on many takes, on this machine or on a cluster."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skelgen.cli import options
from skelgen.cli.options import option
from skelgen.cli.screen import Screen
from skelgen.cli.stage_commands import Assignments, UntilStage, hierarchy_in, refuse_beside_skeleton
from skelgen.errors import ParameterError
from skelgen.parameters import ParameterValue

if TYPE_CHECKING:
    from skelgen.app.batch.run import BatchResult, Pool

EXIT_SOME_FAILED = 3
EXIT_ALL_FAILED = 2

Inputs = Annotated[
    list[str], typer.Argument(metavar="IN...", help="Takes, folders of takes, and patterns in quotes: 'in/**/*.c3d'.")
]
BatchFolder = Annotated[Path, option("--output -o", "FOLDER", "Folder of the batch; each take gets a folder in it.")]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue a batch: takes that are finished in its folder are kept.")
]
Processes = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Takes at a time on this machine.")]
Timeout = Annotated[
    float | None, option("--timeout", "SECONDS", "Give up a take that is not done after this time.", "none")
]
Scheduler = Annotated[str | None, option("--scheduler", "ADDRESS", "Use a dask cluster: tcp://127.0.0.1:8786.", "none")]
Formats = Annotated[
    list[str] | None,
    option(
        "--to",
        "NAME",
        "Write this format of every take too, or `report`; may be repeated.",
        "project, markers, limbs, joints, angles, picture",
    ),
]


def batch(
    takes: Inputs,
    output: BatchFolder,
    resume: Resume = False,
    jobs: Processes = 1,
    timeout: Timeout = None,
    scheduler: Scheduler = None,
    formats: Formats = None,
    n_markers: options.NMarkers = None,
    n_limbs: options.NLimbs = None,
    hierarchy: options.Hierarchy = None,
    root: options.Root = None,
    skeleton: options.SubjectFiles = None,
    seed: options.Seed = None,
    config: options.Config = None,
    methods: options.Methods = None,
    assignments: Assignments = None,
    until_stage: UntilStage = None,
    format_name: options.FormatName = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
    **reader_values: ParameterValue | None,
) -> None:
    """Find the skeletons of many takes: a folder of results for each, a manifest, a page of all.

    Exit codes: 0 every take is done; 3 some failed; 2 all failed, or the batch cannot begin or go on; 130 interrupted.
    """
    from skelgen.app.batch.run import read_manifest, run_batch
    from skelgen.app.batch.work import Job, subject_files
    from skelgen.app.configuration import Settings, settings_with
    from skelgen.app.constraints import RunOptions
    from skelgen.app.pipeline import check_stage

    if until_stage is not None:
        check_stage(until_stage)
    if skeleton:
        excluded = {"--n-markers": n_markers, "--n-limbs": n_limbs, "--hierarchy": hierarchy, "--root": root}
        refuse_beside_skeleton(excluded | {"--until": until_stage})
    settings = settings_with(Settings(config, methods), assignments or ())
    job = Job(
        settings=settings.as_mapping(),
        options=RunOptions(n_markers, n_limbs, 1, hierarchy_in(hierarchy), root),
        seed=seed,
        until=until_stage,
        format_name=format_name,
        reader_options=options.given(reader_values),
        formats=tuple(formats or ()),
        subjects=subject_files(skeleton or ()),
    )
    screen = Screen(quiet, as_json)
    screen.note(settings.all_notices())
    with screen.watching(counted=True) as monitor:
        pool = _pool(jobs, timeout, scheduler, output)
        result = run_batch(takes, output, job, pool=pool, resume=resume, monitor=monitor)
    _show(screen, result)
    screen.json(read_manifest(result.manifest) if as_json else {})
    if result.failed:
        raise typer.Exit(EXIT_SOME_FAILED if result.n_done else EXIT_ALL_FAILED)


def _show(screen: Screen, result: BatchResult) -> None:
    screen.table("Takes that failed", [{"take": one["name"], "why": one["error"]} for one in result.failed])
    kept = f" ({result.n_kept} of them before)" if result.n_kept else ""
    failed = f", {len(result.failed)} failed" if result.failed else ""
    screen.say(f"{result.n_done} of {len(result.records)} takes done{kept}{failed}")
    screen.say(f"written: {result.manifest}, {result.page}")


def _pool(jobs: int, timeout: float | None, scheduler: str | None, output: Path) -> Pool:
    if scheduler is None:
        from skelgen.app.batch.workers import in_processes

        return partial(in_processes, n_workers=jobs, timeout=timeout)
    if jobs != 1:
        raise ParameterError(
            "--jobs is for this machine alone; how many takes a cluster does at a time is its workers'"
        )
    if timeout is not None:
        raise ParameterError("--timeout is for this machine alone; a worker of a cluster cannot be ended from here")
    from skelgen.app.batch.records import MANIFEST
    from skelgen.app.batch.workers import on_cluster

    return partial(on_cluster, address=scheduler, shared=output.absolute() / MANIFEST)
