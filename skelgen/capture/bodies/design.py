"""Targets that cannot be taken for each other: check a design, and propose the least change that makes it good."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from skelgen._kernels.rigid_body_search import sum_of_squares
from skelgen.capture.parameters import BodyParameters
from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget

BAD_ENOUGH = 0.1
"""As a part of the distance that is needed: below it a confusion is bad enough, and no worse one is looked for."""

MAX_LISTED = 3
"""Pairs of distances in a sentence, at most."""

LEAST_WIDTH = 5.0
"""mm; least root mean square distance of the seen balls from a line, so that they fix the rotation about it."""


class AmbiguousTargetError(InputError):
    """A target that can be taken for another one, or for itself turned.

    Attributes
    ----------
    confusion : Confusion
        Which balls can be taken for which.
    target : BodyTarget
        The target.
    """

    def __init__(self, confusion: Confusion, target: BodyTarget) -> None:
        super().__init__(f"{confusion.sentence}; move a ball")
        self.confusion, self.target = confusion, target


@dataclass(frozen=True)
class Confusion:
    """Balls of a target that can be taken for others.

    Attributes
    ----------
    first, second : str
        Names of the targets; the same if a target is ambiguous by itself.
    balls, others : tuple of int
        Balls of the first, and those of the second that they can be taken for; counted from 0.
    distance : float, mm
        Root mean square distance between them when laid on each other.
    sentence : str
        The same in words, with the distances that are near equal.
    """

    first: str
    second: str
    balls: tuple[int, ...]
    others: tuple[int, ...]
    distance: float
    sentence: str


def check_targets(targets: Sequence[BodyTarget], parameters: BodyParameters | None = None) -> None:
    """Refuse targets that cannot be found for sure.

    Parameters
    ----------
    targets : sequence of BodyTarget
        All that are looked for together.
    parameters : BodyParameters, optional
        How many balls must be seen, and how different targets must be (`distinct`).

    Raises
    ------
    InputError
        If a target has too few balls or balls on one line, or can be taken for another one or for itself.
    """
    parameters = parameters or BodyParameters()
    for number, target in enumerate(targets):
        _check_target(target, targets[:number], parameters)


def _check_target(target: BodyTarget, beside: Sequence[BodyTarget], parameters: BodyParameters) -> None:
    """Refuse a target that cannot be found for sure beside others.

    Parameters
    ----------
    target : BodyTarget
        What is checked.
    beside : sequence of BodyTarget
        Others, which were checked already.
    parameters : BodyParameters
        How many balls must be seen, and how different targets must be.

    Raises
    ------
    InputError
        See `check_targets`.
    """
    _check_shape(target, parameters)
    for confusion in find_confusions(target, beside, parameters):
        raise AmbiguousTargetError(confusion, target)


def find_confusions(
    target: BodyTarget, beside: Sequence[BodyTarget] = (), parameters: BodyParameters | None = None
) -> Iterator[Confusion]:
    """Yield the worst confusion of a target with itself and with each of some others, where there is any.

    Parameters
    ----------
    target : BodyTarget
        What may be taken for something else.
    beside : sequence of BodyTarget
        What it may be taken for, beside itself.
    parameters : BodyParameters, optional
        How many balls must be seen, and how different targets must be.
    """
    for other in (target, *beside):
        found = _Matcher(target, other, parameters or BodyParameters()).worst()
        if found is not None:
            yield found


def _check_shape(target: BodyTarget, parameters: BodyParameters) -> None:
    n_balls, needed = len(target.points), parameters.min_points
    if n_balls < needed:
        raise InputError(f"body {target.name!r} has {n_balls} balls; {needed} must be seen, so that it needs as many")
    for balls in combinations(range(n_balls), needed):
        spread = target.points[list(balls)] - target.points[list(balls)].mean(axis=0)
        width = float(np.linalg.svd(spread, compute_uv=False)[1]) / np.sqrt(needed)
        if width < LEAST_WIDTH:
            raise InputError(
                f"the balls {_listed(balls)} of body {target.name!r} lie on one line (within {width:.1f} mm), so that "
                f"they do not fix its rotation; move one of them away by more than {LEAST_WIDTH:g} mm"
            )


class _Matcher:
    """Depth-first through the ways to lay some balls of one target on balls of another."""

    def __init__(self, first: BodyTarget, second: BodyTarget, parameters: BodyParameters) -> None:
        self.first, self.second = first, second
        self.n_matched, self.distinct = parameters.min_points, parameters.distinct
        self.is_same = first is second
        self.best: tuple[float, dict[int, int]] = (self.n_matched * self.distinct**2, {})
        self.points = [np.array(target.points, order="C") for target in (first, second)]
        self.lengths = [np.linalg.norm(points[:, np.newaxis] - points, axis=2) for points in self.points]
        self.tolerance = np.sqrt(2 * self.n_matched) * self.distinct

    def worst(self) -> Confusion | None:
        """The confusion with the smallest distance, or one that is near enough to nothing."""
        self._extend({}, 0)
        squares, matched = self.best
        if not matched:
            return None
        distance = float(np.sqrt(squares / self.n_matched))
        balls, others = tuple(matched), tuple(matched.values())
        sentence = self._sentence(balls, others, distance)
        return Confusion(self.first.name, self.second.name, balls, others, distance, sentence)

    def _extend(self, matched: dict[int, int], ball: int) -> None:
        if len(matched) == self.n_matched:
            if not (self.is_same and all(one == other for one, other in matched.items())):
                self.best = (self._squares(matched), matched)
            return
        is_bad_enough = self.best[1] and self.best[0] < self.n_matched * (BAD_ENOUGH * self.distinct) ** 2
        if is_bad_enough or len(matched) + len(self.first.points) - ball < self.n_matched:
            return
        for other in range(len(self.second.points)):
            if other in matched.values() or not self._agrees(matched, ball, other):
                continue
            more = matched | {ball: other}
            if len(more) < 3 or self._squares(more) < self.best[0]:
                self._extend(more, ball + 1)
        self._extend(matched, ball + 1)

    def _squares(self, matched: dict[int, int]) -> float:
        """Sum of squared distances [mm^2] of balls that are laid on others."""
        others = np.full(len(self.points[0]), -1, dtype=np.intp)
        others[list(matched)] = list(matched.values())
        first, second = self.points
        return sum_of_squares(first, second, others)

    def _agrees(self, matched: dict[int, int], ball: int, other: int) -> bool:
        one, two = self.lengths
        return all(abs(one[ball, known] - two[other, taken]) <= self.tolerance for known, taken in matched.items())

    def _sentence(self, balls: tuple[int, ...], others: tuple[int, ...], distance: float) -> str:
        one, two = self.lengths
        pairs = [
            f"{a + 1}-{b + 1} ({one[a, b]:.1f} mm) and {c + 1}-{d + 1} ({two[c, d]:.1f} mm)"
            for (a, c), (b, d) in combinations(zip(balls, others, strict=True), 2)
            if not self.is_same or (a, b) < (min(c, d), max(c, d))  # two that change places are listed once
        ]
        name, listed = self.first.name, _listed(balls)
        if self.is_same:
            what = f"body {name!r} is ambiguous: its balls {listed} can be taken for its balls"
        else:
            what = f"body {name!r} can be taken for {self.second.name!r}: its balls {listed} for the balls"
        return (
            f"{what} {_listed(others)}, {distance:.2f} mm apart where {self.distinct:g} mm are needed, because "
            f"distances are near equal: {', '.join(pairs[:MAX_LISTED])}"
        )


def _listed(balls: Sequence[int]) -> str:
    return " ".join(str(ball + 1) for ball in balls)


RADII = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""mm; how far the balls may be moved, the least first."""

