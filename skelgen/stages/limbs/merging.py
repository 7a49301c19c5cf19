r"""Merge rigid clusters into limbs that are no more rigid than skin and plates are.

Two clusters become one limb if two tests agree. The first (`distances`) is scale-free: one body with a noise of its own
must describe both better than two bodies do, by the variances of all distances. The second (`relative_motion`) looks at
the relative motion itself: its principal variances, in units of what the noise of both clusters and the flexibility of
a limb explain, must not show a joint. The first takes account of how rigid each limb is, the second sees motions that
hardly change distances: of a hand about its long axis, of a small foot.

At last single markers move between limbs where two rigid bodies then explain the markers of both better. The markers of
two limbs have 3 n - 6 coordinates beside the pose of the whole. The inner coordinates of each limb are noise of that
limb's size, the relative motion may be anything. With Gaussians for all of them, two bodies cost

.. math::
    \tfrac12 d_a \log\sigma_a^2 + \tfrac12 d_b \log\sigma_b^2 + \tfrac12 \log\det S_{ab}

nats per frame, whichever limb each marker is on. A marker near the axis of a hinge fits both limbs by its distances;
here its limb is decided by what it adds to the noise of either limb, and by what it leaves of their relative motion.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

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
from skelgen.stages.limbs.parameters import LimbParameters, MarkerConstraints
from skelgen.stages.limbs.relative_motion import Group, Movements, Spread
from skelgen.stages.limbs.rigid_clusters import (
    GAIN,
    LINKED,
    find_rigid_clusters,
    largest_by_label,
    marker_noise,
    misfit,
    nearest,
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

EXCHANGED = 10.0
"""Largest variance of a distance to any marker of the other limb, in units of its noise, with which a move can pay."""

LEAST_MOVE_GAIN = 0.1
"""nats per frame that a move must gain: some 2 in all for a take worth 20 independent frames. A change of the number of
inner coordinates must gain `GAIN` more for each."""

NOISE_WEIGHT = 0.5
"""Coordinates of the take's noise that are counted among a limb's own: two markers may be rigid by chance."""

SEEN_PART = 0.5
"""Of the sampled frames: what is seen less may be seen only while limbs rest against each other."""

LEAST_MARKERS = 2
"""No limb is left with fewer: a single marker has no inner coordinates, and with them no say."""

LOOKED_AHEAD = 32
"""Pairs whose motion is measured at once after as many were refused: one after the other takes five times as long."""

MOST_MOVES = 100
"""Ends a search that rounding might prolong."""


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
    noise = distances.noise
    own = marker_noise(np.where(distances.weight > 0, distances.variance, np.inf), noise)
    ratio = 2 * distances.bounded / (own[:, np.newaxis] + own)
    clusters = find_rigid_clusters(movements, ratio, own, constraints, parameters.nearness)
    groups = _Merger(movements, distances, parameters, clusters, constraints.apart).joined(n_limbs)
    groups = _exchange_markers(movements, groups, ratio, noise, constraints)
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
        meanwhile = movements.while_seen(marker)
        least = _cost(meanwhile.relative(mates[own], (marker,)), noise) + LEAST_GAIN
        resting = [
            group
            for group in near
            if _cost(meanwhile.relative(mates[group], (marker,)), noise) <= least
            and _cost(meanwhile.relative(mates[own], mates[group]), noise) < 0
        ]
        groups[marker] = min((own, *resting), key=lambda group: movements.distance(marker, mates[group]))
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
    ) -> None:
        members = np.empty(len(distances.variance), dtype=np.intp)
        for index, cluster in enumerate(clusters):
            members[list(cluster)] = index
        self._movements, self._parameters, self._apart = movements, parameters, apart
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
        return float(misfit(motion.ratios(variances))) - (LIMB if min(len(one), len(other)) < FULL_POSE else PLATE)

    def _bend(self, *groups: Group) -> float:
        """Deformation that a limb of these groups may show, as a part of its size: less if a group is a rigid plate.

        Pairs of markers near each other on soft tissue are rigid, too; for them what is usual in the take counts.
        """
        seen = self._movements.bendings((group for group in groups if len(group) > 2), self._white)
        return float(min(self._parameters.flexibility, BEND * max(seen, default=self._usual_bend)))

    def _group_noise(self, group: Group) -> float:
        """Noise variance [mm^2] of a group's markers, steadied by that of the take."""
        spread = self._movements.inner(group) if len(group) > 1 else None
        if spread is None:
            return self._noise
        freedoms = len(spread.covariance)
        return float((PRIOR_WEIGHT * self._noise + np.trace(spread.covariance)) / (PRIOR_WEIGHT + freedoms))

    def _median_noise(self, clusters: list[Group]) -> float:
        """Median of the clusters' noise [mm^2], weighted by their inner coordinates."""
        several = [cluster for cluster in clusters if len(cluster) > 1 and self._movements.inner(cluster) is not None]
        if not several:
            return self._noise
        noises = np.array([self._group_noise(cluster) for cluster in several])
        freedoms = np.cumsum([max(1, 3 * len(several[index]) - 6) for index in np.argsort(noises)])
        return float(np.sort(noises)[np.searchsorted(freedoms, freedoms[-1] / 2)])


