"""Small tables of text about limbs that the user writes: a hierarchy, and names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skelgen_formats.text import split_cells, undefused

from skelgen.errors import FormatError
from skelgen.files import read_content

LIMB_COLUMNS = ("marker", "limb", "name")
"""Titles of the table of limbs that a run writes."""


def read_hierarchy(path: Path | str) -> dict[str, str]:
    """Read a hierarchy: a line ``child,parent`` for every limb, the parent of a root left empty.

    Lines that begin with ``#`` and empty lines are skipped.

    Raises
    ------
    FormatError
        If a line has another form, or a child has two parents.
    """
    return _read_pairs(Path(path), "child,parent", "limb")


def read_limb_names(path: Path | str) -> dict[str, str]:
    """Read names of limbs: a line ``marker,name`` calls the limb of the marker by the name.

    Lines that begin with ``#``, empty lines, and a header ``marker,name`` are skipped. The table of limbs that a run
    writes (``take.limbs.csv``) is read, too: it names those limbs that have more than their number.

    Raises
    ------
    FormatError
        If a line has another form, or a marker stands twice.
    """
    path = Path(path)
    lines = _lines_of(path)
    if lines and lines[0] == ",".join(LIMB_COLUMNS):
        return _names_in_table(path, lines)
    names = _read_pairs(path, "marker,name", "marker")
    nameless = next((marker for marker, name in names.items() if not name), None)
    if nameless is not None:
        raise FormatError(path, "", f"the limb of {nameless} gets no name; write marker,name")
    return names


def _names_in_table(path: Path, lines: Sequence[str]) -> dict[str, str]:
    """One marker of each limb that has more than a number, and its name."""
    names: dict[str, str] = {}
    for number, line in enumerate(lines[1:], start=2):
        row = split_cells(path, line, number, ",")
        if len(row) != len(LIMB_COLUMNS):
            raise FormatError(path, number, f"{len(row)} cells where {', '.join(LIMB_COLUMNS)} belong")
        marker, limb, name = row[0], row[1], undefused(row[2])
        if name not in {"", f"limb{limb}", *names.values()}:
            names[undefused(marker)] = name
    return names


def _lines_of(path: Path) -> list[str]:
    try:
        return read_content(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "is no text in UTF-8") from error


def _read_pairs(path: Path, form: str, what: str) -> dict[str, str]:
    """What stands behind the first comma of each line of a text, by what stands before it."""
    pairs: dict[str, str] = {}
    for number, line in enumerate(_lines_of(path), start=1):
        if not line.strip() or line.lstrip().startswith("#") or (not pairs and line.replace(" ", "").lower() == form):
            continue
        first, _, second = (part.strip() for part in line.partition(","))
        if not first or "," in second:
            raise FormatError(path, number, f"{line.strip()[:60]!r} where {form} belongs")
        if first in pairs:
            raise FormatError(path, number, f"{first!r} stands twice; a line {form} belongs to each {what}")
        pairs[first] = second
    if not pairs:
        raise FormatError(path, "", f"names no {what}; a line {form} belongs to each")
    return pairs