TRIALS = 30
"""Random displacements of each size."""

DIRECTIONS = np.array([steps for steps in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, steps)) in (1, 3)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
"""Along the axes and diagonals of space: 14 unit vectors, in which one ball is tried elsewhere."""

SPACING = 20.0
"""mm; least distance of two balls of a target: nearer ones merge in the images."""


def propose_targets(
    targets: Sequence[BodyTarget], parameters: BodyParameters | None = None, seed: int = 0
) -> list[BodyTarget]:
    """Return targets that can be told apart, as near to the given ones as a random search finds them.

    Parameters
    ----------
    targets : sequence of BodyTarget
        Designs as one would like them; a regular one will do.
    parameters : BodyParameters, optional
        How many balls must be seen, and how different targets must be.
    seed : int
        Of the random search.

    Returns
    -------
    list of BodyTarget
        The same names and numbers of balls; targets that are good beside those before them are kept as they are. Of the
        displacements that do, the one with the most different distances is taken.

    Raises
    ------
    InputError
        If there is none within `RADII`, or a target has too few balls.
    """
    parameters = parameters or BodyParameters()
    rng = np.random.default_rng(seed)
    done: list[BodyTarget] = []
    for target in targets:
        done.append(_nearest_good_target(target, done, parameters, rng))
    return done


