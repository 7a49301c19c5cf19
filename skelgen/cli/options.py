"""Options of the commands: the common ones, and those generated from what stages and formats declare."""

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from skelgen.parameters import Declaration, StageParameters

if TYPE_CHECKING:
    from skelgen_formats.options import Option

_Value = TypeVar("_Value")
_ASKED = "_SKELGEN_COMPLETE"
_LINES = ("_TYPER_COMPLETE_ARGS", "COMP_WORDS")  # of zsh, fish and PowerShell; of bash


def option(
    flags: str, metavar: str, text: str, default: str | bool = True, completion: Callable[..., list[str]] | None = None
) -> Any:
    """Return the declaration of an option that takes a value.

    Parameters
    ----------
    flags : str
        Its flags, with blanks between them.
    metavar : str
        What stands for the value in the help.
    text : str
        The help.
    default : str or bool
        What the help says of a missing value; True for the value itself, False for nothing.
    completion : callable (incomplete) -> list of str, optional
        Values that begin with what was typed.
    """
    return typer.Option(*flags.split(), metavar=metavar, help=text, show_default=default, autocompletion=completion)


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
    from skelgen.app import STAGE_SUMMARIES

    return [name for name in STAGE_SUMMARIES if name.startswith(incomplete)]


def formats_beginning(incomplete: str) -> list[str]:
    """Return the names of formats that begin with what was typed."""
    from skelgen.app.files import readable_formats

    return [entry.name for entry in readable_formats() if entry.name.startswith(incomplete)]


InputFile = Annotated[Path, typer.Argument(metavar="TAKE", help="Take in any known format, or a .skelgen project.")]
OutputFolder = Annotated[Path | None, option("--output -o", "FOLDER", "Folder for the results.", False)]
Calibrated = Annotated[Path, option("--output -o", "FILE", "Settings to write.")]
Square = Annotated[float, option("--square", "MM", "Side of a square of the board.")]
Seed = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of every random choice.", show_default="0, or that of the project"),
]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Processes for work that can be shared.")]
NMarkers = Annotated[
    int | None, typer.Option("--n-markers", min=1, help="Number of physical markers.", show_default="found")
]
NLimbs = Annotated[int | None, typer.Option("--n-limbs", min=1, help="Number of rigid limbs.", show_default="found")]
NBodies = Annotated[
    int | None,
    typer.Option("--n-bodies", min=1, help="Number of bodies, each with a tree of its own.", show_default="found"),
]
IdentitiesFile = Annotated[Path | None, option("--identities", "FILE", "CSV: which point is which marker.", False)]
Hierarchy = Annotated[
    Path | None,
    option(
        "--hierarchy",
        "FILE",
        "Known tree: a line child,parent for every limb, a root's parent empty; bodies by name, or limb0, limb1.",
        "found",
    ),
]
Root = Annotated[str | None, option("--root", "NAME", "Root of the tree: a body, a marker, or limb0 ...", "found")]
NamesFile = Annotated[
    Path | None,
    option(
        "--names",
        "FILE",
        "Names of limbs: a line marker,name calls the limb of the marker by the name; or a table .limbs.csv.",
        "by names of markers",
    ),
]
MarkerSetName = Annotated[
    str | None,
    option(
        "--marker-set",
        "NAME",
        "auto names limbs by the set that is worn; none gives numbers; a set's name binds limbs and tree to it.",
        "auto",
    ),
]
SubjectFiles = Annotated[
    list[Path] | None,
    option(
        "--skeleton",
        "PROJECT",
        "Label and pose by the skeleton of another take of the same body: a .skelgen project, or a run's folder; "
        "once for each body that the take shows.",
        False,
    ),
]
Config = Annotated[Path | None, option("--config", "FILE", "Parameters of all stages: config.xml.", False)]
Methods = Annotated[
    str | None,
    option(
        "--methods",
        "default|classic",
        "Methods of all stages: this program's, or those of Schönauer (2007).",
        "default; those of the thesis for stages that a config.xml of its names alone sets",
    ),
]
FormatName = Annotated[
    str | None, option("--format", "NAME", "Read as this format.", "found by content", formats_beginning)
]
Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace files that are there although you did not name them; never an input."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show neither progress nor notes.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]

