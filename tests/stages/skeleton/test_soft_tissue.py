"""Soft tissue: joints better than without a model of it, and stated deviations as large as the errors."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import skelgen
from skelgen.evaluation import evaluate
from skelgen.kinematics.joints.observability import observed_joints
from skelgen.simulation import simulate
from skelgen.stages.skeleton import SkeletonParameters

SEEDS, N_FRAMES, NOISE = range(6), 800, 0.5  # mm
COVERED = (0.90, 0.98)  # of 95 % intervals: what the issue asks
SCATTER = 0.02  # of the coverage of 42 joints whose errors last for the take


@pytest.fixture(scope="module")
def scores(simulated, reconstructed, true_limbs):
    """Mean joint error [mm] and coverage of random trees of 8 limbs: `scores(tissue [mm], dropouts, model)`."""

    @functools.cache
    def make(tissue: float, dropouts: float = 0.0, model: bool = True) -> np.ndarray:
        found = []
        for seed in SEEDS:
            options = {"noise": NOISE, "soft_tissue": tissue, "dropouts": dropouts}
            case = simulated("tree:8", seed, N_FRAMES, **options)
            parameters = SkeletonParameters(soft_tissue=model)
            project = reconstructed(case.take, given_limbs=true_limbs(case), skeleton=parameters)
            score = evaluate(project, case.truth)
            found.append((score.mean_joint_error, score.coverage))
        return np.array(found)

    return make


@pytest.mark.parametrize(("tissue", "dropouts"), [(3.0, 0.0), (1.0, 0.0), (3.0, 0.1)])
def test_intervals_hold_the_truth(scores, tissue, dropouts):
    coverage = scores(tissue, dropouts)[:, 1].mean()
    assert COVERED[0] - SCATTER <= coverage <= COVERED[1] + SCATTER


def test_slides_that_are_fitted_leave_less_error_and_honest_deviations(scores):
    with_model, without = scores(3.0), scores(3.0, model=False)
    assert with_model[:, 0].mean() < 0.85 * without[:, 0].mean()
    assert min(without[:, 1].mean(), with_model[:, 1].mean()) > 0.8


@pytest.mark.parametrize(("soft_tissue", "is_worn"), [("0", False), ("realistic", True)])
def test_more_frames_say_more_of_white_noise_and_nothing_of_soft_tissue(soft_tissue, is_worn):
    worn = {"motion": "walk", "marker_set": "animation-41"} if is_worn else {}
    take = simulate("human", n_frames=900, seed=2, noise=1.0, soft_tissue=soft_tissue, **worn).take
    few, many = (
        skelgen.reconstruct(take, parameters={"skeleton": {"refine_samples": most}}).skeleton for most in (300, 900)
    )
    places = [np.array([joint.position_in_parent for joint in one.joints]) for one in (few, many)]
    deviations = [np.median([np.linalg.norm(joint.std) for joint in one.joints]) for one in (few, many)]
    assert np.array_equal(*places) == is_worn
    assert (deviations[1] < 0.7 * deviations[0]) != is_worn


def test_joint_that_only_what_is_known_of_bodies_places_is_marked_however_well_it_is_placed():
    worn = {"motion": "squat", "marker_set": "plug-in-gait", "soft_tissue": "realistic"}
    project = skelgen.reconstruct(simulate("human", n_frames=200, seed=1, noise=0.3, **worn).take)
    joints = dict(zip(project.skeleton.joint_names, project.skeleton.joints, strict=True))
    knee, seen = joints["right knee"], dict(zip(joints, observed_joints(project.skeleton, project.motion), strict=True))
    assert seen["right knee"].n_open == 0  # motion and prior together leave nothing open
    assert not knee.is_placed_by_marker_set
    assert not knee.is_determined
    assert "is placed by what is usual of bodies" in seen["right knee"].sentence
