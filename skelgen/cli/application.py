"""The `skelgen` command: its subcommands, its exit codes, its way of failing.

Only the command that is called gets its generated options: what stages declare lives beside numeric code that takes
a second to load, and ``skelgen --help`` shall not wait for it.
"""

import inspect
import io
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Annotated

import typer

import skelgen
from skelgen.app import STAGE_SUMMARIES
from skelgen.cli import (
    accuracy_commands,
    batch_command,
    calibrate_commands,
    capture_commands,
    file_commands,
    stage_commands,
)
from skelgen.cli.options import called_command, generated, reader_options, writer_options
from skelgen.errors import SkelgenError, out_of_memory, shortened

EXIT_INPUT = 2
EXIT_INTERRUPTED = 130
EXIT_READER_GONE = 141

_EPILOG = (
    "Exit codes: 0 all is well; 1 a bug in skelgen; 2 bad input or usage, too little memory or disk, with one sentence "
    "that says where and what; 129 the terminal was closed; 130 interrupted; 141 nobody reads the output any more; 143 "
    "terminated. No file is ever left half-written."
)
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")
_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]  # click's UsageError, wherever this typer keeps it

_FORMER_NAMES = {"label": "labels", "cluster": "limbs", "fit": "skeleton"}
"""Names that commands had before 0.2; they still work, and no help lists them."""

Options = Callable[[], Iterable[inspect.Parameter]]


def run(arguments: Sequence[str]) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str
        Words after ``skelgen``.
    """
    words = list(arguments) or ["--help"]
    for name in _THREAD_VARIABLES:  # one thread: the matrices are small, and workers are processes of their own
        os.environ.setdefault(name, "1")
    for stream in (sys.stdout, sys.stderr):  # names that the terminal cannot show cost a question mark, not the run
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if "--debug" not in words:
        sys.excepthook = _say_that_it_is_a_bug
    try:
        command = typer.main.get_command(build_app(called=called_command(words)))
        code = command.main(args=words, prog_name="skelgen", standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        return _failed("interrupted", EXIT_INTERRUPTED)
    except _USAGE_ERROR as error:
        sentence = str(getattr(error, "format_message", error.__str__)()).rstrip(".") or "Missing command"
        called = getattr(getattr(error, "ctx", None), "command_path", "skelgen")
        return _failed(f"{sentence}; `{called} --help` lists what there is", EXIT_INPUT)
    except Exception as error:
        sentence = out_of_memory(error) or _lack_of_folder(error) or _of_system(error)
        if not isinstance(error, SkelgenError) and (not sentence or "--debug" in words):
            raise
        return _failed(sentence or str(error), getattr(error, "exit_code", EXIT_INPUT))
    if code == EXIT_INTERRUPTED:  # newer typer answers Ctrl-C itself
        return _failed("interrupted", EXIT_INTERRUPTED)
    return code if isinstance(code, int) else 0


def build_app(called: str = "") -> typer.Typer:
    """Return the application.

    Parameters
    ----------
    called : str
        The command whose generated options are needed.
    """
    app = typer.Typer(epilog=_EPILOG, pretty_exceptions_enable=False)
    app.callback()(_root)
    called = _FORMER_NAMES.get(called, called)
    for name, function, options in _commands():
        command = generated(function, options() if name == called else ())
        app.command(name)(command)
        for former in [old for old, new in _FORMER_NAMES.items() if new == name]:
            app.command(former, hidden=True)(command)
    app.add_typer(_calibrate(), name="calibrate")
    return app


def _calibrate() -> typer.Typer:
    group = typer.Typer(
        help="Calibrate cameras, targets and joints for captures, or one skeleton from several takes.",
        no_args_is_help=True,
    )
    for name, function in (
        ("stereo", calibrate_commands.stereo),
        ("room", calibrate_commands.room),
        ("body", capture_commands.calibrate_body),
        ("joints", capture_commands.calibrate_joints),
        ("skeleton", calibrate_commands.skeleton),
        ("simulated", calibrate_commands.simulated),
    ):
        group.command(name)(generated(function, ()))
    return group


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"skelgen {skelgen.__version__}")
        raise typer.Exit


def _root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of a bug.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Markers in, skeleton out: find limbs, joints and motion in optical motion capture."""


def _commands() -> list[tuple[str, Callable[..., None], Options]]:
    stages = [
        (name, stage_commands.stage_command(name, summary), partial(stage_commands.stage_options, name))
        for name, summary in STAGE_SUMMARIES.items()
    ]
    return [
        ("demo", stage_commands.demo, tuple),
        ("run", stage_commands.run, reader_options),
        *stages,
        ("batch", batch_command.batch, reader_options),
        ("convert", file_commands.convert, lambda: [*reader_options(), *writer_options()]),
        ("info", file_commands.info, reader_options),
        ("simulate", accuracy_commands.simulate, accuracy_commands.simulation_options),
        ("evaluate", file_commands.evaluate, tuple),
        ("compare", file_commands.compare, tuple),
        ("formats", file_commands.formats, tuple),
        ("config", file_commands.config, tuple),
        ("report", file_commands.report, tuple),
        ("view", file_commands.view, reader_options),
        ("fill", file_commands.fill, tuple),
        ("correct", file_commands.correct, tuple),
        ("motion-capture", capture_commands.motion_capture, tuple),
        ("benchmark", accuracy_commands.benchmark, tuple),
        ("gui", file_commands.gui, tuple),
    ]


def _lack_of_folder(error: Exception) -> str:
    """Say that the working folder is gone, if that is why files are not found."""
    if any(isinstance(one, FileNotFoundError) for one in (error, error.__cause__, error.__context__)):
        try:
            Path.cwd()
        except OSError:
            return "the folder in which you work is gone; change to one that exists"
    return ""


def _of_system(error: Exception) -> str:
    """Return the system's error on a file, in words; empty if the error is another one."""
    if not isinstance(error, OSError) or error.filename is None:
        return ""
    return f"{shortened(str(error.filename))}: {error.strerror}"


def _failed(sentence: str, code: int) -> int:
    if code == EXIT_READER_GONE:
        return code
    one_line = " ".join(sentence.split())
    print(f"skelgen: {one_line}" if code == EXIT_INTERRUPTED else f"skelgen: error: {one_line}", file=sys.stderr)
    return code


def _say_that_it_is_a_bug(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Replace Python's traceback; the process ends with 1 as after any uncaught exception."""
    what = " ".join(str(error).split())
    print(
        f"skelgen: internal error: {kind.__name__}: {what} (a bug; `skelgen --debug ...` shows where)", file=sys.stderr
    )
