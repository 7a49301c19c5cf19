r"""Group markers into clusters that move as one rigid body, as far as the noise of the take can say.

With the noise of every marker given, a cluster costs, in nats per frame,

.. math::
    \sum_k \tfrac12 (\lambda_k - 1 - \log\lambda_k)_{\lambda_k > 1} - \kappa\, d + P

over its d inner coordinates with variances :math:`\lambda_k` in units of the noise: what a rigid body fails to explain
is a cost, each coordinate that it explains a gain, each cluster a cost. Complete linkage of the distances' variances
gives a start. Clusters are then merged, parted and regrouped, and markers moved, for as long as the cost falls. Limbs
that are less rigid than the take's noise stay in several clusters; joining those is the next step (`merging`).
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.parameters import MarkerConstraints
from skelgen.stages.limbs.relative_motion import TEST_FRAMES, Group, Movements

LINKED = 5.0
"""Largest variance of a distance within a cluster at the start, in units of its noise: soft tissue is rarely beyond."""

GAIN = 0.5
"""nats for each coordinate that a rigid body explains: a width of the prior of motions 1.6 times what is observed."""

CLUSTER_COST = 0.5
"""nats."""

MERGED = 12.0
"""Largest variance of a distance between two clusters, in units of its noise, with which merging them can pay."""

MOVED = 10.0
"""The same for a marker and the cluster it might move to, which gains less."""

NEAREST = 12
"""Clusters with which one may be merged or regrouped, or to which its markers may move: in large takes of nothing but
noise all could be."""

SUSPICIOUS = 4.0
"""A marker leaves its cluster only if some inner distance varies more than this, in units of its noise."""

FITS = 2.0
"""A marker fits a cluster if no distance to it varies more than this, in units of its noise. A small cluster in which
none does is not parted: those of a limb that is its mirror image for a while, as its labels are exchanged, do not."""

FAR_NEARER = 2.0
"""Times as near as its nearest mate must all markers be of a cluster to which a marker moves that fits both."""

REGROUPED = 6
"""A cluster, or two neighbouring ones, with no more markers are regrouped in all ways: 31 of them; else in one way."""

CHANCE = 3.0
"""Standard deviations by which the logarithm of a coordinate's noise may be beyond the usual one. From .19 on all of
`GAIN` is needed: a variance that is three times the usual one is no joint then. Distances within clusters of people
have .25 and more, those of plates with white noise what the frames leave open."""

MOST_CHANGES = 500
"""Ends a search that rounding might keep going."""

NOISE_RANGE = 6.0
"""The variance of one marker's noise is at most so many times that of the take."""

FORBIDDEN = 1e9
"""nats; the cost of a cluster that is not allowed, or that no frames show: finite, so that differences stay numbers."""

TINY = 1e-9
"""nats; a smaller gain is rounding. Also mm^2."""

LOW = 0.16
"""Quantile that is one standard deviation below the middle; as many are as far above it."""


def misfit(ratios: Floats) -> Floats:
    """Return the cost [nats per frame] of coordinates whose variances are `ratios` times the noise, over the last axis.

    Parameters
    ----------
    ratios : ndarray, shape (..., k)
        Of one group or many.

    Returns
    -------
    ndarray, shape (...)
    """
    excess = np.maximum(ratios, 1.0)
    return np.asarray((excess - 1 - np.log(excess)).sum(axis=-1) / 2)


def marker_noise(variance: Floats, noise: float, margin: float) -> Floats:
    """Estimate the noise variance [mm^2] of each marker from its most rigid neighbour, shape (n_markers,).

    Parameters
    ----------
    variance : ndarray, shape (n_markers, n_markers), mm^2
        Half the variance of each distance, infinite where unknown.
    noise : float, mm^2
        Noise of the take, the least of any marker.
    margin : float
        Part of the range that is needed.
    """
    nearest = (variance + np.diag(np.full(len(variance), np.inf))).min(axis=1)
    return np.asarray(np.clip(nearest, noise, NOISE_RANGE**margin * noise))


