r"""Joint costs that compare pairs with different numbers of markers, noise and motion; and how sure edges are.

A gap of mean square s per coordinate, where the noise of both limbs' poses lets expect e and the limbs turn by t
against each other (each axis, root mean square), costs

.. math::
    \eta \, (\max(s, e) + K \max(0, s - \rho e) + h \max(1, T^2 / t^2) + \alpha d) .

A gap below what noise makes is chance and counts as noise; what noise does not explain counts K times more; h is what
the noise could hide in so few frames, blown up to the usual turn T: limbs that hardly move against each other have
small gaps wherever the joint is thought to be. The distance d to the markers decides between what is left;
alpha is at most the root of e, so that it weighs no more than noise where takes have none. To e belongs what joints of
this take usually wander (soft tissue that moves as a whole), estimated from the tree itself, as is
what the ratio of s to e usually is, which says how much of it is chance.

Where the axes of two hinges meet, the two outer limbs turn about that point as well: no gap says which two of the
three joints are there. The rotations do: a hinge leaves nothing but noise across its axis. It costs less by the factor
eta.

How near limbs stay to each other tells neighbours, too, as log odds o. Gaps of true joints may be x times what is
expected as often as :math:`x^{-1/b}`: b is the mean of how far the logarithms of these ratios lie from their median.
Where noise is all there is, b is some 0.05, through 3 mm of soft tissue 0.3, on people 1. A cost that is x times
another thus speaks against a joint by :math:`\log(x) / b`, and both together by the cost times :math:`e^{-b o}`.

An edge of the tree is as sure as the best other edge between the same two parts of it is dearer, as its limbs turn
against each other (those that hardly turn show little of their joint), and as their markers are on them: what mixes
markers of several limbs is nobody's neighbour. How often such an edge is right is learned from takes whose truth is
known.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model import Limbs, Topology
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import spanning_forest
from skelgen.stages.joints.pairs import LEAST_TURN, JointGuess
from skelgen.stages.joints.parameters import JointConstraints, Pair

UNEXPLAINED_WEIGHT = 3.0
"""Noise explains gaps up to chance; beyond, each mm^2 counts so many more."""

CHANCE = 1.5
"""Ratio of gaps to expected gaps that noise still makes: soft tissue lasts, so that few frames are independent."""

CHANCE_SPREAD = 4.0
"""Standard deviations above the median of the tree's joints up to which their ratios are chance, if that is less."""

ENOUGH_RATIOS = 8
"""Fewer joints say nothing of how their ratios are spread."""

MOST_SPREAD = 1.0
"""Largest mean deviation of the logarithms of the ratios of gaps to expected gaps: that of people."""

LEAST_SPREAD = 0.05
"""What noise alone makes: few joints may be alike by chance."""

UNKNOWN_SPREAD, LEAST_RATIOS = 0.4, 3
"""Spread that is assumed if fewer than `LEAST_RATIOS` joints have an expected gap, as most come from descents, or if
half of the gaps are so small that their ratios are unknown."""

LEAST_RATIO = 0.1
"""Least ratio of a gap to the expected one; in exact takes, rounding alone would decide between smaller ones, and
where limbs carry two markers, more noise is expected than there is."""

HINGE_PART = 0.8
"""Of the cost, for a hinge. Of 7 takes with up to 3 mm of soft tissue all hinges turn across their axes by at most 1.2
times the noise, no pair of limbs that has no hinge by less than 2.5 times; the factor need only break ties."""

TYPICAL_QUANTILE = 0.25
"""Quantile of the turns of all pairs of limbs that is the usual turn: joined limbs turn less than those far apart."""

ROUNDS = 4
"""Rounds in which tree and usual gaps are found, each from the other."""


@dataclass(frozen=True, eq=False)
class JointCosts:
    """Joint costs between all limbs.

    Attributes
    ----------
    comparable : ndarray, shape (n_limbs, n_limbs), mm^2
        Costs; infinite where two limbs cannot be joined, 0 on the diagonal.
    order : ndarray, shape (n_limbs, n_limbs), mm^2
        The same, dearer for limbs that do not stay near each other: what the tree is chosen by.
    squares : ndarray, shape (n_limbs, n_limbs), mm^2
        Mean square of the gap per coordinate; infinite where unknown.
    expected : ndarray, shape (n_limbs, n_limbs), mm^2
        What noise and usual wandering let expect for them.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far the limbs turn against each other, each axis.
    distances : ndarray, shape (n_limbs, n_limbs), mm
        Mean distance of each joint from the markers of its limbs; 0 where unknown.
    """

    comparable: Floats
    order: Floats
    squares: Floats
    expected: Floats
    turns: Floats
    distances: Floats = field(default_factory=lambda: np.zeros((1, 1)))

    def surprise(self, children: Ints, above: Ints) -> Floats:
        """Return log odds against joints of a tree by their gaps over the expected ones, beside those of the others.

        Parameters
        ----------
        children, above : ndarray of intp, shape (n_joints,)
            Limbs with a parent, and their parents.
        """
        squares, expected = self.squares[children, above], self.expected[children, above]
        ratios = np.maximum(squares / np.maximum(expected, np.finfo(np.float64).tiny), LEAST_RATIO)
        spread = max(_spread(ratios[np.isfinite(self.turns[children, above])]), LEAST_SPREAD)
        return np.asarray(np.log(ratios / np.median(ratios)) / spread)


