"""Markers matched with those of a set, so that all distances fit best, in the posture that a person takes.

A search begins with one marker that is taken for one of the set and goes on with the usual distances of the set. These
are those of people in all postures, and one who holds both arms out is far from all of them at once; what posture and
proportions do is fitted then, at first to the few markers that fit best, as a trimmed fit is (Chetverikov et al., Image
and Vision Computing 23 (2005) 299-309): legs that are right say how arms are held, though arms were mistaken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from skelgen._kernels.distance_statistics import misfits_to_set, own_misfits, precision_of
from skelgen.model.arrays import Floats, Ints, Singles
from skelgen.stages.limbs.postures import Assumed, above_diagonal, median_of_known
from skelgen.stages.limbs.worn_shapes import Shape, WornSet

START_WEIGHT = 2.0
"""How much the distances to one pair of markers count beside the outlines, at the beginning of a search."""

SEARCHES, ROUNDS = 6, 6
"""Beginnings that are tried for each set, and rounds of each."""

WITHOUT_PARTNER = 2.0
"""Cost of a marker of the take, or of the set, that has no partner."""


@dataclass(frozen=True)
class Rounds:
    """Rounds of a search for a posture.

    Attributes
    ----------
    parts : tuple of float
        Part of the markers, the best fitting ones, by which posture and assignment are found in each round.
    is_careful : bool
        Whether it counts, too, how well these know the posture of the others: then arms are told by their own
        distances as long as only legs are trusted. Other searches reach the same sooner, or nothing.
    """

    parts: tuple[float, ...]
    is_careful: bool = False


INLIER_SHARES = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0, 1.0)
PLAIN, CAREFUL = Rounds(INLIER_SHARES), Rounds(INLIER_SHARES, is_careful=True)
"""Searches that begin with what a search by usual distances has ended with."""

LEAST_INLIERS = 10
"""Markers."""

SURE = 0.8
"""Misfit in a posture below which no other reading is looked for."""

Beside = Callable[[Ints, Ints], Floats]
"""What markers that are matched, and what they are taken for, say beside misfits: see `PostureSearch`."""


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


def matches(shape: Shape, worn: WornSet, n_searches: int = SEARCHES) -> Iterator[Match]:
    """Assign markers to those of a set so that their distances fit best; yield where each search ends that is new.

    Each begins with one marker that is taken for one of the set, and goes on as the assignment of all that suits the
    last one.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    n_searches : int, optional
        Beginnings that are tried.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    outlines, visited = _outline_misfits(shape, worn.mean), set()
    for pair in np.argsort(outlines, axis=None)[: n_searches * 2 : 2].tolist():
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
            ways.append(_match(markers, taken, misfits[markers, taken], sum(misfits.shape)))
            markers, taken = linear_sum_assignment(misfits)
        if ways:
            yield min(ways, key=lambda one: one.misfit)


def _match(markers: Ints, taken: Ints, misfits: Floats, n_both: int) -> Match:
    """Markers as those of a set, with what the ones of both that are left over cost."""
    left_over = WITHOUT_PARTNER * (1 - 2 * len(markers) / n_both)
    return Match(markers, taken, misfits, float(misfits.mean()) + left_over)


def misfits_of(shape: Shape, worn: WornSet, markers: Ints, of_set: Ints) -> Singles:
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
    first, second = above_diagonal(len(markers))
    usual = worn.mean.distances[of_set[first], of_set[second]]
    size = median_of_known(shape.distances[markers[first], markers[second]] - usual)
    taken = shape.tables - np.array([size, 0.0], dtype=np.float32)[:, np.newaxis, np.newaxis]
    return misfits_to_set(taken, worn.mean.tables, worn.spread.precision, markers, of_set)


