"""Which marker a piece of a track is: Student's distributions of its distances to the steadiest markers beside it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from skelgen._kernels.piece_evidence import FREEDOM, distances_to_markers, evidence_of_means
from skelgen._kernels.tracklet_evidence import WITNESSES

N_PIECES, N_MARKERS, SPACING, LEAST = 5, 12, 60.0, 3  # mm
ROUNDING = 1e-9  # nats, and mm


@pytest.fixture(params=range(4))
def rng(request) -> np.random.Generator:
    return np.random.default_rng(request.param)


def laws_of(rng) -> tuple[np.ndarray, np.ndarray]:
    return rng.uniform(50, 400, (N_MARKERS, N_MARKERS)), rng.uniform(1, 1.5 * SPACING**2, (N_MARKERS, N_MARKERS))


def test_distances_are_those_to_the_markers_of_the_points_frame(rng) -> None:
    points, places, row = rng.normal(size=(7, 3)), rng.normal(size=(3, N_MARKERS, 3)), rng.integers(0, 3, 7)
    places[1, 4] = np.nan
    found = distances_to_markers(points, places, row)
    np.testing.assert_allclose(found, np.linalg.norm(places[row] - points[:, np.newaxis], axis=2), atol=ROUNDING)


def test_evidence_is_that_of_students_distributions_of_two_widths(rng) -> None:
    counts = rng.integers(0, 4, (N_PIECES, N_MARKERS)).astype(float)
    mean, (usual, variance) = rng.uniform(50, 400, counts.shape), laws_of(rng)
    found = evidence_of_means((counts, counts * mean), (usual, variance), SPACING, LEAST)
    for piece, marker in np.ndindex(*counts.shape):
        near = np.argsort(variance[marker])
        near = near[(variance[marker, near] < SPACING**2) & (counts[piece, near] > 0)][:WITNESSES]
        off, narrow = mean[piece, near] - usual[marker, near], variance[marker, near]
        two = [student.logpdf(off, FREEDOM, scale=np.sqrt(width)).sum() for width in (narrow, narrow + SPACING**2)]
        wanted = two[0] - two[1] if len(near) >= LEAST else -np.inf
        assert found[piece, marker] == pytest.approx(wanted, abs=ROUNDING)
