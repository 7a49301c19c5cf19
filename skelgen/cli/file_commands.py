"""Commands around files and projects: `convert`, `info`, `evaluate`, `compare`, `report`, `fill`, `correct` ..."""

import importlib
import os
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skelgen.cli.accuracy_commands import RIG, evaluate_rig
from skelgen.cli.options import AsJson, FormatName, InputFile, Overwrite, Quiet, given, option
from skelgen.cli.screen import (
    Screen,
    can_open_windows,
    has_display,
    show_evaluation,
    show_files,
    show_project,
    show_take,
)
from skelgen.errors import InputError, ParameterError
from skelgen.parameters import ParameterValue

if TYPE_CHECKING:
    from skelgen.model import Project

OutputFile = Annotated[
    Path,
    typer.Argument(
        metavar="OUT", help="File to write; its suffix tells the format. {body} in its path writes each body by itself."
    ),
]
OutputFormat = Annotated[str | None, option("--to", "NAME", "Write this format.", "found by the suffix")]
Reading = Annotated[
    list[str] | None,
    option(
        "--reading",
        "NAME=VALUE",
        "An option of the reader that the writer has, too, e.g. timestamp_unit=ms; may be repeated.",
        False,
    ),
]
ProjectFile = Annotated[
    Path, typer.Argument(metavar="RESULT", help="A .skelgen project, or the folder of a run with one in it.")
]


def convert(
    take: InputFile,
    target: OutputFile,
    format_name: FormatName = None,
    to: OutputFormat = None,
    reading: Reading = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    **values: ParameterValue | None,
) -> None:
    """Read a take or a project and write it in another format; options of both sides are those of the file written."""
    from skelgen.app.files import NamedFile, convert_file
    from skelgen.app.outputs import check_outputs, files_of

    screen, written = Screen(quiet), NamedFile(target, to, given(values))
    check_outputs(files_of(target, to, written.options), (take,), (target,), overwrite=overwrite)
    with screen.watching() as monitor:
        source = NamedFile(take, format_name, _named_values(reading or ()))
        notices, files = convert_file(source, written, monitor)
    screen.note(notices)
    show_files(screen, files)


def _named_values(texts: Iterable[str]) -> dict[str, str]:
    pairs = [(text, *text.partition("=")) for text in texts]
    for text, _, equals, _ in pairs:
        if not equals:
            raise ParameterError(f"--reading {text}: it must have the form name=value, e.g. timestamp_unit=ms")
    return {name.strip().replace("-", "_"): value.strip() for _, name, _, value in pairs}


def info(
    take: InputFile,
    format_name: FormatName = None,
    full: Annotated[bool, typer.Option("--full", help="Read all of a large file, too: gaps are counted.")] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    **values: ParameterValue | None,
) -> None:
    """Say what a file holds: format, frames, rate, markers with their gaps, extent, results.

    Of files above 16 MB some frames stand for all: frames and rate are exact, what is seen and the extent estimated.
    """
    from skelgen_formats.lines import Sample

    from skelgen.app.files import NamedFile, name_of_format, open_input
    from skelgen.app.first_look import account_sentences
    from skelgen.app.tables import column_rows, project_tables
    from skelgen.model import Poses

    screen = Screen(quiet, as_json)
    sample = Sample()
    with screen.watching() as monitor:
        file = NamedFile(take, format_name, given(values))
        project = open_input(file, monitor=monitor, sample=None if full else sample)
    format_name = format_name or name_of_format(take)
    tables, columns = project_tables(project, sample), column_rows(project.take, sample)
    screen.note(project.take.notices)
    screen.say(f"format: {format_name}")
    if project.reports:
        show_project(screen, tables)
    else:
        show_take(screen, tables["take"])
    corners = tables["take"]["low_mm"], tables["take"]["high_mm"]
    if corners[0]:
        low, high = (" ".join(f"{x:.1f}" for x in corner or ()) for corner in corners)
        screen.say(f"extent [mm]: {low} .. {high}")
    for sentence in account_sentences(tables["take"]):
        screen.say(sentence)
    title = f"{'Bodies' if isinstance(project.take, Poses) else 'Markers'}, seen and longest gap in frames"
    screen.table(f"{title}, estimated" if sample.n_left_out else title, columns)
    screen.json({"format": format_name, **tables, "columns": columns})


