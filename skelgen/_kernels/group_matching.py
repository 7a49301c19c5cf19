"""What groups of hidden markers gain by having each other's goals, and the best matching, found by a beam."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.marker_exchanges import distance_evidence
from skelgen.model.arrays import Bools, Floats, Ints


class Side(NamedTuple):
    """Markers on one side of a cut.

    Attributes
    ----------
    markers : ndarray of intp, shape (n,)
        Those that are matched.
    sums : ndarray, shape (3, n_markers, n_markers)
        Number, sum [mm] and sum of squares [mm^2] of all distances on this side.
    told : ndarray, shape (n_markers, n_markers), nats
        What these explain by themselves, by `marker_exchanges.explained`.
    is_steady : ndarray of bool, shape (n_markers, n_markers)
        Distances that count.
    """

    markers: Ints
    sums: Floats
    told: Floats
    is_steady: Bools


class Gains(NamedTuple):
    """What members gain as goals [nats].

    Attributes
    ----------
    alone : ndarray, shape (n_members, n_goals)
        By the distances of each to what is not hidden.
    pairs : ndarray, shape (n_members, n_goals, n_members, n_goals)
        By the distance of two members to each other.
    """

    alone: Floats
    pairs: Floats


class Choices(NamedTuple):
    """What a member may have.

    Attributes
    ----------
    clash : ndarray of bool, shape (n_members, n_members)
        Members that have different goals, as they are seen at once.
    unmatched : ndarray, shape (n_members,), nats
        What a member gains without a goal.
    order : ndarray of intp, shape (n_members,)
        In which members get their goals.
    """

    clash: Bools
    unmatched: Floats
    order: Ints


class _Beam(NamedTuple):
    """Matchings, the best first: goals (width, n_members), -1 for none, and what they gain."""

    goals: Ints
    scores: Floats


def gains_of_goals(members: Side, goals: Side, others: Ints, spacing: float) -> Gains:
    """Return what members gain as goals.

    Parameters
    ----------
    members, goals : Side
        Who is matched with whom.
    others : ndarray of intp, shape (n_others,)
        Markers that are not hidden.
    spacing : float, mm
        How far apart markers are.
    """
    shape = len(members.markers), len(goals.markers)
    gains = Gains(np.zeros(shape), np.zeros(shape * 2))
    _write_gains(members, goals, others, spacing, gains)
    return gains


def best_matching(gains: Gains, choices: Choices, width: int) -> tuple[Ints, float]:
    """Return the best matching that a beam finds, -1 for no goal, and what it gains [nats].

    Parameters
    ----------
    gains : Gains
        What members gain as goals.
    choices : Choices
        What they may have.
    width : int
        Matchings that are kept.
    """
    n_members, n_goals = gains.alone.shape
    here, there = (_Beam(np.full((width, n_members), -1, dtype=np.intp), np.zeros(width)) for _ in range(2))
    _search(gains, choices, here, there, np.empty(n_goals + 1), np.empty((width, 2), dtype=np.intp))
    last = there if n_members % 2 else here
    return last.goals[0], float(last.scores[0])


@kernel
def _write_gains(members: Side, goals: Side, others: Ints, spacing: float, gains: Gains) -> None:
    """Write what `gains_of_goals` returns."""
    for i in range(len(members.markers)):
        for k in range(len(goals.markers)):
            for other in others:
                ends = members.markers[i], other, goals.markers[k], other
                gains.alone[i, k] += _gained(members, goals, ends, spacing)
        for j in range(i + 1, len(members.markers)):
            if members.sums[0, members.markers[i], members.markers[j]] > 0.0:
                for k in range(len(goals.markers)):
                    for m in range(len(goals.markers)):
                        ends = members.markers[i], members.markers[j], goals.markers[k], goals.markers[m]
                        gain = _gained(members, goals, ends, spacing)
                        gains.pairs[i, k, j, m] = gain
                        gains.pairs[j, m, i, k] = gain


@kernel_part
def _gained(members: Side, goals: Side, ends: tuple[int, int, int, int], spacing: float) -> float:
    """Return what is gained if two markers of one side are the same as two of the other side [nats]."""
    first, second, one, other = ends
    here, there = members.sums, goals.sums
    if here[0, first, second] <= 0.0 or not (members.is_steady[first, second] or goals.is_steady[one, other]):
        return 0.0
    together = distance_evidence(
        here[0, first, second] + there[0, one, other],
        here[1, first, second] + there[1, one, other],
        here[2, first, second] + there[2, one, other],
        spacing,
    )
    return float(together - members.told[first, second] - goals.told[one, other])


@kernel
def _search(gains: Gains, choices: Choices, here: _Beam, there: _Beam, options: Floats, chosen: Ints) -> None:
    """Give goals to one member after the other; the first beam begins empty, and both take turns."""
    n_kept = 1
    for place in range(len(choices.order)):
        member = choices.order[place]
        n_best = 0
        for row in range(n_kept):
            _write_options(gains, choices, place, here.goals[row], options)
            for option in range(len(options)):
                n_best = _keep(there.scores, chosen, n_best, here.scores[row] + options[option], row, option)
        n_kept = n_best
        for best in range(n_kept):
            row, option = chosen[best, 0], chosen[best, 1]
            for done in range(place):
                there.goals[best, choices.order[done]] = here.goals[row, choices.order[done]]
            there.goals[best, member] = option if option < len(options) - 1 else -1
        here, there = there, here


@kernel_part
def _write_options(gains: Gains, choices: Choices, place: int, goals: Ints, options: Floats) -> None:
    """Write what each goal gains for a member beside those that have goals, and at last what none does."""
    member, n_goals = choices.order[place], len(options) - 1
    for goal in range(n_goals):
        options[goal] = gains.alone[member, goal]
    options[n_goals] = choices.unmatched[member]
    for done in choices.order[:place]:
        taken = goals[done]
        if taken >= 0:
            for goal in range(n_goals):
                options[goal] += gains.pairs[done, taken, member, goal]
    for done in choices.order[:place]:
        if goals[done] >= 0 and choices.clash[member, done]:
            options[goals[done]] = -math.inf


@kernel_part
def _keep(scores: Floats, chosen: Ints, n_kept: int, score: float, row: int, option: int) -> int:
    """Keep a matching if it is among the best, behind equal ones; return how many are kept."""
    if score == -math.inf or (n_kept == len(scores) and score <= scores[n_kept - 1]):
        return n_kept
    place = min(n_kept, len(scores) - 1)
    while place > 0 and scores[place - 1] < score:
        scores[place] = scores[place - 1]
        chosen[place, 0], chosen[place, 1] = chosen[place - 1, 0], chosen[place - 1, 1]
        place -= 1
    scores[place], chosen[place, 0], chosen[place, 1] = score, row, option
    return min(n_kept + 1, len(scores))
