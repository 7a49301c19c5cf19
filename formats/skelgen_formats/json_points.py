"""JSON of points, as scripts, cameras and Qualisys Track Manager write it; a value, or one in each line.

Lists of objects are taken apart into a list for each of their keys, so that ``[{"t": 0, "knee": [1, 2, 3]}, ...]``
becomes times and the positions of a knee; so are objects in them, and objects whose keys are numbers. ``{"x": 1, "y":
2, "z": 3}`` is a position. Where each frame lists points with their names, they may be in any order, or missing; so
may people with an id, or several without one. What is then a list of numbers of any shape is an array, called by the
end of its path that no other has; which of them are positions, names, rate or times `skelgen_formats.named_arrays`
finds. The markers of Track Manager stand in parts, from one frame to another.
"""

import contextlib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, starmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.flags import flag_of_key, numbers_of
from skelgen_formats.json_records import (
    NAME_KEYS,
    OWNER,
    by_frame,
    on_common_frames,
    several_takes,
    with_names_in_order,
    with_numbers_as_ids,
)
from skelgen_formats.lines import Lines, read_lines
from skelgen_formats.named_arrays import take_from_arrays
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.row_owners import array_from_records
from skelgen_formats.summary_json import SCHEMA
from skelgen_formats.table_heads import CAMEL
from skelgen_formats.text import is_number
from skelgen_formats.tidy import read_tidy
from skelgen_formats.tidy_heads import find_tidy_head
from skelgen_formats.titles import UNIT_WORDS
from skelgen_formats.turn_titles import AXES

_STARTS = re.compile(rb'\s*(?:\{\s*["}]|\[\s*[\[{])')
_SUFFIXES = (".json", ".jsonl", ".ndjson")
_NAMES = "names"
_POSITION = "position"
_PLACE_WORDS = (_POSITION, "positions", "pos", "translation", "location", "coordinates", "xyz", "data")
_JSON, _OTHERWISE = "JSON", "this is {}; write the points as TRC or wide CSV, those of images triangulated first"
_DEEPEST, _MOST_TIMES = 64, 1000  # objects in objects; frames for each one that is listed
_OF_FRAME = re.compile(r"(?:(?:frame|image|img|time|t)[ _-]?)?\d+(?:\.\w+)?", re.IGNORECASE)  # frame_0001, 0.02

_Path = tuple[str, ...]


