"""Which marker set a person wears, by the distances of markers alone, and what that says of pairs of markers.

Where soft tissue hides a joint, as of a wrist that carries two markers and a hand that carries two more, motion does
not tell limbs apart. But people wear the sets of their field, and a set has a shape: the usual distance of each two of
its markers, and how much it varies, learned from simulated people of all sizes in natural motions and any posture
(``tables/worn_sets.npz``, made by tests/benchmarks/learn_sets.py). Markers are assigned to those of a set so that all
distances fit best, in the posture that the person takes (`set_matching`). How well they do, and how few of the set's
pairs move as two limbs, says how far to believe the set: log odds that two markers share a limb, which add to what the
pair itself says. Where several ways to read the markers fit about as well, each has a part of the word.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.limbs.postures import square_of_pairs
from skelgen.stages.limbs.set_matching import CAREFUL, PLAIN, SURE, Match, PostureSearch, Rounds, matches
from skelgen.stages.limbs.worn_shapes import Shape, WornSet, once_for_frames, shape_of

SIZES = (0.75, 1.33)
"""Of the number of a set's markers: a take with fewer or more does not wear it."""

SIZES_OF_HALF = (0.75, 1.1)
"""The same of half a set: who wears half wears hardly anything else."""

FIRST_SEARCHES, PROMISING = 3, 0.7
"""Searches after which a set whose misfit is so much larger than the best one's is given up: of 66 people, the sets
that fit nearly best in the end are behind by .45 at most by then, and by .28 and less of all but two."""

STARTS, STARTING = 3, 0.45
"""Readings of each set by its usual distances from which postures are looked for, and how much worse than the best."""

STRAINED, HOPELESS = 1.25, 1.9
"""Misfits of the best between which its set is searched for with more care: below it is right, and what is no person
has more."""

CAREFUL_SEARCHES, TRIED, LEADS, LEADING = 30, 8, 4, 3
"""Beginnings of these, how many are tried in posture, and how often a search goes on from how many of the best."""

MUCH = 0.05
"""By how much smaller a misfit they must find: others are the same but for markers that are easily mistaken."""

OF_NO_SET, MISSING = 3.0, 1.5
"""Costs of a marker of the take that is none of the set, and of one of the set that the take lacks."""

WORN, NOT_WORN = 1.1, 1.35
"""Misfit up to which a set is believed, and from which it is not at all: people in known sets have .1 to 1.3, in any
posture, of whose pairs .98 are right and more."""

BEYOND_DOUBT, DOUBTFUL = 0.5, 0.8
"""Misfit up to which no motion contradicts a set, and from which it may."""

MARKER_FITS, MARKER_DOES_NOT = 1.5, 3.0
"""The same for a single marker."""

NEARLY, EVEN = 0.2, 0.05
"""How much larger than the best a misfit may be, and how much larger it is where a reading is e times less likely."""

CONTRADICTED = -1.0
"""Log odds of a pair by its motion, below which it contradicts a set that has both on one segment."""

AGREED, NOT_AGREED = 0.75, 0.6
"""Part of the set's pairs that are not contradicted: from the first on it is believed, below the second not at all.
Of simulated people in sets that are known, all of whose pairs are right, it is .73 and more."""

STRANGE, TOO_STRANGE = 1.45, 1.6
"""Misfit up to which a set is believed that motion bears out, and from which it is not: it is another one that is
alike in most. Animals and trees have 1.9 and more, people with markers anywhere on their limbs 1.2 to 1.6, which motion
does not bear out."""

BORNE_OUT, NOT_BORNE_OUT = 0.9, 0.8
"""Part of the pairs of such a set that are not contradicted: of people whose own set was left out of the table, .45 to
.8 of the pairs are right below, and .87 and more from .9 on."""

SIDES = ("left", "right")

ARM, LEG = ("upper arm", "forearm", "hand"), ("thigh", "shank", "foot", "toes")

HALVES = {
    "lower": ("pelvis", *(f"{side} {name}" for side in SIDES for name in LEG)),
    "upper": ("chest", "head", *(f"{side} {name}" for side in SIDES for name in ARM)),
}
"""Segments of half a person."""

LEAST_OF_HALF = 15
"""Least markers of half a person: fewer fit anything."""

