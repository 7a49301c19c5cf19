"""Where on the body markers are stuck, told by their distances alone, where no set that is known is worn.

Every laboratory changes a set: a marker more, a cluster elsewhere. Its markers still lie at places that are usual
(`place_matching`). These speak instead of a set where they fit much better and motion bears them out; and single ones
do that fit well, where neither a set nor all places are believed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from skelgen.marker_sets import EVERY_PLACE
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.people import usual_person
from skelgen.stages.limbs.place_matching import mirror_images, nearest_places, segment_odds
from skelgen.stages.limbs.set_matching import Match
from skelgen.stages.limbs.worn_sets import (
    BEYOND_DOUBT,
    DOUBTFUL,
    LEAST_OF_HALF,
    MARKER_DOES_NOT,
    MARKER_FITS,
    NEARLY,
    STRENGTH,
    WORN,
    agreement,
    belief_in_set,
    fitting_sets,
    nearest_set,
    part_of,
    readings,
)
from skelgen.stages.limbs.worn_shapes import Shape, WornSet, once_for_frames, shape_of

STARTS = 2
"""Sets from which a search begins."""

ENOUGH_MARKERS = 20
"""Places of fewer count only where they fit beyond doubt. Of people, real and simulated, of whose markers a third and
more is left out, more of the tree is found with 20 or 22 than with 30; animals and trees of 20 to 29 lose nothing."""

PART_OF_PLACES, OF_PARTING = 2 / 3, 0.5
"""What places that are believed say of a pair beside a set that is believed, and which part of it where they part two
markers: these are easily mistaken for neighbours beyond a joint."""

SURELY_PARTED = 2.0
"""Factor on log odds by which places part two markers that both fit well, as nearly all do: two markers on the wrist
and one on the hand keep their distances, whatever the wrist does."""

PARTED_WELL, NOT_WELL = (0.5, 0.7), (1.0, 0.9)
"""Misfit of either marker, and of all, up to which places part so surely, and from which they do not."""

SURER = 1.5
"""Factor on the log odds of a set that fits beyond doubt: its word counts more than the motion of skin."""

MIRRORED = 0.5
"""Weight of a pair's mirror image in the log odds of the pair, where places are believed: both sides are alike."""

AT_PLACES, NOT_AT_PLACES = 0.8, 1.0
"""Misfit up to which places are believed, and from which they are not at all: of people it is .1 to .9 where nearly all
places are right, of animals and trees .99 and more."""

PLACE_FITS, PLACE_DOES_NOT = 1.0, 1.4
"""The same of a single place, beyond what is believed of all: arms may be mistaken, and legs right. On people in sets
that are not known .94 and more of the pairs of markers that fit so well are rightly on one segment."""

SURE_SEGMENTS, SURE_COUNTS = ("chest", "head"), 0.7
"""Segments whose markers are seldom mistaken, and how much their misfits count."""

WELL = 0.35
"""Misfit of a marker that fits its place well."""

SOME_FIT, NONE_FIT = 0.35, 0.3
"""Part of all markers that fit well, from which single places are believed, and below which none is: recorded people
have .35 and more, animals and trees .3 and less."""

ENOUGH_SEGMENTS = 8
"""Segments with markers, from which single places are believed: part of a body may fit other parts in another size."""

SURE_PLACES = 0.75
"""Misfit up to which places say where joints lie."""

PLACES_BEYOND_DOUBT, PLACES_DOUBTFUL = 0.4, 0.5
"""Misfit up to which no motion contradicts places, and few markers are enough; and from which it may, and they are not.
Of people in sets that are not known nearly all pairs are right, also of legs alone, which have .1 to .4. People with
markers anywhere on their limbs have .44 and more, of whose pairs 70 % and more are right."""

SET_FITS, PLACES_FIT_BETTER = 0.4, 0.6
"""By how much a set's misfit may be larger than that of places and the set be worn, and from where it is not: people
whose set is known have .5 and less, others up to 1.4."""

PLACES_BORNE_OUT, PLACES_NOT_BORNE_OUT = 0.9, 0.82
"""Part of the pairs on one segment that motion does not contradict: animals and wrong places have .5 to .79."""


@dataclass(frozen=True, eq=False)
class Believed:
    """What markers are taken for: those of a set, or those at usual places.

    Attributes
    ----------
    match : Match
        How they fit.
    worn : WornSet
        The set, or all places.
    belief : float
        How far to believe it, 0 to 1.
    single : float
        How far to believe it of single markers that fit well, 0 to 1.
    """

    match: Match
    worn: WornSet
    belief: float
    single: float = 0.0


