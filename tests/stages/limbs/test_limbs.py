"""Limbs: the true partition, whatever the order of the markers and wherever the world is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen.errors import InputError
from skelgen.model import Trajectories
from skelgen.stages.limbs import LimbParameters, find_limbs

STRUCTURES = ("rods", "human", "quadruped", "tree:8", "classic-human")
FAULTS = {"noise": 0.5, "dropouts": 0.05}
SPECTRAL = {
    "local scaling": {},
    "scanned sigma": {"local_scaling": False},
    "given sigma": {"local_scaling": False, "sigma_squared": 25.0},
    "variance": {"measure": "variance"},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", STRUCTURES)
def test_exact_markers_are_parted_exactly(simulated, same_partition, name, seed):
    case = simulated(name, seed)
    assert same_partition(find_limbs(case.take).limb_of_marker, case.truth.limb_of_marker)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", STRUCTURES)
def test_noisy_markers_with_gaps_are_parted_exactly(simulated, same_partition, name, seed):
    case = simulated(name, seed, **FAULTS)
    assert same_partition(find_limbs(case.take).limb_of_marker, case.truth.limb_of_marker)


@pytest.mark.parametrize("settings", [{}, {"method": "spectral"}, {"method": "greedy"}])
def test_permuted_markers_give_permuted_limbs(simulated, same_partition, settings):
    take = simulated("human", **FAULTS).take
    order = np.random.default_rng(5).permutation(take.n_markers)
    shuffled = dataclasses.replace(
        take, positions=take.positions[:, order], names=tuple(np.array(take.names)[order].tolist())
    )
    parameters = LimbParameters(**settings)
    found = find_limbs(take, parameters, n_limbs=15).limb_of_marker
    assert same_partition(find_limbs(shuffled, parameters, n_limbs=15).limb_of_marker, found[order])


def test_limbs_are_numbered_by_their_first_marker(simulated):
    labels = find_limbs(simulated("human").take).limb_of_marker
    _, first = np.unique(labels, return_index=True)
    assert (np.diff(first) > 0).all()


@pytest.mark.parametrize("settings", [{}, {"method": "spectral"}])
def test_moving_the_world_changes_no_limb(simulated, moved_world, settings):
    take = simulated("quadruped", **FAULTS).take
    moved = dataclasses.replace(take, positions=moved_world.points(take.positions))
    parameters = LimbParameters(**settings)
    first, second = (find_limbs(one, parameters).limb_of_marker for one in (take, moved))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("settings", SPECTRAL.values(), ids=SPECTRAL)
@pytest.mark.parametrize("name", ["rods", "human", "classic-human"])
def test_spectral_clustering_parts_a_known_number_of_limbs(simulated, same_partition, name, settings):
    case = simulated(name, **FAULTS)
    limbs = find_limbs(case.take, LimbParameters(method="spectral", **settings), n_limbs=case.truth.n_limbs)
    assert same_partition(limbs.limb_of_marker, case.truth.limb_of_marker)


@pytest.mark.parametrize("name", ["rods", "human", "quadruped"])
def test_greedy_clustering_parts_a_known_number_of_limbs(simulated, same_partition, name):
    case = simulated(name, **FAULTS)
    limbs = find_limbs(case.take, LimbParameters(method="greedy"), n_limbs=case.truth.n_limbs)
    assert same_partition(limbs.limb_of_marker, case.truth.limb_of_marker)


@pytest.mark.parametrize("count", ["rigidity", "rotation", "eigengap", "rising"])
@pytest.mark.parametrize("name", ["rods", "human", "quadruped"])
def test_spectral_clustering_finds_the_number_of_limbs(simulated, same_partition, name, count):
    case = simulated(name, **FAULTS)
    limbs = find_limbs(case.take, LimbParameters(method="spectral", count=count))
    assert same_partition(limbs.limb_of_marker, case.truth.limb_of_marker)


@pytest.mark.parametrize("method", ["rigidity", "spectral", "greedy"])
@pytest.mark.parametrize("n_limbs", [1, 2, 5, 9])
def test_number_of_limbs_is_obeyed(simulated, method, n_limbs):
    limbs = find_limbs(simulated("rods").take, LimbParameters(method=method), n_limbs=n_limbs)
    assert limbs.n_limbs == n_limbs


@pytest.mark.parametrize("n_limbs", [0, 10])
def test_number_of_limbs_that_cannot_be_is_refused(simulated, n_limbs):
    with pytest.raises(InputError, match=f"{n_limbs} limbs cannot be made of 9 markers"):
        find_limbs(simulated("rods").take, n_limbs=n_limbs)


def test_distance_deviation_is_that_of_the_noise(simulated):
    case = simulated("rods", n_frames=600, noise=0.5)
    deviation = find_limbs(case.take).distance_deviation
    same = case.truth.limb_of_marker[:, None] == case.truth.limb_of_marker
    inner = deviation[same & ~np.eye(9, dtype=bool)]
    np.testing.assert_allclose(inner, 0.5 * np.sqrt(2), rtol=0.15)  # of 600 samples: 3 % per standard deviation
    np.testing.assert_array_equal(deviation, deviation.T)


def test_marker_never_seen_with_another_is_left_out(simulated, notices, same_partition):
    case = simulated("rods")
    positions = case.take.positions.copy()
    positions[:150, 4] = np.nan
    positions[150:, np.arange(9) != 4] = np.nan
    take = dataclasses.replace(case.take, positions=positions)
    labels = find_limbs(take, monitor=notices).limb_of_marker
    assert labels[4] == -1
    assert take.names[4] in " ".join(notices.sentences)
    others = np.arange(9) != 4
    assert same_partition(labels[others], case.truth.limb_of_marker[others])


def test_take_without_two_markers_together_is_refused():
    positions = np.full((20, 2, 3), np.nan)
    positions[:10, 0], positions[10:, 1] = 1.0, 2.0
    with pytest.raises(InputError, match="lonely: no two markers are seen together"):
        find_limbs(Trajectories(positions, ("a", "b"), 100.0, "lonely"))


@pytest.mark.parametrize("method", ["rigidity", "spectral", "greedy"])
def test_two_copies_of_a_marker_stay_on_one_limb(simulated, same_partition, method):
    case = simulated("rods", **FAULTS)
    positions = np.concatenate([case.take.positions, case.take.positions[:, :1]], axis=1)
    take = dataclasses.replace(case.take, positions=positions, names=(*case.take.names, "copy"))
    labels = find_limbs(take, LimbParameters(method=method), n_limbs=3).limb_of_marker
    assert same_partition(labels, np.append(case.truth.limb_of_marker, case.truth.limb_of_marker[0]))


def test_same_seed_gives_the_same_limbs(simulated):
    take = simulated("tree:8", 1, **FAULTS).take
    first, second = (find_limbs(take, LimbParameters(method="spectral"), seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.limb_of_marker, second.limb_of_marker)
    np.testing.assert_array_equal(first.distance_deviation, second.distance_deviation)


def test_given_sampling_step_is_obeyed(simulated, same_partition):
    case = simulated("human", n_frames=600, **FAULTS)
    limbs = find_limbs(case.take, LimbParameters(sampling=5))
    assert same_partition(limbs.limb_of_marker, case.truth.limb_of_marker)


REAL = {
    "rods_pendulum/pendulum_01.c3d": lambda name: name[:5],  # Static, Upper, Middle, Lower
    "arm/arm-4-4-4_clean_30fps.c3d": lambda name: int(name[1:]) // 4,
    "arm/arm-4-2-3_clean_120fps.c3d": lambda name: (int(name[1:]) > 3) + (int(name[1:]) > 5),
    "wheelchair/walkingOptiTrack.c3d": lambda name: name.split("_")[0],  # Foot, Knee, Leg
    "bone_pin/abdbonepin.trc": {
        **dict.fromkeys(("ij", "ijc", "centijc7", "centpxt8"), "thorax"),
        **dict.fromkeys(("ac", "acc", "ai", "ts"), "scapula"),
        **dict.fromkeys(("gu", "centelbow", "EpL"), "humerus"),
    }.__getitem__,
}


@pytest.mark.parametrize("path", REAL)
def test_limbs_of_real_recordings_are_those_of_their_labels(recording, same_partition, path):
    take = recording(path)
    true = np.unique([str(REAL[path](name)) for name in take.names], return_inverse=True)[1]
    assert same_partition(find_limbs(take).limb_of_marker, true)


@pytest.mark.parametrize(("structure", "soft_tissue"), [("human", 2.0), ("quadruped", 3.0)])
def test_markers_that_are_fixed_in_the_room_are_one_limb(simulated, structure, soft_tissue):
    take = simulated(structure, n_frames=600, noise=0.4, soft_tissue=soft_tissue).take
    rack = [[900, 700, 300], [900, -600, 300], [950, 650, 1500], [900, -650, 1400]]
    positions = np.concatenate([take.positions, np.random.default_rng(0).normal(rack, 0.4, (600, 4, 3))], axis=1)
    limb_of_marker = find_limbs(Trajectories(positions, (*take.names, *"abcd"), take.rate)).limb_of_marker
    assert len(set(limb_of_marker[-4:])) == 1
    assert limb_of_marker[-1] not in limb_of_marker[:-4]


def test_postures_in_no_order_are_not_fixed_in_the_room():
    rng, n_frames = np.random.default_rng(0), 300
    joint, shape = rng.normal(0, 100, (n_frames, 1, 3)), rng.uniform(-100, 100, (4, 3))
    turns = [Rotation.from_rotvec(rng.normal(0, 0.6, (n_frames, 3))).as_matrix() for _ in range(2)]
    ends = zip(turns, ([0, 0, 200.0], [0, 0, -200.0]), strict=True)
    positions = np.concatenate([joint + (shape + end) @ turn for turn, end in ends], axis=1)
    positions += rng.normal(0, 0.3, positions.shape)
    take = Trajectories(positions, tuple("abcdefgh"), 100.0)
    assert find_limbs(take).limb_of_marker.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
