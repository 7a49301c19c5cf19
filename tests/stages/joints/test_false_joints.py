"""Edges of a tree that are no joints are cut, so that bodies are trees of their own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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


@pytest.mark.parametrize("seed", range(4))
def test_plates_that_fly_by_themselves_share_no_joint(seed):
    rng, times = np.random.default_rng(seed), np.arange(900) / 75
    plates = []
    for number in range(5):
        waves = rng.uniform(0.5, 1.0, 6)[:, np.newaxis] * np.sin(
            2 * np.pi * rng.uniform(0.25, 0.6, (6, 1)) * times + rng.uniform(0, 6, (6, 1))
        )
        places = Rotation.from_rotvec(0.3 * waves[:3].T).as_matrix() @ rng.uniform(-70, 70, (3, 4))
        plates.append(places.swapaxes(1, 2) + (500 * waves[3:].T + [500.0 * number, 0, 800])[:, np.newaxis])
    positions = np.concatenate(plates, axis=1) + rng.normal(0, 0.3, (900, 20, 3))
    limbs = Limbs(np.repeat(np.arange(5), 4), np.zeros((20, 20)))
    topology = find_joints(Trajectories(positions, tuple(f"M{m}" for m in range(20)), 75.0), limbs)
    assert len(topology.roots) == 5 and not topology.loops