class PostureSearch:
    """Searches for the assignment that fits best in the posture of a person; rounds that repeat are found once.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    without_partner : float
        Cost of a marker of the take that is none of the set.
    beside : callable, optional
        Says of matched markers and what they are taken for what each marker of the set costs for each of the take
        beside its misfit, shape (n_markers, n_of_set).
    """

    def __init__(self, shape: Shape, worn: WornSet, without_partner: float, beside: Beside | None = None) -> None:
        self._shape, self._take, self._worn = shape, shape.tables, worn
        self._without_partner, self._beside = without_partner, beside
        self._rounds: dict[tuple[bytes, bytes, bool, bool], _Round] = {}

    def end(
        self, start: Match, rounds: Rounds = PLAIN, before: tuple[Match, float] | None = None
    ) -> tuple[Match, float]:
        """Return the best assignment that is found from another one, in the posture of the best fitting markers.

        Parameters
        ----------
        start : Match
            Where a search by usual distances, or another one of these, ended.
        rounds : Rounds
            Which share of the markers each round is based on.
        before : tuple of Match and float, optional
            What another search found: it is returned where this one finds nothing better.

        Returns
        -------
        match : Match
            The assignment; the misfit counts markers of the take without a partner.
        cost : float
            The mean cost of a marker of the take.
        """
        found = best = _Round(start.markers, start.of_set, start.misfits, np.inf)
        for part in rounds.parts:
            inliers = np.argsort(found.misfits, kind="stable")[: max(LEAST_INLIERS, round(part * len(found.misfits)))]
            markers, of_set = found.markers[inliers], found.of_set[inliers]
            found = self._once(markers, of_set, part == 1.0, rounds.is_careful and part < 1.0)
            best = min(best, found, key=_cost)
        n_markers = self._take.shape[1]
        if before is not None and best.cost / n_markers >= before[1]:
            return before
        own = self._own_misfits(best.markers, best.of_set)
        misfit = float(own.sum()) + self._without_partner * (n_markers - len(best.markers))
        return Match(best.markers, best.of_set, own, misfit / n_markers), best.cost / n_markers

    def _own_misfits(self, markers: Ints, of_set: Ints) -> Floats:
        mean = _assumed(self._shape, self._worn, markers, of_set).mean(of_set)
        return own_misfits(self._take, mean, self._worn.postures.precision, markers, of_set)

    def _once(self, markers: Ints, of_set: Ints, is_last: bool, is_careful: bool) -> _Round:
        """What `_round` returns, kept for other searches that come to the same."""
        key = markers.tobytes(), of_set.tobytes(), is_last, is_careful
        if key not in self._rounds:
            self._rounds[key] = self._round(markers, of_set, is_last, is_careful)
        return self._rounds[key]

    def _round(self, markers: Ints, of_set: Ints, is_last: bool, is_careful: bool) -> _Round:
        """The assignment that fits best in the posture of some markers; in the last rounds some may have no partner."""
        take, postures = self._take, self._worn.postures
        assumed = _assumed(self._shape, self._worn, markers, of_set)
        precision = precision_of(assumed.spread) if is_careful else postures.precision
        costs: Floats | Singles = misfits_to_set(take, assumed.mean(of_set), precision, markers, of_set)
        costs = costs + _mean_cost(assumed.widening, of_set) if is_careful else costs
        costs = costs if self._beside is None else costs + self._beside(markers, of_set)
        markers, of_set = _assigned(costs, self._without_partner if is_last else np.inf)
        misfits = own_misfits(take, assumed.mean(of_set), postures.precision, markers, of_set)
        besides = 0.0 if self._beside is None else float(self._beside(markers, of_set)[markers, of_set].sum())
        cost = float(misfits.sum()) + besides + self._without_partner * (take.shape[1] - len(markers))
        if is_careful:
            misfits = own_misfits(take, assumed.mean(of_set), precision, markers, of_set)
            misfits += _mean_cost(assumed.widening, of_set)[of_set]
        return _Round(markers, of_set, misfits, cost)


class _Round(NamedTuple):
    """An assignment, the misfits by which the next round chooses among its markers, and the cost of all of the take."""

    markers: Ints
    of_set: Ints
    misfits: Floats
    cost: float


def _cost(found: _Round) -> float:
    return found.cost


def _mean_cost(of_pairs: Floats, of_set: Ints) -> Floats:
    """The mean of the costs of the pairs of each marker of a set and those that are matched, shape (n_of_set,)."""
    return np.asarray(of_pairs[of_set].sum(axis=0) / max(len(of_set) - 1, 1))


def _assigned(costs: Floats | Singles, without_partner: float) -> tuple[Ints, Ints]:
    """The assignment of least cost, where markers of the take may have no partner at some cost."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    n_of_set = costs.shape[1]
    if without_partner < np.inf:
        costs = np.concatenate([costs, np.full((len(costs), len(costs)), without_partner)], axis=1)
    markers, of_set = linear_sum_assignment(costs)
    return markers[of_set < n_of_set], of_set[of_set < n_of_set]


def misfits_in_posture(shape: Shape, worn: WornSet, markers: Ints, of_set: Ints) -> Singles:
    """Return what `misfits_of` does, in the posture that suits the matched markers best.

    Parameters
    ----------
    shape, worn, markers, of_set
        As for `misfits_of`.
    """
    mean = _assumed(shape, worn, markers, of_set).mean(of_set)
    return misfits_to_set(shape.tables, mean, worn.postures.precision, markers, of_set)


def _assumed(shape: Shape, worn: WornSet, markers: Ints, of_set: Ints) -> Assumed:
    """What `Postures.assumed` returns, found once for the same markers: searches come to them again."""
    return Assumed(*_posture(shape, worn, markers.tobytes(), of_set.tobytes()), worn.postures)


@lru_cache(maxsize=1024)
def _posture(shape: Shape, worn: WornSet, markers: bytes, of_set: bytes) -> tuple[Floats, Singles]:
    """The posture, and what is known of it; without the distances in it, which are many."""
    pairs = (np.frombuffer(one, dtype=np.intp) for one in (markers, of_set))
    found = worn.postures.assumed(shape.tables, *pairs)
    return found.posture, found.information


def _outline_misfits(one: Shape, other: Shape) -> Floats:
    """Difference of the outlines of each marker of one shape and each of the other."""
    off = one.outlines[:, np.newaxis] - other.outlines
    return np.asarray(np.einsum("ijk,ijk->ij", off, off))
