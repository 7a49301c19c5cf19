"""Every file format that skelgen knows, declared once.

Each format module declares one `Format`; the command line's help, the docs table and (later) the file dialogs are
generated from `FORMATS`. A file is recognised by its content first and by its suffix second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skelgen.errors import FormatError, WriteError
from skelgen.geometry.frame_rate import AS_RECORDED_RATE, with_rate
from skelgen.geometry.up_axis import AS_RECORDED, with_up_axis
from skelgen.model import Project, Take
from skelgen.model.bones import BoneMotion
from skelgen.model.filled import Filled
from skelgen.parameters import Declaration
from skelgen.progress import SILENT, Monitor

AXES_NAME, RATE_NAME = "axes", "rate"
"""The options that the registry obeys itself, for every format that declares them."""

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
    unit : str
        Unit of a number.
    low, high : float or None
        Bounds of a number.
    """

    name: str
    default: Any
    help: str
    choices: tuple[str, ...] = ()
    reading: bool = True
    unit: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def declaration(self) -> Declaration:
        """The option as parameters are declared: for forms, and to check values."""
        kind = str if self.default is None else type(self.default)
        bounds: dict[str, Any] = {"unit": self.unit, "low": self.low, "high": self.high}
        return Declaration(self.name, kind, self.default, self.help, choices=self.choices, **bounds)


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
    read : callable ``(path, **options) -> Take``, or None
        Reader.
    write : callable ``(value, path, *, monitor, **options) -> list of Path``, or None
        Writer; `value` is a `Project` or a `Take`. Writes atomically and returns the files written.
    check : callable (value, options)
        Raises a sentence if the writer cannot take the value: `WriteError` or `MissingResultError`. Quick.
    files : callable (path, options) -> tuple of Path
        The files that the writer will make of a path.
    keeps : tuple of str
        Names of the `parts.PARTS` that a written file holds; all else is lost.
    remarks : callable (project, options) -> tuple of str
        Sentences on what becomes of this project beyond the parts that are lost.
    holds : str
        What it holds, for the table: ``points``, ``markers``, ``poses``, ``skeleton``, ``joints``, ``summary``.
    options : tuple of Option
        What reader and writer can be told.
    note : str
        One sentence for the docs table.
    states_axes : bool
        Whether the writer is told the option ``axes``, obeyed already, since the file states which axis is up.
    read_motion : callable (path, skeleton, unit) -> BoneMotion, or None
        Reader of bones in motion, which are no take; see `skelgen_formats.motions`.
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
    check: Callable[[Project | Take, Mapping[str, Any]], object] = lambda value, options: None
    files: Callable[[Path, Mapping[str, Any]], tuple[Path, ...]] = lambda path, options: (path,)
    keeps: tuple[str, ...] = ()
    remarks: Callable[[Project, Mapping[str, Any]], tuple[str, ...]] = lambda project, options: ()
    states_axes: bool = False
    read_motion: Callable[..., BoneMotion] | None = None


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
    for entry in known_formats():
        if entry.read_motion is not None and path.name.lower().endswith(entry.suffixes):
            said = (
                f"{entry.title} holds bones, not markers; `skelgen simulate --motion {path.name}` puts markers on them"
            )
            raise FormatError(path, "", said)
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
    return entry.read(path, **checked_options(entry, options, reading=True))


def write_file(
    value: Project | Take | Filled,
    path: Path | str,
    format_name: str | None = None,
    *,
    monitor: Monitor = SILENT,
    **options: Any,
) -> list[Path]:
    """Write a project, a take or filled markers in the format named or of the suffix, and return the files written.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What to write.
    path : Path or str
        The file.
    format_name : str, optional
        Name of the format; that of the suffix if left out.
    monitor : Monitor
        Told of progress; may cancel, which leaves what was there before.
    **options
        Options of the format's writer; unknown ones are errors.

    Raises
    ------
    WriteError
        If no writer belongs to the suffix, or the format cannot hold the value.
    ParameterError
        If the value of an option is not allowed.
    """
    path = Path(path)
    entry = format_for_writing(path, format_name)
    return write_as(entry, value, path, options, monitor)


def write_as(
    entry: Format,
    value: Project | Take | Filled,
    path: Path,
    options: Mapping[str, Any],
    monitor: Monitor = SILENT,
) -> list[Path]:
    """Write in a format that is found already; see `write_file`."""
    if entry.write is None:
        raise WriteError(f"the format {entry.name} can only be read")
    clean = checked_options(entry, options)
    monitor.begin(f"writing {path.name}")
    timed = with_rate(value, clean.pop(RATE_NAME, AS_RECORDED_RATE))
    axes = clean.pop(AXES_NAME, AS_RECORDED)
    turned = with_up_axis(timed, axes)
    if entry.states_axes:
        clean[AXES_NAME] = axes
    return entry.write(turned, path, monitor=monitor, **clean)


def format_for_writing(path: Path, format_name: str | None = None) -> Format:
    """Return the format that a file is written in: that of the name, or that of the suffix.

    Raises
    ------
    WriteError
        If there is none.
    """
    return find_format(format_name) if format_name else _by_suffix_for_writing(path)


def checked_options(entry: Format, options: Mapping[str, Any], *, reading: bool = False) -> dict[str, Any]:
    """Return options of a writer, or of a reader, in their declared types.

    Raises
    ------
    WriteError
        If the format has no such option.
    ParameterError
        If a value is not allowed.
    """
    known = {option.name: option for option in entry.options if option.reading or not reading}
    for name in options:
        if name not in known:
            raise WriteError(f"the format {entry.name} has no option {name!r}; it has {', '.join(known) or 'none'}")
    where = f"the format {entry.name}"
    return {name: known[name].declaration.check(value, where) for name, value in options.items()}


def _by_suffix_for_writing(path: Path) -> Format:
    writable = [entry for entry in known_formats() if entry.write is not None]
    fitting = [
        (len(suffix), entry) for entry in writable for suffix in entry.suffixes if path.name.lower().endswith(suffix)
    ]
    if fitting:
        return max(fitting, key=lambda pair: pair[0])[1]  # .poses.csv says more than .csv
    suffixes = " ".join(suffix for entry in writable for suffix in entry.suffixes)
    raise WriteError(f"{path}: no format is written with this suffix; there are {suffixes}")
