"""Merge rigid clusters into limbs that are no more rigid than skin and plates are.

Two clusters become one limb if two tests agree. The first (`distances`) is scale-free: one body with a noise of its own
must describe both better than two bodies do, by the variances of all distances. The second (`relative_motion`) looks at
the relative motion itself: its principal variances, in units of what the noise of both clusters and the flexibility of
a limb explain, must not show a joint. The first takes account of how rigid each limb is, the second sees motions that
hardly change distances: of a hand about its long axis, of a small foot.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.distances import (
    FULL_POSE,
    LEAST_GAIN,
    PRIOR_WEIGHT,
    TINY_VARIANCE,
    PairSums,
    merge_costs,
    noise_variance,
    single_order,
)
from skelgen.stages.limbs.exchanges import exchange_markers
from skelgen.stages.limbs.parameters import LimbParameters, MarkerConstraints
from skelgen.stages.limbs.relative_motion import Group, Movements, Spread
from skelgen.stages.limbs.rigid_clusters import (
    GAIN,
    LINKED,
    find_rigid_clusters,
    largest_by_label,
    margin,
    marker_noise,
    misfit,
)

BEND = 4.0
"""Times the bending that three markers or more show: no more is allowed for a limb that they belong to."""

LIMB = 5.0
"""nats by which a relative motion must be evident: with fewer, a foot that flexes is two; a hand has 25 and more."""

PLATE = 3.0
"""The same between clusters with poses of their own: that each is rigid is evidence of a joint already, while pairs of
markers on soft tissue are rigid because they are near."""

UNRELATED = 1e6
"""Times the largest variance: for markers that are never seen together. Finite, so that sums stay numbers."""

LOOKED_AHEAD = 32
"""Pairs whose motion is measured at once after as many were refused: one after the other takes five times as long."""


@dataclass(frozen=True, eq=False)
class Distances:
    """How much all distances between markers vary.

    Attributes
    ----------
    variance : ndarray, shape (n_markers, n_markers), mm^2
        Half the variance of each distance: the mean noise of its ends if they are one body; 0 where unknown.
    weight : ndarray, shape (n_markers, n_markers)
        Weight of each pair, 0 where it is never seen together.
    """

    variance: Floats
    weight: Floats

    @property
    def noise(self) -> float:
        """Variance [mm^2] of the take's noise."""
        return noise_variance(np.where(self.weight > 0, np.sqrt(2 * self.variance), np.nan))

    @property
    def bounded(self) -> Floats:
        """The variances; a pair that is never seen together has the least that a third marker leaves possible.

        Where no third marker is seen with both, nothing holds them together: the variance is far beyond all others.
        """
        known = np.where(self.weight > 0, self.variance, np.inf)
        np.fill_diagonal(known, 0.0)
        for index in np.flatnonzero(np.isinf(known).any(axis=1)):
            known[index] = np.minimum(known[index], np.maximum(known[index][:, np.newaxis], known).min(axis=0))
            known[:, index] = known[index]
        return np.where(np.isfinite(known), known, UNRELATED * max(known[np.isfinite(known)].max(), TINY_VARIANCE))


def rigid_bodies(
    movements: Movements,
    distances: Distances,
    parameters: LimbParameters,
    constraints: MarkerConstraints,
    n_limbs: int | None = None,
) -> Ints:
    """Group markers that move as rigid bodies.

    Parameters
    ----------
    movements : Movements
        The take.
    distances : Distances
        Its distances.
    parameters : LimbParameters
        Their `motion_factor`, `pair_limit`, `flexibility` and `nearness`.
    constraints : MarkerConstraints
        Which markers share a limb and which do not.
    n_limbs : int, optional
        Number of limbs at which merging stops, and to which it goes on.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Group of each marker.
    """
    noise, part = distances.noise, 1.0
    variance = np.where(distances.weight > 0, distances.variance, np.inf)
    for _ in range(2):  # at first with all of the margins
        own = marker_noise(variance, noise, part)
        ratio = 2 * distances.bounded / (own[:, np.newaxis] + own)
        clusters = find_rigid_clusters(movements, ratio, own, constraints, parameters.nearness, part)
        if part < 1.0 or (part := margin(clusters, variance)) == 1.0:
            break
    groups = _Merger(movements, distances, parameters, clusters, constraints.apart, part).joined(n_limbs)
    groups = exchange_markers(movements, groups, ratio, noise, constraints)
    return _with_resting(movements, ratio, groups, own, constraints)


