"""The command line: `main` is the entry point of the ``skelgen`` command."""

from skelgen.cli.application import main

__all__ = ["main"]