def margin(clusters: list[Group], variance: Floats) -> float:
    """Return which part of `GAIN` and of other margins noise needs that is unlike from marker to marker, at most 1.

    Clusters that hold markers of two limbs by mistake vary more than others; of these there are few.

    Parameters
    ----------
    clusters : list of tuple of int
        Clusters that were found with all of the margins.
    variance : ndarray, shape (n_markers, n_markers), mm^2
        Half the variance of each distance, infinite where unknown.
    """
    within = np.array([variance[pair] for cluster in clusters for pair in combinations(cluster, 2)])
    known = within[np.isfinite(within)]
    if not len(known):
        return 1.0
    low, usual, high = np.quantile(np.log(np.maximum(known, TINY)) / 2, (LOW, 0.5, 1 - LOW))
    most = float(max(usual - low, high - usual)) * (1 + 2 / np.sqrt(len(known)))  # two standard errors more
    spread = np.hypot(most, 1 / np.sqrt(2 * TEST_FRAMES))
    return min(1.0, float(misfit(np.exp([2 * CHANCE * spread]))) / GAIN)


def nearest(distances: Floats, limit: float) -> Bools:
    """Return which entries of each row are within a limit and among the `NEAREST` least, beside one that is its own.

    Parameters
    ----------
    distances : ndarray, shape (n, m)
        Any measure.
    limit : float
        The largest that counts.

    Returns
    -------
    ndarray of bool, shape (n, m)
    """
    within = np.asarray(distances <= limit)
    if distances.shape[1] > NEAREST + 1 and within.sum(axis=1).max() > NEAREST + 1:
        within &= distances <= np.partition(distances, NEAREST, axis=1)[:, [NEAREST]]
    return within


def find_rigid_clusters(
    movements: Movements, ratio: Floats, noise: Floats, constraints: MarkerConstraints, nearness: float, margin: float
) -> list[Group]:
    """Group markers into rigid clusters.

    Parameters
    ----------
    movements : Movements
        The take.
    ratio : ndarray, shape (n_markers, n_markers)
        Variance of each distance in units of its noise.
    noise : ndarray, shape (n_markers,), mm^2
        Variance of each marker's noise.
    constraints : MarkerConstraints
        Which markers share a limb, hence a cluster, and which do not.
    nearness : float
        Cost [nats] of a cluster that is e times as large: of two that motion explains alike, the smaller is likelier.
        With 0 clusters are not parted in two, and only small ones regrouped: motion alone errs with some.
    margin : float
        Part of `GAIN` and `CLUSTER_COST` that is needed.
    """
    search = _Search(movements, ratio, noise, constraints, nearness, margin)
    for _ in range(MOST_CHANGES):
        change = search.best_change()
        if change is None:
            break
        search.apply(change)
    return search.with_nearer() if nearness else search.clusters


Change = tuple[tuple[int, ...], list[Group]]
"""Numbers of the clusters that are replaced, and the clusters that replace them."""


