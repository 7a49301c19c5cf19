"""Bodies that nothing joins are found before their limbs, and each is grouped by itself."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen.errors import InputError
from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.joints import JointConstraints, find_joints
from skelgen.stages.limbs import LimbConstraints, LimbParameters, find_limbs
from skelgen.stages.limbs.bodies import find_bodies, seen_together
from skelgen.stages.limbs.held_bodies import with_held_bodies
from skelgen.stages.limbs.whole_people import (
    SURE_APART,
    bodies_of_people,
    with_people_apart,
    with_whole_people,
)
from skelgen.stages.limbs.worn_sets import HALVES

OPTIONS = {"n_frames": 250, "noise": 0.3, "marker_set": "animation-41", "motion": "walk", "soft_tissue": "realistic"}


@pytest.fixture(scope="module")
def two_people():
    return simulate("human", subjects=2, apart=1000.0, **OPTIONS)


def subject_of(names):
    return np.array([int(name.split(":")[0].removeprefix("subject ")) - 1 for name in names])


def test_two_people_side_by_side_are_two_bodies_and_two_trees(two_people, notices):
    limbs = find_limbs(two_people.take, monitor=notices)
    assert np.array_equal(limbs.body_of_limb[limbs.limb_of_marker], subject_of(two_people.take.names))
    assert limbs.body_probability.min() > 0.9
    assert "2 bodies, of 41 and 41 markers" in " ".join(notices.sentences)
    trees = find_joints(two_people.take, limbs).bodies
    assert [np.unique(limbs.body_of_limb[limbs_of_tree]).tolist() for limbs_of_tree in trees] == [[0], [1]]


def test_two_who_stand_side_by_side_are_two_bodies_though_their_feet_keep_their_distance():
    standing = OPTIONS | {"motion": "squat", "n_frames": 300}
    first, second = (simulate("human", seed=seed, **standing).take.positions for seed in (0, 1))
    beside = second + np.array([800.0, 0.0, 0.0])
    assert find_bodies(np.concatenate([first, beside], axis=1))[0].tolist() == [0] * 41 + [1] * 41


def test_two_who_walk_through_the_room_together_are_two_bodies(two_people):
    way = np.linspace(0.0, 6000.0, two_people.take.n_frames)[:, np.newaxis, np.newaxis] * np.array([0.0, 1.0, 0.0])
    assert find_bodies(two_people.take.positions + way)[0].tolist() == [0] * 41 + [1] * 41


def test_marker_that_is_rarely_seen_does_not_hide_that_there_are_two_bodies():
    positions = simulate("human", subjects=2, apart=1000.0, **OPTIONS | {"n_frames": 2000}).take.positions.copy()
    positions[:900, 3] = positions[912:, 3] = np.nan
    assert find_bodies(positions)[0].tolist() == [0] * 41 + [1] * 41


def test_limbs_of_one_body_are_those_that_it_has_alone(two_people):
    first = np.arange(41)
    alone = dataclasses.replace(
        two_people.take, positions=two_people.take.positions[:, first], names=two_people.take.names[:41]
    )
    both, single = find_limbs(two_people.take), find_limbs(alone)
    assert np.array_equal(both.limb_of_marker[first], single.limb_of_marker)
    assert np.array_equal(both.membership[first][:, : single.n_limbs], single.membership)


@pytest.mark.parametrize("kind", ["human", "quadruped", "rods", "tree:8"])
def test_one_body_is_one(kind):
    assert len(find_bodies(simulate(kind, n_frames=300, noise=0.5).take.positions)[1]) == 1


def test_markers_that_the_user_puts_on_one_limb_are_on_one_body(two_people):
    names = two_people.take.names
    stated = LimbConstraints(together=[(names[0], names[41])])
    assert find_limbs(two_people.take, constraints=stated).n_bodies == 1


def test_joint_that_the_user_states_joins_two_bodies(two_people):
    limbs = find_limbs(two_people.take)
    pair = int(limbs.limb_of_marker[0]), int(limbs.limb_of_marker[41])
    topology = find_joints(two_people.take, limbs, constraints=JointConstraints(joined=[pair]))
    assert len(topology.roots) == 1
    assert list(pair) in np.sort(topology.edges).tolist()


def test_number_of_bodies_may_be_given(two_people):
    assert find_limbs(two_people.take, LimbParameters(n_bodies=1)).n_bodies == 1
    with pytest.raises(InputError, match="can be told apart"):
        find_limbs(dataclasses.replace(two_people.take), LimbParameters(n_bodies=40))


def one_after_the_other(first, second, shared=0):
    """Two simulated takes as one: the second begins where the first ends, less some frames that show both."""
    begin = first.take.n_frames - shared
    positions = np.full((begin + second.take.n_frames, first.take.n_markers + second.take.n_markers, 3), np.nan)
    positions[: first.take.n_frames, : first.take.n_markers] = first.take.positions
    positions[begin:, first.take.n_markers :] = second.take.positions
    names = (*(f"a {name}" for name in first.take.names), *(f"b {name}" for name in second.take.names))
    limbs = np.concatenate([first.truth.limb_of_marker, second.truth.limb_of_marker + first.truth.n_limbs])
    return Trajectories(positions, names, first.take.rate, "both"), limbs


@pytest.mark.parametrize("kind", ["human", "quadruped"])
@pytest.mark.parametrize("shared", [0, 5])
def test_two_that_come_one_after_the_other_are_two_bodies_with_the_limbs_that_each_has(kind, shared):
    first = simulate(kind, seed=1, n_frames=250, noise=0.3)
    take, limbs = one_after_the_other(first, simulate("human", seed=2, **OPTIONS), shared)
    found = find_limbs(take)
    assert found.n_bodies == 2
    assert np.array_equal(found.limb_of_marker, limbs)


def test_few_markers_that_are_seen_for_a_short_time_belong_to_the_body_that_is_seen_then():
    positions = np.zeros((400, 14, 3))
    positions[200:, :6] = positions[:200, 6:12] = np.nan
    positions[3:, 12] = positions[:397, 13] = np.nan
    assert seen_together(positions).tolist() == [0] * 6 + [1] * 6 + [0, 1]
    assert seen_together(positions, 1).tolist() == [0] * 14


BELOW_KNEE = ("SHN", "ANK", "HEE", "MT5", "TOE")


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_leg_below_knee_without_its_knee_is_part_of_its_person(seed):
    person = simulate("human", seed=seed, **OPTIONS).take
    kept = np.array([name not in ("RKNE", "RTHI") for name in person.names])
    names = [name for name in person.names if name not in ("RKNE", "RTHI")]
    parted = np.array([int(name.startswith("R") and name.endswith(BELOW_KNEE)) for name in names], dtype=np.intp)
    assert parted.sum() == len(BELOW_KNEE)
    assert len(np.unique(with_whole_people(person.positions[:, kept], parted))) == 1


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_half_a_person_is_whole(seed):
    person = simulate("human", seed=seed, **OPTIONS)
    limbs = np.array(person.truth.limb_names)[person.truth.limb_of_marker]
    lower = np.isin(limbs, HALVES["lower"])
    parted = np.isin(limbs[lower], ["right shank", "right foot"]).astype(np.intp)
    assert len(np.unique(with_whole_people(person.take.positions[:, lower], parted))) == 1


@pytest.mark.parametrize("distance", [300.0, 1000.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_piece_of_another_person_is_no_part_of_a_person(seed, distance):
    two = simulate("human", seed=seed, subjects=2, **(OPTIONS | {"apart": distance})).take
    subject = subject_of(two.names)
    kept = np.array([one == 0 or name.endswith(BELOW_KNEE) for one, name in zip(subject, two.names, strict=True)])
    bodies = subject[kept]
    assert np.array_equal(with_whole_people(two.positions[:, kept], bodies), bodies)


@pytest.mark.parametrize("seed", [0, 1])
def test_people_who_stay_near_each_other_are_parted(seed):
    two = simulate("human", seed=seed, subjects=2, **(OPTIONS | {"apart": 450.0})).take
    subject = subject_of(two.names)
    found, sure = bodies_of_people(two.positions, np.zeros_like(subject), np.ones(1), np.zeros_like(subject))
    assert [len(np.unique(found[subject == one])) for one in (0, 1)] == [1, 1]
    assert len(np.unique(found)) == 2
    assert sure.tolist() == [SURE_APART, SURE_APART]


def test_limbs_of_people_who_stay_near_each_other_are_on_two_bodies():
    two = simulate("human", seed=0, subjects=2, **OPTIONS).take
    subject, positions = subject_of(two.names), two.positions.copy()
    for one in (0, 1):
        own = subject == one
        middle = positions[:, own].mean(axis=1, keepdims=True)
        positions[:, own] += [500.0 * one, 0.0, 0.0] - middle * [1.0, 1.0, 0.0]
    limbs = find_limbs(dataclasses.replace(two, positions=positions))
    body = limbs.body_of_limb[limbs.limb_of_marker]
    assert len(np.unique(np.stack([subject, body]), axis=1).T) == 2
    assert limbs.body_probability.tolist() == [SURE_APART, SURE_APART]


@pytest.mark.parametrize(("structure", "options"), [("human", OPTIONS), ("tree:20", {"n_frames": 250, "noise": 0.3})])
def test_what_is_one_person_or_none_is_not_parted(structure, options):
    take = simulate(structure, seed=0, **options).take
    assert take.n_markers >= 40
    assert not with_people_apart(take.positions, np.zeros(take.n_markers, dtype=np.intp)).any()


LINKS = (  # of an arm: pivot and axis of the joint to the link before, its turns [rad], where its markers are [mm]
    ((0, 0, 0), (0, 0, 1), 0.0, (0, 0, 50)),
    ((0, 0, 200), (0, 0, 1), 1.0, (0, 0, 250)),
    ((0, 0, 400), (0, 1, 0), 0.6, (0, 0, 650)),
    ((0, 0, 1100), (0, 1, 0), 0.7, (150, 0, 1150)),
    ((300, 0, 1150), (1, 0, 0), 1.2, (450, 0, 1150)),
)


def arm(seed, place=0.0, noise=0.3):
    """An arm on a base that stands still, its markers far from long links' joints, shape (n_frames, 20, 3)."""
    rng, seconds = np.random.default_rng(seed), np.arange(1000) / 100.0
    turned, shifted, links = np.eye(3), np.array([place, 0.0, 0.0]), []
    for number, (pivot, axis, amplitude, centre) in enumerate(LINKS):
        angle = amplitude * np.sin((1.0 + 0.3 * number) * seconds + rng.uniform(0, 6))
        turns = Rotation.from_rotvec(angle[:, np.newaxis] * np.array(axis)).as_matrix()
        shifted = turned @ (np.array(pivot) - turns @ np.array(pivot))[..., np.newaxis] + shifted.reshape(-1, 3, 1)
        turned = turned @ turns
        points = centre + rng.uniform(-60, 60, (4, 3))
        links.append(np.einsum("fij,mj->fmi", turned, points) + shifted[..., 0][:, np.newaxis])
    positions = np.concatenate(links, axis=1)
    return positions + rng.normal(0.0, noise, positions.shape)


