"""Bodies that are whole people: parts of one person that seem to be several, and several people who seem to be one.

What tells bodies apart (`bodies`) are places where nothing keeps markers together. A person who lacks markers may have
such a place, and people who stay near each other all the time, as those who dance do, have none. Where markers are on
the body (`worn_places`) knows what a person is.
"""

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.stages.limbs.bodies import cuts, marker_distances
from skelgen.stages.limbs.worn_places import (
    AT_PLACES,
    ENOUGH_MARKERS,
    PLACES_BEYOND_DOUBT,
    believed_places,
    places_by_distances,
    segments_of,
)
from skelgen.stages.limbs.worn_sets import MARKER_FITS
from skelgen.stages.limbs.worn_shapes import LOOKED_AT

LEAST_SEGMENTS, TRUNK = 7, {"pelvis", "chest"}
"""Segments of bodies that are joined to a person, and what is among them: half a person has no fewer, and two machines
beside each other fit parts of arms and legs."""

WHOLE, FEWEST = 8, 15
"""Segments of a whole person, who may wear nothing on arms and head, both of the trunk among them: one half of a person
at most has these. And markers: the smallest sets have 15 to 19, which must be at their places beyond doubt."""

LEAST_ODDS, MOST_CUTS = -6.0, 4
"""Log odds of ways to part markers, and how many of these are tried, the likeliest first: where recorded people are put
together with their middles .3 m apart, the right one has -5.5 and more, and at most three have more."""

SURE_APART = 0.95
"""Probability that people who are told apart by their places are two."""


def bodies_of_people(positions: Floats, body_of_marker: Ints, sure: Floats, parts: Ints) -> tuple[Ints, Floats]:
    """Return bodies as `with_people_apart` and `with_whole_people` find them, and how sure each is, gone ones too.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    body_of_marker : ndarray of intp, shape (n_markers,)
        Bodies as they are told apart by distances, numbered without holes.
    sure : ndarray, shape (n_bodies,)
        Probability of each.
    parts : ndarray of intp, shape (n_markers,)
        Parts that are on different bodies in any case, numbered without holes.
    """
    found = with_people_apart(positions, body_of_marker)
    sure = np.append(sure, np.full(found.max(initial=-1) + 1 - len(sure), 1.0))
    parted = np.unique([body_of_marker[found != body_of_marker], found[found != body_of_marker]])
    sure[parted] = np.minimum(sure[parted], SURE_APART)
    for part in range(int(parts.max(initial=-1)) + 1 if len(sure) > 1 else 0):
        markers = np.flatnonzero(parts == part)
        numbers, bodies = np.unique(found[markers], return_inverse=True)
        found[markers] = numbers[with_whole_people(positions[:, markers], bodies)]
    return found, sure


def with_whole_people(positions: Floats, body_of_marker: Ints) -> Ints:
    """Return the body of each marker, where bodies whose markers are all at places of one person are one.

    Where a person lacks markers, those beyond a joint may stay near none of the others.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    body_of_marker : ndarray of intp, shape (n_markers,)
        Bodies as they are told apart by distances, numbered without holes.
    """
    shown, joined = positions[spread_frames(len(positions), LOOKED_AT)], body_of_marker.copy()
    from_smallest = np.argsort(np.bincount(body_of_marker), kind="stable").tolist()
    for n_smaller, part in enumerate(from_smallest, start=1):
        for other in reversed(from_smallest[n_smaller:]):
            markers = np.flatnonzero(np.isin(joined, [part, other]))
            if _are_of_one_person(shown[:, markers], joined[markers] == part):
                joined[joined == part] = other
                break
    return joined


def _are_of_one_person(positions: Floats, is_part: Bools) -> bool:
    """Whether markers are at usual places of enough segments, and each of some of them is."""
    places = believed_places(positions, np.zeros((positions.shape[1],) * 2))
    segments = set[str]() if places is None or places.match.misfit >= AT_PLACES else segments_of(places)
    if places is None or len(segments) < LEAST_SEGMENTS or not segments & TRUNK:
        return False
    at_place = places.match.markers[places.match.misfits < MARKER_FITS]
    return bool(np.isin(np.flatnonzero(is_part), at_place).all())


def with_people_apart(positions: Floats, body_of_marker: Ints) -> Ints:
    """Return the body of each marker, where bodies that are several whole people are parted.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    body_of_marker : ndarray of intp, shape (n_markers,)
        Bodies as they are told apart by distances, numbered without holes; those that are new have the next numbers.
    """
    parted = body_of_marker.copy()
    for body in range(int(body_of_marker.max(initial=-1)) + 1):
        for person in _people_of(positions, np.flatnonzero(body_of_marker == body))[1:]:
            parted[person] = parted.max() + 1
    return parted


def _people_of(positions: Floats, markers: Ints) -> list[Ints]:
    """The markers of each person of a body; all of them, if it is no more than one, or nobody."""
    if len(markers) < 2 * FEWEST or _is_whole_person(positions[:, markers]):
        return [markers]
    ways = cuts(marker_distances(positions[:, markers]))
    is_enough = np.minimum(ways.is_second.sum(axis=1), (~ways.is_second).sum(axis=1)) >= FEWEST
    likely = np.flatnonzero(is_enough & (ways.odds > LEAST_ODDS))
    for second in ways.is_second[likely[np.argsort(-ways.odds[likely], kind="stable")[:MOST_CUTS]]]:
        smaller, larger = sorted((markers[second], markers[~second]), key=len)
        if _is_whole_person(positions[:, smaller]):
            others = _people_of(positions, larger)
            if len(others) > 1 or _is_whole_person(positions[:, larger]):
                return [smaller, *others]
    return [markers]


def _is_whole_person(positions: Floats) -> bool:
    """Whether markers are at usual places of a trunk, and of arms and legs."""
    places = places_by_distances(positions)
    most = AT_PLACES if positions.shape[1] >= ENOUGH_MARKERS else PLACES_BEYOND_DOUBT
    if places is None or places.match.misfit >= most:
        return False
    segments = segments_of(places)
    return len(segments) >= WHOLE and segments >= TRUNK
