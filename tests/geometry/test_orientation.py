"""Absolute orientation: exact on exact data, equal between the two closed forms, never a reflection."""

import numpy as np
import pytest

from skelgen.geometry.orientation import ROTATORS, fit_transform
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
