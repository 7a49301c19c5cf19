"""The build of a body is known by the marker set that it wears, without names, and not by its mirror image."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.marker_sets import EVERY_PLACE
from skelgen.simulation import simulate
from skelgen.simulation.people import usual_person
from skelgen.stages.limbs import worn_body, worn_neighbours
from skelgen.stages.limbs.worn_body import neighbours_in
from skelgen.stages.limbs.worn_places import believed_wear
from skelgen.stages.limbs.worn_sets import HALVES

MIRROR = np.array([1.0, -1.0, 1.0])
MISPLACED = 40.0  # mm, so that motion alone would have to bear the set out
MOST = 0.95  # of the pairs of limbs
PROPORTIONS = 35.0  # mm by which a usual person's hips miss those of one of six sizes


@pytest.fixture(scope="module")
def walker():
    return simulate("human", seed=5, motion="walk", marker_set="helen-hayes", n_frames=100, soft_tissue="realistic")


def hips(body, names):
    return body.joints[[names.index("left thigh"), names.index("right thigh")]]


def other_side(name):
    """What a limb's mirror image is called."""
    left = name.replace("left", "right")
    return left if left != name else name.replace("right", "left")


@pytest.mark.parametrize("mirror", [np.ones(3), MIRROR])
def test_joints_of_a_set_that_is_worn_lie_where_they_are_on_the_person(walker, mirror):
    truth, shuffled = walker.truth, np.random.default_rng(0).permutation(walker.take.n_markers)
    limb = truth.limb_of_marker[shuffled]
    body = worn_body(walker.take.positions[:, shuffled] * mirror, limb)
    assert body is not None
    assert np.array_equal(body.segments[body.segments >= 0], limb[body.segments >= 0])
    names = list(truth.limb_names)
    gap = np.diff(hips(body, names), axis=0)[0]
    left_of_right = (truth.joint_positions[:, truth.joint_names.index("pelvis - left thigh")]
                     - truth.joint_positions[:, truth.joint_names.index("pelvis - right thigh")])  # fmt: skip
    assert abs(np.linalg.norm(gap) - np.linalg.norm(left_of_right, axis=1).mean()) < PROPORTIONS
    assert -gap[1] * mirror[1] > 100


@pytest.mark.parametrize("mirror", [np.ones(3), MIRROR])
def test_legs_that_alone_wear_a_set_are_no_mirror_image_either(walker, mirror):
    names, limb = list(walker.truth.limb_names), np.asarray(walker.truth.limb_of_marker)
    worn = np.isin(np.array(names)[limb], HALVES["lower"])
    body = worn_body(walker.take.positions[:, worn] * mirror, limb[worn])
    assert body is not None
    other = np.array([names.index(other_side(name)) for name in names])
    exchanged = not np.array_equal(body.segments, limb[worn])  # legs alone do not tell left from right
    assert np.array_equal(body.segments, other[limb[worn]] if exchanged else limb[worn])
    left_of_right = -np.diff(hips(body, names), axis=0)[0, 1] * mirror[1]
    assert (-left_of_right if exchanged else left_of_right) > 100


def test_limbs_of_a_set_that_is_worn_are_neighbours_as_on_the_body(walker):
    truth, shuffled = walker.truth, np.random.default_rng(0).permutation(walker.take.n_markers)
    odds = worn_neighbours(walker.take.positions[:, shuffled], truth.limb_of_marker[shuffled])
    found = {frozenset(pair) for pair in np.argwhere(odds > 1).tolist()}
    assert found == {frozenset(edge) for edge in truth.edges.tolist()}
    assert odds[~np.eye(len(odds), dtype=np.bool_)].all()


def test_limbs_that_are_parts_of_segments_bear_a_set_out_though_its_markers_are_misplaced():
    case = simulate("human", seed=5, motion="walk", marker_set="animation-41", n_frames=100, soft_tissue="realistic")
    segment = np.asarray(case.truth.limb_of_marker)
    place_on_segment = np.array([(segment[:marker] == own).sum() for marker, own in enumerate(segment)])
    parts, limb = np.unique(segment * len(segment) + place_on_segment // 2, return_inverse=True)
    segment_of_part = parts // len(segment)
    missed = MISPLACED * np.random.default_rng(0).normal(size=(1, len(segment), 3))
    near = {frozenset(edge) for edge in case.truth.edges.tolist()}
    joined = [[one == other or frozenset((one, other)) in near for other in segment_of_part] for one in segment_of_part]
    odds = worn_neighbours(case.take.positions + missed, limb)
    others = ~np.eye(len(parts), dtype=np.bool_)
    assert ((odds > 0) == np.array(joined))[others].mean() > MOST


def test_places_say_as_much_of_neighbours_as_a_set_that_is_worn(walker):
    positions, limb = np.asarray(walker.take.positions), np.asarray(walker.truth.limb_of_marker)
    of_set = worn_neighbours(positions, limb)
    believed = believed_wear(positions, np.zeros((len(limb),) * 2))
    of_places = replace(believed, doubt=1.0, places=replace(believed.places, belief=1.0))
    np.testing.assert_allclose(neighbours_in(of_places, limb), of_set)


def test_joints_are_known_from_usual_places_where_the_set_is_not():
    case = simulate("human", seed=5, motion="walk", marker_set="opencap", n_frames=100, soft_tissue="realistic")
    positions, limb_of_marker = case.take.positions, case.truth.limb_of_marker
    of_set = worn_body(positions, limb_of_marker)
    some = np.arange(len(limb_of_marker)) % 4 != 0  # of which the set is not recognised
    of_places = worn_body(positions[:, some], limb_of_marker[some])
    assert of_set.misplaced < of_places.misplaced
    assert (of_set.marker_set, of_places.marker_set) == ("opencap", "")
    bodies = (of_set, case.truth.limb_names), (of_places, usual_person(EVERY_PLACE).limb_names)
    gaps = [np.linalg.norm(np.diff(hips(body, list(names)), axis=0)) for body, names in bodies]
    assert abs(gaps[0] - gaps[1]) < PROPORTIONS


def test_animals_and_trees_have_no_known_build_nor_neighbours():
    for structure in ("quadruped", "tree:10", "human"):
        case = simulate(structure, n_frames=60, soft_tissue=3.0)
        assert worn_body(case.take.positions, case.truth.limb_of_marker) is None
        if structure != "human":
            assert not worn_neighbours(case.take.positions, case.truth.limb_of_marker).any()


def test_limbs_that_are_not_those_of_the_set_are_no_body_of_it(walker):
    wrong = np.random.default_rng(0).permutation(walker.truth.limb_of_marker)
    assert worn_body(walker.take.positions, wrong) is None
