"""`skelgen calibrate skeleton`: one skeleton from several takes of a body."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import typer

from skelgen.cli.options import AsJson, Config, FormatName, Quiet, Seed
from skelgen.cli.screen import Screen
from skelgen.cli.tables import show_files, show_project
from skelgen.errors import InputError

STEM = "skeleton"
"""Name of the shared skeleton's files."""


def skeleton(
    takes: Annotated[list[Path], typer.Argument(metavar="TAKE...", help="Takes of one body, in any known format.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder: the skeleton, and a folder for each take.")
    ],
    seed: Seed = None,
    config: Config = None,
    format_name: FormatName = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Find one skeleton from several takes of a body, and the motion of each."""
    from skelgen.app.configuration import Settings
    from skelgen.app.files import open_input
    from skelgen.app.joint_calibration import calibrate_together
    from skelgen.app.outputs import stem_of, write_outputs
    from skelgen.app.summary import project_tables

    screen = Screen(quiet, as_json)
    stems = [stem_of(take) for take in takes]
    twice = [stem for stem, count in Counter([*stems, STEM]).items() if count > 1]
    if twice:
        raise InputError(f"two results would be called {twice[0]!r}; rename one of the takes")
    read = [open_input(take, format_name).take for take in takes]
    for take in read:
        screen.note(take.notices)
    with screen.watching() as monitor:
        found = calibrate_together(read, settings=Settings(config), seed=seed or 0, monitor=monitor)
        files = write_outputs(found.skeleton, output, STEM, monitor=monitor)
        for stem, project in zip(stems, found.takes, strict=True):
            files += write_outputs(project, output / stem, stem, monitor=monitor)
    tables: dict[str, Any] = project_tables(found.skeleton)
    show_project(screen, tables)
    show_files(screen, files)
    screen.json({**tables, "files": [str(file) for file in files]})