@dataclass(frozen=True)
class BallMove:
    """One ball that is put elsewhere, so that a target can be found for sure.

    Attributes
    ----------
    ball : int
        Which, counted from 0.
    by : float, mm
        How far it is moved.
    before, after : tuple of float, mm
        Its distances from all other balls, in their order.
    """

    ball: int
    by: float
    before: tuple[float, ...]
    after: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """What to do with a ruler."""
        before, after = (", ".join(f"{length:.0f}" for length in lengths) for lengths in (self.before, self.after))
        return (
            f"it would do to move ball {self.ball + 1}, which is {before} mm from the others, by {self.by:.0f} mm, so "
            f"that these distances become {after} mm"
        )


def propose_move(
    target: BodyTarget, beside: Sequence[BodyTarget] = (), parameters: BodyParameters | None = None
) -> BallMove | None:
    """Return the smallest move of one ball that makes a target good beside others; None if none was found.

    Parameters
    ----------
    target : BodyTarget
        An ambiguous target.
    beside : sequence of BodyTarget
        Others, which are good.
    parameters : BodyParameters, optional
        How many balls must be seen, and how different targets must be.
    """
    parameters = parameters or BodyParameters()
    for radius in RADII:
        good = [
            (_difference(points, beside), ball, points)
            for ball in range(len(target.points))
            for points in _one_ball_moved(target.points, ball, radius)
            if _spacing(points) >= SPACING and _is_good(BodyTarget(target.name, points), beside, parameters)
        ]
        if good:
            _, ball, points = max(good, key=lambda one: one[0])
            others = np.delete(points, ball, axis=0)
            before, after = (np.linalg.norm(others - place[ball], axis=1).tolist() for place in (target.points, points))
            return BallMove(ball, radius, tuple(before), tuple(after))
    return None


def _one_ball_moved(points: Floats, ball: int, radius: float) -> Iterator[Floats]:
    """The points with one ball moved along the axes and diagonals of the target, both ways."""
    for direction in DIRECTIONS:
        moved = points.copy()
        moved[ball] += radius * direction
        yield moved


def _nearest_good_target(
    target: BodyTarget, beside: Sequence[BodyTarget], parameters: BodyParameters, rng: np.random.Generator
) -> BodyTarget:
    if _is_good(target, beside, parameters):
        return target
    for radius in RADII:
        moves = [rng.uniform(-radius, radius, target.points.shape) for _ in range(TRIALS)]
        trials = [BodyTarget(target.name, target.points + move, target.std) for move in moves]
        for trial in sorted(trials, key=lambda one: -_difference(one.points, beside)):
            if _spacing(trial.points) >= SPACING and _is_good(trial, beside, parameters):
                return trial
    raise InputError(
        f"no design for body {target.name!r} was found within {RADII[-1]:g} mm of the given one; give it more balls or "
        "more room"
    )


def _is_good(target: BodyTarget, beside: Sequence[BodyTarget], parameters: BodyParameters) -> bool:
    try:
        _check_target(target, beside, parameters)
    except InputError:
        return False
    return True


def _difference(points: Floats, beside: Sequence[BodyTarget]) -> float:
    """Smallest difference [mm] of two distances, of which at least one is the target's own."""
    own = _distances(points)
    others = np.concatenate([own, *(_distances(target.points) for target in beside)])
    away = np.abs(own[:, np.newaxis] - others)
    away[np.arange(len(own)), np.arange(len(own))] = np.inf
    return float(away.min())


def _spacing(points: Floats) -> float:
    return float(_distances(points).min())


def _distances(points: Floats) -> Floats:
    first, second = np.triu_indices(len(points), 1)
    return np.asarray(np.linalg.norm(points[first] - points[second], axis=1))