STRENGTH = 6.0
"""Log odds of a pair of markers by a set that is believed in full."""


def belief_in_set(match: Match, worn: WornSet, by_motion: Floats) -> float:
    """Return how far to believe that a set is worn, 0 to 1.

    Parameters
    ----------
    match : Match
        How markers fit it.
    worn : WornSet
        The set.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds that two markers share a limb by what each pair does.
    """
    agreed = agreement(match, worn, by_motion)
    borne_out = np.maximum(part_of(agreed, AGREED, NOT_AGREED), part_of(match.misfit, BEYOND_DOUBT, DOUBTFUL))
    usual = part_of(match.misfit, WORN, NOT_WORN) * borne_out
    strange = part_of(match.misfit, STRANGE, TOO_STRANGE) * part_of(agreed, BORNE_OUT, NOT_BORNE_OUT)
    return float(np.maximum(usual, strange))


def agreement(match: Match, worn: WornSet, by_motion: Floats) -> float:
    """Return the part of the pairs on one segment of a set that do not move as two limbs.

    Parameters
    ----------
    match, worn, by_motion
        As for `belief_in_set`.
    """
    together = worn.segments[match.of_set][:, np.newaxis] == worn.segments[match.of_set]
    others = together & ~np.eye(len(together), dtype=np.bool_)
    moving = by_motion[np.ix_(match.markers, match.markers)][others]  # 0: never seen together
    return float(((moving > CONTRADICTED) & (moving != 0)).mean()) if others.any() else 0.0


def nearest_set(positions: Floats) -> tuple[Match, WornSet] | None:
    """Return the set that fits markers best and how, or None if all have far more or fewer markers.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    return next(iter(fitting_sets(positions)), None)


def fitting_sets(positions: Floats) -> tuple[tuple[Match, WornSet], ...]:
    """Return all sets of about as many markers, or with as many on half a body, and how markers fit; the best first.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    best: dict[str, tuple[Match, WornSet]] = {}
    for match, worn in _all_readings(positions):
        best.setdefault(worn.name, (match, worn))
    return tuple(best.values())


def readings(positions: Floats) -> list[tuple[float, Match, WornSet]]:
    """Return the ways to take markers for those of sets that fit nearly best, the best first, and how likely each is.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    every = _all_readings(positions)
    near = [one for one in every if one[0].misfit < every[0][0].misfit + NEARLY]
    weights = np.exp([(every[0][0].misfit - match.misfit) / EVEN for match, _ in near])
    return [(weight, *one) for weight, one in zip((weights / weights.sum()).tolist(), near, strict=True)]


@once_for_frames
def _all_readings(positions: Floats) -> tuple[tuple[Match, WornSet], ...]:
    """All matches with sets of about as many markers that searches end with, the best first.

    Limbs, joints and names all ask for them.
    """
    shape = shape_of(positions)
    starts, every = _starts(shape), _Readings(shape)
    for rank in range(STARTS):
        for part, matched in starts:
            if rank < len(matched):
                every.add(part, matched[rank])
        if any(match.misfit < SURE for match, _ in every.found.values()):
            break
    for match, part in every.sorted()[:1]:  # the best may lead on
        every.add(part, match)
        every.look_carefully()
    return tuple((replace(match, of_set=part.taken[match.of_set]), part.worn) for match, part in every.sorted())


class _Part(NamedTuple):
    """A set, which of its markers are looked for, and the set that these are."""

    worn: WornSet
    taken: Ints
    part: WornSet


class _Readings:
    """Ways to read the markers of a take in the posture that a person takes, each once."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self._searches: dict[WornSet, PostureSearch] = {}
        self.found: dict[tuple[str, bytes, bytes], tuple[Match, _Part]] = {}

    def sorted(self) -> list[tuple[Match, _Part]]:
        """All, the best first."""
        return sorted(self.found.values(), key=lambda one: one[0].misfit)

    def look_carefully(self) -> None:
        """Where the best is strained, add those of its set that careful searches find, if one fits much better."""
        before, (least, part) = dict(self.found), self.sorted()[0]
        if not STRAINED < least.misfit < HOPELESS:
            return
        starts = sorted(matches(self._shape, part.part, CAREFUL_SEARCHES), key=lambda match: match.misfit)
        for start in starts[:TRIED]:
            self.add(part, start, CAREFUL)
        for _ in range(LEADS):
            n_found = len(self.found)
            for match, best in self.sorted()[:LEADING]:
                self.add(best, match, CAREFUL)
            if len(self.found) == n_found:
                break
        if self.sorted()[0][0].misfit > least.misfit - MUCH:
            self.found = before

    def add(self, part: _Part, start: Match, rounds: Rounds = PLAIN) -> None:
        """Add the one that is found from a start."""
        search = self._searches.setdefault(part.part, PostureSearch(self._shape, part.part, OF_NO_SET))
        match, _ = search.end(start, rounds)
        missing = MISSING * (1.0 - len(match.markers) / len(part.taken))
        key = part.worn.name, match.markers.tobytes(), part.taken[match.of_set].tobytes()
        self.found[key] = replace(match, misfit=match.misfit + missing), part


