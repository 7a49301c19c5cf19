r"""How markers move within a group, and how two groups move against each other, beside what a rigid body explains.

Markers are aligned to their mean shape in every frame. Of their 3 n residual coordinates a rigid body's displacements
take six; the others are the *inner* coordinates of the group. The rigid displacements of two parts of it span some of
these, at most six: the *relative motion* of the parts. With an orthonormal basis Q of either,

.. math::
    c_f = Q^\top r_f, \qquad \operatorname{cov}(c) = Q^\top \operatorname{diag}(\sigma_i^2)\, Q \quad\text{in one body},

and larger if there are two. The same holds for parts of one marker (three displacements) and two (five), so that every
size of limb has its test.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from skelgen._kernels import relative_motion as kernels
from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.statistics import median_of_known, pair_lengths
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames

TEST_FRAMES = 150
"""Frames from which one motion is estimated: soft tissue and joints are slow, more frames would repeat each other."""

ENOUGH_FRAMES = 30
"""Sampled frames below which the whole take is asked for frames that show the markers."""

LEAST_FRAMES = 8
"""Fewer frames say nothing of a motion."""

SEEN_PART = 0.75
"""A frame counts if it shows this part of the markers, and three at least."""

KEPT_PART = 0.95
"""Part of the frames, those with the smallest motion, that count: a label that jumps is no joint."""

RANK_TOLERANCE = 0.05
"""Of the largest singular value; a displacement that moves the markers less is none (markers on one line)."""

AT_ONCE = 1_000_000
"""Coordinates of markers that are measured at once: many small groups take one pass, and memory stays small."""

DISTANCE_FRAMES = 30
"""Frames from which usual distances are told."""

LOOKED_AT = 200
"""Frames from which white noise is told, each with the two that follow it."""

STEPS = (1.0, -2.0, 1.0)
"""Weights of three frames in a second difference."""

MEDIAN_OF_SQUARE = 0.455
"""Of a normal variable, beside its variance."""

Group = tuple[int, ...]
"""Indices of markers, rising."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariance of some coordinates of the residuals of a group, or of many groups that have as many of each.

    Attributes
    ----------
    covariance : ndarray, shape (..., k, k), mm^2
        Covariance of the k coordinates.
    basis : ndarray, shape (..., 3 n_markers, k)
        The coordinates, orthonormal, in those of the markers.
    markers : ndarray of intp, shape (..., n_markers)
        The markers.
    radius : ndarray, shape (...), mm
        Root mean square distance of the markers from their middle.
    """

    covariance: Floats
    basis: Floats
    markers: Ints
    radius: Floats

    def of(self, index: int) -> Spread:
        """Return the spread of one of many groups."""
        return Spread(self.covariance[index], self.basis[index], self.markers[index], self.radius[index])

    def ratios(self, variances: Floats) -> Floats:
        """Principal variances in units of what the noise `variances` [mm^2] of all markers explains, shape (..., k)."""
        noise = np.repeat(variances[self.markers], 3, axis=-1)
        root = np.linalg.cholesky(np.swapaxes(self.basis, -1, -2) @ (noise[..., np.newaxis] * self.basis))
        half = np.linalg.solve(root, self.covariance)
        return np.asarray(np.linalg.eigvalsh(np.linalg.solve(root, np.swapaxes(half, -1, -2))))


class _Asked(NamedTuple):
    """What to measure: the inner coordinates of some markers, or the relative motion of two parts of them.

    Attributes
    ----------
    markers : tuple of int
        The markers, those of the first part first.
    n_first : int
        Markers of the first part; 0 for inner coordinates.
    """

    markers: Group
    n_first: int = 0


def white_noise(groups: Ints, whole: Floats) -> float:
    """Variance [mm^2] of a coordinate by second differences of distances within limbs, of which soft tissue has few.

    Parameters
    ----------
    groups : ndarray of intp, shape (n_markers,)
        Rigid group of each marker; -1 for those in none.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm
        All frames; NaN where unseen.
    """
    if len(whole) < len(STEPS):
        return 0.0
    first, second = pairs_within(groups)
    frames = spread_frames(len(whole) - 2, LOOKED_AT)
    shown = [whole[frames + step] for step in range(len(STEPS))]
    gaps = (np.linalg.norm(one[:, first] - one[:, second], axis=2) for one in shown)
    squares = sum(step * gap for step, gap in zip(STEPS, gaps, strict=True)) ** 2 / np.dot(STEPS, STEPS)
    return float(np.nanmedian(squares)) / MEDIAN_OF_SQUARE / 2 if np.isfinite(squares).any() else 0.0


def pairs_within(groups: Ints) -> tuple[Ints, Ints]:
    """Both markers of each pair in one group; markers in none (-1) are in no pair."""
    first, second = np.nonzero(np.triu((groups[:, np.newaxis] == groups) & (groups >= 0), 1))
    return first, second


def _of_pair(one: Group, other: Group) -> _Asked:
    """Ask for the relative motion of two groups, the same in either order."""
    first, second = min(one, other), max(one, other)
    return _Asked(first + second, len(first))


class Movements:
    """The markers of a take, asked for their inner and relative motions; answers are kept.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    frames : ndarray of intp
        Sampled frames; markers that they do not show together are looked for in all frames.
    """

    def __init__(self, positions: Floats, frames: Ints) -> None:
        self._all = positions
        self._sampled = positions[frames]
        self._sampled_seen: Bools = ~np.isnan(self._sampled[:, :, 0])
        self._known: dict[_Asked, Spread | None] = {}

    @property
    def seen_part(self) -> Floats:
        """Part of the sampled frames that shows each marker, shape (n_markers,)."""
        return np.asarray(self._sampled_seen.mean(axis=0))

    @cached_property
    def distances(self) -> Floats:
        """Usual distances of markers [mm], shape (n_markers, n_markers).

        They are 1 on the diagonal and where two are one, and the largest of all where two are never seen together.
        """
        shown = self._sampled[spread_frames(len(self._sampled), DISTANCE_FRAMES)]
        squares = np.zeros((shown.shape[1],) * 2)
        first, second = np.triu_indices(len(squares), 1)
        usual = median_of_known(pair_lengths(shown, first, second).T ** 2)
        squares[first, second] = squares[second, first] = usual
        known = np.nan_to_num(squares, nan=np.nanmax(squares, initial=1.0))
        return np.asarray(np.sqrt(np.maximum(known, 1.0)), dtype=np.float64)

    def while_seen(self, marker: int) -> Movements:
        """Return the movements in the sampled frames that show a marker."""
        shown = self._sampled[self._sampled_seen[:, marker]]
        return Movements(shown, np.arange(len(shown)))

    def inner(self, group: Group) -> Spread | None:
        """Return the spread of the inner coordinates of two markers or more; None if too few frames show them."""
        return self._found(_Asked(group))

    def inner_of_each(self, groups: Iterable[Group]) -> list[Spread | None]:
        """Return `inner` of some groups, found at once."""
        asked = [_Asked(group) for group in groups]
        self._find(asked)
        return [self._known[one] for one in asked]

    def all_inner(self, groups: list[Group]) -> Iterator[tuple[Ints, Spread]]:
        """Return `inner` of many groups: index arrays of groups with the same number of coordinates, and their spreads.

        Groups that too few frames show are in none of them. Nothing is kept, as it may be large.
        """
        return self._spreads([_Asked(group) for group in groups])

    def relative(self, first: Group, second: Group) -> Spread | None:
        """Return the spread of the relative motion of two groups; None if too few frames show both.

        Parameters
        ----------
        first, second : tuple of int
            Markers of both groups.
        """
        return self._found(_of_pair(first, second))

    def measure(self, pairs: Iterable[tuple[Group, Group]]) -> None:
        """Find the inner and relative motions of many pairs of groups at once; `inner` and `relative` then have them.

        Parameters
        ----------
        pairs : iterable of tuple of two groups
            Which; `inner` is found of groups of two markers or more.
        """
        both = list(pairs)
        self._find([_of_pair(*pair) for pair in both])
        self._find([_Asked(group) for pair in both for group in pair if len(group) > 1])

    def bendings(self, groups: Iterable[Group], noise: float) -> list[float]:
        """Return how much groups bend beyond white noise, each as a part of its radius.

        Parameters
        ----------
        groups : iterable of Group
            Of two markers or more; those that too few frames show have none.
        noise : float, mm^2
            Variance of the white noise of a coordinate.
        """
        spreads = [spread for spread in self.inner_of_each(groups) if spread is not None and spread.radius > 0]
        variances = [float(np.trace(spread.covariance)) / len(spread.covariance) - noise for spread in spreads]
        return [float(np.sqrt(max(one, 0.0)) / spread.radius) for one, spread in zip(variances, spreads, strict=True)]

    def white_noise(self, groups: Ints) -> float:
        """Return the variance [mm^2] of a coordinate by white noise, as the function `white_noise` does."""
        return white_noise(groups, self._all)

    def distance(self, marker: int, others: Group) -> float:
        """Return the usual distance [mm] of a marker from the nearest of some others; infinite if none is seen with it.

        Parameters
        ----------
        marker : int
            The marker.
        others : tuple of int
            The others.
        """
        common = self._sampled_seen[:, list(others)] & self._sampled_seen[:, [marker]]
        gaps = [
            float(np.median(np.linalg.norm(self._sampled[both, other] - self._sampled[both, marker], axis=1)))
            for other, both in zip(others, common.T, strict=True)
            if both.any()
        ]
        return min(gaps, default=np.inf)

    def _found(self, asked: _Asked) -> Spread | None:
        if asked not in self._known:
            self._find([asked])
        return self._known[asked]

    def _find(self, asked: list[_Asked]) -> None:
        """Find and keep the spreads of what is not known yet; None where too few frames show the markers."""
        new = [one for one in dict.fromkeys(asked) if one not in self._known]
        self._known.update(dict.fromkeys(new))
        for indices, spread in self._spreads(new):
            self._known.update((new[index], spread.of(place)) for place, index in enumerate(indices.tolist()))

    def _spreads(self, asked: list[_Asked]) -> Iterator[tuple[Ints, Spread]]:
        """Measure what is asked for; yields spreads of equal size together, with the indices of what they answer."""
        alike: dict[tuple[int, int, bool], list[tuple[int, Ints]]] = {}
        for index, one in enumerate(asked):
            frames, are_sampled = self._frames_of(one.markers)
            if len(frames) >= LEAST_FRAMES:
                alike.setdefault((len(one.markers), one.n_first, are_sampled), []).append((index, frames))
        for (n_markers, n_first, are_sampled), members in alike.items():
            most = max(1, AT_ONCE // (3 * n_markers * max(len(frames) for _, frames in members)))
            for start in range(0, len(members), most):
                some = members[start : start + most]
                indices = np.array([index for index, _ in some], dtype=np.intp)
                markers = np.array([asked[index].markers for index in indices.tolist()], dtype=np.intp)
                n_frames, frames = [len(frames) for _, frames in some], np.concatenate([frames for _, frames in some])
                where = frames[:, np.newaxis], np.repeat(markers, n_frames, axis=0)
                places = (self._sampled if are_sampled else self._all)[where]
                for chosen, spread in _spreads_of(places, _spans(n_frames), markers, n_first):
                    yield indices[chosen], spread

    def _frames_of(self, markers: Group) -> tuple[Ints, bool]:
        """Frames that show most of some markers, and whether these are indices into the sampled frames or into all."""
        return self._of_any if self._is_complete else self._frames_with(markers)

    @cached_property
    def _of_any(self) -> tuple[Ints, bool]:
        return self._frames_with((0,))

    @cached_property
    def _sampled_rows(self) -> Bools:
        """Which sampled frames show each marker, shape (n_markers, n_sampled): rows are added up in one go."""
        return np.ascontiguousarray(self._sampled_seen.T)

    @cached_property
    def _all_rows(self) -> Bools:
        return np.ascontiguousarray(~np.isnan(self._all[:, :, 0]).T)

    @cached_property
    def _is_complete(self) -> bool:
        return not np.isnan(self._all).any()

    def _frames_with(self, markers: Group) -> tuple[Ints, bool]:
        frames = self._frames_that_show(markers, self._sampled_rows)
        are_sampled = len(frames) >= ENOUGH_FRAMES
        if not are_sampled:
            frames = self._frames_that_show(markers, self._all_rows)
        return (frames[_test_places(len(frames))] if len(frames) > TEST_FRAMES else frames), are_sampled

    def _frames_that_show(self, markers: Group, seen: Bools) -> Ints:
        """Those of the frames that show most of some markers; `seen` has a row for each marker."""
        needed = max(min(3, len(markers)), int(np.ceil(SEEN_PART * len(markers))))
        return np.flatnonzero(seen[list(markers)].sum(axis=0, dtype=np.int16) >= needed)


@cache
def _test_places(n_frames: int) -> Ints:
    """Places of `TEST_FRAMES` frames, spread over so many."""
    return np.linspace(0, n_frames - 1, TEST_FRAMES).astype(np.intp)


def _spreads_of(places: Floats, spans: Ints, markers: Ints, n_first: int) -> Iterator[tuple[Ints, Spread]]:
    """Spreads of many groups; yields those with as many coordinates together, and the indices of their groups.

    Parameters
    ----------
    places : ndarray, shape (n_rows, n_markers, 3), mm
        The markers of each group in frames of its own, one group after the other; NaN where unseen.
    spans : ndarray of intp, shape (n_groups, 3)
        See `_spans`.
    markers : ndarray of intp, shape (n_groups, n_markers)
        The markers.
    n_first : int
        Markers of the first of two parts; 0 for inner coordinates.
    """
    residuals, shapes = kernels.residuals_of_groups(places, _aligned(places, spans), spans)
    displacements, radii = kernels.displacements_of(shapes)
    for chosen, bases in _relative_bases(shapes, displacements, n_first) if n_first else _inner_bases(displacements):
        covariances = kernels.covariances_along(residuals, spans[chosen], bases)
        yield chosen, Spread(covariances, bases, markers[chosen], radii[chosen])


def _aligned(places: Floats, spans: Ints) -> Floats:
    """Poses that bring the fullest row of each group onto its others, shape (n_rows, 4, 4).

    Its noise rotates all rows alike, and small rotations are no part of the coordinates: aligning again to the mean
    changes nothing that matters.
    """
    seen = ~np.isnan(places[:, :, 0])
    count = seen.sum(axis=1)
    fullest = [first + int(count[first:end].argmax()) for first, end, _ in spans.tolist()]
    shown = np.repeat(fullest, spans[:, 1] - spans[:, 0])
    return fit_transform(places[shown], places, seen & seen[shown])


def _spans(n_frames: list[int]) -> Ints:
    """Where the frames of each group begin and end if they follow one another, and how many of them count."""
    ends = list(accumulate(n_frames))
    kept = [max(LEAST_FRAMES, round(KEPT_PART * number)) for number in n_frames]
    return np.array([*zip([0, *ends[:-1]], ends, kept, strict=True)], dtype=np.intp)


def _inner_bases(displacements: Floats) -> Iterator[tuple[Ints, Floats]]:
    """Orthonormal coordinates that no rigid displacement changes, shape (n_groups, 3 n, k), of groups of each k."""
    left, sizes, _ = np.linalg.svd(displacements, full_matrices=True)
    ranks = _ranks(sizes)
    for rank in sorted(set(ranks.tolist())):
        places = np.flatnonzero(ranks == rank)
        yield places, left[places, :, rank:]


def _relative_bases(shapes: Floats, displacements: Floats, n_first: int) -> Iterator[tuple[Ints, Floats]]:
    """Orthonormal displacements of two parts as rigid bodies that are none of the whole, as `_inner_bases`."""
    of_parts = [kernels.displacements_of(part)[0] for part in (shapes[:, :n_first], shapes[:, n_first:])]
    found = [np.linalg.svd(columns, full_matrices=False)[:2] for columns in (*of_parts, displacements)]
    ranks = np.stack([_ranks(sizes) for _, sizes in found], axis=1)
    for kinds in sorted(set(map(tuple, ranks.tolist()))):
        places = np.flatnonzero((ranks == kinds).all(axis=1))
        first, second, whole = (left[places, :, :rank] for (left, _), rank in zip(found, kinds, strict=True))
        parts = np.zeros((len(places), whole.shape[1], kinds[0] + kinds[1]))
        parts[:, : first.shape[1], : kinds[0]] = first
        parts[:, first.shape[1] :, kinds[0] :] = second
        left, _, _ = np.linalg.svd(parts - whole @ (whole.swapaxes(1, 2) @ parts), full_matrices=False)
        yield places, left[:, :, : parts.shape[2] - kinds[2]]


def _ranks(sizes: Floats) -> Ints:
    """Number of singular values that count, of each group."""
    return np.asarray((sizes > RANK_TOLERANCE * sizes[:, :1]).sum(axis=1))
