"""The body beneath markers that people wear: which limbs are neighbours, and where joints lie to markers of a set."""

import numpy as np

from skelgen.kinematics.calibration.known_body import MISPLACED, KnownBody
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.simulation.articulated import Structure
from skelgen.simulation.people import usual_person
from skelgen.stages.limbs.place_matching import costs_of_places, likely_places, worn_places
from skelgen.stages.limbs.revision import are_plates
from skelgen.stages.limbs.set_matching import Match
from skelgen.stages.limbs.worn_places import Believed, Wear, believed_wear, sure_places, worn_set
from skelgen.stages.limbs.worn_sets import MARKER_DOES_NOT, belief_in_set, part_of
from skelgen.stages.limbs.worn_shapes import WornSet, shape_of

AGREED = 0.8
"""Part of the pairs on one limb that the set must have on one segment: else it is not that set."""

TRUNK = ("pelvis", "chest", "head")
"""Segments that hardly bend, by which a body is told from its mirror image; all segments where half a body is worn."""

LOOKED_AT = 30
"""Frames that are compared with the mirror image."""

ENOUGH = 5
"""Markers of the trunk that a frame must show."""

BESIDE_PLACE = 30.0
"""mm; standard deviation of a coordinate of a marker from the usual place next to it, in a set that is not known."""

MOST_OF_LIMB = 0.6
"""A limb is a segment if at least this part of its markers is on that segment."""

NEIGHBOURS = 4.0
"""Log odds that two limbs are neighbours if their segments are; minus these if they are not."""

BY_LIMBS = 6.0
"""Log odds that two markers on one limb share a segment."""

MAY_BE_WORN, NOT_WORN = 1.4, 2.0
"""Misfit up to which limbs may bear a set out, and from which they do not: animals and random trees have 1.97 and
more."""

WITHIN_SEGMENTS, ACROSS_SEGMENTS = 0.9, 0.7
"""Part of the pairs on one limb that are on one segment, from where the limbs bear a set out, and below which they do
not: of animals and random trees .73 at most, of people .9 and more where all segments are right, even with hands that
are held at the hips. A segment may be in parts: these are neighbours, too."""

MIRROR = np.array([1.0, -1.0, 1.0])


def worn_body(positions: Floats, limb_of_marker: Ints) -> KnownBody | None:
    """Return what is known of a body by the set that it wears, or else by where its markers are; None if nothing is.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Of one body; NaN where unseen.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        The limb of each.
    """
    found, misplaced = _on_limbs(worn_set(positions), limb_of_marker), MISPLACED
    if found is None:
        found, misplaced = _on_limbs(sure_places(positions), limb_of_marker), BESIDE_PLACE
    if found is None:
        return None
    match, worn, together = found
    person = usual_person(worn.name)
    offsets = np.concatenate([limb.markers for limb in person.limbs])
    is_set = worn is not worn_places()
    offsets = offsets[match.of_set] if is_set else _expected(positions, match, offsets)
    segments = worn.segments[match.of_set]
    size = _size(positions[:, match.markers], offsets, together)
    mirror = MIRROR if _is_mirrored(positions[:, match.markers], person, match) else np.ones(3)
    segment_of_marker, places = np.full(positions.shape[1], -1), np.zeros((positions.shape[1], 3))
    fits = match.misfits < MARKER_DOES_NOT
    segment_of_marker[match.markers[fits]] = segments[fits]
    places[match.markers] = size * mirror * offsets
    joints = np.array([limb.joint for limb in person.limbs])
    called = worn.name if is_set else ""
    return KnownBody(segment_of_marker, places, person.parents, size * mirror * joints, misplaced, called)


def _expected(positions: Floats, match: Match, places: Floats) -> Floats:
    """Where markers are expected on their segments [mm], (n_matched, 3): some places of a segment fit nearly alike."""
    costs = costs_of_places(shape_of(positions), match, np.zeros((positions.shape[1],) * 2))[match.markers]
    segments = worn_places().segments
    costs[segments[match.of_set][:, np.newaxis] != segments] = np.inf
    return np.asarray(likely_places(costs) @ places)


