"""Limbs are named by the markers on them: by their set, by words in their names, or by what the names share."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import chain, count, zip_longest

from skelgen.files import read_table
from skelgen.geometry.keypoints import segment_of_name
from skelgen.model import Limbs
from skelgen.model.arrays import Ints
from skelgen.model.limbs import BODY_END
from skelgen.stages.names.marker_sets import MarkerSet, plain_name

_SIDE_WORDS = {"l": "left", "left": "left", "lt": "left", "r": "right", "right": "right", "rt": "right"}
SIDES = ("left", "right")
_MIDDLE = frozenset({"head", "chest", "abdomen", "pelvis"})
_OUTWARD = ("upper arm", "forearm", "hand", "thigh", "shank", "foot", "toes")
_FINGERS = frozenset({"thumb", "index", "middle", "ring", "little"})
_AT_JOINT = 0.6
"""How much a marker beside a joint says of its limb; one amid a segment says 1."""

_LEAST_SHARE = 0.5
"""Of what a limb's markers say, for a name; and of a take's markers that must be of a person, for words to count."""

_LEAST_SEGMENTS = 3
_LEAST_STEM = 3
_SHORT_WORD = 2
_SAYS_NOTHING = frozenset(
    {"marker", "markers", "point", "points", "unlabeled", "unlabelled", "unknown", "traj", "trajectory", "limb", "body"}
)


def name_limbs(limbs: Limbs, markers: Sequence[str], worn: MarkerSet | None = None) -> tuple[str, ...]:
    """Return a name for each limb: that of a segment, or ``limb7`` where the markers do not tell.

    A limb whose markers are numbered pieces of one name of several words (``crane arm 1``, ``crane arm 2``), or of one
    that is no word of the field, is called by it. Else each marker votes for its segment by the marker set or by the
    words in its name, one beside a joint with less weight; the segment with the most votes is the limb's name if it has
    at least half of them. Of two limbs of one body with the same name the one with fewer votes gets a number; limbs of
    another body begin with its name where they are called alike.

    Parameters
    ----------
    limbs : Limbs
        Which marker is on which limb.
    markers : sequence of str, length n_markers
        Names of the markers.
    worn : MarkerSet, optional
        The marker set of the take.
    """
    segments = _segments_of(markers, worn)
    named: dict[int, tuple[float, str]] = {}
    for limb in range(limbs.n_limbs):
        on_limb = [markers[marker] for marker in limbs.markers_of(limb).tolist()]
        votes = _votes(on_limb, segments)
        stem = _shared_stem(on_limb)
        if stem and not (votes and (worn or " " not in stem)):
            named[limb] = (float(len(on_limb)), stem)
        elif votes:
            named[limb] = max(((weight, name) for name, weight in votes.items()), key=_outermost)
    return unique_names(named, limbs.bodies, _subjects(limbs, markers))


def name_bones(limbs: Limbs, points: Sequence[str]) -> tuple[str, ...]:
    """Return a name for each bone between keypoints by the points that it ends in; ``limb7`` where they do not tell.

    Parameters
    ----------
    limbs : Limbs
        Which point each bone ends in; the root's are its own.
    points : sequence of str, length n_points
        Names of the keypoints.
    """
    named: dict[int, tuple[float, str]] = {}
    for limb in range(limbs.n_limbs):
        votes = Counter(segment_of_name(points[point]) for point in limbs.markers_of(limb).tolist())
        del votes[""]
        if votes:
            segment, weight = votes.most_common(1)[0]
            named[limb] = (float(weight), segment)
    return unique_names(named, limbs.bodies)


def segments_of_markers(markers: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Return the segment that each marker of a person sits on by its name, and how much that says.

    A side is believed as it is written in this take, before the name (``LTHI``), behind it (``ASISl``) or as a word of
    its own (``R.Thigh.Upper``), if some marker has its mirror image written so, or all markers of arms and legs are
    written so with one side.

    Parameters
    ----------
    markers : sequence of str
        All markers of a take; those without a known word are left out.

    Examples
    --------
    >>> segments_of_markers(["LTHI", "RTHI", "LANK", "C7", "gripper"])
    {'LTHI': ('left thigh', 1.0), 'RTHI': ('right thigh', 1.0), 'LANK': ('left shank', 0.6), 'C7': ('chest', 1.0)}
    """
    readings = {name: [one for one in _readings(name) if one.word] for name in markers}
    written = defaultdict(set)
    for one in chain.from_iterable(readings.values()):
        written[one.style, one.rest].add(one.side)
    mirrored = {key for key, sides in written.items() if sides >= {*SIDES}}
    known = {
        name: max(found, key=lambda one: ((one.style, one.rest) in mirrored, len(one.word)))
        for name, found in readings.items()
        if found
    }
    believed = {style for style, _ in mirrored}
    on_sides = [one for one in known.values() if _words()[one.word][0] not in _MIDDLE]
    if sum(bool(one.side) and one.style in believed for one in on_sides) < _LEAST_SHARE * len(on_sides):
        believed = set()  # the left and the right marker of one hand
    styles = {(one.style, one.side) for one in on_sides}
    believed |= {style for style, side in styles if side} if len(styles) == 1 else set()
    return {name: _segment_and_weight(reading, reading.style in believed) for name, reading in known.items()}