def read_json(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points of a file.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `points`, `recorded_rate`, `recorded_unit` and `sample` count.

    Raises
    ------
    FormatError
        If it is damaged, or holds no positions.
    """
    text = read_lines(path).whole()
    try:
        try:
            value = json.loads(text)
        except ValueError:
            value = [json.loads(line) for line in text.splitlines() if line.strip()]
        if isinstance(value, dict) and value.get("schema") == SCHEMA:
            raise FormatError(path, "", "this is a summary of skelgen, without positions; open the .skelgen beside it")
    except (ValueError, RecursionError) as error:
        raise FormatError(path, "", _damaged(_JSON, error)) from error
    return take_from_value(path, value, options, _JSON)


def _damaged(what: str, error: Exception) -> str:
    return f"no {what}, or damaged: {' '.join(str(error).split())[:100]}"


def take_from_value(path: Path, value: Any, options: Options, what: str) -> Trajectories | PointCloud | Poses:
    """Return the take that lists and objects hold, as JSON has them.

    Parameters
    ----------
    path : Path
        The file, for errors.
    value : list, dict, str, float or None
        What it holds.
    options : Options
        `points`, `recorded_rate`, `recorded_unit` and `sample` count.
    what : str
        What the file is, for errors.

    Raises
    ------
    FormatError
        If it is damaged, or holds no positions.
    """
    try:
        lines = Lines(path, "\n".join(_table(value)).encode(), "utf-8")
        if find_tidy_head(lines) is not None:
            return read_tidy(path, lines, options)
        counts: dict[_Path, Counter[Any]] = {}
        if n_takes := several_takes(value):
            raise FormatError(path, "", f"{n_takes} takes in one file: write each into a file of its own")
        value = on_common_frames(by_frame(_plain(with_numbers_as_ids(_with_whole_markers(value)))))
        value = with_names_in_order(value)
        _find_owners(value, (), counts, in_frame=False)
        owners = {key: _listed(count) for key, count in counts.items()}
        leaves = dict(starmap(_with_flags, _leaves(_by_owner(value, (), owners), ())))
        arrays = {key: _array(leaf) for key, leaf in _spread(path, leaves).items()}
    except (ValueError, TypeError, LookupError, RecursionError, OverflowError) as error:
        raise FormatError(path, "", _damaged(what, error)) from error
    for key in [key for key in arrays if len(key) > 1 and key[-1].lower() in _PLACE_WORDS]:
        arrays.setdefault(key[:-1], arrays.pop(key))
    several = [key for key in arrays if len(key) > 1 and key[-1] == _NAMES]
    for key in several if len(several) > 1 else ():
        arrays.setdefault(key[:-1], arrays[key])
    # Units of length, time and angles
    for key in [key for key in arrays if len(key) > 1 and key[-2].lower() in UNIT_WORDS]:
        arrays[(*key[:-2], f"{key[-1]}_unit")] = arrays.pop(key)
    return take_from_arrays(path, _called(arrays, owners), options, _OTHERWISE.format(what))


def _called(arrays: Mapping[_Path, NDArray[Any]], owners: Mapping[_Path, list[Any]]) -> dict[str, NDArray[Any]]:
    """Return arrays by the ends of their paths that no other has, and ids in words as names of the points they have.

    Flags of what has no points, such as of a gaze beside them, keep its name.
    """
    of_points = {key[:at] for key, one in arrays.items() if one.ndim >= len(AXES) for at in range(len(key))}
    least = {key: 1 + (flag_of_key(key[-1]) is not None and key[:-1] not in of_points) for key in arrays if key}
    ends = {key: [".".join(key[at:]) for at in range(len(key) - least.get(key, 1), -1, -1)] for key in arrays}
    count = Counter(end for every in ends.values() for end in every)
    ways = {key: next((end for end in ends[key] if count[end] == 1), ".".join(key)) for key in arrays}
    called = {ways[key]: one for key, one in arrays.items()}
    for key, array in arrays.items():
        ids = owners.get(key) or owners.get(key[:-1]) or []
        if any(map(_is_word, ids)) and array.shape[1:] in ((len(ids), len(AXES)), (len(ids), 4, 4)):
            called.setdefault(f"{ways[key]}.{_NAMES}" if array.ndim == len(AXES) else _NAMES, np.array(ids))
    return called


def _table(value: Any) -> Iterator[str]:
    """Yield the lines of a table of records of single values, in a list or in one of an object, if there are any."""
    lists = [value] if isinstance(value, list) else [*value.values()] if isinstance(value, dict) else []
    if isinstance(value, dict) and len(lists) > 1 and all(_are_places(one) for one in lists):
        lists = [[{"name": name, **row} for name, rows in value.items() for row in rows]]
    for rows in (rows for rows in lists if isinstance(rows, list) and rows and isinstance(rows[0], dict)):
        keys = [*rows[0]]
        cells = [row.get(key) for row in rows for key in keys] if all(isinstance(row, dict) for row in rows) else [[]]
        if not any(isinstance(cell, (dict, list)) for cell in cells):
            starts = range(0, len(cells), max(len(keys), 1))
            yield from ("\t".join(keys), *("\t".join(map(_cell, cells[at : at + len(keys)])) for at in starts))
            return


def _are_places(rows: Any) -> bool:
    return isinstance(rows, list) and all(isinstance(row, dict) and {*AXES} <= {*map(str.lower, row)} for row in rows)


def _cell(one: Any) -> str:
    return "" if one is None else " ".join(str(one).split())


def _with_whole_markers(value: Any) -> Any:
    """Return the value with a list for each marker of Track Manager, empty where it has no part."""
    markers = value.get("Markers") if isinstance(value, dict) else None
    if not isinstance(markers, list) or not all(isinstance(one, dict) and "Parts" in one for one in markers):
        return value
    parts = [(one["Name"], part["Range"]["Start"], part["Values"]) for one in markers for part in one["Parts"]]
    first = min(start for _, start, _ in parts)
    last = max(start + len(numbers) for _, start, numbers in parts)
    if last - first > _MOST_TIMES * sum(len(numbers) for _, _, numbers in parts):
        raise ValueError("parts that are far from each other")
    whole = {one["Name"]: [[None] * len(AXES)] * (last - first) for one in markers}
    for name, start, numbers in parts:
        whole[name][start - first : start - first + len(numbers)] = [place[: len(AXES)] for place in numbers]
    return {"unit": "mm", "rate": value["Timebase"]["Frequency"], "Markers": whole}


def _leaves(value: Any, path: _Path) -> Iterator[tuple[_Path, Any]]:
    """Yield what holds no objects, with the keys that lead to it; names of objects in a list under that of the list."""
    value = _plain(value)
    keys = [*dict.fromkeys(_keys(value))]
    if len(path) > _DEEPEST:
        raise ValueError("objects in objects")
    for key in keys:
        is_name = key.lower() in NAME_KEYS and isinstance(value, list)
        yield from _leaves(_picked(value, key), (*path, _NAMES if is_name else key))
    if not keys:
        yield path, value


def _with_flags(path: _Path, leaf: Any) -> tuple[_Path, Any]:
    """Return numbers for words that say whether points are seen, of states under `seen`; anything else as it is."""
    flag = flag_of_key(path[-1]) if path else None
    told = numbers_of(leaf, flag) if flag else None
    if flag is None or told is None:
        return path, leaf
    return (*path[:-1], "seen" if flag.in_words else path[-1]), told.tolist()


def _plain(value: Any) -> Any:
    """Return lists for objects whose keys are numbers, and for those that are a position."""
    if isinstance(value, list):
        return [_plain(one) if isinstance(one, (dict, list)) else one for one in value]
    if not isinstance(value, dict) or not value:
        return value
    if all(map(str.isdecimal, value)) or (len(value) > 1 and all(map(_OF_FRAME.fullmatch, value))):
        return [_plain(one) for one in value.values()]
    axes = {key.lower(): key for key in value if key.lower() in AXES and not isinstance(value[key], dict)}
    if len(axes) < len(AXES):
        return value
    if value.keys() - axes.values() in ({"w"}, {"W"}):  # a quaternion
        return [*value.values()]
    place = [value[axes[axis]] for axis in AXES]
    others = {key: one for key, one in value.items() if key not in axes.values()}
    return {**others, _POSITION: place} if others else place


def _find_owners(value: Any, path: _Path, owners: dict[_Path, Counter[Any]], *, in_frame: bool) -> None:
    """Count whose objects the lists of frames hold, by their ids, and the lists themselves as those of None."""
    if isinstance(value, list):
        if in_frame and value and all(isinstance(one, dict) for one in value):
            owners.setdefault(path, Counter()).update([None, *_ids(value)])
        for one in value:
            _find_owners(one, path, owners, in_frame=True)
    elif isinstance(value, dict):
        for key, one in value.items():
            _find_owners(one, (*path, key), owners, in_frame=in_frame)


def _listed(count: Counter[Any]) -> list[Any]:
    """Return the owners of objects in an order, empty if they have none."""
    n_lists = count.pop(None)
    if n_lists * len(count) > _MOST_TIMES * count.total():
        raise ValueError("ids that hardly any frame has again")
    return sorted(count) if all(isinstance(one, int) for one in count) else [*count]


def _ids(objects: Sequence[dict[str, Any]]) -> list[Any]:
    """Return the id of each object; their places in the list if they have none of their own."""
    if any(key.lower() in NAME_KEYS or key.lower().endswith("name") for key in objects[0]):
        return []
    key = next((key for key in objects[0] if OWNER.fullmatch(CAMEL.sub("_", key).lower())), "")
    ids = [one.get(key) for one in objects]
    are_own = all(isinstance(one, (str, int)) for one in ids) and len({*ids}) == len(ids)
    return ids if are_own else [*range(len(objects))]


def _is_word(identity: Any) -> bool:
    return isinstance(identity, str) and not is_number(identity)


def _by_owner(value: Any, path: _Path, owners: Mapping[_Path, list[Any]]) -> Any:
    """Return the value with the objects of each owner at one place in the lists of all frames, None where missing."""
    if isinstance(value, dict):
        return {key: _by_owner(one, (*path, key), owners) for key, one in value.items()}
    if not isinstance(value, list):
        return value
    inner = [_by_owner(one, path, owners) for one in value]
    if not owners.get(path) or not inner or not isinstance(inner[0], dict):
        return inner
    there = dict(zip(_ids(value), inner, strict=True))
    return [there.get(owner) for owner in owners[path]] if there else inner


def _keys(value: Any) -> Iterator[str]:
    """Yield the keys of objects, in lists of any depth."""
    if isinstance(value, dict):
        yield from value
    elif isinstance(value, list):
        for one in value:
            yield from _keys(one)


def _picked(value: Any, key: str) -> Any:
    """Return what stands under a key, for each object in lists of any depth; None where it has none."""
    if isinstance(value, list):
        return [_picked(one, key) for one in value if isinstance(one, (dict, list)) or one is None]
    return value.get(key) if isinstance(value, dict) else None


def _spread(path: Path, leaves: Mapping[_Path, Any]) -> dict[_Path, Any]:
    """Return leaves with the names that lists of each frame have in common, and their positions in this order."""
    found = dict(leaves)
    for key, names in leaves.items():
        beside = [rows for other, rows in leaves.items() if other != key and other[: len(key) - 1] == key[:-1]]
        tells = _are_texts_of_frames(names) and any(_lists_places(rows, names) for rows in beside)
        if tells and all(1 < len({*row}) == len(row) - sum(map(is_number, row)) for row in names):
            found.setdefault((*key[:-1], _NAMES), found.pop(key))  # called joint, type, id
    for key, names in dict(found).items():
        if not _are_texts_of_frames(names) or all(row == names[0] for row in names):
            continue
        every = [*dict.fromkeys(name for row in names for name in row)]
        for other, rows in dict(found).items():
            if other != key and _lists_places(rows, names):
                frames = [dict(zip(row, places, strict=True)) for row, places in zip(names, rows, strict=True)]
                found |= {other: array_from_records(path, frames, every, len(AXES)), key: every}
    return found


def _lists_places(rows: Any, names: Sequence[Sequence[str]]) -> bool:
    """Whether there is a list for each of those of names, with a position for each name."""
    are_lists = isinstance(rows, list) and all(isinstance(row, list) for row in rows)
    return (
        are_lists
        and [*map(len, rows)] == [*map(len, names)]
        and all(isinstance(place, list) and len(place) == len(AXES) for row in rows for place in row)
    )


def _are_texts_of_frames(value: Any) -> bool:
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(row, list) and all(isinstance(one, str) for one in row) for row in value)
    )


def _array(leaf: Any) -> NDArray[Any]:
    """Return an array of numbers or texts, without axes that hold one; an empty one of what is neither."""
    with contextlib.suppress(ValueError, TypeError):
        array = np.asarray(_filled(leaf), dtype=np.float64)  # of numbers in quotes, too
        return array.squeeze(axis=1) if array.ndim == len(AXES) + 1 and array.shape[1] == 1 else array
    if isinstance(leaf, list) and (names := _names_of_people(leaf)):
        leaf = names
    if isinstance(leaf, list) and all(isinstance(row, list) and len(row) == 1 for row in leaf):
        leaf = [row[0] for row in leaf]
    if _are_texts_of_frames(leaf):
        leaf = leaf[0] if all(row == leaf[0] for row in leaf) else ["_".join(row) for row in leaf]
    is_text = isinstance(leaf, str) or (isinstance(leaf, list) and all(isinstance(one, str) for one in leaf))
    return np.array(leaf if is_text else [])


def _names_of_people(leaf: list[Any]) -> list[str]:
    """Return the names that the points of all people of all frames have; none if there are others at one place."""
    rows = [row for frame in leaf if isinstance(frame, list) for row in frame if isinstance(row, list)]
    if len({*map(len, rows)}) != 1 or not all(one is None or isinstance(one, str) for row in rows for one in row):
        return []
    names = [{*column} - {None} for column in zip(*rows, strict=True)]
    found = [*chain.from_iterable(names)] if all(len(ones) == 1 for ones in names) else []
    return found if len({*found}) == len(found) else []


def _filled(leaf: Any) -> Any:
    """Return a list with lists of nothing seen for what is empty or missing in it."""
    if not isinstance(leaf, Sequence) or isinstance(leaf, str):
        return leaf
    whole = [_filled(one) for one in leaf]
    shapes = [one for one in whole if isinstance(one, list) and any(part is not None for part in one)]
    if not shapes or len(shapes) == len(whole):
        return whole
    empty = np.full(np.shape(np.asarray(shapes[0], dtype=np.float64)), np.nan).tolist()
    return [one if isinstance(one, list) and any(part is not None for part in one) else empty for one in whole]


def _is_json(head: bytes, path: Path) -> bool:
    name = path.name.lower()
    return _STARTS.match(head.removeprefix(b"\xef\xbb\xbf")) is not None and not name.endswith(".gltf")


FORMAT = Format(
    name="json",
    title="JSON of points",
    suffixes=_SUFFIXES,
    holds="markers",
    sniff=_is_json,
    read=read_json,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Export of Track Manager, in mm, or arrays, records and objects of scripts, as of numpy; not of images.",
)
