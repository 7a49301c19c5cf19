"""Marker sets are told by the distances of markers alone."""

import numpy as np

from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.limbs import LimbParameters, find_limbs
from skelgen.stages.limbs.pair_evidence import log_odds
from skelgen.stages.limbs.worn_sets import set_odds


def test_a_set_that_is_worn_tells_which_markers_share_a_limb() -> None:
    case = simulate("human", seed=3, motion="walk", marker_set="plug-in-gait", n_frames=100, soft_tissue="realistic")
    shuffled = np.random.default_rng(0).permutation(case.take.n_markers)
    positions = np.asarray(case.take.positions)[:, shuffled]
    odds = set_odds(positions, log_odds(positions))
    limb = case.truth.limb_of_marker[shuffled]
    pairs = np.triu_indices(len(limb), 1)
    assert np.array_equal(odds[pairs] > 0, (limb[:, np.newaxis] == limb)[pairs])


def test_animals_trees_and_plates_of_three_are_no_set() -> None:
    for structure in ("quadruped", "tree:10", "human"):
        positions = np.asarray(simulate(structure, n_frames=100, soft_tissue=3.0).take.positions)
        assert not set_odds(positions, log_odds(positions)).any()


def test_markers_that_are_never_seen_together_say_nothing() -> None:
    positions = np.full((20, 30, 3), np.nan)
    positions[np.arange(20), np.arange(20)] = 0.0
    assert not set_odds(positions, np.zeros((30, 30))).any()


def test_hands_of_two_markers_are_found_without_names() -> None:
    case = simulate("human", seed=2, motion="walk", marker_set="animation-53", n_frames=300, soft_tissue="realistic")
    names = tuple(f"M{marker}" for marker in range(case.take.n_markers))
    take = Trajectories(case.take.positions, names, case.take.rate)
    names_of_limb = [case.truth.limb_names[limb] for limb in case.truth.limb_of_marker]
    hand = [marker for marker, name in enumerate(names_of_limb) if name == "left hand"]
    forearm = [marker for marker, name in enumerate(names_of_limb) if name == "left forearm"]
    with_set, without = (find_limbs(take, LimbParameters(marker_set=one)).limb_of_marker for one in ("auto", "none"))
    assert not set(with_set[hand]) & set(with_set[forearm])
    assert set(without[hand]) & set(without[forearm])
