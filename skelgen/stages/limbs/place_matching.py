"""Markers matched with usual places on the body, so that all distances fit best.

The 153 places are those of all sets together, and their usual distances to each other are learned as those of sets are
(``tables/worn_places.npz``, made by tests/benchmarks/learn_sets.py), from people in any posture, whose markers miss
their places as those of different examiners do (Della Croce et al., Gait & Posture 21 (2005) 226-237). A search begins
with the sets that fit best and, where markers fit badly from there, with single markers at single places; where the
best of these end, each arm and leg is sought anew. A place that is taken on one side is likely taken on the other, and
markers on one segment move as one limb.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, lru_cache, partial

import numpy as np

from skelgen._kernels.distance_statistics import MOTION_WEIGHT
from skelgen.marker_sets import EVERY_PLACE, worn_markers
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation.people import usual_person
from skelgen.stages.limbs.postures import square_of_pairs
from skelgen.stages.limbs.set_matching import LEAST_INLIERS, Match, PostureSearch, Rounds, matches, misfits_in_posture
from skelgen.stages.limbs.worn_sets import ARM, LEG, SIDES, sets_of_table
from skelgen.stages.limbs.worn_shapes import Shape, WornSet

FROM_SET = Rounds((0.6, 0.7, 0.8, 0.9, 1.0, 1.0, 1.0))
"""Part of the markers by which each round judges: a search begins where that of a set has ended."""

LED_ON = Rounds((0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0, 1.0))
"""The same of a search that goes on from where another one has ended."""

LIMB_ANEW = Rounds((0.95, 0.8, 0.9, 1.0, 1.0))
"""The same of a search that begins with all limbs but one: arms and legs are often taken for a segment too high."""

GOOD, ACCEPTABLE = 0.6, 0.95
"""Mean cost of a marker below which no other beginning is looked for, and below which the end of a search is one."""

SEARCHES, TRIED, LEADS = 4, 12, 5
"""Beginnings in each posture, how many postures are tried, and how often a search goes on from the best."""

ENDS, TURNS = 5, 2
"""From how many of the best ends the search goes on until one is good, and how often each limb is sought anew from
there."""

AT_NO_PLACE = 1.5
"""Cost of a marker that is at none of these places, in the search."""

LEFT_OUT = 3.0
"""The same in the misfit of all: half an animal may be at places, of people nine markers in ten are."""

ONE_SIDED = 0.2
"""Cost of a place that is taken while its mirror image is free."""

MOTION_COUNTS = 0.75
"""Part of its log odds that a pair on one segment counts: what pairs do depends on each other."""


INDEPENDENT = 12.0
"""So many of a marker's distances are independent: then the segments of simulated people in sets that are not known are
as likely as they are right (log odds of -3, 1.5, 3 and 5 where -2.9 and less, 1.3, 3 and 5.2 are found)."""

MISTAKEN = 0.03
"""Probability that all places are wrong, which bounds the odds: soft bodies that are no person may fit as well."""


@cache
def worn_places() -> WornSet:
    """Return the shape of all places at once."""
    return sets_of_table("worn_places.npz")[0]


def nearest_places(shape: Shape, sets: Sequence[tuple[Match, WornSet]], by_motion: Floats) -> tuple[Match, WornSet]:
    """Match markers with places so that distances fit best, and markers on one segment move as one limb.

    Parameters
    ----------
    shape : Shape
        Of the take.
    sets : sequence of tuple of Match and WornSet
        Sets from which the search begins, and how the take fits them.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds that two markers share a limb by what each pair does.
    """
    return _nearest(shape, tuple(sets), by_motion.astype(np.float64, copy=False).tobytes())


@lru_cache(maxsize=4)
def _nearest(shape: Shape, sets: tuple[tuple[Match, WornSet], ...], motion: bytes) -> tuple[Match, WornSet]:
    """What `nearest_places` returns, found once for the same motion: limbs, names and joints ask for it."""
    search = _search(shape, motion)
    best, _ = min((search.end(start, FROM_SET) for start in _beginnings(shape, sets)), key=_cost)
    left_out = 1.0 - len(best.markers) / len(shape.distances)
    return replace(best, misfit=best.misfit + (LEFT_OUT - AT_NO_PLACE) * left_out), worn_places()


@lru_cache(maxsize=4)
def _search(shape: Shape, motion: bytes) -> PostureSearch:
    """The search for markers at places; `motion` holds the log odds of all pairs."""
    by_motion = np.frombuffer(motion).reshape(shape.distances.shape)
    return PostureSearch(shape, worn_places(), AT_NO_PLACE, partial(_beside_misfits, by_motion))


@lru_cache(maxsize=4)
def _beginnings(shape: Shape, sets: tuple[tuple[Match, WornSet], ...]) -> tuple[Match, ...]:
    """Markers at places from which searches begin, found once for a take, whatever motion says.

    Who lacks many markers, or wears what no set has, may be near no set.
    """
    starts = tuple(replace(match, of_set=_places_of(worn)[match.of_set]) for match, worn in sets)
    silent = _search(shape, np.zeros(shape.distances.shape).tobytes())
    best, cost = _led_on(silent, min((silent.end(start, FROM_SET) for start in starts), key=_cost))
    if cost >= GOOD:
        others = [min(matches(shape, posed, SEARCHES), key=_misfit) for posed in _places_in_postures()]
        tried = [silent.end(start, FROM_SET) for start in sorted(others, key=_misfit)[:TRIED]]
        best, cost = _gone_on(silent, sorted([(best, cost), *tried], key=_cost)[:ENDS])
    return (*starts, best) if cost < ACCEPTABLE else starts


@cache
def _places_in_postures() -> tuple[WornSet, ...]:
    """All places, in each of the postures from which searches begin: others are far from the usual distances."""
    places = worn_places()
    moved = places.ways.reshape(-1, places.ways.shape[2]) @ places.beginnings.T
    means = places.mean.tables + square_of_pairs(moved.reshape(len(places.ways), 2, -1).T)
    return tuple(replace(places, mean=Shape(*mean)) for mean in means)


def _misfit(match: Match) -> float:
    return match.misfit


def _cost(end: tuple[Match, float]) -> float:
    return end[1]


def _led_on(search: PostureSearch, found: tuple[Match, float]) -> tuple[Match, float]:
    """Where searches end that go on from the end of another, as long as they find better ones."""
    for _ in range(LEADS):
        before, found = found, search.end(found[0], LED_ON, found)
        if found is before:
            break
    return found


def _gone_on(search: PostureSearch, ends: Sequence[tuple[Match, float]]) -> tuple[Match, float]:
    """The best of where searches end that go on from each of some ends, until one is good."""
    found = []
    for end in ends:
        found.append(_with_limbs_anew(search, _led_on(search, end)))
        if found[-1][1] < GOOD:
            break
    return min(found, key=_cost)


def _with_limbs_anew(search: PostureSearch, end: tuple[Match, float]) -> tuple[Match, float]:
    """Where searches end that begin without one arm or leg each, as long as they find better ones."""
    for _ in range(TURNS):
        before = end
        for on_limb in _limbs():
            match, kept = end[0], ~on_limb[end[0].of_set]
            if LEAST_INLIERS <= kept.sum() < len(kept):
                others = Match(match.markers[kept], match.of_set[kept], match.misfits[kept], match.misfit)
                end = search.end(others, LIMB_ANEW, end)
        if end is before:
            break
    return end


@cache
def _limbs() -> tuple[Bools, ...]:
    """Which places are on each arm and leg, shapes (n_places,)."""
    names = np.array(usual_person(EVERY_PLACE).limb_names)[worn_places().segments]
    return tuple(np.isin(names, [f"{side} {name}" for name in limb]) for side in SIDES for limb in (ARM, LEG))


def _beside_misfits(by_motion: Floats, markers: Ints, taken: Ints) -> Floats:
    """What each place costs for each marker beside its misfit, shape (n_markers, n_places)."""
    places, others = worn_places(), max(len(taken) - 1, 1)
    costs = _wide()[taken].sum(axis=0) / others + ONE_SIDED
    costs[mirror_images()[taken]] -= ONE_SIDED
    if not by_motion.any():
        return np.broadcast_to(costs, (len(by_motion), len(costs)))
    on_segments = by_motion[:, markers] @ _is_on_segment()[taken]
    return np.asarray(costs - (2.0 * MOTION_COUNTS / others * on_segments)[:, places.segments])


@cache
def _is_on_segment() -> Floats:
    """One for each place on its segment, else zero, shape (n_places, n_segments)."""
    segments = worn_places().segments
    return np.eye(segments.max() + 1)[segments]


def costs_of_places(shape: Shape, match: Match, by_motion: Floats) -> Floats:
    """Return what each place costs for each marker, beside markers that are at places, shape (n_markers, n_places).

    Parameters
    ----------
    shape : Shape
        Of the take.
    match : Match
        Markers at places.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds that two markers share a limb by what each pair does.
    """
    misfits = misfits_in_posture(shape, worn_places(), match.markers, match.of_set)
    return misfits + _beside_misfits(by_motion, match.markers, match.of_set)


def likely_places(costs: Floats) -> Floats:
    """Return how likely each marker is at each place by what it costs there, shape (n_markers, n_places).

    Parameters
    ----------
    costs : ndarray, shape (n_markers, n_places)
        As of `costs_of_places`; infinite where a marker is not.
    """
    likely = np.exp(-0.5 * INDEPENDENT * (costs - costs.min(axis=1, keepdims=True)))
    return np.asarray(likely / likely.sum(axis=1, keepdims=True))


def segment_odds(shape: Shape, match: Match, by_motion: Floats) -> Floats:
    """Return the log odds that two markers share a segment, over all places that each may be at (n_markers, n_markers).

    Parameters
    ----------
    shape, match, by_motion
        As for `costs_of_places`.
    """
    on_segment = likely_places(costs_of_places(shape, match, by_motion)) @ _is_on_segment()
    together = np.clip(on_segment @ on_segment.T, MISTAKEN, 1.0 - MISTAKEN)
    odds = np.log(together / (1.0 - together))
    np.fill_diagonal(odds, 0.0)
    return np.asarray(odds)


@cache
def _wide() -> Floats:
    """Cost of the spread of the distances of each place, as of normal variables, shape (n_places, n_places)."""
    of_distances, of_motions = 2.0 * np.log(worn_places().postures.spread)
    wide = of_distances + MOTION_WEIGHT * of_motions
    return np.asarray(np.nan_to_num(wide - np.nanmedian(wide)))


@cache
def mirror_images() -> Ints:
    """Return the place that mirrors each, shape (n_places,); those in the middle mirror themselves."""
    other, names = {"L ": "R ", "R ": "L "}, worn_places().markers
    return np.array([names.index(other.get(name[:2], name[:2]) + name[2:]) for name in names])


@cache
def _places_of(worn: WornSet) -> Ints:
    """The places of a set's markers, shape (n_markers,)."""
    number = {name: index for index, name in enumerate(worn_places().markers)}
    place_at = {(one.limb, *one.offset): number.get(one.name, -1) for one in worn_markers(EVERY_PLACE)}
    of_marker = {one.name: place_at[(one.limb, *one.offset)] for one in worn_markers(worn.name)}
    return np.array([of_marker[name] for name in worn.markers])
