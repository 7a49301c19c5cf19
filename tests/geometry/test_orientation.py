"""Absolute orientation: exact on exact data, equal between the two closed forms, never a reflection."""

import numpy as np
import pytest

from skelgen._kernels.absolute_orientation import fast_rotations
from skelgen.geometry.orientation import ROTATORS, fit_transform, rotation_by_svd
from skelgen.geometry.rotations import matrix_from_vector

ROUNDING = 1e-9  # mm, for coordinates of some 1000 mm


@pytest.fixture
def case():
    random = np.random.default_rng(3)
    source = random.normal(size=(5, 3)) * 100
    rotation = matrix_from_vector(random.normal(size=(200, 3)))
    translation = random.normal(size=(200, 1, 3)) * 1000
    target = source @ rotation.swapaxes(1, 2) + translation
    return source, rotation, translation, target


@pytest.mark.parametrize("name", ROTATORS)
def test_exact_points_give_the_exact_transform(case, name):
    source, rotation, translation, target = case
    fitted = fit_transform(source, target, np.ones(target.shape[:2], bool), ROTATORS[name])
    np.testing.assert_allclose(fitted[:, :3, :3], rotation, atol=1e-12)
    np.testing.assert_allclose(fitted[:, :3, 3], translation[:, 0], atol=ROUNDING)


@pytest.mark.parametrize("name", ROTATORS)
def test_unseen_points_are_ignored(case, name):
    source, rotation, _, target = case
    seen = np.random.default_rng(0).random(target.shape[:2]) < 0.9
    seen[:, :3] = True
    target = np.where(seen[..., None], target, np.nan)
    np.testing.assert_allclose(fit_transform(source, target, seen, ROTATORS[name])[:, :3, :3], rotation, atol=1e-12)


def test_both_closed_forms_agree_on_noisy_points(case):
    source, _, _, target = case
    noisy = target + np.random.default_rng(1).normal(size=target.shape) * 5
    seen = np.ones(target.shape[:2], bool)
    by_name = [fit_transform(source, noisy, seen, rotator) for rotator in ROTATORS.values()]
    np.testing.assert_allclose(by_name[0], by_name[1], atol=1e-7)


@pytest.mark.parametrize("name", ROTATORS)
def test_a_mirror_image_never_gives_a_reflection(name):
    source = np.random.default_rng(4).normal(size=(6, 3))
    mirrored = source * [1, 1, -1]
    fitted = fit_transform(source, mirrored[None], np.ones((1, 6), bool), ROTATORS[name])
    assert np.linalg.det(fitted[0, :3, :3]) == pytest.approx(1)


def test_frames_without_points_are_nan(case):
    source, _, _, target = case
    seen = np.ones(target.shape[:2], bool)
    seen[7] = False
    fitted = fit_transform(source, np.where(seen[..., None], target, np.nan), seen)
    assert np.isnan(fitted[7]).all()
    assert np.isfinite(np.delete(fitted, 7, axis=0)).all()


@pytest.mark.parametrize("spread", [(100, 80, 60), (100, 50, 0), (100, 2, 0)])
def test_roots_of_the_quartic_give_the_rotations_of_the_eigensolver(spread):
    random = np.random.default_rng(5)
    source = random.normal(size=(4, 3)) * spread
    turned = source @ matrix_from_vector(random.normal(size=(500, 3)) * 2).swapaxes(1, 2)
    moments = np.einsum("fni,nj->fij", turned + random.normal(size=turned.shape), source)
    found, sure = fast_rotations(moments)
    assert sure.all()
    np.testing.assert_allclose(found, rotation_by_svd(moments), atol=1e-9)


@pytest.mark.parametrize("name", ROTATORS)
def test_many_frames_of_points_on_a_line_still_get_proper_rotations_that_fit(name):
    random = np.random.default_rng(6)
    source = np.array([[0.0, 0, 0], [0, 0, 50], [0, 0, 120]])
    turned = source @ matrix_from_vector(random.normal(size=(500, 3)) * 2).swapaxes(1, 2)
    turned[0] = 0.0  # all in one place
    found = fit_transform(source, turned, np.ones((500, 3), bool), ROTATORS[name])
    np.testing.assert_allclose(np.linalg.det(found[:, :3, :3]), 1)
    np.testing.assert_allclose(
        (source @ found[:, :3, :3].swapaxes(1, 2) + found[:, None, :3, 3])[1:], turned[1:], atol=1e-6
    )


def test_lines_and_single_places_are_not_trusted():
    line = np.einsum("i,j->ij", [0.0, 0, 1], [0.0, 0.6, 0.8])
    _, sure = fast_rotations(np.stack([line, np.zeros((3, 3)), np.eye(3)]))
    assert sure.tolist() == [False, False, True]
