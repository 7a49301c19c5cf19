"""Records of JSON of which each is a person, or a point, at a moment, as AlphaPose and COCO list them.

Only what tells surely that several records are of one moment makes them one frame: an id or name tells them apart in
it, or each has a number of its own and stands beside those of the same image; most moments have several; and each
record holds one pose. All else is left as it is: rates of two clocks, and takes one after the other, repeat moments,
too.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from skelgen_formats.clock_titles import clock_of, is_frame
from skelgen_formats.flags import flag_of_key
from skelgen_formats.table_heads import CAMEL
from skelgen_formats.text import is_number, seconds_of
from skelgen_formats.turn_titles import AXES

NAME_KEYS = ("name", "label")
"""Keys of names of points or people."""

OWNER = re.compile(
    r"(?:(?:body|person|people|subject|user|player|actor|skeleton|track(?:ing)?|instance)_?)?(?:id|idx|index)|person|subject"
)
"""Keys, in small letters with underscores, of what tells people or points apart."""

_IMAGE = re.compile(r"(?:image|img)(?:_(?:id|idx|index|name|file|path))?|file_?name")
_NO_PLACE = re.compile(
    r"(?:.*_)?(?:v|vel.*|speed|acc.*|rot.*|orient.*|euler.*|angles?|angular.*|quat.*|normal|direction|size|dim.*|scale"
    r"|colou?r|rgb|b?box|forces?|moments?|torques?|gyro.*|mag.*|gaze|offset|pos.*|translation|location|coord.*|xyz|data)"
)
_INDICES = {"index", "idx"}  # at times in whole seconds also those of frames in them
_FEWEST = 2  # points of a person
_DEEPEST = 16  # objects in objects, of which frames have numbers for keys
_TAKE = re.compile(
    r"(?:take|trial|recording|session)(?:_?(?:name|id|no|number|file))?|(?:sequence|clip|motion)(?:_?(?:name|file))?"
)
_OF_FRAME, _MOST_PEOPLE = 2, 8  # lists in lists of a frame of points; people in a frame, of whom as many objects are
_MOST_TIMES = 16  # numbers on common frames for each that is there

_Records = list[dict[str, Any]]
_Path = tuple[str, ...]


def by_frame(value: Any) -> Any:
    """Return frames, each with a list of its records, for records of people or points that repeat a frame.

    Parameters
    ----------
    value : list, dict, str, float or None
        As JSON has it; lists in an object are looked at, too.
    """
    if isinstance(value, dict):
        return {key: by_frame(one) if isinstance(one, list) else one for key, one in value.items()}
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(one, dict) for one in value):
        return value
    plain = {key: _plain(key) for key in value[0]}
    own = [key for key in plain if OWNER.fullmatch(plain[key]) or plain[key] in NAME_KEYS]
    of_records = {key for key in own if len({str(one.get(key)) for one in value}) == len(value)}  # as COCO numbers them
    owners = [key for key in own if key not in of_records]
    images = [key for key in plain if _IMAGE.fullmatch(plain[key])]
    numbered = [key for key in plain if is_frame(plain[key])]
    if any(plain[key] not in _INDICES for key in owners):
        numbered += [key for key in plain if clock_of([plain[key]])]
    for key in [*images, *(key for key in numbered if owners and _are_numbers(value, key))]:
        frames: dict[str, _Records] = {}
        for one in value:
            record = {other: part for other, part in one.items() if other != key and other not in of_records}
            frames.setdefault(str(one.get(key)), []).append(record)
        is_sure = _tell_apart(frames, owners) if owners else _are_numbered(value, key, of_records)
        is_several = _are_several(frames, is_numbered=is_frame(plain[key])) or _are_few_beside(
            frames, value, key, owners
        )
        if is_sure and is_several and not _are_takes(value, key, owners):
            return _listed(key, frames, [*owners])
    return value


def with_numbers_as_ids(value: Any) -> Any:
    """Return lists of records with ids for objects that frames have with numbers for keys, if not all have the same.

    Such as ``{"people": {"3": {...}, "7": {...}}}``; points, whose values are places, are called by them.

    Parameters
    ----------
    value : list, dict, str, float or None
        As JSON has it.
    """
    found: dict[_Path, Counter[tuple[str, ...]]] = {}
    for path, numbered in _numbered_in_frames(value, (), in_frame=False):
        found.setdefault(path, Counter())[tuple(numbered)] += 1
    # What has more numbers than there are frames has frames itself
    differing = {path for path, keys in found.items() if len(keys) > 1 and keys.total() > max(map(len, keys))}
    return _listed_by_number(value, (), differing) if differing else value


def _numbered_in_frames(value: Any, path: _Path, *, in_frame: bool) -> Iterator[tuple[_Path, dict[str, Any]]]:
    """Yield the objects in frames whose keys are all numbers, with the keys that lead to them."""
    if isinstance(value, list):
        for one in filter(_may_hold_objects, value):
            yield from _numbered_in_frames(one, path, in_frame=True)
    elif isinstance(value, dict):
        is_numbered = bool(value) and all(map(str.isdecimal, value))
        if is_numbered and in_frame and all(isinstance(one, dict) or _is_place(one) for one in value.values()):
            yield path, value
        elif len(path) < _DEEPEST:
            for key, one in value.items():
                if _may_hold_objects(one):
                    inner = path if is_numbered else (*path, key)
                    yield from _numbered_in_frames(one, inner, in_frame=in_frame or is_numbered)


def _may_hold_objects(value: Any) -> bool:
    """Whether this is an object, or a list that begins with one, or with a list."""
    is_list = isinstance(value, list) and len(value) > 0
    return isinstance(value[0], (dict, list)) if is_list else isinstance(value, dict)


def _listed_by_number(value: Any, path: _Path, differing: Collection[_Path]) -> Any:
    if isinstance(value, list):
        return [_listed_by_number(one, path, differing) if isinstance(one, (dict, list)) else one for one in value]
    if not isinstance(value, dict):
        return value
    is_numbered = bool(value) and all(map(str.isdecimal, value))
    if is_numbered and path in differing:
        return [
            {"name": f"point {key}", "position": one} if _is_place(one) else {"id": int(key)} | one
            for key, one in value.items()
        ]
    return {key: _listed_by_number(one, path if is_numbered else (*path, key), differing) for key, one in value.items()}


def on_common_frames(value: Any) -> Any:
    """Return people, or points, who list their frames, each with their numbers, on the frames of all, None between.

    Parameters
    ----------
    value : list, dict, str, float or None
        As JSON has it; a list in an object is looked at, too.
    """
    if isinstance(value, dict):
        return {key: on_common_frames(one) if isinstance(one, list) else one for key, one in value.items()}
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(one, dict) for one in value):
        return value
    key = next((key for key in value[0] if is_frame(_plain(key)) and all(_lists_frames(one, key) for one in value)), "")
    counted: list[Any] = [one.get(key) for one in value] if key else []
    every = sorted({frame for frames in counted for frame in frames})
    is_same = all(frames == every for frames in counted)
    if is_same or len(every) * len(value) > _MOST_TIMES * sum(map(len, counted)):
        return value
    shared = (
        {k: _on_frames(part, frames, every) for k, part in one.items()}
        for one, frames in zip(value, counted, strict=True)
    )
    return [one | {key: every} for one in shared]


def _lists_frames(record: dict[str, Any], key: str) -> bool:
    """Whether there are different whole numbers under the key, and as many of something else."""
    frames = record.get(key)
    if not isinstance(frames, list) or len(frames) < 2 or not all(isinstance(one, int) for one in frames):
        return False
    others = (part for other, part in record.items() if other != key)
    return len({*frames}) == len(frames) and any(_is_as_long(part, frames) for part in others)


def _is_as_long(part: Any, frames: Sequence[int]) -> bool:
    return isinstance(part, list) and len(part) == len(frames)


def _on_frames(part: Any, frames: Sequence[int], every: Sequence[int]) -> Any:
    if not _is_as_long(part, frames):
        return part
    there = dict(zip(frames, part, strict=True))
    return [there.get(frame) for frame in every]


def with_names_in_order(value: Any) -> Any:
    """Return the points of people, lists of objects with a name each, in one order of names, None where missing.

    Parameters
    ----------
    value : list, dict, str, float or None
        As JSON has it.
    """
    orders: dict[_Path, dict[str, Counter[tuple[str, ...]]]] = {}
    for path, named in _named_of_people(value, (), 0):
        for key, words in named.items():
            orders.setdefault(path, {}).setdefault(key, Counter())[words] += 1
    known = {}
    for path, by_key in orders.items():
        key, counts = max(by_key.items(), key=lambda item: item[1].total() * (1 + (item[0] in NAME_KEYS)))
        every = [*dict.fromkeys(word for words in counts for word in words)]
        n_words = sum(len(words) * count for words, count in counts.items())
        is_alike = len(counts) == 1 and key in NAME_KEYS
        is_single = max(map(len, counts)) < _FEWEST
        if not is_alike and not is_single and len(every) * counts.total() <= _MOST_TIMES * n_words:
            known[path] = key, every
    return _with_order(value, (), 0, known) if known else value


def _named_of_people(value: Any, path: _Path, depth: int) -> Iterator[tuple[_Path, dict[str, tuple[str, ...]]]]:
    """Yield names of points in lists of people in one of frames by their keys, with the keys that lead to them."""
    if isinstance(value, list):
        if named := _names_in(value) if depth >= _OF_FRAME else {}:
            yield path, named
        if depth < _DEEPEST and (not named or len(value) < _FEWEST):
            for one in filter(_may_hold_objects, value):
                yield from _named_of_people(one, path, depth + 1)
    elif isinstance(value, dict) and len(path) < _DEEPEST:
        for key, one in value.items():
            if _may_hold_objects(one):
                yield from _named_of_people(one, (*path, key), depth)


def _names_in(points: list[Any]) -> dict[str, tuple[str, ...]]:
    """Return words by the keys under which each object has one of its own; states are none."""
    if not points or not all(isinstance(one, dict) for one in points):
        return {}
    texts = (key for key, one in points[0].items() if isinstance(one, str) and not is_number(one))
    every = {key: tuple(one.get(key) for one in points) for key in texts if not flag_of_key(key)}
    return {key: words for key, words in every.items() if {*map(type, words)} == {str} and len({*words}) == len(points)}


def _with_order(value: Any, path: _Path, depth: int, known: Mapping[_Path, tuple[str, list[str]]]) -> Any:
    if isinstance(value, dict):
        return {key: _with_order(one, (*path, key), depth, known) for key, one in value.items()}
    if not isinstance(value, list):
        return value
    key, names = known.get(path, ("", []))
    if depth >= _OF_FRAME and key and value and all(isinstance(one, dict) and one.get(key) in names for one in value):
        there = {one[key]: {k: part for k, part in one.items() if k != key} | {"name": one[key]} for one in value}
        count = Counter(one[key] for one in value)  # what stands twice is of neither
        return [there[name] if count[name] == 1 else None for name in names]
    return [_with_order(one, path, depth + 1, known) if _may_hold_objects(one) else one for one in value]


def several_takes(value: Any) -> int:
    """Return how many takes a list holds, in objects with the name of a trial each; else 0.

    Parameters
    ----------
    value : list, dict, str, float or None
        As JSON has it; the only list of an object is looked at, and objects in one alone.
    """
    if isinstance(value, dict):
        parts = [one for one in value.values() if isinstance(one, (list, dict))]
        if len(parts) == 1:
            return several_takes(parts[0])
        value = parts if len(parts) == len(value) else []
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(one, dict) for one in value):
        return 0
    single = {
        key: [one.get(key) for one in value] for key, part in value[0].items() if isinstance(part, (str, int, float))
    }
    moments = [
        key for key in single if is_frame(_plain(key)) or clock_of([_plain(key)]) or _IMAGE.fullmatch(_plain(key))
    ]
    told = (len({*map(str, ones)}) == len(ones) for key, ones in single.items() if _TAKE.fullmatch(_plain(key)))
    are_takes = not moments and any(told) and all(any(map(_is_of_frames, one.values())) for one in value)
    return len(value) if are_takes else 0


def _is_of_frames(part: Any) -> bool:
    """Whether there are lists of points in a list; each of a list of objects may hold one point alone."""
    is_long = isinstance(part, list) and len(part) > _MOST_PEOPLE
    return is_long and _depth(part) > _OF_FRAME + isinstance(part[0], dict)


def _depth(part: Any) -> int:
    """Return how many lists or objects stand in each other, by the first of each."""
    if isinstance(part, dict):
        return 1 + max((_depth(one) for one in part.values()), default=0)
    return 1 + _depth(part[0]) if isinstance(part, list) and part else int(isinstance(part, list))


def _plain(key: str) -> str:
    return CAMEL.sub("_", key).lower()


def _are_numbers(records: _Records, key: str) -> bool:
    """Whether all moments are numbers, times of day or dates; frames of reference have names."""
    return all(isinstance(one.get(key), (int, float, str)) and is_number(seconds_of(str(one[key]))) for one in records)


def _are_together(records: _Records, key: str) -> bool:
    """Whether the records of each moment stand behind each other; takes that follow each other begin anew."""
    moments = [moment for moment, _ in groupby(str(one.get(key)) for one in records)]
    return len({*moments}) == len(moments)


def _are_numbered(records: _Records, key: str, of_records: Collection[str]) -> bool:
    """Whether each record has a number of its own, and no name, and stands beside those of the same image."""
    return bool(of_records) and not {*map(_plain, of_records)} & {*NAME_KEYS} and _are_together(records, key)


def _are_takes(records: _Records, key: str, owners: Sequence[str]) -> bool:
    """Whether subjects, as those of a study, come after each other, with the same moments each."""
    return any("subject" in _plain(owner) for owner in owners) and not _are_together(records, key)


def _are_several(frames: Mapping[str, _Records], *, is_numbered: bool) -> bool:
    """Whether most moments have several records; images and times are more than the records of any."""
    counts = [*map(len, frames.values())]
    is_many = len(frames) > (1 if is_numbered else max(counts))
    return is_many and 2 * sum(count > 1 for count in counts) > len(frames)


def _are_few_beside(frames: Mapping[str, _Records], records: _Records, key: str, owners: Sequence[str]) -> bool:
    """Whether some images have people beside the one that all have, with an id each; their records stand together."""
    is_image = len(owners) > 0 and bool(_IMAGE.fullmatch(_plain(key)))
    return is_image and 1 < max(map(len, frames.values())) < len(frames) and _are_together(records, key)


def _tell_apart(frames: Mapping[str, _Records], owners: Sequence[str]) -> bool:
    """Whether owners tell apart the records of each moment, by names only such as hold one position."""
    names = [key for key in owners if _plain(key) in NAME_KEYS]
    every = [record for records in frames.values() for record in records]
    if names and any(_is_list_of_lists(part) for record in every for part in record.values()):
        return False
    keys = names or owners
    return all(
        len({str([one.get(key) for key in keys]) for one in records}) == len(records) for records in frames.values()
    )


def _listed(key: str, frames: Mapping[str, _Records], owners: Sequence[str]) -> Any:
    """Return frames with lists of records, the points of people in lists if each has a key of its own."""
    listed = [{key: moment, "points": records} for moment, records in frames.items()]
    every = [record for records in frames.values() for record in records]
    parts = [part for part in every[0] if all(_holds_places(record.get(part)) for record in every)]
    own = [part for part in dict.fromkeys(part for one in every for part in one) if part not in owners]
    places = [part for part in own if all(one.get(part) is None or _is_place(one[part]) for one in every)]
    places = [part for part in places if any(one.get(part) is not None for one in every)]
    if len(parts) == 1 and not places:
        names = [*dict.fromkeys(name for one in every for name in one[parts[0]])]
        for one in every:
            one[parts[0]] = [one[parts[0]].get(name) for name in names]
    elif not parts and len(places) >= _FEWEST and not any(_NO_PLACE.fullmatch(_plain(part)) for part in places):
        names = places
        for one in every:
            one["keypoints"] = [one.pop(name, None) for name in names]
    else:
        return listed
    return {"names": names, "frames": listed}


def _holds_places(part: Any) -> bool:
    return (
        isinstance(part, dict)
        and sum(map(_is_place, part.values())) >= _FEWEST
        and all(place is None or _is_place(place) for place in part.values())
    )


def _is_place(part: Any) -> bool:
    return (
        isinstance(part, list)
        and len(part) == len(AXES)
        and all(isinstance(one, (int, float)) or one is None for one in part)
    )


def _is_list_of_lists(part: Any) -> bool:
    return isinstance(part, list) and any(isinstance(one, list) for one in part)
