"""Limbs are named by shape and motion where no name of a marker helps; a side is never wrong with confidence."""

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.simulation import simulate
from skelgen.simulation.articulated import Attachment, Capsule, Structure, Swing, limb
from skelgen.simulation.structures import find_structure
from skelgen.stages.names import contradicts_sides, names_by_shape
from skelgen.stages.names.animals import find_quadruped
from skelgen.stages.names.moving_tree import MovingTree

_MIRROR = np.array([-1.0, 1.0, 1.0])


def hidden(take, flip=1.0):
    """The same markers without names, perhaps in a mirror."""
    names = [f"M{number:03d}" for number in range(take.positions.shape[1])]
    return skelgen.Trajectories(take.positions * flip, names, take.rate)


def true_names(simulated, project):
    """Names of the limbs of a project by the names of the simulated limbs."""
    truth = simulated.truth
    first = [int(project.limbs.markers_of(limb)[0]) for limb in range(project.limbs.n_limbs)]
    return tuple(truth.limb_names[truth.limb_of_marker[marker]] for marker in first)


@pytest.fixture(scope="module")
def human():
    simulated = simulate("human", n_frames=150, seed=3, noise=0.1)
    return simulated, skelgen.reconstruct(hidden(simulated.take))


def test_a_person_without_names_has_them_with_sides_and_joints_too(human):
    simulated, project = human
    assert project.limbs.names == project.skeleton.limb_names == true_names(simulated, project)
    assert {"left elbow", "right knee", "neck", "waist"} <= set(project.skeleton.joint_names)
    assert "those of a person" in " ".join(project.reports["skeleton"].notices)
    assert "mirrored" in " ".join(project.reports["skeleton"].notices)


def test_a_marker_set_is_known_by_its_shape_and_names_hands_and_forearms():
    options = {"motion": "run", "marker_set": "plug-in-gait", "soft_tissue": "realistic"}
    simulated = simulate("human", n_frames=100, seed=20, noise=0.3, **options)
    project = skelgen.reconstruct(hidden(simulated.take))
    named = skelgen.reconstruct(simulated.take, parameters={"limbs": {"marker_set": "auto"}})
    assert set(project.limbs.names) == set(named.limbs.names)
    assert project.limbs.names == true_names(simulated, project)
    assert "the markers have the shape of Plug-in Gait" in " ".join(project.reports["skeleton"].notices)


def test_a_mirrored_person_with_names_is_told(human):
    simulated, project = human
    assert not contradicts_sides(project.skeleton, project.motion)
    mirrored = skelgen.Trajectories(simulated.take.positions * _MIRROR, simulated.take.names, simulated.take.rate)
    told = skelgen.reconstruct(mirrored).reports["skeleton"].notices
    assert any("mirrored" in notice for notice in told)


def test_a_side_that_the_user_states_decides_all(human):
    _, project = human
    marker = project.trajectories.names[int(project.limbs.markers_of(project.limbs.names.index("left thigh"))[0])]
    corrected = skelgen.correct(project, "name", [marker], "right thigh")
    other = {"left": "right", "right": "left"}
    swapped = [" ".join(other.get(word, word) for word in name.split()) for name in project.limbs.names]
    assert list(corrected.limbs.names) == swapped


def test_a_motion_is_looked_at_once_however_often_its_limbs_are_renamed(human):
    _, project = human
    motion, asked = replace(project.motion), []
    for stated in ({}, {0: "trunk"}):
        names_by_shape(project.skeleton, motion, stated, lambda: asked.append(1) or ())
    assert asked == [1]


def test_names_stay_when_stages_run_again(human):
    _, project = human
    again = skelgen.reconstruct(project.before("joints"))
    assert again.limbs.names == project.limbs.names


def test_a_set_of_none_gives_numbers_alone(human):
    simulated, _ = human
    project = skelgen.reconstruct(hidden(simulated.take), parameters={"limbs": {"marker_set": "none"}})
    assert project.skeleton.limb_names[0] == "limb0"


def test_a_person_whose_knees_bend_both_ways_has_neutral_names():
    limbs = [replace(limb, offsets=np.zeros_like(limb.offsets)) for limb in find_structure("human").limbs]
    simulated = simulate(Structure("puppet", tuple(limbs)), n_frames=150, seed=3, noise=0.1)
    project = skelgen.reconstruct(hidden(simulated.take))
    assert {"thigh A", "thigh B", "hand A", "head", "pelvis"} <= set(project.limbs.names)
    assert {"knee A", "elbow B"} <= set(project.skeleton.joint_names)
    assert "sides are called A and B" in " ".join(project.reports["skeleton"].notices)


def test_an_animal_has_names():
    simulated = simulate("quadruped", n_frames=150, seed=1, noise=0.1)
    project = skelgen.reconstruct(hidden(simulated.take))
    assert project.limbs.names == true_names(simulated, project)