@dataclass(frozen=True, eq=False)
class Wear:
    """What a person seems to wear.

    Attributes
    ----------
    sets : tuple of Believed
        Ways to take markers for those of sets, the best first; beliefs add to that in the surest, less by how
        much worse it fits than the best.
    places : Believed or None
        Usual places; none if there are too few markers to tell.
    doubt : float
        How far places speak instead of sets, as they fit better, 0 to 1.
    """

    sets: tuple[Believed, ...]
    places: Believed | None
    doubt: float

    @property
    def share(self) -> float:
        """Weight of the places as a whole; the sets have the rest."""
        return self.doubt * self.places.belief if self.places is not None else 0.0

    def of_places(self, n_markers: int) -> Floats:
        """Return the weight of what places say of each two markers, shape (n_markers, n_markers).

        Single places speak where sets do not.

        Parameters
        ----------
        n_markers : int
            Of the take.
        """
        if self.places is None:
            return np.zeros((n_markers, n_markers))
        single = np.maximum(_belief_in_pairs(self.places, n_markers) - self.share, 0.0)
        return np.asarray(self.share + (1.0 - sum(reading.belief for reading in self.sets)) * single)


def _belief_in_pairs(places: Believed, n_markers: int) -> Floats:
    """How far to believe in the places of each two markers, shape (n_markers, n_markers): more where both fit well."""
    fits, segments = np.zeros(n_markers), places.worn.segments[places.match.of_set]
    counts = np.where(np.isin(segments, _sure_segments()), SURE_COUNTS, 1.0)
    fits[places.match.markers] = part_of(counts * places.match.misfits, PLACE_FITS, PLACE_DOES_NOT)
    return np.maximum(places.belief, places.single * np.minimum(fits[:, np.newaxis], fits))


def worn_odds(positions: Floats, by_motion: Floats) -> Floats:
    """Return the log odds that two markers share a limb by what is worn, shape (n_markers, n_markers).

    A set speaks unless places fit much better: then these do, as far as motion bears them out.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds by what each pair does.
    """
    odds, worn = np.zeros(by_motion.shape), believed_wear(positions, by_motion)
    if worn is None:
        return odds
    for reading in worn.sets:
        odds += reading.belief * _pair_odds(reading, len(by_motion))
    sure = float(part_of(worn.sets[0].match.misfit, BEYOND_DOUBT, DOUBTFUL)) * (1.0 - worn.doubt)
    odds *= (1.0 - worn.share) * (1.0 + (SURER - 1.0) * sure)
    if worn.places is not None:
        odds += worn.of_places(len(by_motion)) * _odds_of_places(shape_of(positions), worn.places, by_motion)
        odds += MIRRORED * worn.places.belief * (_of_mirror_images(worn.places.match, by_motion) - by_motion)
    return odds


def believed_wear(
    positions: Floats,
    by_motion: Floats,
    belief_in: Callable[[Match, WornSet, Floats], float] = belief_in_set,
) -> Wear | None:
    """Return what a person seems to wear, or None if all sets have far more or fewer markers.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds that two markers share a limb, which bear out what is worn or contradict it.
    belief_in : callable, optional
        Says of a match, a set and these log odds how far to believe the set, 0 to 1.
    """
    best = nearest_set(positions)
    if best is None:
        return None
    places, near = believed_places(positions, by_motion), readings(positions)
    beliefs = np.array([belief_in(match, worn, by_motion) for _, match, worn in near])
    likely = np.array([weight for weight, *_ in near]) * beliefs
    if likely.any():  # motion chooses among readings that fit nearly alike
        behind = np.exp([(best[0].misfit - match.misfit) / NEARLY for _, match, _ in near])
        likely *= (behind * beliefs).max() / likely.sum()
    sets = tuple(Believed(match, worn, belief) for belief, (_, match, worn) in zip(likely.tolist(), near, strict=True))
    return Wear(sets, places, _doubt(best[0], places.match) if places is not None else 0.0)


def _doubt(of_set: Match, places: Match) -> float:
    """How far to believe in places instead of a set, 0 to 1, from how much better they fit."""
    return 1.0 - float(part_of(of_set.misfit - places.misfit, SET_FITS, PLACES_FIT_BETTER))


def worn_set(positions: Floats) -> tuple[Match, WornSet] | None:
    """Return the set that is worn and how markers fit it; None if none is believed in full, or places fit much better.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    best = nearest_set(positions)
    if best is None or best[0].misfit > WORN:
        return None
    places = places_by_distances(positions)
    return best if places is None or _doubt(best[0], places.match) < 1.0 else None


def sure_places(positions: Floats) -> tuple[Match, WornSet] | None:
    """Return the usual places at which markers are and how they fit, or None if they do not fit so well beyond doubt.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    places = places_by_distances(positions) if positions.shape[1] >= ENOUGH_MARKERS else None
    return (places.match, places.worn) if places is not None and places.match.misfit < SURE_PLACES else None