_READER_PANEL = "Options of readers"
_WRITER_PANEL = "Options of writers"


def generated(function: Callable[..., None], options: Iterable[inspect.Parameter]) -> Callable[..., None]:
    """Return `function` with its ``**`` parameter replaced by options, as typer wants to see them.

    Parameters
    ----------
    function : callable
        A command that takes its generated options as ``**values``.
    options : iterable of inspect.Parameter
        From `parameter_options` or `reader_options`; names that the command already has are left out.
    """
    own = inspect.signature(function, eval_str=True).parameters.values()
    plain = [entry for entry in own if entry.kind is not inspect.Parameter.VAR_KEYWORD]
    by_name = {entry.name: entry for entry in (*options, *plain)}  # what the command has itself comes last and wins
    every = plain + [entry for entry in by_name.values() if entry not in plain]

    @functools.wraps(function)
    def command(**values: object) -> None:
        function(**values)

    command.__doc__ = str(function.__doc__).partition("\n\n    Parameters\n")[0]  # each option has its own help
    del command.__wrapped__  # else typer reads the signature of `function`
    ordered = [entry.replace(kind=inspect.Parameter.KEYWORD_ONLY) for entry in every]
    command.__signature__ = inspect.Signature(ordered)  # type: ignore[attr-defined]  # inspect reads it, mypy does not
    command.__annotations__ = {entry.name: entry.annotation for entry in ordered}
    return command


def parameter_options(declared: type[StageParameters]) -> list[inspect.Parameter]:
    """Return one option per declared parameter; None stands for "not given"."""
    panel = f"Parameters of {declared.stage}"
    return [_option(entry.name, entry.kind, _help(entry), entry.default, panel) for entry in declared.declarations()]


def reader_options() -> list[inspect.Parameter]:
    """Return one option per choice that a reading format offers."""
    return _format_options(_READER_PANEL, reading=True)


def writer_options() -> list[inspect.Parameter]:
    """Return one option per choice that a writing format offers."""
    return _format_options(_WRITER_PANEL, reading=False)


def given(values: Mapping[str, _Value | None]) -> dict[str, _Value]:
    """Return the generated options that the user gave."""
    return {name: value for name, value in values.items() if value is not None}


def _format_options(panel: str, *, reading: bool) -> list[inspect.Parameter]:
    from skelgen_formats.registry import known_formats

    from skelgen.app.files import readable_formats

    formats = readable_formats() if reading else [entry for entry in known_formats() if entry.write is not None]
    offered: dict[str, dict[str, Option]] = {}
    for entry in formats:
        for option in entry.options:
            if option.reading if reading else option.writing:
                offered.setdefault(option.name, {})[entry.name] = option
    return [_shared_option(name, by_format, panel) for name, by_format in offered.items()]


def _shared_option(name: str, by_format: "Mapping[str, Option]", panel: str) -> inspect.Parameter:
    """The option of one or several formats, told as by the one that has most choices."""
    richest = max(by_format.values(), key=lambda option: len(option.choices))
    choices = f" ({' | '.join(richest.choices)})" if richest.choices else ""
    text = f"{richest.help.rstrip('.')}{choices}. For {', '.join(by_format)}."
    defaults = {option.default for option in by_format.values()}
    default = richest.default if len(defaults) == 1 else "as the format has it"
    return _option(name, str if richest.default is None else type(richest.default), text, default, panel)


def _option(name: str, kind: type, text: str, default: object, panel: str) -> inspect.Parameter:
    flag = "--" + name.replace("_", "-")
    flags = f"{flag}/--no-{flag[2:]}" if kind is bool else flag
    shown = "none" if default is None else str(default) or "empty"
    declared = typer.Option(None, flags, help=text, show_default=shown, rich_help_panel=panel)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=declared, annotation=kind | None)


def _help(entry: Declaration) -> str:
    limits = " ".join(part for part in (entry.bounds, entry.unit) if part)
    seed = f"; {entry.config_name} in config.xml" if entry.config_name else ""
    return f"{entry.help.rstrip('.')}{f' ({limits})' if limits else ''}{seed}."
