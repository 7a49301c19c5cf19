"""A marker that is split where it slipped: its limb keeps both parts, and the skeleton is as good as without slip."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skelgen
from skelgen.kinematics.gap_filling.filling import fill_gaps

FRAME, SIZE = 300, 15.0  # mm
AS_GOOD = 1.05  # times the mean residual of the undisturbed take


@pytest.mark.parametrize("name", ["left thigh 2", "left hand 1"])
def test_limb_keeps_both_parts_and_the_skeleton_fits_as_well(simulated, name):
    case = simulated("human", n_frames=600, noise=0.5, dropouts=0.02)
    marker, positions = case.take.names.index(name), case.take.positions.copy()
    limb = case.truth.limb_of_marker[marker]
    positions[FRAME:, marker] += case.truth.world_from_limb[FRAME:, limb, :3, 0] * SIZE
    clean = skelgen.reconstruct(case.take)
    split = skelgen.reconstruct(dataclasses.replace(case.take, positions=positions))
    names = split.trajectories.names
    limbs = split.limbs.limb_of_marker
    assert names[-1] == f"{name}_2"
    assert limbs[-1] == limbs[marker] >= 0
    assert np.array_equal(limbs[:-1], clean.limbs.limb_of_marker)
    assert np.array_equal(split.topology.parents, clean.topology.parents)
    assert np.nanmean(split.motion.residuals) < AS_GOOD * np.nanmean(clean.motion.residuals)
    filled = fill_gaps(split.trajectories, split.skeleton, split.motion)
    assert np.isfinite(filled.positions[FRAME:, marker]).all()