def comparable_costs(
    guesses: Mapping[Pair, JointGuess], n_limbs: int, alpha: float, odds: Floats | float = 0.0
) -> JointCosts:
    """Return costs that can be compared.

    Parameters
    ----------
    guesses : mapping of pair to JointGuess
        A joint between each two limbs.
    n_limbs : int
        Number of limbs.
    alpha : float, mm
        Weight of the mean distance between joint and markers, at most.
    odds : ndarray, shape (n_limbs, n_limbs), optional
        Log odds that limbs are joined, by how near each other they stay.
    """
    squares = _table(guesses, lambda guess: guess.square, n_limbs, np.inf)
    possible = np.isfinite(squares)
    noise = _table(guesses, lambda guess: guess.expected, n_limbs, 0.0)
    hidden = _table(guesses, lambda guess: guess.hidden_part, n_limbs, 0.0)
    distances = _table(guesses, lambda guess: guess.distance, n_limbs, 0.0)
    turns = _table(guesses, lambda guess: guess.turn, n_limbs, np.nan)
    wobbles = _table(guesses, lambda guess: guess.wobble, n_limbs, np.nan)
    kinds = np.where((wobbles <= CHANCE) & (turns >= LEAST_TURN), HINGE_PART, 1.0)
    # Square of how much less than usual two limbs turn, at least 1
    moves = np.maximum(np.nan_to_num(turns, nan=1.0), LEAST_TURN)
    upper = np.triu(possible, 1)
    typical = float(np.quantile(moves[upper], TYPICAL_QUANTILE)) if upper.any() else 1.0
    stillness = np.maximum(1.0, (typical / moves) ** 2)
    wandering, chance, spread, costs, order, expected = 0.0, CHANCE, UNKNOWN_SPREAD, squares, squares, noise
    for _ in range(ROUNDS):
        expected = noise + wandering
        unexplained = np.maximum(0.0, squares - chance * expected)
        costs = np.maximum(squares, expected) + UNEXPLAINED_WEIGHT * unexplained
        far = np.minimum(alpha, np.sqrt(expected)) * distances
        costs = np.where(possible, kinds * (costs + hidden * expected * stillness + far), np.inf)
        np.fill_diagonal(costs, 0.0)
        order = costs * np.exp(-spread * odds)
        parents = spanning_forest(order)
        children = np.flatnonzero(parents >= 0)
        if len(children):
            edges = children, parents[children]
            wandering = max(float(np.median(squares[edges] - noise[edges])), 0.0)
            ratios = squares[edges] / np.maximum(noise[edges] + wandering, np.finfo(np.float64).tiny)
            chance, spread = _chance(ratios), _spread(ratios[np.isfinite(turns[edges])])
    return JointCosts(costs, order, squares, expected, turns, distances)


def _chance(ratios: Floats) -> float:
    """Largest ratio of a gap to the expected one that noise explains, from the ratios of the tree's joints."""
    if len(ratios) < ENOUGH_RATIOS:
        return CHANCE
    middle = float(np.median(ratios))
    spread = SIGMA_OF_MEDIAN * float(np.median(np.abs(ratios - middle)))
    return float(np.clip(middle + CHANCE_SPREAD * spread, 1.0, CHANCE))


def _spread(ratios: Floats) -> float:
    """Mean deviation of the logarithms, estimated from their median deviation: some ratios may be wrong (Laplace)."""
    if len(ratios) < LEAST_RATIOS or np.median(ratios) <= LEAST_RATIO:
        return UNKNOWN_SPREAD
    logarithms = np.log(np.maximum(ratios, LEAST_RATIO))
    return min(float(np.median(np.abs(logarithms - np.median(logarithms))) / np.log(2)), MOST_SPREAD)


