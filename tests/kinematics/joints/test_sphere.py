"""Centres of spheres: exact on exact points, unbiased by linearisation."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.kinematics.joints.closed_form import fit_sphere

CENTRE = np.array([150.0, -60.0, 90.0])
RADII = np.array([80.0, 200.0])
EXACT = 1e-6  # mm


@pytest.fixture
def case(random_poses):
    """Two points that move at will on spheres around a point of a moving body."""
    body = random_poses(200, 3)
    directions = np.random.default_rng(4).normal(size=(200, 2, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    local = CENTRE + RADII[:, None] * directions
    return body, np.einsum("fij,fnj->fni", body[:, :3, :3], local) + body[:, None, :3, 3]


def test_exact_points_give_centre_and_radii(case):
    fit = fit_sphere(*case, np.zeros(3))
    np.testing.assert_allclose(fit.centre, CENTRE, atol=EXACT)
    np.testing.assert_allclose(fit.radii, RADII, atol=EXACT)
    assert fit.variance < EXACT


def test_gaps_change_nothing_in_exact_points(case):
    body, points = case
    body[:20], points[40:90, 0] = np.nan, np.nan
    np.testing.assert_allclose(fit_sphere(body, points, np.zeros(3)).centre, CENTRE, atol=EXACT)


def test_noise_biases_a_small_cap_of_the_sphere_little(case, random_poses):
    body = random_poses(2000, 5)
    random = np.random.default_rng(6)
    directions = np.array([1.0, 0, 0]) + random.normal(size=(2000, 1, 3)) * [0, 0.3, 0.3]
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    local = CENTRE + 200.0 * directions + random.normal(size=(2000, 1, 3))
    points = np.einsum("fij,fnj->fni", body[:, :3, :3], local) + body[:, None, :3, 3]
    fit = fit_sphere(body, points, np.zeros(3))
    np.testing.assert_allclose(fit.centre, CENTRE, atol=5.0)  # mm; the algebraic fit alone is off by a centimetre
    assert fit.variance == pytest.approx(1.0, rel=0.1)


def test_too_few_frames_give_no_centre(case):
    body, points = case
    assert fit_sphere(body[:4], points[:4], np.zeros(3)) is None


def test_point_that_is_never_seen_gives_no_centre(case):
    body, points = case
    points[:, 1] = np.nan
    assert fit_sphere(body, points, np.zeros(3)) is None


def test_points_that_turn_about_one_axis_lean_to_the_body(random_poses):
    body = random_poses(100, 8)
    angle = np.linspace(-1, 1, 100)
    local = CENTRE + 100.0 * np.stack([np.cos(angle), np.sin(angle), np.zeros(100)], axis=1)
    points = (np.einsum("fij,fj->fi", body[:, :3, :3], local) + body[:, :3, 3])[:, None]
    fit = fit_sphere(body, points, np.zeros(3))
    np.testing.assert_allclose(fit.centre[:2], CENTRE[:2], atol=1e-3)
    assert np.isfinite(fit.centre).all()
