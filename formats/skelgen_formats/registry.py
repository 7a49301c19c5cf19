"""Every file format that skelgen knows, declared once.

Each format module declares one `Format`; the command line's help, the docs table and (later) the file dialogs are
generated from `FORMATS`. A file is recognised by its content first and by its suffix second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skelgen.errors import FormatError, WriteError
from skelgen.model import Project, Take
from skelgen.model.filled import Filled

SNIFF_BYTES = 4096
"""How much of a file's beginning the sniffers are shown."""


@dataclass(frozen=True)
class Option:
    """A choice that a reader or writer offers; given by name to `read_take` and `write_file`.

    Attributes
    ----------
    name : str
        Keyword, e.g. ``timestamp_unit``.
    default : object
        Value when nobody says otherwise.
    help : str
        One sentence for the user.
    choices : tuple of str
        Allowed values, empty for any.
    reading : bool
        Whether the reader takes it too, not only the writer.
    """

    name: str
    default: Any
    help: str
    choices: tuple[str, ...] = ()
    reading: bool = True


@dataclass(frozen=True)
class Format:
    """One file format.

    Attributes
    ----------
    name : str
        Short name for the command line, e.g. ``c3d``.
    title : str
        Name for people.
    suffixes : tuple of str
        File endings, lower case with the dot, the usual one first.
    sniff : callable (head, path) -> bool
        Whether the first `SNIFF_BYTES` bytes look like this format; must not read the file.
    read : callable (path, **options) -> Take, or None
        Reader.
    write : callable (value, path, **options) -> list of Path, or None
        Writer; `value` is a `Project` or a `Take`. Writes atomically and returns the files written.
    holds : str
        What it holds, for the table: ``points``, ``markers``, ``poses``, ``skeleton``, ``joints``, ``summary``.
    options : tuple of Option
        What reader and writer can be told.
    note : str
        One sentence for the docs table.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    holds: str
    sniff: Callable[[bytes, Path], bool] = lambda head, path: False
    read: Callable[..., Take] | None = None
    write: Callable[..., list[Path]] | None = None
    options: tuple[Option, ...] = field(default=())
    note: str = ""


def known_formats() -> tuple[Format, ...]:
    """Return all formats in the order in which they are sniffed."""
    from skelgen_formats import FORMATS  # noqa: PLC0415 - the table imports this module

    return FORMATS


def find_format(name: str) -> Format:
    """Return the format called `name`, or raise `WriteError` that lists the names."""
    for entry in known_formats():
        if entry.name == name:
            return entry
    names = ", ".join(entry.name for entry in known_formats())
    raise WriteError(f"there is no format {name!r}; formats are {names}")


def recognise(path: Path) -> Format:
    """Return the readable format of a file, by content first and suffix second.

    Raises
    ------
    FormatError
        If the file cannot be opened, is empty, or nothing matches.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(SNIFF_BYTES)
    except OSError as error:
        raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error
    if not head:
        raise FormatError(path, "", "the file is empty")
    readable = [entry for entry in known_formats() if entry.read is not None]
    for entry in readable:
        if entry.sniff(head, path):
            return entry
    for entry in readable:
        if path.name.lower().endswith(entry.suffixes):
            return entry
    names = ", ".join(f"{entry.name} ({' '.join(entry.suffixes)})" for entry in readable)
    raise FormatError(path, "", f"neither content nor suffix belongs to a known format; known are {names}")


def read_take(path: Path | str, format_name: str | None = None, **options: Any) -> Take:
    """Read a take from a file of any registered format.

    Parameters
    ----------
    path : Path or str
        The file.
    format_name : str, optional
        Skip the recognition and read as this format.
    **options
        Options of the format's reader; unknown ones are errors.

    Raises
    ------
    FormatError
        If the file is not what its format demands.
    """
    path = Path(path)
    entry = find_format(format_name) if format_name else recognise(path)
    if entry.read is None:
        raise FormatError(path, "", f"the format {entry.name} can only be written")
    _check_options(entry, options, reading=True)
    return entry.read(path, **options)


def write_file(
    value: Project | Take | Filled, path: Path | str, format_name: str | None = None, **options: Any
) -> list[Path]:
    """Write a project, a take or filled markers in the format named or of the suffix, and return the files written.

    Raises
    ------
    WriteError
        If no writer belongs to the suffix, or the format cannot hold the value.
    """
    path = Path(path)
    entry = format_for_writing(path, format_name)
    if entry.write is None:
        raise WriteError(f"the format {entry.name} can only be read")
    _check_options(entry, options)
    return entry.write(value, path, **options)


def format_for_writing(path: Path, format_name: str | None = None) -> Format:
    """Return the format that a file is written in: that of the name, or that of the suffix.

    Raises
    ------
    WriteError
        If there is none.
    """
    return find_format(format_name) if format_name else _by_suffix_for_writing(path)


def _by_suffix_for_writing(path: Path) -> Format:
    writable = [entry for entry in known_formats() if entry.write is not None]
    fitting = [
        (len(suffix), entry) for entry in writable for suffix in entry.suffixes if path.name.lower().endswith(suffix)
    ]
    if fitting:
        return max(fitting, key=lambda pair: pair[0])[1]  # .poses.csv says more than .csv
    suffixes = " ".join(suffix for entry in writable for suffix in entry.suffixes)
    raise WriteError(f"{path}: no format is written with this suffix; there are {suffixes}")


def _check_options(entry: Format, options: dict[str, Any], *, reading: bool = False) -> None:
    known = {option.name: option for option in entry.options if option.reading or not reading}
    for name, value in options.items():
        if name not in known:
            raise WriteError(f"the format {entry.name} has no option {name!r}; it has {', '.join(known) or 'none'}")
        if known[name].choices and value not in known[name].choices:
            raise WriteError(f"{name} is {value!r}; it must be one of {', '.join(known[name].choices)}")
