"""How sure it is that markers are on their limbs."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.benchmark.people import simulated_person
from skelgen.errors import InputError
from skelgen.model import Limbs, Trajectories
from skelgen.stages.limbs import LimbConstraints, LimbParameters, doubt_notices, find_limbs
from skelgen.stages.limbs.membership import pair_bends


def test_markers_of_rigid_limbs_are_sure_and_shares_are_probabilities(simulated):
    limbs = find_limbs(simulated("human", n_frames=300, noise=0.3).take)
    assert np.median(limbs.probability) > 0.95
    assert not len(limbs.doubtful)
    assert (limbs.membership.sum(axis=1) < 1 + 1e-9).all()


@pytest.mark.parametrize(("body", "noise"), [("human", 0.0), ("tree:8", 0.0), ("human", 0.05)])
def test_markers_of_exact_takes_are_no_less_sure(simulated, body: str, noise: float):
    limbs = find_limbs(simulated(body, n_frames=300, noise=noise).take)
    assert not len(limbs.doubtful)


def test_a_marker_between_two_limbs_is_the_least_sure_and_named_with_both(simulated):
    case = simulated("human", n_frames=300, noise=0.3)
    first, second = case.truth.edges[0]
    on_first, on_second = (np.flatnonzero(case.truth.limb_of_marker == limb) for limb in (first, second))
    positions = case.take.positions.copy()
    positions[:, on_first[0]] = (positions[:, on_first[1:]].mean(axis=1) + positions[:, on_second].mean(axis=1)) / 2
    take = Trajectories(positions, case.take.names, case.take.rate)
    limbs = find_limbs(take)
    assert np.nanargmin(limbs.probability) == on_first[0]
    assert limbs.doubtful[0] == on_first[0]
    said = next(doubt_notices(limbs, take.names))
    assert said.startswith(f"{take.names[on_first[0]]} is on limb ")
    assert ", but could be on " in said


def test_pairs_that_bend_where_larger_limbs_do_not_are_doubtful():
    """A plate and three pairs: in two of these, as of phalanges with one marker each, the distance varies by 2 mm."""
    rng, sway = np.random.default_rng(0), np.sin(np.outer(np.arange(300), [0.05, 0.07]))
    plate = rng.normal(0, 40, (5, 3)) + np.zeros((300, 1, 1))
    pairs = [np.tile([[200.0 * number, 0, 0], [200.0 * number + 30, 0, 0]], (300, 1, 1)) for number in (1, 2, 3)]
    for pair, bend in zip(pairs, sway.T, strict=False):
        pair[:, 1, 0] += 3 * bend
    positions = np.concatenate([plate, *pairs], axis=1) + rng.normal(0, 0.2, (300, 11, 3))
    bends = pair_bends(positions, np.repeat(np.arange(4), [5, 2, 2, 2])[:, np.newaxis] == np.arange(4))
    assert (bends[5:9] > 1).all()
    assert not bends[[0, 1, 2, 3, 4, 9, 10]].any()


def test_what_people_wear_makes_their_markers_surer():
    for number in (1, 3, 4):
        take = simulated_person(number)[0].take
        by_motion = find_limbs(take, LimbParameters(marker_set="none"))
        assert len(find_limbs(take).doubtful) < len(by_motion.doubtful)


def test_what_the_user_states_is_sure(simulated):
    case = simulated("human", n_frames=300, noise=0.3)
    pair = (case.take.names[0], case.take.names[-1])
    limbs = find_limbs(case.take, constraints=LimbConstraints(together=(pair,)))
    assert limbs.probability[[0, -1]].tolist() == [1.0, 1.0]
    apart = find_limbs(case.take, constraints=LimbConstraints(apart=(case.take.names[:2],)))
    assert apart.membership[0, apart.limb_of_marker[1]] == 0.0


def test_the_next_limb_is_the_most_likely_other_one_or_none():
    membership = [[0.55, 0.45, 0.0], [0.1, 0.6, 0.05], [0.0, 0.0, 1.0], [np.nan] * 3]
    limbs = Limbs([0, 1, 2, -1], np.zeros((4, 4)), membership=membership)
    rivals, shares = limbs.rivals
    assert rivals.tolist() == [1, -1, -1, -1]
    np.testing.assert_allclose(shares, [0.45, 0.25, 0.0, np.nan])
    assert limbs.doubtful.tolist() == [0, 1]
    assert not len(Limbs([0, 0], np.zeros((2, 2))).doubtful)


def test_a_limb_that_is_likelier_than_the_markers_own_is_said_to_be_so():
    membership = [[0.03, 0.96], [0.0, 1.0], [0.55, 0.45], [1.0, 0.0]]
    limbs = Limbs([0, 1, 0, 0], np.zeros((4, 4)), membership=membership)
    assert list(doubt_notices(limbs, ["LFIN", "LWRA", "LWRB", "LFRM"])) == [
        "LFIN is on limb 0 (3 %), but could be on limb 1 (96 %), which is likelier by its distances",
        "LWRB is on limb 0 (55 %), but could be on limb 1 (45 %)",
    ]


def test_more_than_certain_is_refused():
    with pytest.raises(InputError, match="no probabilities"):
        Limbs([0, 0], np.zeros((2, 2)), membership=[[1.5], [0.5]])
