"""Frames that fit two poses are posed as the frames around them tell."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.simulation import simulate

FOLDED = 15.0  # mm: an arm on the wrong side is 40 mm off, the right side with a marker too few up to 7


@pytest.fixture(scope="module")
def arm_with_a_marker_too_few():
    """Two-marker arm; in frames 890 to 899 two of its markers are unseen, and folding it fits about as well."""
    simulated = simulate("classic-human", seed=0, n_frames=1000, noise=0.5, dropouts=0.05)
    return simulated.truth, skelgen.reconstruct(simulated.take, seed=0)


def test_arm_does_not_fold_to_the_other_side_for_some_frames(arm_with_a_marker_too_few):
    truth, project = arm_with_a_marker_too_few
    wrist = truth.joint_positions[885:905, truth.joint_names.index("left forearm - left hand")]
    apart = np.linalg.norm(project.motion.joint_positions[885:905] - wrist[:, np.newaxis], axis=2)
    assert apart[:, np.median(apart, axis=0).argmin()].max() < FOLDED