def evaluate(
    result: ProjectFile,
    truth: Annotated[
        Path, typer.Argument(metavar="TRUTH", help="The .truth.npz that `skelgen simulate` wrote; or a rig's settings.")
    ],
    plot: Annotated[Path | None, option("--plot", "FILE.svg", "Of a rig: draw the errors.", False)] = None,
    as_json: AsJson = False,
) -> None:
    """Compare a result with the truth of its simulation; or, as `evaluate rig settings.xml`, tell a rig's errors."""
    if str(result) == RIG:
        return evaluate_rig(truth, plot, Screen(as_json=as_json))
    if plot is not None:
        raise ParameterError("--plot belongs to `skelgen evaluate rig settings.xml`")
    from skelgen.app.project_file.archive import find_result, open_project
    from skelgen.evaluation import evaluate as scores_of
    from skelgen.evaluation import evaluation_tables
    from skelgen.simulation import read_truth

    screen = Screen(as_json=as_json)
    evaluation = scores_of(open_project(find_result(result)), read_truth(truth))
    tables = evaluation_tables(evaluation)
    show_evaluation(screen, tables)
    if not tables:
        screen.say("nothing to compare yet: labels came with the take; limbs and joints have to be found first")
    screen.json(evaluation.as_mapping())


def compare(
    result: ProjectFile,
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="Another result of the same take.")],
    as_json: AsJson = False,
) -> None:
    """Compare two results of one take: markers, limbs, bodies, joints and their angles."""
    from skelgen.app.comparison import compare_results, comparison_sentences, comparison_tables
    from skelgen.app.project_file.archive import find_result, open_project

    screen = Screen(as_json=as_json)
    one, two = (open_project(find_result(path)) for path in (result, other))
    found = compare_results(one, two)
    sentences, tables = comparison_sentences(two, found), comparison_tables(one, two, found)
    for sentence in sentences:
        screen.say(sentence)
    for title, rows in tables.items():
        screen.table(title.capitalize(), rows)
    screen.json({"sentences": sentences, **tables})


def formats(as_json: AsJson = False) -> None:
    """List every file format: what it holds, whether it is read and written, its options."""
    from skelgen.app.files import format_rows

    screen = Screen(as_json=as_json)
    rows = format_rows()
    screen.table("Formats", rows)
    screen.json({"formats": rows})


def config(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="A config.xml whose values are checked and shown.", show_default="none"),
    ] = None,
    write: Annotated[Path | None, option("--write", "FILE", "Write all defaults with their help.", False)] = None,
    as_json: AsJson = False,
) -> None:
    """Show all parameters, or write them as config.xml."""
    from skelgen.app.configuration import Settings, parameter_rows, write_defaults
    from skelgen.app.outputs import check_outputs

    screen = Screen(as_json=as_json)
    settings = Settings(file)
    screen.note(settings.all_notices())
    rows = parameter_rows(settings)
    if write:
        check_outputs((write,), (file,), (write,))
        write_defaults(write)
        show_files(screen, [write])
    else:
        screen.table("Parameters", rows)
    screen.json({"parameters": rows})


def report(
    result: ProjectFile,
    output: Annotated[Path | None, option("--output -o", "FILE", "HTML file.", "beside the project")] = None,
    quiet: Quiet = False,
) -> None:
    """Write the HTML report of a project."""
    from skelgen.app.outputs import check_outputs, recording_of
    from skelgen.app.project_file.archive import find_result, open_project
    from skelgen.app.report import write_report

    source = find_result(result)
    target, project = output or source.with_suffix(".html"), open_project(source)
    check_outputs((target,), (source, recording_of(project)), (target,))
    show_files(Screen(quiet), [write_report(project, target)])


def view(
    take: InputFile,
    output: Annotated[Path | None, option("--output -o", "FILE", "HTML file.", "a temporary file")] = None,
    format_name: FormatName = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    **values: ParameterValue | None,
) -> None:
    """Open markers and skeleton in the browser, where they turn and play; the page is complete in itself."""
    from tempfile import mkdtemp

    from skelgen.app.files import NamedFile, open_input
    from skelgen.app.outputs import check_outputs
    from skelgen.app.report import write_view

    screen, given_target = Screen(quiet), output
    if given_target:
        check_outputs((given_target,), (take,), (given_target,), overwrite=overwrite)
    with screen.watching() as monitor:
        project = open_input(NamedFile(take, format_name, given(values)), monitor=monitor)
    target = given_target or Path(mkdtemp(prefix="skelgen-")) / f"{take.stem}.html"
    show_files(screen, [write_view(project, target)])
    if not _opened(target):
        print(f"no browser could be opened here: open {target} in one", file=sys.stderr)


def _opened(page: Path) -> bool:
    """Open a page in the user's browser; whether that went well."""
    import webbrowser

    if not has_display() and "BROWSER" not in os.environ:  # browsers of terminals play nothing
        return False
    return webbrowser.open(page.resolve().as_uri())


