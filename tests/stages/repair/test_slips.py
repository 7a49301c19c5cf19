"""Slipped markers are found where they slip and split there; soft tissue, glitches and gaps are no slips."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen._kernels.marker_steps import changes, jumps
from skelgen.stages.repair import RepairParameters, repair_take
from skelgen.stages.repair.slip_evidence import leaps
from skelgen.stages.repair.slips import find_slips, split_slipped

FRAME, SIZE, TOLERANCE = 320, 15.0, 2.0  # mm: lines of eight frames with 0.5 mm noise
NAME = "head 3"


@pytest.fixture
def slipped(simulated):
    """`slipped(last)`: a take in which one marker sits elsewhere on its limb from `FRAME` to `last`."""

    def make(last=None, **faults):
        case = simulated("human:4", n_frames=600, noise=0.5, **faults)
        marker = case.take.names.index(NAME)
        positions = case.take.positions.copy()
        limb = case.truth.limb_of_marker[marker]
        frames = slice(FRAME, last)
        positions[frames, marker] += case.truth.world_from_limb[frames, limb, :3, 0] * SIZE
        return dataclasses.replace(case.take, positions=positions)

    return make


@pytest.mark.parametrize("soft_tissue", [0.0, 2.0])
def test_a_slip_is_found_with_its_frame_and_size(slipped, soft_tissue):
    (slip,) = find_slips(slipped(soft_tissue=soft_tissue))
    assert (slip.name, slip.frame) == (NAME, FRAME)
    assert slip.size == pytest.approx(SIZE, abs=TOLERANCE)
    assert slip.sure


def test_a_slipped_marker_is_split_and_nothing_is_lost(slipped):
    take = slipped()
    split = split_slipped(take, find_slips(take))
    old, new = split.names.index(NAME), split.names.index(f"{NAME}_2")
    assert not split.seen[FRAME:, old].any()
    assert not split.seen[:FRAME, new].any()
    both = np.where(np.isnan(split.positions[:, old]), split.positions[:, new], split.positions[:, old])
    np.testing.assert_array_equal(both, take.positions[:, old])
    assert f"frame {FRAME}" in split.notices[-1]
    assert f"{NAME}_2" in split.notices[-1]


def test_the_labels_stage_splits_unless_it_is_told_not_to(slipped):
    take = slipped()
    assert f"{NAME}_2" in repair_take(take).trajectories.names
    assert repair_take(take, RepairParameters(slips=False)).trajectories is take


def test_what_may_be_a_slip_is_told_and_left(slipped):
    take = slipped()
    doubtful = [dataclasses.replace(slip, sure=False) for slip in find_slips(take)]
    left = split_slipped(take, doubtful)
    assert left.names == take.names
    assert "may slip" in left.notices[-1]


def test_a_glitch_of_the_tracker_is_no_slip(slipped):
    assert find_slips(slipped(last=FRAME + 3)) == ()


def test_a_step_across_the_plane_of_three_markers_is_told_and_not_split(simulated, notices):
    case = simulated("human", n_frames=600, noise=0.5)
    marker = case.take.names.index("left thigh 1")
    limb = case.truth.limb_of_marker == case.truth.limb_of_marker[marker]
    corners = case.take.positions[FRAME:, limb]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    positions = case.take.positions.copy()
    positions[FRAME:, marker] += SIZE * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    take = dataclasses.replace(case.take, positions=positions)
    (slip,) = find_slips(take)
    assert (slip.name, slip.frame, slip.sure) == ("left thigh 1", FRAME, False)
    repair_take(take, monitor=notices)
    assert any("found, 1 marker may have slipped and is left as it is" in one for one in notices.sentences)


def test_a_leap_that_is_made_back_is_none():
    steps = np.zeros((300, 3))
    steps[100], steps[150] = 20.0, -20.0
    paces = np.random.default_rng(0).normal(size=(300, 3))
    paces[100] += 20.0
    assert leaps(steps, lambda: paces, 4.0, 60) == []
    steps[150] = 0.0
    assert [frame for frame, _ in leaps(steps, lambda: paces, 4.0, 60)] == [100]


@pytest.mark.parametrize("structure", ["human", "human:4", "quadruped"])
def test_soft_tissue_is_no_slip(simulated, structure):
    take = simulated(structure, n_frames=600, noise=0.5, soft_tissue=2.0, dropouts=0.05).take
    assert find_slips(take) == ()
    assert split_slipped(take, ()) is take


@pytest.mark.parametrize(("n_frames", "n_markers"), [(0, 0), (1, 3), (600, 1), (600, 2)])
def test_takes_too_small_to_tell_have_no_slips(simulated, n_frames, n_markers):
    whole = simulated("human:4", n_frames=600, noise=0.5).take
    part = whole.positions[:n_frames, :n_markers]
    assert find_slips(dataclasses.replace(whole, positions=part, names=whole.names[:n_markers])) == ()


def test_a_marker_that_is_never_seen_disturbs_nothing(slipped):
    take = slipped()
    positions = take.positions.copy()
    positions[:, 0] = np.nan
    assert [slip.name for slip in find_slips(dataclasses.replace(take, positions=positions))] == [NAME]


def test_constant_acceleration_is_no_jump():
    times = np.arange(60.0)
    assert np.abs(jumps((times**2)[:, np.newaxis])[8:-8]).max() < 1e-9  # where both lines are whole


def test_a_step_is_a_jump_of_its_size_and_a_change_that_lasts():
    series = np.where(np.arange(60) < 30, 1.0, 4.0)[:, np.newaxis]
    assert jumps(series)[30, 0] == pytest.approx(3.0)
    assert changes(series, 10)[30, 0] == pytest.approx(3.0)
    assert changes(series, 10, 5)[30, 0] == pytest.approx(3.0)
