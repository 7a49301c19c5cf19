"""Better target designs: balls are moved as little as is needed, so that no target can be taken for another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from skelgen.capture.bodies.design import check_target
from skelgen.capture.bodies.parameters import BodyParameters
from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget

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
        done.append(_better(target, done, parameters, rng))
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
    target: BodyTarget,
    beside: Sequence[BodyTarget] = (),
    parameters: BodyParameters | None = None,
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
            for points in _moved(target.points, ball, radius)
            if _spacing(points) >= SPACING and _is_good(BodyTarget(target.name, points), beside, parameters)
        ]
        if good:
            _, ball, points = max(good, key=lambda one: one[0])
            others = np.delete(points, ball, axis=0)
            before, after = (np.linalg.norm(others - place[ball], axis=1).tolist() for place in (target.points, points))
            return BallMove(ball, radius, tuple(before), tuple(after))
    return None


def _moved(points: Floats, ball: int, radius: float) -> Iterator[Floats]:
    """The points with one ball moved along the axes and diagonals of the target, both ways."""
    for direction in DIRECTIONS:
        moved = points.copy()
        moved[ball] += radius * direction
        yield moved


def _better(
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
        check_target(target, beside, parameters)
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