class _Search:
    def __init__(
        self,
        movements: Movements,
        ratio: Floats,
        noise: Floats,
        constraints: MarkerConstraints,
        nearness: float,
        margin: float,
    ) -> None:
        self._movements, self._ratio, self._noise, self._apart = movements, ratio, noise, constraints.apart
        self._block_of = {marker: block for block in constraints.blocks for marker in block}
        self._by_size = nearness * np.log(movements.distances) if nearness else None
        self._gain, self._cluster = GAIN * margin, CLUSTER_COST * margin
        self._costs: dict[Group, float] = {}
        self._ways: dict[Group, list[list[Group]]] = {}
        self.clusters = _linkage(ratio, constraints.blocks, constraints.apart)

    def apply(self, change: Change) -> None:
        """Replace clusters."""
        replaced, added = change
        self.clusters = [cluster for index, cluster in enumerate(self.clusters) if index not in replaced] + added

    def best_change(self) -> Change | None:
        """The merge or move that lowers the cost most; if none does, the best regrouping of two small clusters."""
        for candidates in (self._merges_and_moves, self._regroupings):
            changes = list(candidates())
            self._weigh([group for _, added in changes for group in added] + self.clusters)
            costs, now = self._costs, [self._costs[cluster] for cluster in self.clusters]
            gains = [
                sum(costs[group] for group in added) - sum(now[index] for index in replaced)
                for replaced, added in changes
            ]
            best = min(gains, default=0.0)
            if best < -TINY:
                return changes[gains.index(best)]
        return None

    def with_nearer(self) -> list[Group]:
        """The clusters, but with markers that move with two of them, being on the axis between, on the far nearer one.

        A marker on an axis fits both; with more markers than others a cluster would gain more by it.
        """
        labels, distances = self._labels(), self._movements.distances
        apart = distances + np.diag(np.full(len(distances), np.inf))
        own = -largest_by_label(-apart, labels)[np.arange(len(labels)), labels]  # from the nearest mate
        is_nearer = largest_by_label(distances, labels) * FAR_NEARER < own[:, np.newaxis]
        is_nearer &= largest_by_label(self._ratio, labels) <= FITS
        for marker, cluster in np.argwhere(is_nearer).tolist():
            rest = _without(self.clusters[labels[marker]], (marker,))
            other, is_free = self.clusters[cluster], len(self._block_of[marker]) == 1
            if is_free and min(len(rest), len(other)) > 1 and not self._apart[marker, list(other)].any():
                self.clusters[labels[marker]], self.clusters[cluster] = rest, _union(other, (marker,))
                labels[marker] = cluster
        return self.clusters

    def _merges_and_moves(self) -> Iterator[Change]:
        labels = self._labels()
        to_piece = largest_by_label(self._ratio, labels)
        across = largest_by_label(to_piece.T, labels)
        for first, second in _near_pairs(across, MERGED):
            yield (first, second), [_union(self.clusters[first], self.clusters[second])]
        for index, cluster in enumerate(self.clusters):
            for block in dict.fromkeys(self._block_of[marker] for marker in cluster):
                if len(block) < len(cluster):
                    yield from self._moves(index, block, to_piece[list(block)].max(axis=0))

    def _moves(self, index: int, block: Group, distance: Floats) -> Iterator[Change]:
        others = [other for other in np.flatnonzero(nearest(distance[np.newaxis], MOVED)[0]).tolist() if other != index]
        if not others and distance[index] <= SUSPICIOUS:
            return
        rest = _without(self.clusters[index], block)
        yield (index,), [rest, block]
        for other in others:
            yield (index, other), [rest, _union(self.clusters[other], block)]

    def _regroupings(self) -> Iterator[Change]:
        """Clusters in two, and pairs of neighbours otherwise.

        Small turns, and motions across the line between two limbs, hardly change distances: linkage takes these limbs
        for one, which no single marker leaves to anyone's gain.
        """
        if self._by_size is not None:
            for index, cluster in enumerate(self.clusters):
                varies = self._ratio[np.ix_(cluster, cluster)].max() > FITS and self._costs[cluster] > self._cluster
                if len(cluster) > (3 if varies else REGROUPED):
                    yield from (((index,), parts) for parts in self._ways_of(cluster))
        labels = self._labels()
        least = -largest_by_label(largest_by_label(-self._ratio, labels).T, labels)
        for first, second in _near_pairs(least, SUSPICIOUS):
            both = _union(self.clusters[first], self.clusters[second])
            if len(both) > REGROUPED and self._by_size is None:
                continue
            for parts in self._ways_of(both):
                yield (first, second), parts

    def _ways_of(self, markers: Group) -> list[list[Group]]:
        if markers not in self._ways:
            self._ways[markers] = list(self._ways_to_split(markers))
        return self._ways[markers]

    def _ways_to_split(self, markers: Group) -> Iterator[list[Group]]:
        if len(markers) > REGROUPED:
            yield from self._cut(markers)
            return
        blocks = sorted({self._block_of[marker] for marker in markers})
        wide = [pair for pair in combinations(markers, 2) if self._ratio[pair] > MERGED]
        for size in range(len(blocks) - 1):
            for added in combinations(blocks[1:], size):
                one: Group = tuple(sorted(blocks[0] + tuple(marker for block in added for marker in block)))
                if not any((first in one) == (second in one) for first, second in wide):
                    yield [one, _without(markers, one)]

    def _cut(self, markers: Group) -> Iterator[list[Group]]:
        """Part markers between which distances vary most: by the signs of the vector to which these add up most."""
        excess = np.minimum(self._ratio[np.ix_(markers, markers)], MERGED) - 1.0
        np.fill_diagonal(excess, 0.0)
        signs = dict(zip(markers, np.linalg.eigh(excess)[1][:, 0] > 0, strict=True))
        one = tuple(marker for marker in markers if signs[self._block_of[marker][0]])
        if 0 < len(one) < len(markers):
            yield [one, _without(markers, one)]

    def _labels(self) -> Ints:
        labels = np.empty(len(self._ratio), dtype=np.intp)
        for index, cluster in enumerate(self.clusters):
            labels[list(cluster)] = index
        return labels

    def _weigh(self, groups: list[Group]) -> None:
        """Find the costs of groups that have none yet."""
        several: list[Group] = []
        for group in dict.fromkeys(groups):
            if group in self._costs:
                continue
            if len(group) == 1:
                self._costs[group] = self._cluster
            elif self._apart[np.ix_(group, group)].any():
                self._costs[group] = self._cluster + FORBIDDEN
            elif len(group) == 2:
                pair: Floats = self._ratio[group[:1], group[1:]]
                self._costs[group] = self._cluster + float(misfit(pair)) - self._gain + self._size(group)
            else:
                self._costs[group] = self._cluster + FORBIDDEN  # unless frames show it
                several.append(group)
        for indices, spread in self._movements.all_inner(several):
            ratios = spread.ratios(self._noise)
            inner = misfit(ratios) - self._gain * ratios.shape[1]
            self._costs.update(
                (several[index], self._cluster + cost + self._size(several[index]))
                for index, cost in zip(indices.tolist(), inner.tolist(), strict=True)
            )

    def _size(self, group: Group) -> float:
        """Cost [nats per frame] of the mean logarithm of the distances in a cluster."""
        if self._by_size is None:
            return 0.0
        return float(self._by_size[np.ix_(group, group)].sum()) / (len(group) * (len(group) - 1))