@dataclass(frozen=True)
class _Reading:
    """One way to part a name into a side, written in a style, and the rest, of which a word is known or is empty."""

    style: str
    side: str
    rest: str
    word: str


def _segment_and_weight(reading: _Reading, is_side_believed: bool) -> tuple[str, float]:
    segment, weight = _words()[reading.word]
    is_sided = reading.side and is_side_believed and segment not in _MIDDLE
    return (f"{reading.side} {segment}" if is_sided else segment), weight


def _readings(name: str) -> list[_Reading]:
    own, plain = name.rpartition(":")[2], plain_name(name)
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[0-9]+", own)
    sides = [word for word in words if word.lower() in _SIDE_WORDS]
    readings = []
    if sides:
        rest = "".join(word for word in words if word is not sides[0]).lower()
        readings.append(_reading("word", _SIDE_WORDS[sides[0].lower()], rest))
    readings += [_reading("word", side, plain.removeprefix(side)) for side in SIDES if plain.startswith(side)]
    if plain[:1] in {"l", "r"}:
        readings.append(_reading("before", _SIDE_WORDS[plain[0]], plain[1:], must_be_whole=own[:2].islower()))
    readings.append(_reading("", "", plain))
    if plain[-1:] in {"l", "r"}:
        readings.append(_reading("behind", _SIDE_WORDS[plain[-1]], plain[:-1], must_be_whole=True))
    return readings


@lru_cache(maxsize=4096)
def _reading(style: str, side: str, rest: str, must_be_whole: bool = False) -> _Reading:
    after_number = rest.lstrip("0123456789")
    begun = (word for word in _words() if rest.startswith(word) or after_number.startswith(word))
    fitting = (word for word in begun if len(word) > _SHORT_WORD or rest == word)
    word = max(fitting, key=len, default="")
    is_refused = must_be_whole and word not in {after_number, after_number.rstrip("0123456789")}
    return _Reading(style, side, rest, "" if is_refused else word)


@cache
def _words() -> Mapping[str, tuple[str, float]]:
    """The segment of each word, and how much the word says of it."""
    words: dict[str, tuple[str, float]] = {}
    for segment, rows in read_table(__file__, "words").items():
        words |= dict.fromkeys(rows.get("firm", ()), (segment, 1.0))
        words |= dict.fromkeys(rows.get("at_joint", ()), (segment, _AT_JOINT))
    return words


def _segments_of(markers: Sequence[str], worn: MarkerSet | None) -> dict[str, tuple[str, float]]:
    """Segment and weight of each marker that tells one; of none, if the take does not look like a person."""
    by_words = segments_of_markers(markers)
    if worn is not None:
        by_set = {name: (segment, by_words.get(name, ("", 1.0))[1]) for name, segment in worn.segments.items()}
        return by_words | by_set
    n_segments = len({segment for segment, _ in by_words.values()})
    is_person = n_segments >= _LEAST_SEGMENTS and len(by_words) >= _LEAST_SHARE * len(markers)
    return by_words if is_person else {}


