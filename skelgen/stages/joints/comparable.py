r"""Joint costs that can be compared between pairs with different numbers of markers, noise and motion.

A gap of mean square s per coordinate, where the noise of both limbs' poses lets expect e and the limbs turn by t
against each other (each axis, root mean square), costs

.. math::
    \max(s, e) + K \max(0, s - \rho e) + h \max(1, T^2 / t^2) + \alpha d .

A gap below what noise makes is chance and counts as noise; what noise does not explain counts K times more; h is what
the noise could hide in so few frames, blown up to the usual turn T: limbs that hardly move against each other have
small gaps wherever the joint is thought to be. The distance d to the markers decides between what is left. To e belongs
what joints of this take usually wander (soft tissue that moves as a whole), estimated from the tree itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Bools, Floats
from skelgen.stages.joints.pairs import LEAST_TURN, JointGuess
from skelgen.stages.joints.tree import spanning_tree

Guesses = Mapping[tuple[int, int], JointGuess]

UNEXPLAINED_WEIGHT = 3.0
"""Noise explains gaps up to chance; beyond, each mm^2 counts so many more."""

CHANCE = 1.5
"""Ratio of gaps to expected gaps that noise still makes: soft tissue lasts, so that few frames are independent."""

USUAL_PART = 0.25
"""Of all pairs of limbs turn less than what counts as usual: limbs of a joint turn less than those far apart."""

ROUNDS = 3
"""Of tree and usual wandering, each from the other."""


@dataclass(frozen=True, eq=False)
class JointCosts:
    """Joint costs between all limbs.

    Attributes
    ----------
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Comparable costs; infinite where two limbs cannot be joined, 0 on the diagonal.
    squares : ndarray, shape (n_limbs, n_limbs), mm^2
        Mean square of the gap per coordinate; infinite where unknown.
    expected : ndarray, shape (n_limbs, n_limbs), mm^2
        What noise and usual wandering let expect for them.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far the limbs turn against each other, each axis.
    """

    costs: Floats
    squares: Floats
    expected: Floats
    turns: Floats


def comparable_costs(guesses: Guesses, n_limbs: int, alpha: float) -> JointCosts:
    """Return costs that can be compared.

    Parameters
    ----------
    guesses : mapping of pair to JointGuess
        A joint between each two limbs.
    n_limbs : int
        Number of limbs.
    alpha : float, mm
        Weight of the mean distance between joint and markers.
    """
    squares = _table({pair: guess.square for pair, guess in guesses.items()}, n_limbs)
    possible = np.isfinite(squares)
    noise = np.where(possible, _table({pair: guess.expected for pair, guess in guesses.items()}, n_limbs), 0.0)
    hidden = np.where(possible, _table({pair: guess.hidden_part for pair, guess in guesses.items()}, n_limbs), 0.0)
    far = alpha * np.where(possible, _table({pair: guess.distance for pair, guess in guesses.items()}, n_limbs), 0.0)
    turns = np.where(possible, _table({pair: guess.turn for pair, guess in guesses.items()}, n_limbs), np.nan)
    stillness = _stillness(turns, possible)
    wandering, costs, expected = 0.0, squares, noise
    for _ in range(ROUNDS):
        expected = noise + wandering
        unexplained = np.maximum(0.0, squares - CHANCE * expected)
        costs = np.maximum(squares, expected) + UNEXPLAINED_WEIGHT * unexplained
        costs = np.where(possible, costs + hidden * expected * stillness + far, np.inf)
        np.fill_diagonal(costs, 0.0)
        parents = spanning_tree(costs, np.zeros(n_limbs, dtype=np.intp))
        children = np.flatnonzero(parents >= 0)
        if len(children):
            excess = squares[children, parents[children]] - noise[children, parents[children]]
            wandering = max(float(np.median(excess)), 0.0)
    return JointCosts(costs, squares, expected, turns)


def _stillness(turns: Floats, possible: Bools) -> Floats:
    """Square of how much less than usual two limbs turn, at least 1."""
    moves = np.maximum(np.nan_to_num(turns, nan=1.0), LEAST_TURN)
    upper = np.triu(possible, 1)
    usual = float(np.quantile(moves[upper], USUAL_PART)) if upper.any() else 1.0
    return np.asarray(np.maximum(1.0, (usual / moves) ** 2))


def _table(values: Mapping[tuple[int, int], float], n_limbs: int) -> Floats:
    table = np.full((n_limbs, n_limbs), np.inf)
    np.fill_diagonal(table, 0.0)
    for (first, second), value in values.items():
        table[first, second] = table[second, first] = value
    return table
