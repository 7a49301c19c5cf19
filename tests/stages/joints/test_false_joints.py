"""Edges of a tree that are no joints are cut, so that bodies are trees of their own."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import Limbs, Trajectories
from skelgen.simulation import simulate
from skelgen.stages.joints import find_joints


@pytest.mark.parametrize(("mount", "rider", "seed"), [("tree:8", "human", 0), ("quadruped", "tree:8", 1)])
def test_a_rider_who_moves_in_the_saddle_is_a_body_of_his_own(mount, rider, seed):
    below, above = (simulate(name, seed=seed + after, n_frames=600) for after, name in enumerate((mount, rider)))
    sway = np.sin(np.arange(600)[:, np.newaxis] / 100 * [9, 6, 11]) * np.array([30.0, 15, 40])
    carried = below.truth.world_from_limb[:, 0] @ np.linalg.inv(above.truth.world_from_limb[:, 0])
    carried[:, :3, 3] += sway + np.array([0.0, 0, 300])
    seated = np.einsum("fij,fmj->fmi", carried[:, :3, :3], above.take.positions) + carried[:, np.newaxis, :3, 3]
    positions = np.concatenate([below.take.positions, seated], axis=1)
    positions += np.random.default_rng(0).normal(0, 0.5, positions.shape)
    n_below = len(below.truth.parents)
    limb_of_marker = np.concatenate([below.truth.limb_of_marker, above.truth.limb_of_marker + n_below])
    take = Trajectories(positions, tuple(f"M{number}" for number in range(len(limb_of_marker))), 100.0)
    parents = find_joints(take, Limbs(limb_of_marker, np.zeros((len(limb_of_marker),) * 2))).parents
    assert (parents < 0).sum() == 2
    assert not ((parents[n_below:] >= 0) & (parents[n_below:] < n_below)).any()
