"""Markers matched with usual places on the body, so that all distances fit best.

The 153 places are those of all sets together, and their usual distances to each other are learned as those of sets are
(``tables/worn_places.npz``, made by tests/benchmarks/learn_sets.py), from people in any posture, whose markers miss
their places as those of different examiners do (Della Croce et al., Gait & Posture 21 (2005) 226-237). A search begins
with the sets that fit best. A place that is taken on one side is likely taken on the other, and markers on one segment
move as one limb.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from skelgen._kernels.distance_statistics import MOTION_WEIGHT
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.people import EVERY_PLACE, worn_markers
from skelgen.stages.limbs.worn_sets import WITHOUT_PARTNER, Match, misfits_of
from skelgen.stages.limbs.worn_shapes import Shape, WornSet

ROUNDS = 12
"""Of a search from each beginning."""

WIDE = 0.5
"""Weight of the spread of a place's distances as a cost: a place with wide spreads fits any marker."""

ONE_SIDED = 0.2
"""Cost of a place that is taken while its mirror image is free."""

MOTION_COUNTS = 0.5
"""Part of its log odds that a pair on one segment counts: what pairs do depends on each other."""


@cache
def worn_places() -> WornSet:
    """Return the shape of all places at once."""
    with np.load(Path(__file__).with_name("tables") / "worn_places.npz") as table:
        mean, spread = (Shape(*table[name].astype(np.float64)) for name in ("mean", "spread"))
        return WornSet(EVERY_PLACE, mean, spread, table["segments"].astype(np.intp), tuple(table["markers"].tolist()))


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
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    best, visited = None, set()
    for match, worn in sets:
        markers, taken = match.markers, _places_of(worn)[match.of_set]
        for _ in range(ROUNDS):
            matched = markers.tobytes() + taken.tobytes()
            if matched in visited:  # another search went on from here, or this one stands still
                break
            visited.add(matched)
            misfits, costs = misfits_and_costs(shape, markers, taken, by_motion)
            cost = float(costs[markers, taken].mean())
            if best is None or cost < best[0]:
                best = cost, markers, taken, misfits[markers, taken]
            markers, taken = linear_sum_assignment(costs)
    assert best is not None
    _, markers, taken, misfits = best
    left_over = WITHOUT_PARTNER * (1.0 - len(markers) / len(shape.distances))
    return Match(markers, taken, misfits, float(misfits.mean()) + left_over), worn_places()


def misfits_and_costs(shape: Shape, markers: Ints, taken: Ints, by_motion: Floats) -> tuple[Floats, Floats]:
    """Return the misfit of each marker's distances at each place, and the whole cost, shapes (n_markers, n_places).

    Parameters
    ----------
    shape : Shape
        Of the take.
    markers, taken : ndarray of intp, shape (n_matched,)
        Markers to which distances are compared, and the places that they are taken for.
    by_motion : ndarray, shape (n_markers, n_markers)
        Log odds that two markers share a limb by what each pair does.
    """
    places = worn_places()
    others = max(len(taken) - 1, 1)
    misfits = misfits_of(shape, places, markers, taken)
    costs = misfits + _wide()[:, taken].sum(axis=1) / others
    alike = places.segments[taken, np.newaxis] == places.segments
    costs -= 2.0 * MOTION_COUNTS * by_motion[:, markers] @ alike / others
    return misfits, costs + ONE_SIDED * ~np.isin(mirror_images(), taken)


@cache
def _wide() -> Floats:
    """Cost of the spread of the distances of each place, shape (n_places, n_places)."""
    spread = worn_places().spread
    wide = 2.0 * np.log(spread.distances) + 2.0 * MOTION_WEIGHT * np.log(spread.motions)
    return np.asarray(WIDE * np.nan_to_num(wide - np.nanmedian(wide)))


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
