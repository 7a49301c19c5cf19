"""Which marker set a person wears, by the distances of markers alone, and what that says of pairs of markers.

Where soft tissue hides a joint, as of a wrist that carries two markers and a hand that carries two more, motion does
not tell limbs apart. But people wear the sets of their field, and a set has a shape: the usual distance of each two of
its markers, and how much it varies, learned from simulated people of all sizes in natural motions and any posture
(``tables/worn_sets.npz``, made by tests/benchmarks/learn_sets.py). Markers are assigned to those of a set so that all
distances fit best. How well they do, and how few of the set's pairs move as two limbs, says how far to believe the set:
log odds that two markers share a limb, which add to what the pair itself says. Where several ways to read the markers
fit about as well, each has a part of the word.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import islice
from pathlib import Path

import numpy as np

from skelgen._kernels.distance_statistics import MOTION_WEIGHT, misfits_to_set
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.stages.limbs.worn_shapes import LOOKED_AT, Shape, WornSet, shape_of

SIZES = (0.75, 1.33)
"""Of the number of a set's markers: a take with fewer or more does not wear it."""

SIZES_OF_HALF = (0.75, 1.1)
"""The same of half a set: who wears half wears hardly anything else."""

OUTLINE_SPREAD = 0.15, 0.5
"""Standard deviations of these, and of those of how much the distances vary."""

START_WEIGHT = 2.0
"""How much the distances to one pair of markers count beside the outlines, at the beginning of a search."""

SEARCHES, ROUNDS = 12, 10
"""Beginnings that are tried for each set, and rounds of each."""

FIRST_SEARCHES, PROMISING = 3, 0.7
"""Searches after which a set whose misfit is so much larger than the best one's is given up: of 66 people, the sets
that fit nearly best in the end are behind by .45 at most by then, and by .28 and less of all but two."""

WITHOUT_PARTNER = 2.0
"""Cost of a marker of the take, or of the set, that has no partner."""

WORN, NOT_WORN = 1.3, 1.6
"""Misfit up to which a set is believed, and from which it is not at all."""

BEYOND_DOUBT, DOUBTFUL = 0.6, 1.0
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

STRANGE, TOO_STRANGE = 1.8, 2.1
"""Misfit up to which a set is believed that motion bears out, and from which it is not: people take postures that the
simulation does not, as in a landing with both arms held out (1.1 to 1.7). Animals and trees have 2.0 and more, people
with markers anywhere on their limbs 1.2 to 1.8, which motion does not bear out."""

BORNE_OUT, NOT_BORNE_OUT = 0.85, 0.75
"""Part of the pairs of such a set that are not contradicted: of people whose own set was left out of the table, .77 to
.87 of the pairs are right up to .79, and .96 and more from .85 on."""

SIDES = ("left", "right")

HALVES = {
    "lower": ("pelvis", *(f"{side} {name}" for side in SIDES for name in ("thigh", "shank", "foot", "toes"))),
    "upper": ("chest", "head", *(f"{side} {name}" for side in SIDES for name in ("upper arm", "forearm", "hand"))),
}
"""Segments of half a person."""

LEAST_OF_HALF = 15
"""Least markers of half a person: fewer fit anything."""

STRENGTH = 6.0
"""Log odds of a pair of markers by a set that is believed in full."""


@dataclass(frozen=True, eq=False)
class Match:
    """Markers of a take as those of a set.

    Attributes
    ----------
    markers, of_set : ndarray of intp, shape (n_matched,)
        Markers of the take, and of the set.
    misfits : ndarray, shape (n_matched,)
        Mean square of how far the distances of each are off, in standard deviations.
    misfit : float
        Their mean, and what is left over.
    """

    markers: Ints
    of_set: Ints
    misfits: Floats
    misfit: float


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


def _all_readings(positions: Floats) -> tuple[tuple[Match, WornSet], ...]:
    """All matches with sets of about as many markers that searches end with, the best first."""
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    return _readings_of(shown.tobytes(), shown.shape)


@lru_cache(maxsize=4)
def _readings_of(shown: bytes, n: tuple[int, ...]) -> tuple[tuple[Match, WornSet], ...]:
    """The same, found once for the frames that are looked at: limbs, joints and names all ask for it."""
    shape = shape_of(np.frombuffer(shown).reshape(n))
    parts = [(worn, *part) for worn in worn_sets() for part in _parts(worn, n[1])]
    searches = [matches(shape, part) for _, _, part in parts]
    found = [list(islice(search, FIRST_SEARCHES)) for search in searches]
    best = min((one.misfit for matched in found for one in matched), default=np.inf)
    for search, matched in zip(searches, found, strict=True):
        if min(one.misfit for one in matched) < best + PROMISING:
            matched.extend(search)
    every = [
        (replace(match, of_set=taken[match.of_set]), worn)
        for (worn, taken, _), matched in zip(parts, found, strict=True)
        for match in matched
    ]
    return tuple(sorted(every, key=lambda one: one[0].misfit))


