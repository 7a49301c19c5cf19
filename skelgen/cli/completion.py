"""Completion in the shell: which command is meant, and values that only the program knows.

A shell that completes a line starts the program with ``_SKELGEN_COMPLETE`` set, no arguments, and the line so far in a
variable: typer answers with the names it knows, so the options of that line's command must have been generated.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

_ASKED = "_SKELGEN_COMPLETE"
_LINES = ("_TYPER_COMPLETE_ARGS", "COMP_WORDS")  # of zsh, fish and PowerShell; of bash


def called_command(words: Sequence[str]) -> str:
    """Return the name of the command in `words`, or in the line that a shell completes; empty without any.

    Parameters
    ----------
    words : sequence of str
        Arguments of the program.
    """
    if _ASKED in os.environ:
        words = next((os.environ[name] for name in _LINES if name in os.environ), "").split()[1:]
    return next((word for word in words if word[0:1] != "-"), "")


def stages_beginning(incomplete: str) -> list[str]:
    """Return the names of stages that begin with what was typed."""
    from skelgen.app.stage_names import STAGE_NAMES

    return [stage.name for stage in STAGE_NAMES if stage.name.startswith(incomplete)]


def formats_beginning(incomplete: str) -> list[str]:
    """Return the names of formats that begin with what was typed."""
    from skelgen.app.files import readable_formats

    return [entry.name for entry in readable_formats() if entry.name.startswith(incomplete)]
