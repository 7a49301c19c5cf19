"""Which marker set a person wears, by the distances of markers alone, and what that says of pairs of markers.

Where soft tissue hides a joint, as of a wrist that carries two markers and a hand that carries two more, motion does
not tell limbs apart. But people wear the sets of their field, and a set has a shape: the usual distance of each two of
its markers, and how much it varies, learned from simulated people of all sizes in natural motions
(``tables/worn_sets.npz``, made by tests/benchmarks/learn_sets.py). Markers are assigned to those of a set so that all
distances fit best. How well they do, and how few of the set's pairs move as two limbs, says how far to believe the set:
log odds that two markers share a limb, which add to what the pair itself says.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path

import numpy as np

from skelgen.model.arrays import Floats, Ints, spread_frames

LOOKED_AT = 60
"""Frames."""

LEAST_COMMON = 8
"""Frames that must show both markers."""

SHORTEST, LEAST_MOTION = 5.0, 1.0
"""mm; smaller distances and deviations of these say nothing more."""

SIZES = (0.75, 1.33)
"""Of the number of a set's markers: a take with fewer or more does not wear it."""

LARGEST = 9.0
"""Square of the most that one distance may be off, in standard deviations; some markers belong to no set."""

UNKNOWN = 2.5
"""The same for markers that are never seen together."""

MOTION_WEIGHT = 0.5
"""How much the deviation of a distance counts beside the distance."""

OUTLINE = tuple(np.linspace(0.05, 0.95, 12))
"""Quantiles of a marker's distances to all others, by which a search begins."""

OUTLINE_SPREAD = 0.15, 0.5
"""Standard deviations of these, and of those of how much the distances vary."""

START_WEIGHT = 2.0
"""How much the distances to one pair of markers count beside the outlines, at the beginning of a search."""

SEARCHES, ROUNDS = 12, 10
"""Beginnings that are tried for each set, and rounds of each."""

WITHOUT_PARTNER = 2.0
"""What markers of the take or of the set that are left over cost."""

WORN, NOT_WORN = 1.8, 2.05
"""Misfit up to which a set is believed, and from which it is not at all."""

BEYOND_DOUBT, DOUBTFUL = 0.8, 1.3
"""Misfit up to which no motion contradicts a set, and from which it may."""

MARKER_FITS, MARKER_DOES_NOT = 1.5, 3.0
"""The same for a single marker."""

CONTRADICTED = -1.0
"""Log odds of a pair by its motion, below which it contradicts a set that has both on one segment."""

AGREED, NOT_AGREED = 0.8, 0.65
"""Part of the set's pairs that are not contradicted: from the first on it is believed, below the second not at all."""

STRANGE, TOO_STRANGE = 2.3, 2.8
"""Misfit up to which a set is believed that motion bears out, and from which it is not: people take postures that no
natural motion of the simulation has. With joint angles of twice the usual size 1.8 to 2.7; animals 2.8 and more."""

BORNE_OUT, NOT_BORNE_OUT = 0.85, 0.75
"""Part of the pairs of such a set that are not contradicted: of people whose own set was left out of the table, .77 to
.87 of the pairs are right up to .79, and .96 and more from .85 on."""

STRENGTH = 6.0
"""Log odds that a set which is believed gives a pair of markers."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Of a set, or of a take.

    Attributes
    ----------
    distances, motions : ndarray, shape (n_markers, n_markers)
        Logarithms of the usual distances over their median, and of their deviations over them; NaN where unknown.
    """

    distances: Floats
    motions: Floats

    @cached_property
    def outlines(self) -> tuple[Floats, Floats]:
        """Quantiles of the distances and of the motions of each marker, shapes (n_markers, n_quantiles)."""
        return _quantiles(self.distances), _quantiles(self.motions)


