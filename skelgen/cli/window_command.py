"""The command `gui`, which opens the desktop window."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from skelgen.errors import InputError

_MODULE = "skelgen_gui.main"  # found by name: the command line does not depend on the window
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")


def gui(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="A recording or a project to open.", show_default=False)
    ] = None,
) -> None:
    """Open the desktop window."""
    if sys.platform == "linux" and not any(os.environ.get(name) for name in _DISPLAYS):
        raise InputError("there is no display: start skelgen gui in a desktop session, or use skelgen run without one")
    try:
        window = importlib.import_module(_MODULE)
    except ImportError as error:
        what = "the window needs PySide6, which cannot be loaded"
        raise InputError(f"{what} ({error}): pip install 'skelgen[gui]'") from error
    raise typer.Exit(window.main([] if file is None else [str(file)]))
