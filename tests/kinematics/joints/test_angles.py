"""Angles of joints over time."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.joints.angles import continued, joint_angles
from skelgen.model import Joint

NOWHERE = np.zeros(3)
EXACT = 1e-9  # rad
TURNS = np.linspace(0, -20, 200)  # rad


def about(angle, axis):
    return matrix_from_vector(np.outer(angle, axis))


def test_the_angle_of_a_wheel_goes_on_over_full_turns():
    axis = np.array([0.0, 0.6, 0.8])
    wheel = Joint(0, 1, NOWHERE, NOWHERE, "hinge", axis, np.ones(3))
    angles = joint_angles(wheel, about(TURNS, axis))
    np.testing.assert_allclose(continued(wheel, angles)[:, 0], TURNS, atol=EXACT)
    first = continued(wheel, angles[:90])
    np.testing.assert_allclose(continued(wheel, angles[90:], first[-1])[:, 0], TURNS[90:], atol=EXACT)


def test_both_angles_of_a_universal_joint_go_on_over_full_turns():
    first, second, other = np.eye(3)[0], np.eye(3)[1], 0.5 * np.sin(TURNS)
    joint = Joint(0, 1, NOWHERE, NOWHERE, "universal", first, np.ones(3), second)
    for angles in ((TURNS, other), (other, TURNS)):
        found = continued(joint, joint_angles(joint, about(angles[0], first) @ about(angles[1], second)))
        np.testing.assert_allclose(found, np.stack(angles, axis=1), atol=EXACT)
