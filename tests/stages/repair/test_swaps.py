"""Exchanged labels are found with their frames and given back; takes without errors pass untouched."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen.model import Limbs, Trajectories
from skelgen.stages.repair import RepairParameters, repair_take
from skelgen.stages.repair.swaps import find_swaps, indistinguishable_pairs, repair_swaps

FAULTS = {"noise": 0.5, "soft_tissue": 2.0, "dropouts": 0.05}


@pytest.fixture
def soft(simulated):
    return simulated("human", n_frames=600, **FAULTS).take


def relabelled(take, cycle, first, last):
    """The take with each label of a ring on the next one's marker, frames `first` to `last`."""
    positions = take.positions.copy()
    positions[first : last + 1, list(cycle)] = take.positions[first : last + 1, [*cycle[1:], cycle[0]]]
    return dataclasses.replace(take, positions=positions)


@pytest.mark.parametrize("structure", ["human", "quadruped"])
@pytest.mark.parametrize("faults", [{}, {"noise": 0.5}, FAULTS])
def test_takes_without_errors_pass_untouched(simulated, structure, faults):
    take = simulated(structure, n_frames=600, **faults).take
    assert repair_take(take).trajectories is take


@pytest.mark.parametrize("seed", [16, 17])
def test_a_tool_that_turns_after_it_stood_still_exchanges_no_labels(seed):
    rng, times = np.random.default_rng(seed), np.arange(1200) / 100
    turn = np.outer(np.radians(80) * np.clip((times - 10) / 1.2, 0, 1), [1.0, 0, 0])
    tool, holder = rng.uniform([-10, -40, -40], [70, 40, 40], (3, 3)), np.array([[-60.0, 45, 0], [-30, -45, 10]])
    turned = np.stack([Rotation.from_rotvec(turn).apply(place) for place in tool], axis=1)
    positions = np.concatenate([np.tile(holder, (1200, 1, 1)), turned], axis=1)
    positions += rng.normal(0, 0.3, positions.shape)
    assert find_swaps(Trajectories(positions, tuple("abcde"), 100.0)) == ()


@pytest.mark.parametrize("seed", [1, 4])
def test_a_drawer_that_is_pulled_while_most_of_it_is_hidden_exchanges_no_labels(seed):
    rng, times = np.random.default_rng(seed), np.arange(1200) / 100
    pulled = np.outer(np.clip((times - 9) / 1.5, 0, 1), [300.0, 0, 0])
    frame, drawer = rng.uniform(-400, 400, (4, 3)), rng.uniform(-200, 200, (3, 3))
    positions = np.concatenate([np.tile(frame, (1200, 1, 1)), drawer + pulled[:, np.newaxis]], axis=1)
    positions += rng.normal(0, 0.4, positions.shape)
    positions[600:1140, 4:6] = np.nan
    assert find_swaps(Trajectories(positions, tuple("abcdefg"), 100.0)) == ()


@pytest.mark.parametrize("pair", [("left foot 1", "left foot 3"), ("left shank 1", "right shank 1")])
def test_an_exchange_of_two_labels_is_undone_exactly(soft, pair):
    spoiled = relabelled(soft, [soft.names.index(name) for name in pair], 200, 280)
    (swap,) = swaps = find_swaps(spoiled)
    assert (set(swap.names), swap.first_frame, swap.last_frame) == (set(pair), 200, 280)
    np.testing.assert_array_equal(repair_swaps(spoiled, swaps).positions, soft.positions)


@pytest.mark.parametrize("size", [3, 4])
def test_a_plate_that_rotates_its_labels_is_undone_exactly(simulated, size):
    take = simulated("human:4", n_frames=600, noise=0.5).take
    cycle = [take.names.index(f"chest {number + 1}") for number in range(size)]
    spoiled = relabelled(take, cycle, 300, 420)
    repaired = repair_swaps(spoiled, find_swaps(spoiled))
    np.testing.assert_array_equal(repaired.positions, take.positions)


@pytest.mark.parametrize("first", [480, 560])
def test_an_exchange_until_the_end_of_the_take_is_undone(soft, first):
    spoiled = relabelled(soft, (0, 20), first, 599)
    np.testing.assert_array_equal(repair_swaps(spoiled, find_swaps(spoiled)).positions, soft.positions)


def test_every_repair_is_told_with_its_frames_and_evidence(soft, notices):
    repaired = repair_take(relabelled(soft, (0, 20), 100, 149), monitor=notices).trajectories
    (notice,) = repaired.notices
    assert "frames 100 to 149" in notice
    assert "mm as they were called" in notice
    assert notice in notices.sentences


def test_a_label_on_an_unlabelled_marker_is_left(soft):
    positions = soft.positions.copy()
    positions[200:300, 5] += [150.0, 80.0, -60.0]
    assert find_swaps(dataclasses.replace(soft, positions=positions)) == ()


def test_mirror_images_are_told_to_be_indistinguishable():
    rng = np.random.default_rng(0)
    triangle = np.array([[-30.0, 0, 0], [30, 0, 0], [0, 80, 0]])
    positions = triangle + rng.normal(0, 0.2, (100, 3, 3)) + rng.normal(0, 100, (100, 1, 3))
    take = Trajectories(positions, ("left", "right", "top"), 100.0)
    assert indistinguishable_pairs(take, limbs=Limbs([0, 0, 0], np.zeros((3, 3)))) == (("left", "right"),)


def test_nothing_is_looked_for_when_repair_is_off(soft, notices):
    spoiled = relabelled(soft, (0, 20), 100, 149)
    assert repair_take(spoiled, RepairParameters(repair=False), monitor=notices).trajectories is spoiled
    assert "skipped" in notices.sentences[0]


@pytest.mark.parametrize("positions", [np.full((9, 3, 3), np.nan), np.zeros((1, 4, 3)), np.zeros((50, 4, 3))])
def test_takes_that_say_nothing_pass_untouched(positions):
    names = [f"m{index}" for index in range(positions.shape[1])]
    take = Trajectories(positions, names, 100.0)
    assert repair_take(take).trajectories is take


def test_labels_of_the_suit_that_are_wrong_for_a_fifth_of_the_take_are_found(recording):
    (swap,) = find_swaps(recording("human/nick_freeform_001.c3d"))
    assert set(swap.names) == {"LIWR", "LOHAND"}
    assert swap.first_frame == 0
    assert 196 < swap.last_frame < 230  # both labels are lost between these frames


@pytest.mark.parametrize("path", ["arm/arm-4-4-4_clean_30fps.c3d", "rods_pendulum/pendulum_01.c3d"])
def test_clean_recordings_pass_untouched(recording, path):
    take = recording(path)
    assert repair_take(take, RepairParameters(slips=False)).trajectories is take
    np.testing.assert_array_equal(repair_take(take).trajectories.positions, take.positions)


def test_a_label_on_a_marker_none_of_whose_mates_is_seen_is_exchanged_with_none():
    rng = np.random.default_rng(2)
    paths = 2 * np.cumsum(rng.normal(size=(2, 600, 1, 3)), axis=1) + [[[[0.0, 0, 0]]], [[[300, 0, 0]]]]
    limbs = [path + rng.uniform(-80, 80, (3, 3)) for path in paths]
    positions = np.concatenate(limbs, axis=1) + rng.normal(0, 0.3, (600, 6, 3))
    positions[200:300, 0] = positions[200:300, 3]
    positions[200:300, 3:] = np.nan
    assert find_swaps(Trajectories(positions, tuple("abcdef"), 100.0)) == ()
