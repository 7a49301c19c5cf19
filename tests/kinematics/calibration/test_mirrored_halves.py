"""Halves that mirror each other: who is whose twin, bones of one length, and joints inward of markers."""

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.calibration.joint_places import joint_places, places
from skelgen.kinematics.calibration.mirrored_halves import (
    INWARD,
    inward_places,
    inward_residuals,
    twin_residuals,
    twins,
)
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed

PARENTS = np.array([-1, 0, 0, 0, 1, 2])  # a trunk on a pelvis, two thighs, two shanks
JOINTS = np.array([[0.0, 0, 0], [0, 90, 0], [0, -90, 0], [0, 0, 120], [0, 0, -400], [0, 0, -400]])
TWIN = [-1, 2, 1, -1, 5, 4]
SEGMENTS = {1: "thigh", 2: "thigh", 4: "shank", 5: "shank"}
STEP = 1e-3  # mm


@pytest.fixture
def fit():
    """A person from the knees to the shoulders with markers on the outer side, in frames turned anyhow."""
    rng = np.random.default_rng(0)
    outer = np.array([[20.0, 50, -80], [-20, 55, -200], [0, 50, -380]])
    trunk = np.array([[60.0, 100, 200], [60, -100, 200], [-80, 0, 350]])
    offsets = [
        [[80, 110, 30], [80, -110, 30], [-90, 0, 40]],
        outer,
        outer * [1, -1, 1],
        trunk,
        outer,
        outer * [1, -1, 1],
    ]
    limbs, turns = np.repeat(np.arange(6), 3), matrix_from_vector(rng.normal(size=(6, 3)))
    joints = np.einsum("lij,lj->li", turns[np.maximum(PARENTS, 0)], JOINTS)
    chain = Chain(PARENTS, limbs, joints, np.einsum("mij,mj->mi", turns[limbs], np.concatenate(offsets)))
    still = turns.swapaxes(1, 2) @ matrix_from_vector(0.02 * rng.normal(size=(5, 6, 3)))
    poses = ChainPoses(np.zeros((5, 3)), still)
    return observed(chain, Articulation.free(6), poses, poses.markers(chain))


def test_thighs_and_shanks_are_twins_and_a_trunk_has_none(fit):
    assert twins(fit.chain, joint_places(fit)).tolist() == TWIN


def test_bones_that_are_alike_are_not_surprising_and_longer_ones_are(fit):
    chain, twin = fit.chain, np.array(TWIN)
    np.testing.assert_allclose(twin_residuals(chain, twin)[1], 0, atol=1e-9)
    joints = chain.joints.copy()
    joints[4] *= 1.02
    assert np.abs(twin_residuals(chain.moved(joints, chain.offsets), twin)[1]).max() == pytest.approx(1.0, rel=0.02)


def test_joints_lie_inward_of_markers_on_the_outer_side(fit):
    chain, known = fit.chain, joint_places(fit)
    inward = inward_places(fit, known, np.array(TWIN), SEGMENTS)
    assert {one.place.limb for one in inward} == {1, 2, 4, 5}
    off = dict(zip([one.place.limb for one in inward], inward_residuals(chain, inward)[1], strict=True))
    for limb in (4, 5):  # markers are 50 mm outward of the knees
        size = next(one.distance for one in known if one.limb == limb)
        assert off[limb] == pytest.approx((50 / size - INWARD["shank"][0]) / INWARD["shank"][1], abs=0.5)
    assert inward_places(fit, known, np.array(TWIN), {}) == []


def test_rows_are_the_slopes_of_half_the_squares(fit):
    chain, twin = fit.chain, np.array(TWIN)
    inward = inward_places(fit, joint_places(fit), twin, SEGMENTS)
    rng = np.random.default_rng(1)
    off = chain.moved(chain.joints + 20 * rng.normal(size=(6, 3)), chain.offsets + 5 * rng.normal(size=(18, 3)))
    for residuals_of in (lambda one: inward_residuals(one, inward), lambda one: twin_residuals(one, twin)):

        def half_squares(step, residuals_of=residuals_of):
            moved = (places(off).ravel() + step).reshape(-1, 3)
            return (residuals_of(off.moved(np.vstack([off.joints[:1], moved[18:]]), moved[:18]))[1] ** 2).sum() / 2

        rows, towards = residuals_of(off)
        unit = np.eye(rows.shape[1]) * STEP
        slopes = [(half_squares(one) - half_squares(-one)) / (2 * STEP) for one in unit]
        np.testing.assert_allclose(rows.T @ towards, slopes, rtol=1e-4, atol=1e-5)
