"""The classic joint solver: limbs of two markers, where a descent from half-way between them ends in wrong places."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.stages.classic.conjugate_gradients import DescentParameters
from skelgen.stages.classic.joint_solver import JointSolver
from skelgen.stages.classic.lateration import common_distances

SEEDS = range(5)
NOISE = 1e-8  # mm^2: none
EXACT = 1e-2  # mm: what the issue asks of joints in exact takes


@pytest.fixture
def elbow(simulated):
    """Markers of upper arm and forearm, two each, and where the elbow is."""

    def of_seed(seed, **options):
        case = simulated("classic-human", seed=seed, **options)
        limbs = [case.truth.limb_names.index(name) for name in ("right upper arm", "right forearm")]
        column = case.truth.edges.tolist().index(limbs)
        markers = [case.take.positions[:, case.truth.limb_of_marker == limb] for limb in limbs]
        return markers, case.truth.joint_positions[:, column]

    return of_seed


def solver(noise=NOISE, **options):
    return JointSolver(DescentParameters(**options), max_residual=25.0, max_fallback=5, noise=noise, seed=0)


@pytest.mark.parametrize("method", ["polak-ribiere", "fletcher-reeves"])
@pytest.mark.parametrize("seed", SEEDS)
def test_elbow_between_limbs_of_two_markers_is_exact(elbow, seed, method):
    markers, joint = elbow(seed)
    found = solver(method=method).solve(*markers, alpha=0.0)
    assert np.linalg.norm(found.positions - joint, axis=1).mean() < EXACT
    assert found.variance < EXACT**2


def test_noisy_elbow_is_as_good_as_from_the_truth(elbow):
    markers, joint = elbow(0, noise=0.5)
    true_distances = np.linalg.norm(np.concatenate(markers, axis=1) - joint[:, np.newaxis], axis=2).mean(axis=0)
    errors = [
        np.linalg.norm(solver(0.25).solve(*markers, 0.0, start).positions - joint, axis=1).mean()
        for start in (None, true_distances)
    ]
    assert errors[0] < 1.5 * errors[1]


def test_gaps_leave_the_elbow_where_it_is(elbow):
    markers, joint = elbow(1, dropouts=0.1)
    usable = ~np.isnan(np.stack([limb[:, :, 0] for limb in markers])).all(axis=2).any(axis=0)
    found = solver().solve(*(limb[usable] for limb in markers), alpha=0.0)
    errors = np.linalg.norm(found.positions - joint[usable], axis=1)
    seen = (~np.isnan(np.concatenate(markers, axis=1)[usable, :, 0])).sum(axis=1)
    assert errors[seen == 4].max() < EXACT
    assert np.median(errors[seen == 3]) < EXACT  # some are beyond: a gap of many frames bridges to the other side


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_that_fit_all_frames_are_the_true_ones(elbow, seed):
    markers, joint = elbow(seed)
    four, found = common_distances(*markers, n_wanted=1, seed=0)
    true = np.linalg.norm(np.concatenate(markers, axis=1)[:, four] - joint[:, np.newaxis], axis=2).mean(axis=0)
    np.testing.assert_allclose(found[0], true, rtol=1e-6)


def test_limbs_of_one_marker_have_no_common_distances(elbow):
    (first, second), _ = elbow(0)
    four, found = common_distances(first[:, :1], second, n_wanted=1, seed=0)
    assert not len(four)
    assert not len(found)


def test_known_distances_are_a_better_start(elbow):
    markers, joint = elbow(2)
    distances = np.linalg.norm(np.concatenate(markers, axis=1) - joint[:, np.newaxis], axis=2).mean(axis=0)
    cold, warm = solver().solve(*markers, 0.0), solver().solve(*markers, 0.0, distances)
    assert warm.n_iterations < cold.n_iterations / 5
    assert np.linalg.norm(warm.positions - joint, axis=1).max() < EXACT


def test_annealing_never_ends_worse(simulated):
    case = simulated("rods")
    markers = [case.take.positions[:, case.truth.limb_of_marker == limb] for limb in (0, 1)]
    plain = solver(max_iterations=30)
    shaken = dataclasses.replace(plain, descent=DescentParameters(max_iterations=30, anneal=True))
    assert shaken.solve(*markers, 0.0).variance <= plain.solve(*markers, 0.0).variance