def _votes(on_limb: Sequence[str], segments: Mapping[str, tuple[str, float]]) -> Counter[str]:
    """Weight of each segment that has at least half of what a limb's markers say; none if most of them say nothing."""
    votes: Counter[str] = Counter()
    stated = [segments[name] for name in on_limb if name in segments]
    for segment, weight in stated:
        votes[segment] += weight  # type: ignore[assignment]
    if len(stated) < _LEAST_SHARE * len(on_limb):
        return Counter()
    if len(votes) > 1:  # fingers on one limb are a hand
        votes = sum((Counter({_with_hand(name): weight}) for name, weight in votes.items()), Counter())
    return Counter({name: weight for name, weight in votes.items() if weight >= _LEAST_SHARE * votes.total()})


def _outermost(vote: tuple[float, str]) -> tuple[float, int, str]:
    """Weight, then how far out: a limb with markers at the elbow and at the wrist is the forearm between them."""
    weight, name = vote
    segment = name.removeprefix("left ").removeprefix("right ")
    return weight, _OUTWARD.index(segment) if segment in _OUTWARD else -1, name


def _with_hand(name: str) -> str:
    side, _, segment = name.rpartition(" ")
    return f"{side} hand".strip() if segment in _FINGERS else name


def _shared_stem(on_limb: Sequence[str]) -> str:
    """Return what all names share but for a number at their end, with a leading side in full, or nothing."""
    stems = {re.sub(r"[\W_]*[0-9]+$", "", name.rpartition(":")[2]) for name in on_limb}
    if len(on_limb) < 2 or len(stems) > 1:
        return ""
    words = [word for word in re.split(r"[\W_]+", stems.pop().strip()) if word.lower() not in _SAYS_NOTHING]
    words[:1] = [_SIDE_WORDS.get(word.lower(), word) for word in words[:1]]
    letters = sum(len(word) for word in words if word.isalpha())
    return " ".join(words) if letters >= _LEAST_STEM else ""


def _subjects(limbs: Limbs, markers: Sequence[str]) -> list[str]:
    """What each body is called by its markers, if all begin with its name, ``Anna:LKNE``; else nothing."""
    begun = [
        {markers[marker].rpartition(":")[0].strip() for limb in members.tolist() for marker in limbs.markers_of(limb)}
        for members in limbs.bodies
    ]
    called = [one.pop() if len(one) == 1 else "" for one in begun]
    words = [re.sub("[0-9]+", "", name) for name in called]  # subject 1, subject 2: no names, they count
    return [name if words.count(word) == 1 else "" for name, word in zip(called, words, strict=True)]


def unique_names(
    named: Mapping[int, tuple[float, str]], bodies: Sequence[Ints], subjects: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return a name for each limb; of limbs of one body that are called alike, all but the first get a number.

    All named limbs of a body begin with its name, ``Anna: pelvis`` or ``body2: pelvis``, if some are called as one of
    another body.

    Parameters
    ----------
    named : mapping of int to (float, str)
        Weight and name of limbs; the heaviest comes first.
    bodies : sequence of ndarray of intp
        The limbs of each body, in the order in which bodies are numbered; limbs without a name are called ``limb7``.
    subjects : sequence of str, optional
        What each body is called; the number of one that has no name tells it apart.
    """
    names = [f"limb{limb}" for limb in range(sum(map(len, bodies)))]
    numbers = set(names)
    own: list[dict[int, str]] = []
    for limbs in bodies:
        called, taken = dict[int, str](), set(numbers)
        order = sorted((limb for limb in limbs.tolist() if limb in named), key=lambda limb: (-named[limb][0], limb))
        for limb in order:
            name = named[limb][1]
            called[limb] = next(
                one for one in chain([name], (f"{name} {again}" for again in count(2))) if one not in taken
            )
            taken.add(called[limb])
        own.append(called)
    n_bodies = Counter(name for called in own for name in called.values())
    for number, (called, subject) in enumerate(zip_longest(own, subjects), start=1):
        begin = f"{subject or f'body{number}'}{BODY_END}" if any(n_bodies[name] > 1 for name in called.values()) else ""
        for limb, name in called.items():
            names[limb] = begin + name
    return tuple(names)