def _on_limbs(found: tuple[Match, WornSet] | None, limb_of_marker: Ints) -> tuple[Match, WornSet, np.ndarray] | None:
    """What is worn, how it fits, and which pairs of its markers are on one limb and one segment.

    None if nothing is believed in full, or limbs are not its segments.
    """
    if found is None:
        return None
    match, worn = found
    segments, limbs = worn.segments[match.of_set], limb_of_marker[match.markers]
    alike, own = segments[:, np.newaxis] == segments, limbs[:, np.newaxis] == limbs
    np.fill_diagonal(own, val=False)
    return (match, worn, alike & own) if own.any() and alike[own].mean() >= AGREED else None


def markers_of_set(positions: Floats, limb_of_marker: Ints) -> tuple[str, tuple[str, ...], bool] | None:
    """Return the set that markers have the shape of, and which of its markers each is, or None if there is none.

    Rigid plates are worn by machines rather than by people, and no set is looked for.

    Parameters
    ----------
    positions, limb_of_marker
        As for `worn_body`.

    Returns
    -------
    name : str
        Of the set.
    markers : tuple of str, length n_markers
        What the set calls each; empty for those that fit none.
    is_whole : bool
        Whether all markers of the set are there and no others.
    """
    found = None if are_plates(positions, limb_of_marker) else _on_limbs(worn_set(positions), limb_of_marker)
    if found is None:
        return None
    match, worn, _ = found
    called = [""] * positions.shape[1]
    for marker, of_set, misfit in zip(match.markers.tolist(), match.of_set.tolist(), match.misfits, strict=True):
        called[marker] = worn.markers[of_set] if misfit < MARKER_DOES_NOT else ""
    return worn.name, tuple(called), len(worn.segments) == sum(map(bool, called)) == len(called)


def worn_neighbours(positions: Floats, limb_of_marker: Ints) -> Floats:
    """Return the log odds that limbs are neighbours by what is worn, shape (n_limbs, n_limbs).

    Limbs on one segment of a person are neighbours, and those on segments that a joint connects; others are not. They
    are 0 where it is not known which segment a limb is, where nothing that is known is worn, and on rigid plates, whose
    motion says all there is.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Of one body; NaN where unseen.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        The limb of each, numbered without holes; -1 for those on none.
    """
    nothing = np.zeros((limb_of_marker.max() + 1,) * 2)
    if are_plates(positions, limb_of_marker):
        return nothing
    on_limb, own = limb_of_marker >= 0, limb_of_marker[:, np.newaxis] == limb_of_marker
    by_limbs = np.where(own, BY_LIMBS, -BY_LIMBS) * (on_limb[:, np.newaxis] & on_limb)
    np.fill_diagonal(by_limbs, 0.0)
    worn = believed_wear(positions, by_limbs, _belief_by_limbs)
    return nothing if worn is None else neighbours_in(worn, limb_of_marker)


def neighbours_in(worn: Wear, limb_of_marker: Ints) -> Floats:
    """Return the log odds that limbs are neighbours if a person wears this, shape (n_limbs, n_limbs).

    Parameters
    ----------
    worn : Wear
        What seems to be worn.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        As of `worn_neighbours`.
    """
    odds = np.zeros((limb_of_marker.max() + 1,) * 2)
    for reading in worn.sets:
        odds += (1.0 - worn.share) * reading.belief * _neighbours_of(reading, limb_of_marker)
    if worn.places is not None:
        on = np.arange(len(odds)) == limb_of_marker[:, np.newaxis]
        weight = on.T @ worn.of_places(len(on)) @ on / np.outer(on.sum(axis=0), on.sum(axis=0))
        odds += weight * _neighbours_of(worn.places, limb_of_marker)
    return odds


