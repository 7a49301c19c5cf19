"""A label on the marker of another limb, which has none meanwhile, is given back; nothing is found without error."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.model import Trajectories
from skelgen.stages.repair import repair_take
from skelgen.stages.repair.moves import find_moves, undo_moves

FIRST, LAST = 200, 349
NAME, OTHER = "head 3", "right thigh 1"


@pytest.fixture
def take(simulated) -> Trajectories:
    """A human with soft tissue and dropouts."""
    return simulated("human:4", n_frames=600, noise=0.5, soft_tissue=2.0, dropouts=0.03).take


@pytest.fixture
def moved(take):
    """`moved(alone)`: one label sits on a marker of another limb; `alone`, nothing else of its own limb is seen."""

    def make(alone=False):
        positions, frames = take.positions.copy(), slice(FIRST, LAST + 1)
        marker, other = take.names.index(NAME), take.names.index(OTHER)
        if alone:
            mates = [index for index, name in enumerate(take.names) if name.startswith("head")]
            positions[frames, mates] = np.nan
        positions[frames, marker] = take.positions[frames, other]
        positions[frames, other] = np.nan
        return dataclasses.replace(take, positions=positions)

    return make


@pytest.mark.parametrize("alone", [False, True])
def test_a_label_on_another_marker_is_found_and_given_back(take, moved, alone):
    wrong = moved(alone)
    (move,) = find_moves(wrong)
    assert (move.name, move.other_name) == (NAME, OTHER)
    seen = FIRST + np.flatnonzero(take.seen[FIRST : LAST + 1, take.names.index(OTHER)])
    assert (move.first_frame, move.last_frame) == (seen[0], seen[-1])
    repaired, other = undo_moves(wrong, (move,)), take.names.index(OTHER)
    np.testing.assert_array_equal(repaired.positions[:, other], take.positions[:, other])
    assert not repaired.seen[FIRST : LAST + 1, take.names.index(NAME)].any()


def test_nothing_is_found_in_a_take_without_errors(take):
    assert find_moves(take) == ()
    assert undo_moves(take, ()) is take


def test_a_marker_that_is_only_unseen_is_no_move(take):
    positions = take.positions.copy()
    positions[FIRST:, [take.names.index(NAME), take.names.index(OTHER)]] = np.nan
    assert find_moves(dataclasses.replace(take, positions=positions)) == ()


def test_the_stage_tells_of_it_with_frames_evidence_and_outcome(moved):
    repair = repair_take(moved())
    (finding,) = repair.findings
    assert (finding.kind, finding.names) == ("moved", (NAME, OTHER))
    assert OTHER in finding.outcome
    assert "its distances to right thigh" in finding.evidence
    assert f"{NAME} is where {OTHER} was" in repair.trajectories.notices[-1]


def test_the_toe_of_the_suit_that_sits_on_the_wrist_is_found(recording):
    (move,) = find_moves(recording("human/nick_freeform_001.c3d"))
    assert (move.name, move.other_name, move.first_frame) == ("RTOE", "RIWR", 975)