def _linkage(ratio: Floats, blocks: list[Group], apart: Bools) -> list[Group]:
    """Complete linkage of blocks up to `LINKED`."""
    if len(blocks) == 1:
        return list(blocks)
    from scipy.cluster.hierarchy import fcluster, linkage  # noqa: PLC0415 - heavy
    from scipy.spatial.distance import squareform  # noqa: PLC0415 - heavy

    labels = np.empty(len(ratio), dtype=np.intp)
    for index, block in enumerate(blocks):
        labels[list(block)] = index
    large = np.where(apart, np.finfo(np.float64).max / 4, np.minimum(ratio, np.finfo(np.float64).max / 8))
    between = largest_by_label(largest_by_label(large, labels).T, labels)
    np.fill_diagonal(between, 0.0)
    number = fcluster(linkage(squareform(between, checks=False), method="complete"), LINKED, criterion="distance")
    return [
        tuple(sorted(marker for index in np.flatnonzero(number == one) for marker in blocks[index]))
        for one in np.unique(number)
    ]


def largest_by_label(table: Floats, labels: Ints) -> Floats:
    """Return the largest entry of each row over the columns of each label, shape (len(table), n_labels).

    Parameters
    ----------
    table : ndarray, shape (n, n_markers)
        Any measure.
    labels : ndarray of intp, shape (n_markers,)
        Label of each column, from 0 without holes.
    """
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(labels.max() + 1))
    return np.asarray(np.maximum.reduceat(table[:, order], starts, axis=1))


def _near_pairs(table: Floats, limit: float) -> list[tuple[int, int]]:
    """Pairs of clusters in which one is among the nearest of the other."""
    near = nearest(table, limit)
    return [(first, second) for first, second in np.argwhere(np.triu(near | near.T, 1)).tolist()]


def _union(first: Group, second: Group) -> Group:
    return tuple(sorted(first + second))


def _without(group: Group, markers: Group) -> Group:
    return tuple(marker for marker in group if marker not in markers)
