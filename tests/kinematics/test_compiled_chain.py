"""Compiled loops over the frames of a chain do what their plain twins do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.evaluation.bound import true_chain
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import plain_covariances, plain_information, plain_posing, plain_pull
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.chain.normal_equations import total_information
from skelgen.kinematics.inverse.poses import MAX_STEPS, fit_poses
from skelgen.simulation import simulate

compiled_covariances = pytest.importorskip("skelgen.kinematics.compiled_covariances", reason="numba is not installed")
compiled_pull = pytest.importorskip("skelgen.kinematics.compiled_pull", reason="numba is not installed")
compiled_posing = pytest.importorskip("skelgen.kinematics.compiled_posing", reason="numba is not installed")
compiled_information = pytest.importorskip("skelgen.kinematics.compiled_information", reason="numba is not installed")

SAME = 1e-9  # rad, and of the largest number: rounding of some thousand operations
SAME_PLACE = 1e-3  # mm; where damping alone holds a turn, it lets rounding grow a million times
SAME_COVARIANCE = 1e-7  # the same where nothing but the given level tells of a turn
SAME_FIT = 1e-6  # the same where a fit may end a step earlier


@pytest.fixture(scope="module", params=["free", "held", "lone markers"])
def case(request):
    """A chain beside its markers: with ball joints, with all kinds, or with limbs that have one marker or none."""
    simulated = simulate("tree:30", n_frames=40, noise=0.5, dropouts=0.2)
    chain, articulation, poses = true_chain(simulated.truth)
    positions = simulated.take.positions.copy()
    positions[3] = np.nan
    kinds = ("ball", "rigid", *articulation.kinds[2:])
    articulation = replace(articulation, kinds=kinds).at_rest(chain.parents, poses.rotations)
    if request.param == "held":
        assert set(kinds) == {"ball", "hinge", "universal", "rigid"}
    else:
        articulation = Articulation.free(chain.n_limbs)
    if request.param == "lone markers":
        chain, positions = thinned(chain, positions)
    turns = matrix_from_vector(0.1 * np.random.default_rng(0).normal(size=(*poses.rotations.shape[:2], 3)))
    rotations = articulation.projected(chain.parents, turns @ poses.rotations)
    return chain, articulation, ChainPoses(poses.root + 5.0, rotations), positions


def thinned(chain, positions):
    """The chain with one marker on every third limb, and none on every fourth."""
    place = np.array(
        [(chain.limb_of_marker[:marker] == limb).sum() for marker, limb in enumerate(chain.limb_of_marker)]
    )
    limb = chain.limb_of_marker
    kept = ((limb % 3 > 0) | (place == 0)) & (limb % 4 != 1)
    return Chain(chain.parents, limb[kept], chain.joints, chain.offsets[kept]), positions[:, kept]


@pytest.mark.parametrize("steps", [1, 2])
def test_steps_of_poses_are_the_same(case, steps):
    chain, articulation, start, positions = case
    given = chain, articulation, start, positions, seen_weights(positions), steps
    found, wanted = compiled_posing.settled(*given), plain_posing.settled(*given)
    seen = seen_weights(positions) > 0
    np.testing.assert_allclose(found.markers(chain)[seen], wanted.markers(chain)[seen], rtol=0, atol=SAME_PLACE)
    if np.bincount(chain.limb_of_marker).min() > 2:
        np.testing.assert_allclose(found.rotations[seen.any(axis=1)], wanted.rotations[seen.any(axis=1)], atol=SAME)


def test_settled_poses_are_the_same_from_far_away(case):
    chain, articulation, start, positions = case
    far = matrix_from_vector(np.random.default_rng(1).normal(size=(*start.rotations.shape[:2], 3)))
    start = replace(start, rotations=articulation.projected(chain.parents, far @ start.rotations))
    weights = seen_weights(positions, np.random.default_rng(2).uniform(0.1, 1.0, positions.shape[:2]))
    given = chain, articulation, start, positions, weights, 4 * MAX_STEPS
    found, wanted = compiled_posing.settled(*given), plain_posing.settled(*given)
    squares = [
        np.einsum("fmi,fm->f", np.nan_to_num(positions - one.markers(chain)) ** 2, weights) for one in (found, wanted)
    ]
    np.testing.assert_allclose(squares[0], squares[1], rtol=SAME_FIT)


def test_information_is_the_same(case):
    chain, articulation, poses, positions = case
    weights = seen_weights(positions, np.random.default_rng(2).uniform(0.1, 1.0, positions.shape[:2]))
    found = compiled_information.summed(chain, articulation, poses, weights)
    wanted = plain_information.summed(chain, articulation, poses, weights)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=SAME * np.abs(wanted).max())
    np.testing.assert_array_equal(found, found.T)


def test_arrays_that_may_not_be_written_to_are_left_alone_and_compile_nothing_anew(case):
    chain, articulation, start, positions = case
    fit_poses(chain, start, positions, articulation)
    total_information(chain, articulation, start, positions)
    before = [len(one.signatures) for one in (compiled_posing.settle_frames, compiled_information.add_frames)]
    frozen = [np.asfortranarray(one) for one in (start.root, start.rotations, positions)]
    for one in frozen:
        one.flags.writeable = False
    poses = ChainPoses(frozen[0], frozen[1])
    fit_poses(chain, poses, frozen[2], articulation)
    total_information(chain, articulation, poses, frozen[2])
    assert [len(one.signatures) for one in (compiled_posing.settle_frames, compiled_information.add_frames)] == before


def test_chunks_of_frames_make_no_difference(case, monkeypatch):
    chain, articulation, start, positions = case
    whole = fit_poses(chain, start, positions, articulation), total_information(chain, articulation, start, positions)
    for module in ("posing", "information"):
        monkeypatch.setattr(f"skelgen.kinematics.{module}.CHUNK_FRAMES", 7)
    parts = fit_poses(chain, start, positions, articulation), total_information(chain, articulation, start, positions)
    np.testing.assert_array_equal(parts[0].rotations, whole[0].rotations)
    np.testing.assert_allclose(parts[1], whole[1], rtol=0, atol=SAME * np.abs(whole[1]).max())


def test_pull_is_the_same(case):
    chain, articulation, poses, positions = case
    weights = seen_weights(positions, np.random.default_rng(2).uniform(0.1, 1.0, positions.shape[:2]))
    found = compiled_pull.summed(chain, articulation, poses, positions, weights)
    wanted = plain_pull.summed(chain, articulation, poses, positions, weights)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=SAME * np.abs(wanted).max())


def test_covariances_are_the_same(case):
    chain, articulation, poses, positions = case
    given = chain, articulation, poses, seen_weights(positions), (1.0, 0.01)
    for found, wanted in zip(compiled_covariances.outward(*given), plain_covariances.outward(*given), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=SAME_COVARIANCE * np.abs(wanted).max())
