"""Kernels of groups of markers against rigid bodies whose noise and jumps are known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skelgen._kernels.relative_motion import covariances_along, displacements_of, residuals_of_groups
from skelgen.geometry.orientation import fit_transform

SHAPE = np.array([[0.0, 0, 0], [90, 0, 0], [0, 70, 0], [20, 30, 60]])
N_FRAMES = 60


def moved(rng, noise=0.0):
    """A rigid body of four markers that turns and travels, beside another marker."""
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.1, (N_FRAMES, 3)), axis=0)).as_matrix()
    positions = np.full((N_FRAMES, 5, 3), 500.0)
    positions[:, :4] = SHAPE @ turns.swapaxes(1, 2) + np.cumsum(rng.normal(0, 9, (N_FRAMES, 1, 3)), axis=0)
    return positions + rng.normal(0, noise, positions.shape)


def spans_of(n_groups, n_kept=N_FRAMES):
    """Spans of groups that all frames show."""
    first = N_FRAMES * np.arange(n_groups)
    return np.stack([first, first + N_FRAMES, np.full(n_groups, n_kept)], axis=1)


def aligned(positions, *groups):
    """Residuals of groups, one after the other, and shapes; the first frame shows all markers."""
    places = np.concatenate([positions[:, group] for group in groups])
    first = np.repeat(places[::N_FRAMES], N_FRAMES, axis=0)
    poses = fit_transform(first, places, ~np.isnan(places[:, :, 0]))
    return residuals_of_groups(places, poses, spans_of(len(groups)))


def inner_bases(shapes):
    """Coordinates that no rigid displacement changes."""
    return np.linalg.svd(displacements_of(shapes)[0])[0][:, :, 6:]


def test_a_rigid_body_has_no_residuals_and_keeps_its_shape():
    residuals, shapes = aligned(moved(np.random.default_rng(0)), (0, 1, 2, 3), (1, 0, 2, 3))
    assert np.abs(residuals).max() < 1e-9
    distances = np.linalg.norm(shapes[:, :, np.newaxis] - shapes[:, np.newaxis], axis=3)
    truth = np.linalg.norm(SHAPE[:, np.newaxis] - SHAPE, axis=2)
    np.testing.assert_allclose(distances[0], truth, atol=1e-9)
    np.testing.assert_allclose(distances[1], truth[np.ix_([1, 0, 2, 3], [1, 0, 2, 3])], atol=1e-9)


def test_unseen_markers_have_no_residuals_and_the_others_keep_theirs():
    positions = moved(np.random.default_rng(1))
    positions[5:20, 2] = np.nan
    residuals, _ = aligned(positions, (0, 1, 2, 3))
    assert np.isnan(residuals[5:20, 2]).all()
    assert np.nanmax(np.abs(residuals)) < 1e-9


def test_displacements_are_those_of_a_rigid_body():
    columns, radii = displacements_of(SHAPE[np.newaxis])
    away = SHAPE - SHAPE.mean(axis=0)
    assert radii[0] == pytest.approx(np.sqrt((away**2).sum(axis=1).mean()))
    for axis in range(3):
        np.testing.assert_allclose(columns[0, :, axis].reshape(-1, 3), np.tile(np.eye(3)[axis], (4, 1)))
        turned = np.cross(np.eye(3)[axis], away) / radii[0]
        np.testing.assert_allclose(columns[0, :, 3 + axis].reshape(-1, 3), turned, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_covariances_are_those_of_the_noise(seed):
    residuals, shapes = aligned(moved(np.random.default_rng(seed), noise=0.5), (0, 1, 2, 3))
    found = covariances_along(residuals, spans_of(1), inner_bases(shapes))
    rows = residuals.reshape(N_FRAMES, -1) @ inner_bases(shapes)[0]
    np.testing.assert_allclose(found[0], rows.T @ rows / N_FRAMES, rtol=1e-9)
    assert np.trace(found[0]) / 6 == pytest.approx(0.25, rel=0.5)


def test_frames_with_the_largest_residuals_do_not_count():
    positions = moved(np.random.default_rng(4), noise=0.1)
    positions[[7, 30], 1] += 40.0
    residuals, shapes = aligned(positions, (0, 1, 2, 3))
    bases = inner_bases(shapes)
    assert np.trace(covariances_along(residuals, spans_of(1, n_kept=N_FRAMES - 3), bases)[0]) < 10
    assert np.trace(covariances_along(residuals, spans_of(1), bases)[0]) > 20


def test_products_are_means_over_the_frames_that_show_both_markers():
    residuals = np.random.default_rng(5).normal(size=(10, 2, 3))
    residuals[:4, 0] = np.nan
    residuals[8:, 1] = np.nan
    found = covariances_along(residuals, np.array([[0, 10, 10]]), np.eye(6)[np.newaxis])[0]
    rows = np.nan_to_num(residuals.reshape(10, 6))
    counts = np.repeat(np.repeat([[6, 4], [4, 8]], 3, axis=0), 3, axis=1)
    np.testing.assert_allclose(found, rows.T @ rows / counts)
