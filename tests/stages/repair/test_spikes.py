"""Spikes of labels are gaps, and nothing that was measured is taken for one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.model import Trajectories
from skelgen.stages.limbs import find_limbs
from skelgen.stages.repair import repair_take
from skelgen.stages.repair.spikes import find_spikes

OPTIONS = {"n_frames": 300, "noise": 0.3, "motion": "walk", "marker_set": "animation-41", "soft_tissue": "realistic"}
LEAST_PART = 0.85  # the others lie in the direction in which their limb moves, or beside another


@pytest.fixture(scope="module")
def spiky(simulated):
    """A person, each of whose markers is 80 mm off three times for 1 to 6 frames, and where."""
    take, rng = simulated("human", seed=4, **OPTIONS).take, np.random.default_rng(0)
    positions, where = take.positions.copy(), np.zeros(take.positions.shape[:2], dtype=np.bool_)
    for marker in range(take.n_markers):
        for first in (20 + 2 * marker, 110 + 2 * marker, 200 + 2 * marker):
            away, frames = rng.normal(size=3), slice(first, first + rng.integers(1, 7))
            positions[frames, marker] += 80.0 * away / np.linalg.norm(away)
            where[frames, marker] = True
    return dataclasses.replace(take, positions=positions), where


def test_spikes_are_gaps(spiky) -> None:
    take, where = spiky
    repair = repair_take(take)
    found = np.isnan(repair.trajectories.positions[..., 0])
    assert (found & where).sum() > LEAST_PART * where.sum() and not (found & ~where).any()
    assert {one.kind for one in repair.findings} == {"spike"}


def test_limbs_are_those_without_spikes(spiky, simulated, same_partition) -> None:
    clean = find_limbs(simulated("human", seed=4, **OPTIONS).take).limb_of_marker
    assert same_partition(find_limbs(repair_take(spiky[0]).trajectories).limb_of_marker, clean)


@pytest.mark.parametrize(
    "name", ["bodies/flips.c3d", "bodies/landing.trc", "bodies/treadmill.trc", "bone_pin/abdbonepin.trc"]
)
def test_recordings_have_none(recording, name) -> None:
    assert find_spikes(recording(name)) == ()


@pytest.mark.parametrize("every", [1, 2])
def test_of_three_markers_the_one_that_jumps_is_found_and_what_is_seen_in_every_second_frame_is_none(every) -> None:
    rng = np.random.default_rng(0)
    positions = rng.uniform(-200, 200, (1, 3, 3)) + rng.normal(size=(200, 3, 3))
    positions[100, 2] += 100.0
    positions[np.arange(200) % every > 0] = np.nan
    found = find_spikes(Trajectories(positions, tuple("abc"), 100.0))
    assert [(one.name, one.frames.tolist()) for one in found] == ([("c", [100])] if every == 1 else [])
