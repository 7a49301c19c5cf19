"""Files that people try and that hold nothing to read: what each is, and what to export instead."""

import re
from functools import partial
from itertools import chain
from pathlib import Path

from skelgen_formats.lines import decoded_head
from skelgen_formats.text import words_of
from skelgen_formats.titles import bodies_of, turned_without_place

_NUMBER, _PARTING = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?", re.IGNORECASE), re.compile(r"[\s;,]+")
_CELLS, _TITLE_LINES = re.compile(r"[,;\t]"), 24
_COMMENTS = ("#", "%", "//")
_IS_CELL, _FEWEST_LYING = re.compile(r"[-+.,\d\s();e]*", re.IGNORECASE), 8  # of numbers over time; cells of a row
_FEWEST_NUMBERS = 3  # in the first line of a table without titles
_known = partial(words_of, "foreign")


def no_file(head: bytes) -> str:
    """Return what came instead of a file, or what no table of points holds, whatever it is called, or an empty text.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    begin, known = head.lstrip().lower(), _known()
    by_start = (sentence for start, sentence in known["instead"].items() if begin.startswith(start.encode()))
    by_words = (
        str(kind["sentence"]).format(**known["sentences"])
        for kind in known["kinds"]
        if any(word.encode() in head for word in kind.get("holds", ()))
    )
    return next(chain(by_start, by_words), "")


def table_hint(head: bytes) -> str:
    """Return what the titles of a table lack, or an empty text if the file is no table.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    text = decoded_head(head)
    if "\0" in text:
        return str(_known()["sentences"]["binary"])
    lines = [line for line in text.splitlines()[:_TITLE_LINES] if line.strip()]
    rows = [[cell.strip(' "') for cell in _CELLS.split(line)] for line in lines]
    if not any(len(row) > 1 for row in rows):
        return ""
    lying = [row for row in rows if len(row) > _FEWEST_LYING and row[0] and not _IS_CELL.fullmatch(row[0])]
    if sum(all(map(_IS_CELL.fullmatch, row[1:])) for row in lying) > 1:
        return str(_known()["sentences"]["lying"])
    for row in rows:
        plain = [title.lower().rstrip("0123456789_") for title in row]  # x1, y1
        along = [{title[:-1] for title in plain if title.endswith(axis)} for axis in "xyz"]
        if turned := turned_without_place(row):
            names = ", ".join(turned[:8])
            return f"the titles name rotations of {names}, and no positions: name_x, name_y, name_z; export both"
        if (is_flat := bool(along[0] & along[1] - along[2])) or len(bodies_of(row)) == 1:
            return str(_known()["sentences"]["two_axes" if is_flat else "single"])
    return str(_known()["sentences"]["table"])


def is_foreign(head: bytes, path: Path) -> str:
    """Return what a file is and what to do instead, or an empty text if it is none of these.

    Parameters
    ----------
    head : bytes
        Its beginning.
    path : Path
        The file; its suffix tells where the content does not.
    """
    name, text = path.name.lower(), decoded_head(head)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    by_text = ""
    if text.lstrip().startswith("HIERARCHY"):
        by_text = "bvh"
    elif any(line.startswith("ITEM\t") for line in lines[:6]):
        by_text = "visual3d"
    elif any(line.strip(",; ") == "endheader" for line in lines):
        by_text = "orientations" if any("quaternion" in line.lower() for line in lines[:_TITLE_LINES]) else "opensim"
    by_name = [kind["sentence"] for kind in _known()["kinds"] if name.endswith(tuple(kind["suffixes"]))]
    starts = head.decode("latin-1")
    by_content = [kind["sentence"] for kind in _known()["kinds"] if starts.startswith(tuple(kind.get("starts", ())))]
    plain = [line for line in lines if not line.startswith(_COMMENTS)]
    words = [word for word in _PARTING.split(plain[0]) if word] if plain else []
    is_untitled = len(words) >= _FEWEST_NUMBERS and all(map(_NUMBER.fullmatch, words))
    sentences = _known()["sentences"]
    told = (sentences.get(by_text), *by_name, *by_content, sentences["untitled"] if is_untitled else "")
    return str(next(filter(None, told), "")).format(**(sentences | {"name": path.name}))
