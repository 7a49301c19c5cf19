"""What a joint's motion leaves open is said in words."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.observability import range_of_motion, undetermined_place

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


def test_hinge_says_that_its_place_along_the_axis_is_open():
    said = undetermined_place((3, 4), "hinge", range_of_motion(swing((60, 0, 0))), np.diag([41.0**2, 1, 1]), SIZE)
    assert said == (
        "the joint between limb 3 and 4 turns about one axis only: its place along that axis is not determined, +-41 mm"
    )


def test_joint_that_does_not_turn_says_so():
    said = undetermined_place((0, 1), "rigid", range_of_motion(swing((1, 0, 0))), np.eye(3) * 50.0**2, SIZE)
    assert said.endswith("does not turn: its place is not determined, +-50 mm")


def test_joint_that_turns_too_little_names_the_direction():
    said = undetermined_place((0, 1), "ball", range_of_motion(swing((20, 3, 2))), np.diag([15.0**2, 1, 1]), SIZE)
    assert "turns too little (by 20, 3, 2 deg" in said
    assert "known to +-15 mm only" in said


def test_determined_place_is_not_talked_about():
    assert undetermined_place((0, 1), "ball", range_of_motion(swing((60, 30, 10))), np.eye(3), SIZE) == ""