def _parts(worn: WornSet, n_markers: int) -> list[tuple[Ints, WornSet]]:
    """A set and its halves, those that have about as many markers as the take."""
    halves = worn.halves if n_markers >= LEAST_OF_HALF else ()
    sized = [((np.arange(len(worn.segments)), worn), SIZES), *((half, SIZES_OF_HALF) for half in halves)]
    return [part for part, (least, most) in sized if least <= n_markers / len(part[0]) <= most]


@cache
def worn_sets() -> tuple[WornSet, ...]:
    """Return the shapes of all sets."""
    with np.load(Path(__file__).with_name("tables") / "worn_sets.npz") as table:
        read = {key: table[key] for key in table.files}
    return tuple(_worn_set(name, read) for name in sorted({key.partition("/")[0] for key in read}))


def _worn_set(name: str, table: dict[str, np.ndarray]) -> WornSet:
    """A set of the table, with its halves."""
    segments, markers = table[f"{name}/segments"].astype(np.intp), table[f"{name}/markers"]
    halves = []
    for part in [part for part in HALVES if f"{name}/{part}/taken" in table]:
        taken = table[f"{name}/{part}/taken"].astype(np.intp)
        shapes = _shapes(table, f"{name}/{part}")
        halves.append((taken, WornSet(name, *shapes, segments[taken], tuple(markers[taken].tolist()))))
    return WornSet(name, *_shapes(table, name), segments, tuple(markers.tolist()), tuple(halves))


def _shapes(table: dict[str, np.ndarray], key: str) -> tuple[Shape, Shape]:
    """The mean and the spread of a set, or of half of it."""
    mean, spread = (Shape(*table[f"{key}/{name}"].astype(np.float64)) for name in ("mean", "spread"))
    return mean, spread


def matches(shape: Shape, worn: WornSet) -> Iterator[Match]:
    """Assign markers to those of a set so that their distances fit best; yield where each search ends that is new.

    Each begins with one marker that is taken for one of the set, and goes on as the assignment of all that suits the
    last one.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    outlines, visited = _outline_misfits(shape, worn.mean), set()
    for pair in np.argsort(outlines, axis=None)[: SEARCHES * 2 : 2].tolist():
        marker, of_set = divmod(pair, outlines.shape[1])
        start = outlines + START_WEIGHT * misfits_of(shape, worn, np.array([marker]), np.array([of_set]))
        start[marker] = start[:, of_set] = start.max()
        start[marker, of_set] = 0.0
        markers, taken = linear_sum_assignment(start)
        ways = []
        for _ in range(ROUNDS):
            matched = markers.tobytes() + taken.tobytes()
            if matched in visited:  # another search went on from here, or this one stands still
                break
            visited.add(matched)
            misfits = misfits_of(shape, worn, markers, taken)
            ways.append(_match(markers, taken, misfits))
            markers, taken = linear_sum_assignment(misfits)
        if ways:
            yield min(ways, key=lambda one: one.misfit)


def _match(markers: Ints, taken: Ints, misfits: Floats) -> Match:
    """Markers as those of a set, with what the ones that are left over cost."""
    of_each = misfits[markers, taken]
    left_over = WITHOUT_PARTNER * (1 - 2 * len(markers) / sum(misfits.shape))
    return Match(markers, taken, of_each, float(of_each.mean()) + left_over)


def misfits_of(shape: Shape, worn: WornSet, markers: Ints, of_set: Ints) -> Floats:
    """Return the mean square of how far distances are off if a marker is one of a set, shape (n_markers, n_of_set).

    Bodies are compared as if they were of one size.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    markers, of_set : ndarray of intp, shape (n_matched,)
        Markers to which distances are compared, and what they are taken for.
    """
    differences = shape.distances[np.ix_(markers, markers)] - worn.mean.distances[np.ix_(of_set, of_set)]
    known = differences[~np.isnan(differences)]  # what is worn says which distance is the usual one
    size = float(np.median(known)) if len(known) else 0.0
    taken = shape.tables - np.array([size, 0.0])[:, np.newaxis, np.newaxis]
    return misfits_to_set(taken, worn.mean.tables, worn.spread.tables, markers, of_set)


def _outline_misfits(one: Shape, other: Shape) -> Floats:
    """Difference of the outlines of each marker of one shape and each of the other."""
    total = np.zeros((len(one.distances), len(other.distances)))
    pairs = zip(one.outlines, other.outlines, OUTLINE_SPREAD, (1.0, MOTION_WEIGHT), strict=True)
    for values, means, spread, weight in pairs:
        total += weight * ((values[:, np.newaxis] - means) ** 2).mean(axis=2) / spread**2
    return total


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