@pytest.mark.parametrize("with_head", [False, True])
def test_robots_and_horses_with_all_legs_on_one_trunk_are_animals(with_head):
    """Hips that turn about the axis forward, along which nothing tells where they are; a neck like a fifth finger."""
    limbs = [limb("trunk", Attachment("", "free", (0, 0, 500)), Capsule((160, 0, 30), 70, start=(-160, 0, 30)), 5)]
    for leg, (x, y) in {"a": (190, 50), "b": (190, -50), "c": (-190, 50), "d": (-190, -50)}.items():
        bend = [Swing((20,), (middle,), [(0, 1, 0)]) for middle in (40, -80)]
        hip = Attachment("trunk", "hinge", (x, y, 0), Swing((12,), axes=[(1, 0, 0)]))
        thigh, shank = (Attachment(leg + part, "hinge", (0, 0, 0), one) for part, one in zip("ht", bend, strict=True))
        limbs.append(limb(leg + "h", hip, Capsule((30, y, 0), 35, start=(-30, y, 0)), 3))
        limbs.append(limb(leg + "t", thigh._replace(joint=(0, 1.7 * y, 0)), Capsule((0, 0, -210), 28), 3))
        limbs.append(limb(leg + "s", shank._replace(joint=(0, 0, -213)), Capsule((0, 0, -200), 20), 3))
    if with_head:
        limbs.append(limb("neck", Attachment("trunk", "ball", (200, 0, 60)), Capsule((120, 0, 120), 40), 3))
        limbs.append(limb("head", Attachment("neck", "ball", (130, 0, 130)), Capsule((120, 0, -20), 40), 3))
    take = simulate(Structure("robot", tuple(limbs)), n_frames=300, seed=1, noise=0.2).take
    told = " ".join(skelgen.reconstruct(hidden(take)).reports["skeleton"].notices)
    assert "those of a four-legged animal" in told


@pytest.mark.parametrize(("flip", "side"), [(1.0, "right"), (_MIRROR, "left")])
def test_a_hand_has_names(flip, side):
    simulated = simulate("hand", n_frames=400, seed=1, noise=0.02)
    project = skelgen.reconstruct(hidden(simulated.take, flip))
    numbers = {"proximal": "1", "middle": "2", "distal": "3"}
    wanted = []
    for name in true_names(simulated, project):
        finger, _, part = name.partition(" ")
        wanted.append(f"{side} {finger} {numbers[part]}" if part else f"{side} hand")
    assert list(project.limbs.names) == wanted


def test_a_chain_has_links_in_order():
    simulated = simulate("rods", n_frames=150, seed=1)
    project = skelgen.reconstruct(hidden(simulated.take))
    assert sorted(project.limbs.names) == ["link 1", "link 2", "link 3"]
    assert true_names(simulated, project)[project.limbs.names.index("link 2")] == "middle rod"


def test_a_tree_that_looks_like_nothing_has_numbers():
    simulated = simulate("tree:8", n_frames=150, seed=1)
    assert skelgen.reconstruct(hidden(simulated.take)).limbs.names[0] == "limb0"


@pytest.mark.parametrize(("n_legs", "is_animal"), [(4, True), (6, False)])
def test_only_four_legs_make_a_four_legged_animal(n_legs, is_animal):
    """A trunk with pairs of legs of two limbs that point down and outward."""
    hips = np.array([[300.0 * (leg // 2), 80.0 * (-1) ** leg, 0.0] for leg in range(n_legs)])
    if n_legs == 4:
        hips[:, 0] *= 2
    joints, centres = {}, {0: hips.mean(axis=0)}
    for leg, hip in enumerate(hips):
        upper, lower, out = 1 + 2 * leg, 2 + 2 * leg, np.array([0.0, 20.0 * (-1) ** leg, -250.0])
        for pair, place in (((0, upper), hip), ((upper, lower), hip + out)):
            joints[pair] = joints[pair[::-1]] = np.tile(place, (5, 1))
        centres |= {upper: hip + out / 2, lower: hip + 1.7 * out}
    markers = {limb: np.tile(place, (5, 1, 1)) for limb, place in centres.items()}
    tree = MovingTree(tuple(centres), joints, np.zeros((5, len(centres), 3, 3)), markers, 1.0)
    assert (find_quadruped(tree) is not None) == is_animal


def test_a_tree_of_very_many_ends_is_no_animal_and_is_not_tried_for_long():
    two = np.zeros((2, 3))
    pairs = [(0, 1), *((trunk, end) for trunk in (0, 1) for end in range(2 + 60 * trunk, 62 + 60 * trunk))]
    joints = {pair[::step]: two for pair in pairs for step in (1, -1)}
    tree = MovingTree(tuple(range(122)), joints, np.zeros((2, 122, 3, 3)), dict.fromkeys(range(122), two[:, None]), 1.0)
    assert find_quadruped(tree) is None  # of eight million fours of ends


def test_a_person_who_moves_freely_in_many_limbs_is_named_with_sides(recording):
    take = recording("human/nick_freeform_001.c3d")
    project = skelgen.reconstruct(hidden(take))
    limb_of = dict(zip(take.names, np.asarray(project.limbs.limb_of_marker), strict=True))
    wanted = {"LFHD": "head", "C7": "chest", "LFWT": "pelvis", "LUPA": "left upper arm", "LOWR": "left forearm"}
    wanted |= {"LKNE": "left thigh", "RKNE": "right thigh", "LANK": "left shank", "RANK": "right shank"}
    wanted |= {"LTOE": "left foot", "RTOE": "right foot", "RUPA": "right upper arm", "ROWR": "right forearm"}
    called = {marker: project.limbs.names[limb_of[marker]].rstrip(" 23456789") for marker in wanted}
    assert called == wanted
