"""Joints beyond the tree close loops only where they move against what lies between."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen.stages.joints.loops import closing_loops
from skelgen.stages.joints.pairs import Guessing
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.segments import make_segments

FRAMES = np.arange(300)
PLATE = np.array([[0.0, 0, 0], [20, 0, 5], [5, 18, -4], [-8, 6, 15]])  # mm


@pytest.mark.parametrize(("far", "moves", "closes"), [(300.0, 0.0, False), (300.0, 60.0, True), (30.0, 0.0, False)])
def test_a_joint_that_is_known_no_better_than_it_moves_closes_no_loop(far, moves, closes):
    """Small plates turn about one point, seen from afar; what lies between them stands beside it, or moves there."""
    rng, times = np.random.default_rng(0), FRAMES[:, np.newaxis] / 100
    turns = [Rotation.from_rotvec(0.5 * np.sin(times * np.array(pace))) for pace in ([5, 3, 2], [2, 4, 7])]
    ends = [np.stack([turn.apply(place) for place in PLATE + np.array([far, 0, 0])], axis=1) for turn in turns]
    between = PLATE + ((30 + moves * np.sin(3 * times)) * np.eye(3)[1])[:, np.newaxis]
    markers = [limb + rng.normal(0, 0.3, limb.shape) for limb in (ends[0], between, ends[1])]
    how, known_well = Guessing(JointParameters(), 0), np.full((3, 3), 0.01)  # mm^2
    loops = closing_loops([(0, 2)], np.array([1, -1, 1]), make_segments(markers, FRAMES), known_well, how)
    assert loops == (((0, 2),) if closes else ())