def _exchange_markers(
    movements: Movements, groups: Ints, ratio: Floats, noise: float, constraints: MarkerConstraints
) -> Ints:
    """Move markers between limbs, the most profitable first, for as long as that pays; `ratio` as in `_Exchange`."""
    search = _Exchange(movements, ratio, noise, constraints)
    groups = groups.copy()
    for _ in range(MOST_MOVES):
        gain, block, limb = max(search.moves(groups), default=(0.0, (), -1))
        if gain <= 0:
            break
        groups[list(block)] = limb
    return groups


class _Move(NamedTuple):
    """Markers that might move from their own body to another."""

    own: Group
    block: Group
    other: Group

    @property
    def now(self) -> tuple[Group, Group]:
        """Both bodies before the move."""
        return self.own, self.other

    @property
    def then(self) -> tuple[Group, Group]:
        """Both bodies after it."""
        rest = tuple(marker for marker in self.own if marker not in self.block)
        return rest, tuple(sorted(self.other + self.block))


class _Exchange:
    """Moves of markers between limbs, by variances of distances in units of their noise, `ratio`."""

    def __init__(self, movements: Movements, ratio: Floats, noise: float, constraints: MarkerConstraints) -> None:
        self._movements, self._ratio, self._noise, self._constraints = movements, ratio, noise, constraints
        self._costs: dict[tuple[Group, Group], float] = {}
        self._gains: dict[_Move, float] = {}

    def moves(self, groups: Ints) -> list[tuple[float, Group, int]]:
        """Gain [nats per frame] beyond what it must be at least, markers and new limb of all moves."""
        moves = list(self._possible(groups))
        self._weigh(dict.fromkeys(move for move, _ in moves))
        return [(self._gains[move], move.block, limb) for move, limb in moves]

    def _possible(self, groups: Ints) -> Iterator[tuple[_Move, int]]:
        """Moves that can pay, and the new limb."""
        members = {limb: tuple(np.flatnonzero(groups == limb).tolist()) for limb in np.unique(groups).tolist()}
        limbs, bodies = list(members), list(members.values())
        seen = self._movements.seen_part
        farthest = np.array([self._ratio[:, other].max(axis=1) for other in bodies])
        for block in self._constraints.blocks:
            own = members[int(groups[block[0]])]
            if len(own) - len(block) < LEAST_MARKERS or seen[list(block)].min() < SEEN_PART:
                continue
            near = nearest(farthest[:, list(block)].max(axis=1)[np.newaxis], EXCHANGED)[0]
            for index in np.flatnonzero(near).tolist():
                other = bodies[index]
                if other != own and len(other) >= LEAST_MARKERS:
                    yield _Move(own, block, other), limbs[index]

    def _weigh(self, moves: Iterable[_Move]) -> None:
        """Find the gains of moves that have none yet; they stay as long as both bodies do."""
        new = [move for move in moves if move not in self._gains]
        self._gains.update(dict.fromkeys(new, -np.inf))
        allowed = [move for move in new if not self._constraints.apart[np.ix_(move.block, move.other)].any()]
        self._movements.measure(pair for move in allowed for pair in (move.now, move.then))
        self._gains.update((move, self._gain(move)) for move in allowed)

    def _gain(self, move: _Move) -> float:
        # inner coordinates of pairs and of larger groups, before and after the move
        inner = [sum(3 * len(one) - (6 if len(one) > 2 else 5) for one in pair) for pair in (move.now, move.then)]
        least = LEAST_MOVE_GAIN + GAIN * abs(inner[0] - inner[1])
        after = self._cost(*move.then)
        return self._cost(*move.now) - after - least if np.isfinite(after) else -np.inf

    def _cost(self, first: Group, second: Group) -> float:
        first, second = min(first, second), max(first, second)
        if (first, second) not in self._costs:
            self._costs[first, second] = self._of_two_bodies(first, second)
        return self._costs[first, second]

    def _of_two_bodies(self, first: Group, second: Group) -> float:
        relative = self._movements.relative(first, second)
        if relative is None:
            return np.inf
        size = len(relative.covariance)
        motion = np.linalg.slogdet(relative.covariance / self._noise + NOISE_WEIGHT / size * np.eye(size))[1]
        return self._of_one(first) + self._of_one(second) + float(motion) / 2

    def _of_one(self, group: Group) -> float:
        inner = self._movements.inner(group)
        if inner is None:
            return np.inf
        size = len(inner.covariance)
        total = max(float(np.trace(inner.covariance)), 0.0)  # below where pairs are seen in frames of their own
        variance = (NOISE_WEIGHT + total / self._noise) / (NOISE_WEIGHT + size)
        return float(size * np.log(variance) / 2)