def _belief_by_limbs(match: Match, worn: WornSet, by_limbs: Floats) -> float:
    """How far to believe a set, where limbs on one segment each bear it out, though a segment may be in parts."""
    alike = worn.segments[match.of_set][:, np.newaxis] == worn.segments[match.of_set]
    own = by_limbs[np.ix_(match.markers, match.markers)] > 0
    within = float(alike[own].mean()) if own.any() else 0.0
    may_be = part_of(match.misfit, MAY_BE_WORN, NOT_WORN) * part_of(within, WITHIN_SEGMENTS, ACROSS_SEGMENTS)
    return max(float(may_be), belief_in_set(match, worn, by_limbs))


def _neighbours_of(reading: Believed, limb_of_marker: Ints) -> Floats:
    """The log odds that limbs are neighbours if what markers are taken for is true, shape (n_limbs, n_limbs)."""
    segments = _segments_of_limbs(reading.match, reading.worn, limb_of_marker)
    joined = _joined_segments(usual_person(reading.worn.name).parents, segments)
    known = (segments[:, np.newaxis] >= 0) & (segments >= 0)
    np.fill_diagonal(known, val=False)
    return np.where(known, np.where(joined, NEIGHBOURS, -NEIGHBOURS), 0.0)


def _segments_of_limbs(match: Match, worn: WornSet, limb_of_marker: Ints) -> Ints:
    """The segment that each limb is, -1 where its markers are on several or fit none, shape (n_limbs,)."""
    fits = match.misfits < MARKER_DOES_NOT
    votes = np.zeros((limb_of_marker.max() + 1, worn.segments.max() + 1))
    limbs = limb_of_marker[match.markers]
    counted = fits & (limbs >= 0)
    np.add.at(votes, (limbs[counted], worn.segments[match.of_set[counted]]), 1.0)
    sizes = np.bincount(limb_of_marker[limb_of_marker >= 0], minlength=len(votes))
    return np.where(votes.max(axis=1) >= MOST_OF_LIMB * sizes, votes.argmax(axis=1), -1)


def _joined_segments(parents: Ints, segments: Ints) -> np.ndarray:
    """Whether two limbs are on one segment, or on two between which no other segment has a limb, (n_limbs, n_limbs)."""
    joined = segments[:, np.newaxis] == segments
    for limb, segment in enumerate(segments.tolist()):
        above = int(parents[segment]) if segment >= 0 else -1
        while above >= 0 and above not in segments:
            above = int(parents[above])
        joined[limb] |= (segments == above) & (above >= 0)
    return np.asarray(joined | joined.T)


def _size(positions: Floats, offsets: Floats, pairs: np.ndarray) -> float:
    """Size of the body over that of the usual person, from distances between markers on one limb."""
    first, second = np.nonzero(np.triu(pairs))
    apart = np.linalg.norm(positions[:, first] - positions[:, second], axis=2)
    seen = ~np.isnan(apart).all(axis=0)
    found, usual = np.nanmedian(apart[:, seen], axis=0), np.linalg.norm(offsets[first] - offsets[second], axis=1)[seen]
    return float(found @ usual / (usual @ usual))


def _is_mirrored(positions: Floats, person: Structure, match: Match) -> bool:
    """Whether left and right are exchanged: distances alone cannot tell a body from its mirror image."""
    origins = np.zeros((person.n_limbs, 3))
    for limb in range(1, person.n_limbs):
        origins[limb] = origins[person.parents[limb]] + person.limbs[limb].joint
    standing = np.concatenate([limb.markers + origin for limb, origin in zip(person.limbs, origins, strict=True)])
    names = np.array(person.limb_names)[person.limb_of_marker[match.of_set]]
    of_trunk = np.isin(names, TRUNK) if {"pelvis", "chest"} <= set(names.tolist()) else np.ones(len(names), np.bool_)
    standing, sense = standing[match.of_set[of_trunk]], 0.0
    for shown in positions[spread_frames(len(positions), LOOKED_AT)][:, of_trunk]:
        seen = ~np.isnan(shown[:, 0])
        if seen.sum() >= ENOUGH:
            one, other = (points[seen] - points[seen].mean(axis=0) for points in (shown, standing))
            product = one.T @ other
            sense += float(np.sign(np.linalg.det(product)) * np.linalg.svd(product, compute_uv=False)[2])
    return sense < 0
