"""Files that people try and that hold nothing to read: what each is, and what to export instead."""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from skelgen_formats.lines import decoded_head
from skelgen_formats.titles import turned_without_place

_NUMBER, _PARTING = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?", re.IGNORECASE), re.compile(r"[\s;,]+")
_CELLS, _TITLE_LINES = re.compile(r"[,;\t]"), 24
_COMMENTS = ("#", "%", "//")
_FEWEST_NUMBERS = 3  # in the first line of a table without titles
_MARKERS = "export the markers as C3D or TRC"

_OPENSIM = "coordinates, forces or results of OpenSim, no measured markers; give the .trc that they come from"
_ORIENTATIONS = (
    "orientations of sensors, of OpenSim, without positions; joints need where bodies are: give markers or poses"
)

_INSTEAD = (
    (b"version https://git-lfs", "a pointer of Git LFS, not the file; fetch it with `git lfs pull`"),
    (b"<!doctype html", "a web page, not the file; download the file itself"),
    (b"<html", "a web page, not the file; download the file itself"),
)
_UNTITLED = (
    "numbers without titles; write over the columns which point's they are: name_x, name_y, name_z, or frame, name, x,"
    " y, z where each point has a row, or of a single body x, y, z, qx, qy, qz, qw"
)


def no_file(head: bytes) -> str:
    """Return what came instead of a file, whatever it is called, or an empty text.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    begin = head.lstrip().lower()
    return next((sentence for start, sentence in _INSTEAD if begin.startswith(start)), "")


def table_hint(head: bytes) -> str:
    """Return what the titles of a table lack, or an empty text if the file is no table.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    lines = [line for line in decoded_head(head).splitlines()[:_TITLE_LINES] if line.strip()]
    rows = [[cell.strip(' "') for cell in _CELLS.split(line)] for line in lines]
    if not any(len(row) > 1 for row in rows):
        return ""
    for row in rows:
        plain = [title.lower().rstrip("0123456789_") for title in row]  # x1, y1
        along = [{title[:-1] for title in plain if title.endswith(axis)} for axis in "xyz"]
        if turned := turned_without_place(row):
            names = ", ".join(turned[:8])
            return f"the titles name rotations of {names}, and no positions: name_x, name_y, name_z; export both"
        if along[0] & along[1] - along[2]:
            return "the titles name x and y alone: points in images; triangulate them first, e.g. with anipose"
    return "a table needs titles: name_x, name_y, name_z of each point, or frame, name, x, y, z with a row per point"


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
        by_text = f"BVH: bones, not markers; `skelgen simulate --motion {path.name}` puts markers on them"
    elif any(line.startswith("ITEM\t") for line in lines[:6]):
        by_text = (
            f"an ASCII export of Visual3D without targets; export those of the folder ORIGINAL with it, or {_MARKERS}"
        )
    elif any(line.strip(",; ") == "endheader" for line in lines):
        by_text = _ORIENTATIONS if any("quaternion" in line.lower() for line in lines[:_TITLE_LINES]) else _OPENSIM
    kinds = [(kind, kind["sentence"].format(markers=_MARKERS, opensim=_OPENSIM)) for kind in _kinds()]
    by_name = [sentence for kind, sentence in kinds if name.endswith(tuple(kind["suffixes"]))]
    starts = head.decode("latin-1")
    by_content = [sentence for kind, sentence in kinds if starts.startswith(tuple(kind.get("starts", ())))]
    plain = [line for line in lines if not line.startswith(_COMMENTS)]
    words = [word for word in _PARTING.split(plain[0]) if word] if plain else []
    is_untitled = len(words) >= _FEWEST_NUMBERS and all(map(_NUMBER.fullmatch, words))
    return next(filter(None, (by_text, *by_name, *by_content, _UNTITLED if is_untitled else "")), "")


@cache
def _kinds() -> list[dict[str, Any]]:
    text = Path(__file__).with_name("tables").joinpath("foreign.toml").read_text(encoding="utf-8")
    kinds: list[dict[str, Any]] = tomllib.loads(text)["kinds"]
    return kinds
