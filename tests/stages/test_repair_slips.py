"""Slipped markers are found where they slip and split there; soft tissue is no slip."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.stages.labels.repair import find_slips, split_slipped

FRAME, SIZE, TOLERANCE = 320, 10.0, 0.5  # mm: the mean of hundred frames with 0.5 mm noise


@pytest.fixture
def slipped(simulated):
    """A take in which one marker slips on its limb."""
    case = simulated("human:4", n_frames=600, noise=0.5)
    marker = case.take.names.index("head 3")
    positions = case.take.positions.copy()
    limb = case.truth.limb_of_marker[marker]
    positions[FRAME:, marker] += case.truth.world_from_limb[FRAME:, limb, :3, 0] * SIZE
    return dataclasses.replace(case.take, positions=positions)


def test_a_slip_is_found_with_its_frame_and_size(slipped, simulated, true_limbs):
    (slip,) = find_slips(slipped, true_limbs(simulated("human:4", n_frames=600, noise=0.5)))
    assert (slip.name, slip.frame) == ("head 3", FRAME)
    assert slip.size == pytest.approx(SIZE, abs=TOLERANCE)


def test_a_slipped_marker_is_split_and_nothing_is_lost(slipped, simulated, true_limbs):
    slips = find_slips(slipped, true_limbs(simulated("human:4", n_frames=600, noise=0.5)))
    split = split_slipped(slipped, slips)
    old, new = split.names.index("head 3"), split.names.index("head 3'2")
    assert not split.seen[FRAME:, old].any()
    assert not split.seen[:FRAME, new].any()
    both = np.where(np.isnan(split.positions[:, old]), split.positions[:, new], split.positions[:, old])
    np.testing.assert_array_equal(both, slipped.positions[:, old])
    assert f"frame {FRAME}" in split.notices[-1]


@pytest.mark.parametrize("structure", ["human", "human:4", "quadruped"])
def test_soft_tissue_is_no_slip(simulated, structure):
    take = simulated(structure, n_frames=600, noise=0.5, soft_tissue=2.0, dropouts=0.05).take
    assert find_slips(take) == ()
    assert split_slipped(take, ()) is take