def _starts(shape: Shape) -> list[tuple[_Part, list[Match]]]:
    """Where searches by usual distances end that fit nearly best, the best of each set first."""
    parts = [part for worn in worn_sets() for part in _parts(worn, len(shape.distances))]
    searches = [matches(shape, part.part) for part in parts]
    found = [list(islice(search, FIRST_SEARCHES)) for search in searches]
    best = min((one.misfit for matched in found for one in matched), default=np.inf)
    for search, matched in zip(searches, found, strict=True):
        if min(one.misfit for one in matched) < best + PROMISING:
            matched.extend(search)
        matched.sort(key=lambda one: one.misfit)
    best = min((matched[0].misfit for matched in found), default=np.inf)
    near = ([one for one in matched if one.misfit < best + STARTING] for matched in found)
    return list(zip(parts, near, strict=True))


def _parts(worn: WornSet, n_markers: int) -> list[_Part]:
    """A set and its halves, those that have about as many markers as the take."""
    least, most = SIZES_OF_HALF
    has_half = any(least <= n_markers / len(part) <= most for part in worn.parts)
    halves = worn.halves if n_markers >= LEAST_OF_HALF and has_half else ()
    sized = [((np.arange(len(worn.segments)), worn), SIZES), *((half, SIZES_OF_HALF) for half in halves)]
    return [_Part(worn, *part) for part, (least, most) in sized if least <= n_markers / len(part[0]) <= most]


@cache
def worn_sets() -> tuple[WornSet, ...]:
    """Return the shapes of all sets."""
    return sets_of_table("worn_sets.npz")


def sets_of_table(file_name: str) -> tuple[WornSet, ...]:
    """Return the sets of a table as they were learned; theirs are the markers, and the pairs, one after the other."""
    with np.load(Path(__file__).with_name("tables") / file_name) as file:
        table = {key: file[key] for key in file.files}
    n_markers = table["n_markers"].astype(np.intp)
    of_markers, of_pairs = np.cumsum(n_markers)[:-1], np.cumsum(n_markers * (n_markers - 1) // 2)[:-1]
    usual = np.split(table["usual"].astype(np.float64), of_pairs, axis=2)
    ways = np.split(table["ways"].astype(np.float32), of_pairs)
    segments = np.split(table["segments"].astype(np.intp), of_markers)
    halves, markers = (np.split(table[key], of_markers) for key in ("halves", "markers"))
    beginnings = table["beginnings"].astype(np.float64)
    sets = []
    for number, name_of_set in enumerate(table["names"].tolist()):
        (mean, spread, left), names = usual[number], tuple(markers[number].tolist())
        shapes = Shape(*square_of_pairs(mean)), Shape(*square_of_pairs(spread))
        parts = tuple(np.flatnonzero(halves[number] == half) for half in np.unique(halves[number]) if half)
        of_set = WornSet(name_of_set, *shapes, ways[number], left, segments[number], names, parts, beginnings)
        sets.append(of_set)
    return tuple(sets)


def part_of(value: Floats | float, all_of: float, nothing: float) -> Floats:
    """Return 1 up to one value, 0 from another one on.

    Parameters
    ----------
    value : ndarray or float
        What is judged.
    all_of, nothing : float
        These values.
    """
    return np.clip((nothing - np.asarray(value)) / (nothing - all_of), 0.0, 1.0)