@dataclass(frozen=True, eq=False)
class WornSet:
    """A marker set, as people wear it.

    Attributes
    ----------
    name : str
        What the set is called.
    mean, spread : Shape
        Of people, and the standard deviations between them.
    segments : ndarray of intp, shape (n_markers,)
        Number of the segment that carries each marker.
    markers : tuple of str, length n_markers
        What the set calls them.
    """

    name: str
    mean: Shape
    spread: Shape
    segments: Ints
    markers: tuple[str, ...]


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
    """Return all sets of about as many markers and how markers fit them, the best first.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    return _fitting_sets(shown.tobytes(), shown.shape)


@lru_cache(maxsize=4)
def _fitting_sets(shown: bytes, n: tuple[int, ...]) -> tuple[tuple[Match, WornSet], ...]:
    """The same, found once for the frames that are looked at: limbs, joints and names all ask for it."""
    shape = shape_of(np.frombuffer(shown).reshape(n))
    sizes = [(worn, n[1] / len(worn.segments)) for worn in worn_sets()]
    found = [(best_match(shape, worn), worn) for worn, size in sizes if SIZES[0] <= size <= SIZES[1]]
    return tuple(sorted(found, key=lambda one: one[0].misfit))


def markers_of_set(positions: Floats) -> tuple[str, tuple[str, ...], bool] | None:
    """Return the set that markers have the shape of, and which of its markers each is, or None if there is none.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.

    Returns
    -------
    name : str
        Of the set.
    markers : tuple of str, length n_markers
        What the set calls each; empty for those that fit none.
    is_whole : bool
        Whether all markers of the set are there and no others.
    """
    found = nearest_set(positions)
    if found is None or found[0].misfit > WORN:
        return None
    match, worn = found
    called = [""] * positions.shape[1]
    for marker, of_set, misfit in zip(match.markers.tolist(), match.of_set.tolist(), match.misfits, strict=True):
        called[marker] = worn.markers[of_set] if misfit < MARKER_DOES_NOT else ""
    return worn.name, tuple(called), len(worn.segments) == sum(map(bool, called)) == len(called)


def shape_of(positions: Floats) -> Shape:
    """Return usual distances of markers and how much they vary.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    gaps = np.sort(np.linalg.norm(shown[:, :, np.newaxis] - shown[:, np.newaxis], axis=3), axis=0)  # NaN last
    count = (~np.isnan(gaps)).sum(axis=0)
    middle = np.take_along_axis(gaps, np.maximum(count - 1, 0)[np.newaxis] // 2, axis=0)[0]
    mean = np.nansum(gaps, axis=0) / np.maximum(count, 1)
    deviation = np.sqrt(np.nansum((gaps - mean) ** 2, axis=0) / np.maximum(count, 1))
    known = (count >= min(LEAST_COMMON, len(shown))) & ~np.eye(len(count), dtype=np.bool_)
    distances = np.where(known, np.log(np.maximum(middle, SHORTEST)), np.nan)
    motions = np.log(np.maximum(deviation, LEAST_MOTION)) - distances
    return Shape(distances - (np.nanmedian(distances) if known.any() else 0.0), motions)


@cache
def worn_sets() -> tuple[WornSet, ...]:
    """Return the shapes of all sets."""
    with np.load(Path(__file__).with_name("tables") / "worn_sets.npz") as table:
        names = sorted({key.partition("/")[0] for key in table.files})
        return tuple(
            WornSet(
                name,
                Shape(*table[f"{name}/mean"].astype(np.float64)),
                Shape(*table[f"{name}/spread"].astype(np.float64)),
                table[f"{name}/segments"].astype(np.intp),
                tuple(table[f"{name}/markers"].tolist()),
            )
            for name in names
        )


def best_match(shape: Shape, worn: WornSet) -> Match:
    """Assign markers to those of a set so that their distances fit best.

    Each search begins with one marker that is taken for one of the set, and goes on as the assignment of all that suits
    the last one.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    outlines, comparison = _outline_misfits(shape, worn.mean), SetComparison(shape, worn)
    best, visited = None, set()
    for seed in np.argsort(outlines, axis=None)[: SEARCHES * 2 : 2].tolist():
        marker, of_set = divmod(seed, outlines.shape[1])
        start = outlines + START_WEIGHT * comparison.misfits(np.array([marker]), np.array([of_set]))
        start[marker] = start[:, of_set] = start.max()
        start[marker, of_set] = 0.0
        markers, taken = linear_sum_assignment(start)
        for _ in range(ROUNDS):
            matched = markers.tobytes() + taken.tobytes()
            if matched in visited:  # another search went on from here, or this one stands still
                break
            visited.add(matched)
            misfits = comparison.misfits(markers, taken)
            fit = float(misfits[markers, taken].mean())
            if best is None or fit < best[0]:
                best = fit, markers, taken, misfits[markers, taken]
            markers, taken = linear_sum_assignment(misfits)
    assert best is not None
    fit, markers, taken, misfits = best
    return Match(markers, taken, misfits, fit + WITHOUT_PARTNER * (1 - 2 * len(markers) / sum(outlines.shape)))


class SetComparison:
    """Distances of a take beside those of a set: what each marker is taken for is compared once, however often asked.

    Parameters
    ----------
    shape : Shape
        Of the take.
    worn : WornSet
        The set.
    """

    def __init__(self, shape: Shape, worn: WornSet) -> None:
        self._shape, self._worn = shape, worn
        self._compared: dict[tuple[int, int], Floats] = {}

    def misfits(self, markers: Ints, of_set: Ints) -> Floats:
        """Return the mean square of how far distances are off if a marker is one of the set, (n_markers, n_of_set).

        Parameters
        ----------
        markers, of_set : ndarray of intp, shape (n_matched,)
            Markers to which distances are compared, and what they are taken for.
        """
        pairs = list(zip(markers.tolist(), of_set.tolist(), strict=True))
        new = [pair for pair in pairs if pair not in self._compared]
        if new:
            self._compared.update(zip(new, self._squares(*np.array(new).T), strict=True))
        total = np.zeros((len(self._shape.distances), len(self._worn.segments)))
        for pair in pairs:
            total += self._compared[pair]
        return total / max(len(pairs) - 1, 1)

    def _squares(self, markers: Ints, of_set: Ints) -> Floats:
        """Squares of how far the distances to some markers are off, shape (n_compared, n_markers, n_of_set)."""
        mean, spread = self._worn.mean, self._worn.spread
        total = self._shape.distances[markers, :, np.newaxis] - mean.distances[of_set, np.newaxis]
        total /= spread.distances[of_set, np.newaxis]
        motions = self._shape.motions[markers, :, np.newaxis] - mean.motions[of_set, np.newaxis]
        motions /= spread.motions[of_set, np.newaxis]
        np.square(total, out=total)
        total += MOTION_WEIGHT * np.square(motions, out=motions)
        np.minimum(total, LARGEST, out=total)
        total[np.isnan(total)] = UNKNOWN
        every = np.arange(len(markers))
        total[every, :, of_set] = LARGEST  # where another marker is it is not
        total[every, markers] = 0.0  # and a marker says nothing of where it is itself
        return total


def _outline_misfits(one: Shape, other: Shape) -> Floats:
    """How unlike the distances to all others are, for each marker of one and each of the other."""
    total = np.zeros((len(one.distances), len(other.distances)))
    pairs = zip(one.outlines, other.outlines, OUTLINE_SPREAD, (1.0, MOTION_WEIGHT), strict=True)
    for values, means, spread, weight in pairs:
        total += weight * ((values[:, np.newaxis] - means) ** 2).mean(axis=2) / spread**2
    return total


def _quantiles(table: Floats) -> Floats:
    """The quantiles `OUTLINE` of what is known in each row, of rows without anything zeros, shape (n, n_quantiles)."""
    count = (~np.isnan(table)).sum(axis=1, keepdims=True)
    rows = np.sort(np.where(count > 0, table, 0.0), axis=1)  # NaN last
    place = np.array(OUTLINE) * np.maximum(count - 1, 0)
    below = place.astype(np.intp)
    low = np.take_along_axis(rows, below, axis=1)
    high = np.take_along_axis(rows, np.minimum(below + 1, np.maximum(count - 1, 0)), axis=1)
    return np.asarray(low + (high - low) * (place - below))


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
