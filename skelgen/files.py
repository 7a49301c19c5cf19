"""Files appear whole or not at all: write beside, flush, rename. And readable tables beside modules."""

import contextlib
import hashlib
import os
import stat
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

from skelgen.errors import FormatError, WriteError
from skelgen.interrupts import unfinished, uninterrupted

UNFINISHED = ".skelgen-"
"""Beginning of the names of what is not finished yet: a program that is killed leaves such files and folders."""

TRUTH_SUFFIX = ".truth.npz"
"""Usual end of the name of a file that holds what is true of a simulated take; it lies beside the take, and is none."""

_BLOCK = 1 << 20  # bytes read at once
_SHOWN_OF_NAME = 32  # characters of a file's name in that of its temporary file


@contextlib.contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """Open a file for reading; never waits for a pipe or a device, which may have no end.

    Raises
    ------
    FormatError
        If it cannot be opened or read, or is a folder, a pipe or a device.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            what = "it is a folder" if path.is_dir() else "it is a pipe or a device, which may never end"
            raise FormatError(path, "", f"cannot be read: {what}; give a file, or write the data into one first")
        opened = path.open("rb")
    except (OSError, ValueError) as error:  # ValueError: a zero character in the name
        raise FormatError(path, "", f"cannot be read: {getattr(error, 'strerror', None) or error}") from error
    with opened as stream:
        try:
            yield stream
        except OSError as error:
            raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error


def read_content(path: Path, most: int = -1) -> bytes:
    """Return the bytes of a file; errors as of `open_regular`.

    Parameters
    ----------
    path : Path
        The file.
    most : int
        Only so many from its beginning.
    """
    with open_regular(path) as stream:
        return stream.read(most)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; rename it to `path` on success, remove it on any failure.

    Raises
    ------
    WriteError
        If the folder cannot be written, the disk is full, or the rename fails.

    Examples
    --------
    >>> with replacing(Path("walk.txt")) as temporary:
    ...     characters = temporary.write_text("one, two")
    >>> Path("walk.txt").read_text()
    'one, two'
    """
    path = Path(os.path.realpath(path)) if path.is_symlink() else path  # a link stays one
    _check_replaceable(path)
    folder, created, arrived = path.parent, _missing(path.parent), False
    beginning, suffix = path.name[:_SHOWN_OF_NAME], path.suffix[:_SHOWN_OF_NAME]  # a name may be as long as it can
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with unfinished(folder / f"{UNFINISHED}{beginning}.{_random()}{suffix}") as temporary:
            temporary.touch(exist_ok=False)
            yield temporary
            with uninterrupted():
                temporary.replace(path)
                arrived = True
    except OSError as error:
        raise WriteError(f"{path}: cannot be written: {error.strerror or error}") from error
    except UnicodeError as error:
        raise WriteError(f"{path}: cannot be written: a name in it, or its own, does not fit") from error
    finally:
        if not arrived:
            _remove_empty(created)


@contextlib.contextmanager
def arriving_together(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder whose files replace those in `folder` when the block ends well.

    Parameters
    ----------
    folder : Path
        Where the files go; created if absent, and removed again if nothing arrives.

    Raises
    ------
    WriteError
        If the folder cannot be written, or writing into the temporary one fails; tells of `folder` only.
    """
    created, arrived = _missing(folder), False
    try:
        _create(folder)
        with unfinished(folder / f"{UNFINISHED}{_random()}") as temporary:
            temporary.mkdir()
            with _telling_of(folder, instead_of=str(temporary)):
                yield temporary
            files = sorted(temporary.iterdir())
            for file in files:
                _check_replaceable(folder / file.name)
            with uninterrupted():  # all of them, or none
                for file in files:
                    file.replace(folder / file.name)
                arrived = True
    except OSError as error:
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from error
    finally:
        if not arrived:
            _remove_empty(created)


def sha256_of(path: Path) -> str:
    """Return the checksum of a file's content as a hexadecimal text; errors as of `open_regular`."""
    digest = hashlib.sha256()
    with open_regular(path) as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


@contextlib.contextmanager
def _telling_of(folder: Path, instead_of: str) -> Iterator[None]:
    try:
        yield
    except WriteError as error:
        raise WriteError(str(error).replace(instead_of, str(folder))) from error.__cause__


def _check_replaceable(path: Path) -> None:
    """Raise `WriteError` if there is something at a path that no file may take the place of."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # there is nothing, or nobody may look; then writing says why
        return
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
        raise WriteError(f"{path}: cannot be written: {what} has this name; nothing was written")


def _missing(folder: Path) -> list[Path]:
    """Return which of a folder and its parents are not there yet, the innermost first."""
    return [place for place in (folder, *folder.parents) if not place.exists()]


def check_folder(folder: Path) -> None:
    """Raise `WriteError` if a file is in the place of a folder, or of one that holds it."""
    for place in (folder, *folder.parents):
        if place.is_file():
            raise WriteError(f"{place}: cannot be created: there is a file of this name")


def _create(folder: Path) -> None:
    try:
        check_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"{folder}: cannot be created: {error.strerror or error}") from error


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with contextlib.suppress(OSError):  # somebody else put something there: then it stays
            folder.rmdir()


def _random() -> str:
    return os.urandom(8).hex()


@cache
def read_table(module: str, name: str) -> dict[str, Any]:
    """Return a readable table that stands beside a module, in the folder ``tables``.

    Parameters
    ----------
    module : str
        File of the module: its ``__file__``.
    name : str
        Of the table's file, without its suffix.
    """
    return tomllib.loads(Path(module).with_name("tables").joinpath(f"{name}.toml").read_text(encoding="utf-8"))
