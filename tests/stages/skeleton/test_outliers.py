"""Gross label errors are left out of the fit and named; exact and soft takes lose nothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.evaluation import evaluate
from skelgen.model import Trajectories
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import find_limbs
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

ERROR = 800.0  # mm: another marker of a human body
ROUNDING = 1e-3  # mm: what the fit of the other markers may lose


@pytest.fixture
def fit(notices):
    """Fit a skeleton to positions with the limbs and joints of the undisturbed take."""
    return lambda case, positions: _fit(case, positions, notices)


def _fit(case, positions, notices):
    take = Trajectories(positions, case.take.names, case.take.rate)
    limbs = find_limbs(case.take)
    topology = find_joints(case.take, limbs)
    skeleton, motion = fit_skeleton(take, limbs, topology, monitor=notices)
    return skeleton, motion, [notice for notice in notices.sentences if "left out of the fit" in notice]


def test_a_mislabelled_stretch_pulls_nothing_and_is_named(simulated, fit):
    case = simulated("human", n_frames=300)
    marker = case.take.names.index("left foot 1")
    positions = case.take.positions.copy()
    positions[100:150, marker] += [0.0, 0.0, ERROR]
    _, motion, left_out = fit(case, positions)
    assert left_out == ["left out of the fit because it cannot belong to the marker: left foot 1 in 50 frames"]
    np.testing.assert_allclose(motion.residuals[100:150, marker], ERROR, atol=ROUNDING)
    assert np.delete(motion.residuals, marker, axis=1).max() < ROUNDING


@pytest.mark.parametrize("faults", [{}, {"noise": 0.5, "dropouts": 0.05}, {"soft_tissue": 3.0}])
def test_takes_without_gross_errors_lose_nothing(simulated, fit, faults):
    case = simulated("human", n_frames=300, **faults)
    _, _, left_out = fit(case, case.take.positions)
    assert left_out == []


@pytest.mark.parametrize("name", ["rods", "tree:8"])
def test_a_hundredth_of_wrong_positions_hardly_moves_joints(simulated, reconstructed, true_limbs, name):
    """Positions of 1 % are displaced by 20 to 50 mm, which is less than the limits for single limbs catch."""
    case = simulated(name, 0, 400, noise=0.5)
    random = np.random.default_rng(0)
    positions = case.take.positions.copy()
    wrong = random.random(positions.shape[:2]) < 0.01
    way = random.normal(size=(wrong.sum(), 3))
    positions[wrong] += way / np.linalg.norm(way, axis=1, keepdims=True) * random.uniform(20, 50, (wrong.sum(), 1))
    dirty = dataclasses.replace(case.take, positions=positions)
    clean, robust, plain = (
        evaluate(
            reconstructed(take, given_limbs=true_limbs(case), skeleton=SkeletonParameters(robust=limit)), case.truth
        ).mean_joint_error
        for take, limit in ((case.take, 6.0), (dirty, 6.0), (dirty, 1e6))
    )
    assert robust < 1.25 * clean  # a frame without a marker of three knows less
    assert plain > 1.5 * clean