def _table(
    guesses: Mapping[Pair, JointGuess], value: Callable[[JointGuess], float], n_limbs: int, impossible: float
) -> Floats:
    """One value of each joint, shape (n_limbs, n_limbs), 0 on the diagonal."""
    table = np.full((n_limbs, n_limbs), impossible)
    np.fill_diagonal(table, 0.0)
    for (first, second), guess in guesses.items():
        if np.isfinite(guess.square):
            table[first, second] = table[second, first] = value(guess)
    return table


MOST_DEARER = 4.0
"""Logarithm of how many times dearer the next edge is: more says nothing more."""

SHOWN_TURN = 0.05
"""rad, each axis; what turns less is noise."""

TIE = 0.05
"""Logarithm of how many times dearer an edge is that could as well be there: costs differ by so much by chance."""

SUREST = 0.98
"""Mean probability of a limb's markers above which they say nothing more."""

# Learned by tests/benchmarks/doubt.py
BIAS, WEIGHTS = -0.24, (0.53, 1.07, 1.07, 0.42)
RIVAL_SHARE = 0.26
"""Part of the wrong edges whose rival is right; with the others another edge is right, or limbs are wrong."""


def with_certainty(
    topology: Topology, turns: Floats, limbs: Limbs, constraints: JointConstraints, worn: Floats
) -> Topology:
    """Return a tree with the probability of each of its edges, and of the best other edge instead.

    Parameters
    ----------
    topology : Topology
        The tree.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far limbs turn against each other, each axis; NaN if unknown.
    limbs : Limbs
        The limbs, with the probability of each marker.
    constraints : JointConstraints
        What the user states of the tree.
    worn : ndarray, shape (n_limbs, n_limbs)
        Log odds that limbs are neighbours by what is worn: an edge that they contradict is so much less sure.
    """
    features, against = edge_features(topology, turns, limbs), np.minimum(worn[tuple(topology.edges.T)], 0.0)
    sure = 1 / (1 + np.exp(-(BIAS + features @ np.array(WEIGHTS) + against)))
    found = sure / (1 + np.exp(-features[:, 0] / TIE))
    rivals = RIVAL_SHARE * (1 - sure) + sure - found
    has_rival = topology.rivals[:, 0] >= 0
    stated = [(min(edge), max(edge)) in constraints.joined for edge in topology.edges.tolist()]
    is_stated = np.array(stated, dtype=np.bool_) | (constraints.parents is not None)
    return replace(
        topology,
        edge_probability=np.where(is_stated, 1.0, found),
        rival_probability=np.where(is_stated | ~has_rival, 0.0, rivals),
    )


def edge_features(topology: Topology, turns: Floats, limbs: Limbs) -> Floats:
    """Return what tells how sure each edge is, shape (n_joints, 4).

    Logarithm of how many times dearer the best other edge is; logarithm of how far the limbs turn against each other
    [rad], as usual if unknown; log odds of the markers on the less sure of both limbs, and in the mean of all limbs.

    Parameters
    ----------
    topology : Topology
        The tree.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far limbs turn against each other, each axis; NaN if unknown.
    limbs : Limbs
        The limbs, with the probability of each marker.
    """
    parents, children = topology.edges.T
    costs = np.maximum(topology.joint_costs[parents, children], np.finfo(np.float64).tiny)
    leads = np.nan_to_num(np.log1p(np.maximum(topology.margins, 0.0) / costs), nan=MOST_DEARER)
    own = turns[parents, children]
    usual_turn = float(np.nanmedian(own)) if np.isfinite(own).any() else 1.0
    shown = np.log(np.maximum(np.nan_to_num(own, nan=usual_turn), SHOWN_TURN))
    odds = _odds_of_limbs(limbs)
    of_all = np.full(len(parents), odds.mean())
    return np.stack([np.minimum(leads, MOST_DEARER), shown, np.minimum(odds[parents], odds[children]), of_all], axis=1)


def _odds_of_limbs(limbs: Limbs) -> Floats:
    """Log odds that the markers of each limb are on it, shape (n_limbs,); a single marker mixes nothing."""
    on_limb = limbs.limb_of_marker >= 0
    own, sure = limbs.limb_of_marker[on_limb], np.nan_to_num(limbs.probability[on_limb], nan=1.0)
    sizes = np.bincount(own, minlength=limbs.n_limbs)
    mean = np.bincount(own, weights=sure, minlength=limbs.n_limbs) / np.maximum(sizes, 1)
    bounded = np.clip(np.where(sizes > 1, mean, 1.0), 1 - SUREST, SUREST)
    return np.asarray(np.log(bounded / (1 - bounded)))
