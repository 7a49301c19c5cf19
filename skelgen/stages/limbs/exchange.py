r"""Move single markers between limbs where two rigid bodies then explain the markers of both better.

The markers of two limbs have 3 n - 6 coordinates beside the pose of the whole. The inner coordinates of each limb are
noise of that limb's size, the relative motion may be anything. With Gaussians for all of them, two bodies cost

.. math::
    \tfrac12 d_a \log\sigma_a^2 + \tfrac12 d_b \log\sigma_b^2 + \tfrac12 \log\det S_{ab}

nats per frame, in whatever way the markers are shared out. A marker near the axis of a hinge fits both limbs by its
distances; here it tells by what it adds to the noise of either limb, and by what it leaves of their relative motion.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.limbs.constraints import Constraints
from skelgen.stages.limbs.pieces import GAIN
from skelgen.stages.limbs.relative import Group, Movements

EXCHANGED = 10.0
"""Largest variance of a distance to any marker of the other limb, in units of its noise, with which a move can pay."""

LEAST_MOVE_GAIN = 0.1
"""nats per frame that a move must gain: some 2 in all if a take tells as much as 20 frames that know nothing of each
other. What changes the number of inner coordinates must gain `GAIN` more for each."""

TAKE_WEIGHT = 0.5
"""Coordinates of the take's noise that are counted among a limb's own: two markers may be rigid by chance."""

SEEN_PART = 0.5
"""Of the sampled frames: what is seen less may be seen only while limbs rest against each other."""

LEAST_LEFT = 2
"""No limb is left with fewer: a single marker has no inner coordinates, and with them no say."""

MOST_MOVES = 100
"""Ends a search that rounding might keep going."""


def exchanged(movements: Movements, groups: Ints, ratio: Floats, noise: float, wishes: Constraints) -> Ints:
    """Move markers, the most profitable first, for as long as that pays.

    Parameters
    ----------
    movements : Movements
        The take.
    groups : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    ratio : ndarray, shape (n_markers, n_markers)
        Variance of each distance in units of its noise.
    noise : float, mm^2
        Variance of the take's noise.
    wishes : Constraints
        Which markers share a limb and which do not.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        As many limbs as before.
    """
    search = _Exchange(movements, ratio, noise, wishes)
    groups = groups.copy()
    for _ in range(MOST_MOVES):
        gain, block, limb = max(search.moves(groups), default=(0.0, (), -1))
        if gain <= 0:
            break
        groups[list(block)] = limb
    return groups


class _Exchange:
    def __init__(self, movements: Movements, ratio: Floats, noise: float, wishes: Constraints) -> None:
        self._movements, self._ratio, self._noise, self._wishes = movements, ratio, noise, wishes
        self._costs: dict[tuple[Group, Group], float] = {}

    def moves(self, groups: Ints) -> Iterator[tuple[float, Group, int]]:
        """Gain [nats per frame] beyond what it must be at least, markers and new limb of all moves."""
        members = {limb: tuple(np.flatnonzero(groups == limb).tolist()) for limb in np.unique(groups).tolist()}
        seen = self._movements.seen_part
        farthest = {limb: self._ratio[:, other].max(axis=1) for limb, other in members.items()}
        for block in self._wishes.blocks:
            own = members[int(groups[block[0]])]
            rest = tuple(marker for marker in own if marker not in block)
            if len(rest) < LEAST_LEFT or seen[list(block)].min() < SEEN_PART:
                continue
            for limb, other in members.items():
                if other == own or len(other) < LEAST_LEFT or farthest[limb][list(block)].max() > EXCHANGED:
                    continue
                if not self._wishes.apart[np.ix_(block, other)].any():
                    yield self._gain((own, other), (rest, tuple(sorted(other + block)))), block, limb

    def _gain(self, now: tuple[Group, Group], then: tuple[Group, Group]) -> float:
        explained = [sum(_n_inner(group) for group in pair) for pair in (now, then)]
        return self._cost(*now) - self._cost(*then) - LEAST_MOVE_GAIN - GAIN * abs(explained[0] - explained[1])

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
        motion = np.linalg.slogdet(relative.covariance / self._noise + TAKE_WEIGHT / size * np.eye(size))[1]
        return self._of_one(first) + self._of_one(second) + float(motion) / 2

    def _of_one(self, group: Group) -> float:
        inner = self._movements.inner(group)
        if inner is None:
            return np.inf
        size = len(inner.covariance)
        variance = (TAKE_WEIGHT + np.trace(inner.covariance) / self._noise) / (TAKE_WEIGHT + size)
        return float(size * np.log(variance) / 2)


def _n_inner(group: Group) -> int:
    """Coordinates of a group beside its pose."""
    return 3 * len(group) - (6 if len(group) > 2 else 5)