def bodies_of(positions):
    take = Trajectories(positions, [f"M{marker}" for marker in range(positions.shape[1])], 100.0)
    limbs = find_limbs(take)
    return limbs.n_limbs, limbs.body_of_limb[limbs.limb_of_marker].tolist()


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.3), (1, 0.3), (2, 0.3), (0, 0.0), (0, 0.8)])
def test_long_links_of_a_machine_are_one_body_by_the_joint_between_them(seed, noise):
    positions = arm(seed, noise=noise)
    assert len(find_bodies(positions)[1]) == 2  # by distances
    assert bodies_of(positions) == (5, [0] * 20)


def test_machines_beside_each_other_are_two_though_their_bases_are_still():
    assert bodies_of(np.concatenate([arm(0), arm(1, place=1500.0)], axis=1)) == (10, [0] * 20 + [1] * 20)


def test_plates_that_move_by_themselves_are_held_by_no_joint():
    moving = [simulate("rods", n_frames=300, noise=0.3, seed=seed).take.positions[:, :3] for seed in (0, 1)]
    positions = np.concatenate([moving[0], moving[1] + np.array([400.0, 0.0, 0.0])], axis=1)
    body = np.repeat([0, 1], 3)
    assert np.array_equal(with_held_bodies(positions, body, [np.arange(3), np.arange(3, 6)]), body)