def _with_resting(
    movements: Movements, ratio: Floats, groups: Ints, noise: Floats, constraints: MarkerConstraints
) -> Ints:
    """Move markers that are seen only while their limb and others rest against each other to the nearest of these."""
    groups = groups.copy()
    seen_part = movements.seen_part
    for marker in [block[0] for block in constraints.blocks if len(block) == 1 and seen_part[block[0]] < 1]:
        own = int(groups[marker])
        is_near = largest_by_label(ratio[[marker]], groups)[0] <= LINKED
        is_near[own] = False
        is_near[groups[constraints.apart[marker]]] = False
        near = np.flatnonzero(is_near).tolist()
        if not near or (groups == own).sum() == 1:
            continue
        mates: dict[int, Group] = {
            group: tuple(one for one in np.flatnonzero(groups == group).tolist() if one != marker)
            for group in (own, *near)
        }
        away = {group: movements.distance(marker, mates[group]) for group in mates}
        nearer = [group for group in near if away[group] < away[own]]
        if not nearer:
            continue
        meanwhile = movements.while_seen(marker)
        least = _cost(meanwhile.relative(mates[own], (marker,)), noise) + LEAST_GAIN
        resting = [
            group
            for group in nearer
            if _cost(meanwhile.relative(mates[group], (marker,)), noise) <= least
            and _cost(meanwhile.relative(mates[own], mates[group]), noise) < 0
        ]
        groups[marker] = min((own, *resting), key=away.__getitem__)
    return groups


def _cost(motion: Spread | None, noise: Floats) -> float:
    """Evidence of a joint beside what the coordinates explain [nats per frame], without any bending."""
    if motion is None:
        return np.inf
    ratios = motion.ratios(noise)
    return float(misfit(ratios)) - GAIN * len(ratios)


class _Merger:
    def __init__(
        self,
        movements: Movements,
        distances: Distances,
        parameters: LimbParameters,
        clusters: list[Group],
        apart: Bools,
        margin: float,
    ) -> None:
        members = np.empty(len(distances.variance), dtype=np.intp)
        for index, cluster in enumerate(clusters):
            members[list(cluster)] = index
        self._movements, self._parameters, self._apart = movements, parameters, apart
        self._margin, self._flexibility = margin, margin * parameters.flexibility
        self._verdicts: dict[tuple[Group, Group], float] = {}
        self._noise = distances.noise
        self._noise = max(self._noise, self._median_noise(clusters))
        self._white = movements.white_noise(members)
        seen = movements.bendings((cluster for cluster in clusters if len(cluster) > 1), self._white)
        self._usual_bend = float(np.median(seen or np.inf))
        self._groups = PairSums(distances.variance, distances.weight, members)

    def joined(self, n_limbs: int | None) -> Ints:
        groups = self._groups
        least = n_limbs or 1
        groups.merge_while(lambda: self._allowed(self._by_rigidity()), least)
        usual = groups.neighbour_motion()
        groups.merge_while(lambda: self._allowed(single_order(groups, usual)), least)
        if n_limbs is not None:
            groups.merge_while(self._all_evidence, least)
        return groups.members.astype(np.intp)

    def _by_rigidity(self) -> Floats:
        pays = merge_costs(self._groups, self._noise, self._parameters) < 0
        return np.where(pays, self._groups.across, np.inf)

    def _allowed(self, order: Floats) -> Floats:
        """Set pairs whose relative motion shows a joint to infinity, in the order of merging, until one shows none."""
        n_refused = 0
        while True:
            first, second = (int(index) for index in np.unravel_index(np.argmin(order), order.shape))
            if not np.isfinite(order[first, second]) or self._evidence(first, second) < 0:
                return order
            order[first, second] = np.inf
            n_refused += 1
            if n_refused % LOOKED_AHEAD == 0:
                self._look_ahead(order)

    def _look_ahead(self, order: Floats) -> None:
        """Measure the next pairs of the order together: after many refusals, more are likely."""
        nearest_ones = np.argsort(order, axis=None, kind="stable")[:LOOKED_AHEAD]
        chosen = np.unravel_index(nearest_ones[np.isfinite(order.ravel()[nearest_ones])], order.shape)
        pairs = ((self._members(first), self._members(second)) for first, second in zip(*chosen, strict=True))
        self._movements.measure(pair for pair in pairs if pair not in self._verdicts)

    def _all_evidence(self) -> Floats:
        size = len(self._groups.sizes)
        order = np.full((size, size), np.inf)
        for first, second in np.argwhere(np.isfinite(self._groups.across)).tolist():
            order[first, second] = self._evidence(first, second)
        return order

    def _evidence(self, first: int, second: int) -> float:
        """Evidence [nats per frame] that two groups are two limbs."""
        one, other = self._members(first), self._members(second)
        if (one, other) not in self._verdicts:
            self._verdicts[one, other] = self._tested_evidence(one, other)
        return self._verdicts[one, other]

    def _members(self, index: int) -> Group:
        return tuple(np.flatnonzero(self._groups.members == index).tolist())

    def _tested_evidence(self, one: Group, other: Group) -> float:
        if self._apart[np.ix_(one, other)].any():
            return np.inf
        motion = self._movements.relative(one, other)
        if motion is None:
            return np.inf
        variances = np.full(len(self._apart), (self._bend(one, other) * motion.radius) ** 2)
        variances[list(one)] += self._group_noise(one)
        variances[list(other)] += self._group_noise(other)
        least = LIMB if min(len(one), len(other)) < FULL_POSE else PLATE
        return float(misfit(motion.ratios(variances))) - self._margin * least

    def _bend(self, *groups: Group) -> float:
        """Deformation that a limb of these groups may show, as a part of its size: less if a group is a rigid plate.

        Pairs of markers near each other on soft tissue are rigid, too; for them what is usual in the take counts.
        """
        seen = self._movements.bendings((group for group in groups if len(group) > 2), self._white)
        return float(min(self._flexibility, BEND * max(seen, default=self._usual_bend)))

    def _group_noise(self, group: Group) -> float:
        """Noise variance [mm^2] of a group's markers, steadied by that of the take."""
        spread = self._movements.inner(group) if len(group) > 1 else None
        if spread is None:
            return self._noise
        freedoms = len(spread.covariance)
        return float((PRIOR_WEIGHT * self._noise + np.trace(spread.covariance)) / (PRIOR_WEIGHT + freedoms))

    def _median_noise(self, clusters: list[Group]) -> float:
        """Median of the clusters' noise [mm^2], weighted by their inner coordinates."""
        several = [cluster for cluster in clusters if len(cluster) > 1]
        shown = self._movements.inner_of_each(several)
        several = [cluster for cluster, spread in zip(several, shown, strict=True) if spread is not None]
        if not several:
            return self._noise
        noises = np.array([self._group_noise(cluster) for cluster in several])
        freedoms = np.cumsum([max(1, 3 * len(several[index]) - 6) for index in np.argsort(noises)])
        return float(np.sort(noises)[np.searchsorted(freedoms, freedoms[-1] / 2)])


