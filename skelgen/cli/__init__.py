"""The command line: `main` is the entry point of the ``skelgen`` command.

A command is a function whose arguments are its options. Each is declared once, with its help, in its annotation, or in
`skelgen.cli.options` where commands share it; so ``--help`` lists them, and the docstring does not repeat them.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words after ``skelgen``. If left out, those of the process, whose signals and standard streams are then this
        function's to answer.
    """
    if arguments is None:
        from skelgen.cli.process import run_process

        return run_process()
    from skelgen.cli.application import run

    return run(arguments)