def fill(
    result: ProjectFile,
    output: Annotated[Path, option("--output -o", "FILE", "Marker file to write; its suffix tells the format.")],
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Fill the gaps of all markers; a table beside the file says which positions are filled, from what, how surely."""
    from skelgen.app import face
    from skelgen.app.export import write_filled
    from skelgen.app.outputs import check_outputs, files_of, recording_of
    from skelgen.app.project_file.archive import find_result

    source = find_result(result)
    project, planned = face.load(source), files_of(output, None, {"filled": True})
    check_outputs(planned, (source, recording_of(project)), (output,), overwrite=overwrite)
    filled = face.fill(project)
    screen = Screen(quiet)
    files, marking = write_filled(filled, output)
    screen.note((filled.sentence, marking))
    show_files(screen, files)


_KINDS_HELP = (
    "What is stated. Of markers: merge, split, rename, delete, swap, confirm, smooth, fill. Of limbs, named by their "
    "markers: together, apart, move, name, join, part, root, name-joint, kind. Numbers: n_markers, n_limbs."
)
_MODULE = "skelgen_gui.main"  # found by name: the command line does not depend on the window


def gui(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="A recording or a project to open.", show_default=False)
    ] = None,
) -> None:
    """Open the desktop window."""
    if not can_open_windows():
        raise InputError("there is no display: start skelgen gui in a desktop session, or use skelgen run without one")
    try:
        window = importlib.import_module(_MODULE)
    except ImportError as error:
        what = "the window needs PySide6, which cannot be loaded"
        raise InputError(f"{what} ({error}): pip install 'skelgen-mocap[gui]'") from error
    raise typer.Exit(window.main([] if file is None else [str(file)]))


def correct(
    result: ProjectFile,
    kind: Annotated[str, typer.Argument(metavar="[KIND]", help=_KINDS_HELP, show_default=False)] = "",
    names: Annotated[
        list[str] | None, typer.Argument(metavar="MARKER", help="Markers that it is about.", show_default=False)
    ] = None,
    output: Annotated[Path | None, option("--output -o", "FILE", "Project to write.", False)] = None,
    value: Annotated[str, option("--value", "VALUE", "Name, type, number, Hz, or way of filling.")] = "",
    frames: Annotated[str, option("--frames", "FIRST-LAST", "Where it holds.", "whole take")] = "",
    listed: Annotated[bool, typer.Option("--list", help="List what is stated so far, with its numbers.")] = False,
    back: Annotated[int | None, option("--take-back", "N", "Take back what has this number in the list.")] = None,
    quiet: Quiet = False,
) -> None:
    """State something that you know better, or take it back, as the window's corrections do; later runs obey it."""
    from skelgen.app import face
    from skelgen.app.corrections import frames_seen_together
    from skelgen.app.outputs import check_outputs
    from skelgen.app.project_file.archive import find_result, save_project
    from skelgen.app.taking_back import take_back
    from skelgen.model.project import STAGES

    if bool(kind) + listed + (back is not None) != 1:
        raise ParameterError("give one of three: the KIND of what you state, --list, or --take-back N")
    source = find_result(result)
    if listed:
        return _show_corrections(Screen(quiet), face.load(source))
    if output is None:
        raise ParameterError("say where the corrected project goes: --output FILE.skelgen")
    span = _span(frames)
    check_outputs((output,), (source,), (output,))
    screen, project = Screen(quiet), face.load(source)
    with screen.watching() as monitor:
        corrected = (
            face.correct(project, kind, names or (), value, span)
            if back is None
            else take_back(project, back, monitor=monitor)
        )
    stated = corrected.corrections[-1].sentence if back is None else f"taken back: {project.corrections[back].sentence}"
    dropped = [stage for stage in STAGES if project.has(stage) and not corrected.has(stage)]
    again = [f"to be run again: {', '.join(dropped)} (skelgen run {shlex.quote(str(output))})"] if dropped else []
    n_shared = frames_seen_together(project, names or ()) if kind == "merge" and project.has("labels") else 0
    odd = f"they are seen at the same time in {n_shared} frames, where the others' positions are left out"
    screen.note((stated, *([odd] if n_shared else ()), *again))
    show_files(screen, [save_project(corrected, output)])


def _show_corrections(screen: Screen, project: "Project") -> None:
    rows = [{"number": n, "stated": one.sentence, "obeyed by": one.stage} for n, one in enumerate(project.corrections)]
    if rows:
        screen.table("Corrections", rows)
    else:
        screen.say("nothing is stated yet")


def _span(frames: str) -> tuple[int | None, int | None]:
    first, hyphen, last = frames.partition("-")
    if not all(not part or part.isdecimal() for part in (first, last)) or (frames and not hyphen):
        raise ParameterError(f"--frames {frames}: a first and a last frame with a hyphen between them belong there")
    return int(first) if first else None, int(last) if last else None