def with_one_fixed(groups: Ints, fixed: Bools, apart: Bools) -> Ints:
    """Return groups of markers in which those that are fixed in the room are one: nothing tells them apart.

    Parameters
    ----------
    groups : ndarray of intp, shape (n_markers,)
        Group of each marker, -1 for none.
    fixed : ndarray of bool, shape (n_markers,)
        Which markers are fixed in the room; a group is if all of its markers are.
    apart : ndarray of bool, shape (n_markers, n_markers)
        Which markers are stated not to share a limb: then nothing changes.
    """
    still = (groups >= 0) & ~np.isin(groups, groups[~fixed])
    if not still.any() or apart[np.ix_(still, still)].any():
        return groups
    merged, kept = np.where(still, groups[still].min(), groups), groups >= 0
    merged[kept] = np.unique(merged[kept], return_inverse=True)[1]
    return merged


def majority(groupings: list[Ints]) -> Ints:
    """Group markers that more than half of the groupings put together.

    Where that is contradictory, because a is with b and b with c but a not with c, the markers that hang together are
    grouped as in the grouping that agrees best with the others about them. Kirk et al. (2005) keep the tightest of
    several groupings.

    Parameters
    ----------
    groupings : list of ndarray of intp, shape (n_markers,)
        Group of each marker, by several samplings.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
    """
    together: Floats = np.mean([groups[:, np.newaxis] == groups for groups in groupings], axis=0)
    result = np.full(len(together), -1, dtype=np.intp)
    for marker in range(len(together)):
        if result[marker] < 0:
            reached = np.flatnonzero(_reached(together > 1 / 2, marker))
            result[reached] = reached[_agreed(together[np.ix_(reached, reached)], [one[reached] for one in groupings])]
    return result


def _reached(linked: Bools, marker: int) -> Bools:
    """Markers that are linked to one, directly or through others."""
    reached = np.zeros(len(linked), dtype=np.bool_)
    reached[marker] = True
    while (wider := np.asarray(linked[reached].any(axis=0))).sum() > reached.sum():
        reached = wider
    return reached


def _agreed(together: Floats, groupings: list[Ints]) -> Ints:
    """For each of some markers that hang together, the first of its group."""
    if (together > 1 / 2).all():
        return np.zeros(len(together), dtype=np.intp)
    same = [groups[:, np.newaxis] == groups for groups in groupings]
    best = min(same, key=lambda pairs: float(np.abs(pairs - together).sum()))
    return np.asarray(best.argmax(axis=1), dtype=np.intp)
