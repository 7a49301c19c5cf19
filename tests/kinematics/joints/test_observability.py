"""What a joint's motion leaves open is said in words."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.joints.observability import observed_joints, open_directions, range_of_motion
from skelgen.model import Joint, Motion, Skeleton
from skelgen.model.placed_joints import place_of

SIZE = 100.0  # mm


def swing(ranges):
    """Rotations that swing about x, y and z one after the other, from end to end by given angles [deg]."""
    steps = np.linspace(-0.5, 0.5, 51)[:, None]
    return np.concatenate(
        [matrix_from_vector(steps * np.deg2rad(one) * axis) for one, axis in zip(ranges, np.eye(3), strict=True)]
    )


@pytest.mark.parametrize("ranges", [(60, 30, 10), (40, 5, 0), (3, 2, 1)])
def test_range_is_that_of_the_swings(ranges):
    found = range_of_motion(swing(ranges))
    np.testing.assert_allclose(np.rad2deg(found.ranges), ranges, atol=0.5)
    np.testing.assert_allclose(np.abs(found.directions[0]), [1, 0, 0], atol=1e-6)


def test_limbs_that_never_move_have_no_range():
    assert (range_of_motion(np.tile(np.eye(3), (10, 1, 1))).ranges == 0).all()


@pytest.fixture
def joined():
    """`joined(kind, ranges, deviations or covariance)`: two limbs of `SIZE` whose joint turns and is known so."""

    def make(kind, ranges, deviations, along=(0, 0, 0), limb_of_marker=(0, 0, 0, 1, 1, 1), is_seen=True, **facts):
        turns = swing(ranges)
        world = np.tile(np.eye(4), (len(turns), 2, 1, 1))
        world[:, 1, :3, :3] = turns
        axis = np.array([1.0, 0.0, 0.0]) if kind == "hinge" else None
        covariance = np.diag(np.square(deviations)).astype(float) if np.ndim(deviations) == 1 else deviations
        std = np.sqrt(np.diag(covariance))
        joint = Joint(0, 1, np.zeros(3), np.zeros(3), kind, axis, std, covariance=covariance, **facts)
        offsets = np.array([[SIZE, 0, 0], [0, SIZE, 0], [0, 0, SIZE]] * 2)
        offsets[3:] += 3 * SIZE * np.array(along)
        labels, pose = np.array(limb_of_marker), np.tile(np.eye(4), (2, 1, 1))
        skeleton = Skeleton(np.array([-1, 0]), (joint,), labels, offsets, np.zeros(6), pose)
        nothing = np.zeros((len(turns), 6, 3))
        seen = np.full((len(turns), 2), is_seen)
        motion = Motion(world, np.zeros((len(turns), 1, 3)), nothing, nothing[..., 0], seen, 100.0)
        return observed_joints(skeleton, motion)[0]

    return make


def test_hinge_says_that_its_place_along_the_axis_is_open(joined):
    seen = joined("hinge", (60, 0, 0), [41, 1, 1])
    assert seen.sentence == (
        "the joint between limb 0 and 1 turns about one axis only: its place along that axis is not determined, +-41 mm"
    )
    assert seen.open_std == pytest.approx(41)
    np.testing.assert_allclose(np.abs(seen.open_direction), [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(seen.motion.ranges), [60, 0, 0], atol=0.5)


def test_joint_that_does_not_turn_says_so(joined):
    assert joined("rigid", (1, 0, 0), [50, 50, 50]).sentence.endswith(
        "does not turn: its place is not determined, +-50 mm"
    )


def test_what_is_nowhere_told_is_as_uncertain_as_the_limb_is_large(joined):
    said = joined("hinge", (60, 0, 0), [SIZE, 1, 1]).sentence
    assert said.endswith("is not determined (anywhere within the limb's size, +-100 mm)")


def test_joint_that_turns_too_little_names_the_direction_and_the_turns_across_it(joined):
    """Turns about the direction, however large, say nothing of the place along it."""
    said = joined("ball", (120, 3, 2), [15, 1, 1]).sentence
    assert said == (
        "the joint between limb 0 and 1 turns by 120 deg about one axis, by 3 deg about those across it: "
        "its place along that axis is known to +-15 mm only"
    )


@pytest.mark.parametrize(
    ("known", "way"), [([1, 15, 1], "sideways of limb 0"), (np.full((3, 3), 81.0), "towards the middle of limb 0")]
)
def test_the_direction_in_which_a_place_is_open_is_said_in_words(joined, known, way):
    """The middle of limb 0 lies along (1, 1, 1) from its joint."""
    said = joined("ball", (20, 2, 2), known).sentence
    assert said.startswith("the joint between limb 0 and 1 turns too little (")
    assert f"to tell its place {way}: that is known to +-" in said


def test_a_joint_is_named_once(joined):
    said = joined("undetermined", (20, 2, 2), [1, 15, 1]).sentence
    assert said.startswith("the joint between limb 0 and 1 turns too little to tell its type; it turns too little (")


@pytest.mark.parametrize(
    ("kind", "facts"),
    [
        ("ball", {"is_placed_by_marker_set": True}),
        ("ball", {"open_directions": 2, "usual_directions": 2}),
        ("hinge", {"open_directions": 1, "usual_directions": 1}),
        ("ball", {"open_directions": 3}),
    ],
)
def test_what_places_a_joint_is_said_in_the_words_of_report_and_files(joined, kind, facts):
    joint = Joint(0, 1, np.zeros(3), np.zeros(3), kind, np.eye(3)[0] if kind == "hinge" else None, np.ones(3), **facts)
    assert place_of(joint).words in joined(kind, (60, 30, 10), [1, 1, 1], **facts).sentence


def test_turns_that_suffice_are_not_called_too_little(joined):
    """A joint whose place is open although it turns far enough lacks better markers, not more motion."""
    seen = joined("ball", (40, 120, 2), [15, 1, 1])
    assert seen.sentence.endswith("turns by 120 deg, but its place sideways of limb 0 is known to +-15 mm only")
    assert seen.advice == "markers nearer to the bone, or more of them, would tell it"
    hidden = joined("undetermined", (120, 3, 2), [1, 1, 1]).sentence
    assert hidden.endswith("turns by 120 deg, but errors of the markers hide its type")


def test_hinge_that_is_open_across_its_axis_is_not_determined():
    """The place of a hinge along its axis is open in any case: one open direction across it makes two."""
    across, along = np.diag([1.0, 400.0, 1.0]), np.diag([400.0, 1.0, 1.0])
    axis = np.array([1.0, 0.0, 0.0])
    assert [open_directions(one, SIZE, axis) for one in (across, along, np.eye(3))] == [2, 1, 0]
    assert [open_directions(one, SIZE) for one in (across, along, np.eye(3))] == [1, 1, 0]


def test_determined_place_is_not_talked_about(joined):
    assert joined("ball", (60, 30, 10), [1, 1, 1]).sentence == ""


def test_joint_whose_kind_nothing_tells_says_so(joined):
    said = joined("undetermined", (5, 3, 2), [1, 1, 1]).sentence
    assert said == "the joint between limb 0 and 1 turns too little to tell its type"


@pytest.mark.parametrize(
    ("turns", "along", "advice"),
    [
        ((60, 30, 2), (0, 0, 1), "turn limb 1 about its long axis"),
        ((60, 30, 2), (0, 1, 0), "swing limb 1 in another plane"),
        ((1, 0, 0), (0, 0, 1), "bend and turn limb 1"),
    ],
)
def test_the_motion_that_would_determine_a_joint_is_named(joined, turns, along, advice):
    seen = joined("ball", turns, [80, 1, 1], along)  # open along x: turns about y or z are missing
    assert seen.advice == advice
    assert seen.notice == f"{seen.sentence}; {advice}"


def test_no_motion_is_asked_of_a_hinge(joined):
    assert joined("hinge", (60, 0, 0), [41, 1, 1]).advice == ""
    assert joined("ball", (60, 30, 10), [1, 1, 1]).notice == ""


def test_joint_without_frames_that_show_it_has_no_range():
    assert (range_of_motion(np.zeros((0, 3, 3))).ranges == 0).all()


@pytest.mark.parametrize(
    ("limb_of_marker", "limbs"), [((0, 0, 0, 1, -1, -1), "limb 1"), ((0, -1, -1, 1, -1, -1), "limb 0 and limb 1")]
)
def test_a_limb_with_one_marker_is_advised_a_second_and_no_motion(joined, limb_of_marker, limbs):
    seen = joined("ball", (60, 30, 2), [80, 1, 1], (0, 0, 1), limb_of_marker)
    assert seen.advice == f"one marker only: put a second one on {limbs}"


def test_a_joint_that_no_frame_shows_is_not_said_to_stand_still(joined):
    """A limb with one marker is posed by interpolation: how it turns is not measured."""
    seen = joined("undetermined", (60, 30, 2), [80, 1, 1], limb_of_marker=(0, 0, 0, 1, -1, -1), is_seen=False)
    shown = "the joint between limb 0 and 1 has no frame that shows how it turns: its place is not determined, +-80 mm"
    assert seen.notice == f"{shown}; one marker only: put a second one on limb 1"
