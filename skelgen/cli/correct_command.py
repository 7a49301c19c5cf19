"""The command `correct`: what the user knows better is stated, as by the window's corrections."""

from pathlib import Path
from typing import Annotated

import typer

from skelgen.cli.file_commands import ProjectFile
from skelgen.cli.options import Quiet
from skelgen.cli.screen import Screen, show_files
from skelgen.errors import ParameterError


def correct(
    result: ProjectFile,
    kind: Annotated[str, typer.Argument(metavar="KIND", help="What is stated: rename, merge, fill, smooth, …")],
    names: Annotated[
        list[str] | None, typer.Argument(metavar="MARKER", help="Markers that it is about.", show_default=False)
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Project to write.", show_default=False)
    ] = Path(),
    value: Annotated[
        str, typer.Option("--value", metavar="VALUE", help="Name, type, number, Hz, or way of filling.")
    ] = "",
    frames: Annotated[
        str, typer.Option("--frames", metavar="FIRST-LAST", help="Where it holds.", show_default="whole take")
    ] = "",
    quiet: Quiet = False,
) -> None:
    """State something that you know better, as the window's corrections do; later runs and exports obey it."""
    from skelgen.app import face
    from skelgen.app.outputs import check_outputs
    from skelgen.app.project_file.archive import find_result, save_project
    from skelgen.model.project import STAGES

    if output == Path():
        raise ParameterError("say where the corrected project goes: --output FILE.skelgen")
    first, hyphen, last = frames.partition("-")
    if not all(not part or part.isdecimal() for part in (first, last)) or (frames and not hyphen):
        raise ParameterError(f"--frames {frames}: a first and a last frame with a hyphen between them belong there")
    source = find_result(result)
    check_outputs((output,), (source,), (output,))
    project = face.load(source)
    span = int(first) if first else None, int(last) if last else None
    corrected = face.correct(project, kind, names or (), value, span)
    screen = Screen(quiet)
    dropped = [stage for stage in STAGES if project.has(stage) and not corrected.has(stage)]
    screen.note((corrected.corrections[-1].sentence, *(["to be run again: " + ", ".join(dropped)] if dropped else [])))
    show_files(screen, [save_project(corrected, output)])
