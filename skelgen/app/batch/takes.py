"""The takes of a batch: from folders, patterns and files to a list with a folder name for each."""

import glob
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from skelgen_formats.registry import SNIFF_BYTES, known_formats

from skelgen.app.batch.records import MANIFEST, RECORD
from skelgen.app.outputs import OUTPUTS, stem_of
from skelgen.app.project_file.archive import SUFFIX
from skelgen.errors import FormatError, InputError
from skelgen.files import TRUTH_SUFFIX, read_content

GENERIC = (".csv", ".tsv", ".xml")
"""Suffixes that say little: in a folder, the content must look like a take's too."""


@dataclass(frozen=True)
class Entry:
    """One take of a batch.

    Attributes
    ----------
    source : str
        Absolute path of its file.
    name : str
        Name of its folder below that of the batch, with slashes between the parts.
    folder : str
        Absolute path of its folder.
    """

    source: str
    name: str
    folder: str

    @property
    def stem(self) -> str:
        """Beginning of the names of its files."""
        return stem_of(self.source)


def find_entries(inputs: Iterable[Path | str], output: Path, earlier: Mapping[str, str] | None = None) -> list[Entry]:
    """Find the takes and name a folder for each.

    A take in a folder or of a pattern keeps its place below that folder, or below the part of the pattern without
    wildcards: ``in/monday/walk.c3d`` of ``in`` goes into ``monday/walk``. Where several takes would have one name, the
    second is called ``walk-2`` and so on, in the order given.

    Parameters
    ----------
    inputs : iterable of Path or str
        Files, folders (searched with all below) and patterns such as ``in/**/*.c3d``.
    output : Path
        Folder of the batch; nothing in it is a take.
    earlier : mapping of str to str, optional
        Names that takes have from a batch before, by source.

    Raises
    ------
    InputError
        If an input does not exist, or there is no take at all.
    """
    output = _absolute(output)
    wanted: dict[str, str] = {}
    for one in inputs:
        for path, name in _takes_of(str(one), output):
            wanted.setdefault(str(_absolute(path)), name)
    if not wanted:
        raise InputError(
            f"there is no take in {', '.join(map(str, inputs)) or 'nothing'}; `skelgen formats` says what is"
        )
    names = _distinct(wanted, earlier or {})
    return [Entry(source, name, str(output / name)) for source, name in names.items()]


def _takes_of(text: str, output: Path) -> list[tuple[Path, str]]:
    """Files of one input, each with the name that it would have."""
    path = Path(text)
    if path.is_dir():
        return [(file, _name_below(file, path)) for file in _in_folder(path, output)]
    if path.exists():
        return [(path, stem_of(path))]
    if not glob.has_magic(text):
        raise InputError(f"{text}: there is no such file or folder")
    found = sorted(Path(one) for one in glob.glob(text, recursive=True))  # noqa: PTH207 - takes whole paths
    files = [file for file in found if file.is_file() and not file.absolute().is_relative_to(output)]
    if not files:
        raise InputError(f"{text}: no file fits this pattern")
    steady = Path(*takewhile(lambda part: not glob.has_magic(part), path.parts))
    return [(file, _name_below(file, steady)) for file in files]


def _absolute(path: Path) -> Path:
    """Without dots, but with symbolic links: on other machines these may lead elsewhere."""
    return Path(os.path.abspath(path))  # noqa: PTH100


def _name_below(file: Path, folder: Path) -> str:
    below = file.relative_to(folder)
    if ".." in below.parts:  # of a pattern that climbs: its takes would leave the folder of the batch
        below = Path(below.name)
    return (below.parent / stem_of(below)).as_posix()


def _in_folder(folder: Path, output: Path) -> list[Path]:
    """Takes in a folder and below: no results of earlier runs, nothing hidden, nothing of the batch itself."""
    found = []
    for place, folders, files in os.walk(folder):
        here = Path(place)
        folders[:] = sorted(name for name in folders if not name.startswith(".") and _is_input(here / name, output))
        names = set(files)
        found += [here / name for name in sorted(files) if not _is_result(name, names) and _is_take(here / name)]
    return found


def _is_input(folder: Path, output: Path) -> bool:
    try:
        is_batch = (folder / MANIFEST).exists() or (folder / RECORD).exists()
    except OSError:  # nobody may look into it
        return False
    return not is_batch and _absolute(folder) != output


def _is_result(name: str, beside: set[str]) -> bool:
    """Whether a file stands beside the project that it was written with."""
    return any(name.endswith(one.suffix) and name[: -len(one.suffix)] + SUFFIX in beside for one in OUTPUTS)


def _is_take(path: Path) -> bool:
    readable = [entry for entry in known_formats() if entry.read is not None]
    suffixes = tuple(suffix for entry in readable for suffix in entry.suffixes)
    name = path.name.lower()
    if name.startswith(".") or name.endswith(TRUTH_SUFFIX) or not name.endswith(suffixes):
        return False
    if not name.endswith(GENERIC):
        return True
    try:
        head = read_content(path, SNIFF_BYTES)
    except FormatError:
        return True  # its own error will say why
    return any(entry.sniff(head, path) for entry in readable)


def _distinct(wanted: Mapping[str, str], earlier: Mapping[str, str]) -> dict[str, str]:
    """Name of each source; names that differ in case alone count as one, as on some disks they are."""
    names: dict[str, str] = {}
    taken: set[str] = set()
    for source in wanted:
        if source in earlier and earlier[source].casefold() not in taken:
            names[source] = earlier[source]
            taken.add(earlier[source].casefold())
    natural = {name.casefold() for name in wanted.values()}
    for source, name in wanted.items():
        if source in names:
            continue
        chosen, number = name, 1
        while chosen.casefold() in taken or (number > 1 and chosen.casefold() in natural):
            number += 1
            chosen = f"{name}-{number}"
        names[source] = chosen
        taken.add(chosen.casefold())
    return {source: names[source] for source in wanted}
