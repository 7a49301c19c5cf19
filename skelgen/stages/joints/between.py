"""Of three joints on one line, one between each two of three limbs, that in the middle is not there.

Limbs that swing on either side of a third, as thighs and wheels do, seem to be joined to each other, too: half-way
between their joints both move alike if they mirror each other, and on the axis of two wheels nothing moves. Three limbs
with three joints could not move at all, but about an axis that all share; the three instant centres of three limbs that
move a little always lie on one line (Kennedy 1886). The joint that lies between the others is taken for the false one,
where both of its limbs have their other joint nearer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import mean_distances
from skelgen.geometry.statistics import lengths_of, median_of_known
from skelgen.model.arrays import Floats
from skelgen.stages.joints.costs import CHANCE, JointCosts
from skelgen.stages.joints.pairs import MIN_COMMON, JointGuess
from skelgen.stages.joints.parameters import Pair
from skelgen.stages.joints.segments import Segment

ON_LINE = 0.1
"""Of the distance of the outer joints: the way over the middle one is longer by no more."""

INSIDE = 0.2
"""Of the same: how far the middle joint is from either, at least."""

SIDE_BY_SIDE = 10.0
"""Standard deviations of a joint by noise: axes that are farther apart are two."""

DEARER = 2.0
"""Times the dearer of the other two joints, what the middle one costs at least."""

UNLIKELY = 20.0
"""Times the cost of the middle joint: what is dearer is no joint, however small its gap is."""


def without_middle_joints(
    costs: JointCosts, guesses: Mapping[Pair, JointGuess], segments: Sequence[Segment]
) -> tuple[JointCosts, set[Pair]]:
    """Return costs in whose order no joint between two others is cheaper than these; and the limbs of such joints.

    Parameters
    ----------
    costs : JointCosts
        Costs of all joints.
    guesses : mapping of pair to JointGuess
        The joints.
    segments : sequence of Segment
        All limbs, in the frames of the guesses.
    """
    order, between, joints = costs.order.copy(), set[Pair](), _Joints(guesses, segments)
    fits = np.isfinite(costs.squares) & (costs.squares <= CHANCE * costs.expected)
    np.fill_diagonal(fits, False)
    for one, other in guesses:
        for third in np.flatnonzero(fits[one] & fits[other]).tolist():
            dearest = max(costs.order[one, third], costs.order[other, third])
            if dearest <= UNLIKELY * costs.order[one, other] and joints.are_parted_by(one, other, third):
                order[one, other] = order[other, one] = max(order[one, other], DEARER * dearest)
                between.add((one, other))
    return replace(costs, order=order), between


@dataclass(frozen=True, eq=False)
class _Joints:
    """The joints between limbs, in the same frames."""

    guesses: Mapping[Pair, JointGuess]
    segments: Sequence[Segment]

    def are_parted_by(self, one: int, other: int, third: int) -> bool:
        """Whether the joint of two limbs lies between those that both have with a third, and farther from both.

        Where a joint is on the axis of a hinge is not known: half-way between its limbs, if axes are one, or as far
        along it as the joint between, if they are side by side.
        """
        pairs = (one, other), (one, third), (other, third)
        given = [self.guesses[min(pair), max(pair)].positions for pair in pairs]
        if {len(place) for place in given} != {len(self.segments[third].points)}:  # some are of other frames
            return False
        middles = [(self.segments[limb].middle + self.segments[mate].middle) / 2 for limb, mate in pairs]
        half_way = [self._slid(*pair, middle) for pair, middle in zip(pairs, middles, strict=True)]
        beside = [given[0], *(self._slid(*pair, given[0]) for pair in pairs[1:])]
        noise = max(self.guesses[min(pair), max(pair)].expected for pair in pairs[1:])
        return any(
            _is_first_between(places, least) and self._is_far(one, other, places)
            for places, least in ((half_way, 0.0), (beside, SIDE_BY_SIDE * np.sqrt(noise)))
        )

    def _slid(self, one: int, other: int, goal: Floats) -> Floats:
        """Where a joint is [mm], shape (n_frames, 3): that of a hinge as far along its axis as some places."""
        pair = min(one, other), max(one, other)
        guess = self.guesses[pair]
        if not guess.wobble <= CHANCE:
            return guess.positions
        axis = self.segments[pair[0]].shape.world_from_limb[:, :3, :3] @ guess.axis_in_first
        along = ((goal - guess.positions) * axis).sum(axis=1)
        known = along[np.isfinite(along)]
        return np.asarray(guess.positions + (known.mean() if len(known) else 0.0) * axis)

    def _is_far(self, one: int, other: int, places: Sequence[Floats]) -> bool:
        """Whether the first of three is farther from both limbs than the second from one, the third from other."""
        far = [[self._far(limb, place) for place in places] for limb in (one, other)]
        return far[0][1] < far[0][0] and far[1][2] < far[1][0]

    def _far(self, limb: int, place: Floats) -> float:
        """Mean distance of a place from the markers of a limb [mm]."""
        return float(mean_distances(*contiguous(place, self.segments[limb].markers))[0].mean())


def _is_first_between(places: Sequence[Floats], least: float) -> bool:
    """Whether the first of three places is on the line between the others, which are so far apart [mm]."""
    shown = np.stack(places)
    known = np.isfinite(shown).all(axis=(0, 2))
    if known.sum() < MIN_COMMON:
        return False
    middle, first, second = shown[:, known]
    apart, *ways = lengths_of(np.stack([first - second, middle - first, middle - second]))
    usual, longer, *parts = median_of_known(np.stack([apart, ways[0] + ways[1] - apart, *ways], axis=1)).tolist()
    return bool(longer <= ON_LINE * usual and min(parts) >= INSIDE * usual and usual > least)
