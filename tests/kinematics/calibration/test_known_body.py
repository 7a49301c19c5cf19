"""What is known of a body's build: 0 where it holds, whatever frames limbs have, and joints that follow from it."""

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.calibration.joint_places import places
from skelgen.kinematics.calibration.known_body import (
    KnownBody,
    body_residuals,
    joints_of_body,
    joints_of_limbs,
    known_limbs,
)
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed

N_FRAMES = 5
STEP = 1e-3  # mm


@pytest.fixture
def case():
    """Three limbs of four, four and two markers in a row, whose frames are turned anyhow, and their known build."""
    rng = np.random.default_rng(0)
    segments = np.repeat([0, 1, 2], [4, 4, 2])
    offsets, joints = rng.normal(size=(10, 3)) * 80, np.array([[0, 0, 0], [0, 0, 200.0], [10, 0, 300.0]])
    body = KnownBody(segments, offsets, np.array([-1, 0, 1]), joints)
    turns = matrix_from_vector(rng.normal(size=(3, 3)))
    joints_here = joints.copy()
    joints_here[1:] = np.einsum("lij,lj->li", turns[:2], joints[1:])
    chain = Chain(body.parents, segments, joints_here, np.einsum("mij,mj->mi", turns[segments], offsets))
    poses = ChainPoses(rng.normal(size=(N_FRAMES, 3)), matrix_from_vector(rng.normal(size=(N_FRAMES, 3, 3))))
    return chain, body, observed(chain, Articulation.free(3), poses, poses.markers(chain))


def test_a_chain_of_that_build_is_not_surprising(case):
    chain, body, _ = case
    np.testing.assert_allclose(body_residuals(chain, known_limbs(chain, body))[1], 0, atol=1e-9)


def test_rows_are_the_slopes_of_half_the_squares(case):
    chain, body, _ = case
    rng = np.random.default_rng(1)
    off = chain.moved(chain.joints + 30 * rng.normal(size=(3, 3)), chain.offsets + 5 * rng.normal(size=(10, 3)))
    limbs = known_limbs(off, body)

    def half_squares(step):
        moved = (places(off).ravel() + step).reshape(-1, 3)
        return (body_residuals(off.moved(np.vstack([off.joints[:1], moved[10:]]), moved[:10]), limbs)[1] ** 2).sum() / 2

    rows, towards = body_residuals(off, limbs)
    unit = np.eye(rows.shape[1]) * STEP
    slopes = [(half_squares(one) - half_squares(-one)) / (2 * STEP) for one in unit]
    np.testing.assert_allclose(rows.T @ towards, slopes, rtol=1e-4, atol=1e-6)


def test_joints_go_to_where_limbs_whose_markers_fix_them_expect_them(case):
    chain, body, fit = case
    joints = chain.joints.copy()
    joints[1:] += 200.0
    astray = Chain(chain.parents, chain.limb_of_marker, joints, chain.offsets)
    limbs = known_limbs(astray, body)
    assert joints_of_limbs(astray, limbs) == {1, 2}
    one = observed(astray, fit.articulation, fit.poses[slice(0, 1)], fit.positions[:1])
    moved = joints_of_body(one, limbs)
    assert np.linalg.norm(moved.chain.joints[1] - chain.joints[1]) < np.linalg.norm(joints[1] - chain.joints[1])


def test_markers_that_are_on_the_limb_of_another_segment_say_nothing(case):
    chain, body, _ = case
    wrong = KnownBody(np.where(np.arange(10) == 0, 2, body.segments), body.offsets, body.parents, body.joints)
    assert len(known_limbs(chain, wrong)[0].rows) == len(known_limbs(chain, body)[0].rows) - 1
