r"""Move single markers between limbs where two rigid bodies then explain the markers of both better.

The markers of two limbs have 3 n - 6 coordinates beside the pose of the whole. The inner coordinates of each limb are
noise of that limb's size, the relative motion may be anything. With Gaussians for all of them, two bodies cost

.. math::
    \tfrac12 d_a \log\sigma_a^2 + \tfrac12 d_b \log\sigma_b^2 + \tfrac12 \log\det S_{ab}

nats per frame, whichever limb each marker is on. A marker near the axis of a hinge fits both limbs by its distances;
here its limb is decided by what it adds to the noise of either limb, and by what it leaves of their relative motion.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.limbs.parameters import MarkerConstraints
from skelgen.stages.limbs.relative_motion import Group, Movements
from skelgen.stages.limbs.rigid_clusters import GAIN, nearest

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

MOST_MOVES = 100
"""Ends a search that rounding might prolong."""


def exchange_markers(
    movements: Movements, groups: Ints, ratio: Floats, noise: float, constraints: MarkerConstraints
) -> Ints:
    """Move markers between limbs, the most profitable first, for as long as that pays.

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
    constraints : MarkerConstraints
        Which markers share a limb and which do not.
    """
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