@once_for_frames
def places_by_distances(positions: Floats) -> Believed | None:
    """Return the usual places that fit best by distances alone, as for `believed_places`.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    return believed_places(positions, np.zeros((positions.shape[1], positions.shape[1])))


def believed_places(positions: Floats, by_motion: Floats) -> Believed | None:
    """Return the usual places that fit markers best, or None if there are too few markers to tell, or no set is near.

    Parameters
    ----------
    positions, by_motion
        As for `believed_wear`.
    """
    sets = fitting_sets(positions)
    if not sets or len(by_motion) < LEAST_OF_HALF:
        return None
    match, places = nearest_places(shape_of(positions), sets[:STARTS], by_motion)
    beyond_doubt = part_of(match.misfit, PLACES_BEYOND_DOUBT, PLACES_DOUBTFUL)
    agreed = agreement(match, places, by_motion)
    borne_out = np.maximum(part_of(agreed, PLACES_BORNE_OUT, PLACES_NOT_BORNE_OUT), beyond_doubt)
    if len(by_motion) < ENOUGH_MARKERS:
        return Believed(match, places, float(beyond_doubt * borne_out))
    some = part_of((match.misfits < WELL).sum() / len(by_motion), SOME_FIT, NONE_FIT)
    found = Believed(match, places, float(part_of(match.misfit, AT_PLACES, NOT_AT_PLACES) * borne_out), float(some))
    return found if len(segments_of(found)) >= ENOUGH_SEGMENTS else replace(found, single=0.0)


def segments_of(places: Believed) -> set[str]:
    """Return the names of the segments that markers are taken to be on."""
    return set(np.array(usual_person(EVERY_PLACE).limb_names)[places.worn.segments[places.match.of_set]].tolist())


def _of_mirror_images(match: Match, by_motion: Floats) -> Floats:
    """Log odds by motion of the mirror image of each pair; of the pair itself where a marker has no mirror image."""
    mirrored = mirror_images()
    marker_at = np.full(len(mirrored), -1)
    marker_at[match.of_set] = match.markers
    image = np.full(len(by_motion), -1)
    image[match.markers] = marker_at[mirrored[match.of_set]]
    has_image = image >= 0
    known = has_image[:, np.newaxis] & has_image & (by_motion[np.ix_(image, image)] != 0)
    return np.where(known, by_motion[np.ix_(image, image)], by_motion)


def _pair_odds(believed: Believed, n_markers: int) -> Floats:
    """The log odds that two markers share a limb, if what they are taken for is true, (n_markers, n_markers)."""
    match, segments = believed.match, believed.worn.segments[believed.match.of_set]
    odds, fits = np.zeros((n_markers, n_markers)), part_of(match.misfits, MARKER_FITS, MARKER_DOES_NOT)
    signs = np.where(segments[:, np.newaxis] == segments, STRENGTH, -STRENGTH)
    odds[np.ix_(match.markers, match.markers)] = signs * np.minimum(fits[:, np.newaxis], fits)
    np.fill_diagonal(odds, 0.0)
    return odds


def _odds_of_places(shape: Shape, places: Believed, by_motion: Floats) -> Floats:
    """The log odds that two markers share a limb by their places, (n_markers, n_markers).

    Places that part two markers count half, more where the other places at which either may be part them, too, and
    most where both fit well.
    """
    odds = PART_OF_PLACES * _pair_odds(places, len(by_motion))
    parted = odds < 0
    odds[parted] = np.minimum(OF_PARTING * odds, segment_odds(shape, places.match, by_motion))[parted]
    odds[parted] *= (1.0 + (SURELY_PARTED - 1.0) * _fit_well(places.match, len(odds)))[parted]
    return odds


def _fit_well(match: Match, n_markers: int) -> Floats:
    """How far both markers of each pair fit well, and all do, 0 to 1, shape (n_markers, n_markers)."""
    of_marker, of_all = zip(PARTED_WELL, NOT_WELL, strict=True)
    fits = np.zeros(n_markers)
    fits[match.markers] = part_of(match.misfits, *of_marker) * part_of(match.misfit, *of_all)
    return np.asarray(np.minimum(fits[:, np.newaxis], fits))


@cache
def _sure_segments() -> Ints:
    """The numbers of `SURE_SEGMENTS`."""
    return np.flatnonzero(np.isin(usual_person(EVERY_PLACE).limb_names, SURE_SEGMENTS))
