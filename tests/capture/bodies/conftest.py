from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.capture.values import StereoPoints
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import BodyTarget

NOISE = np.array([0.1, 0.1, 0.3])
"""mm; deviations of a triangulated point across and along the depth, of the reference rig at 1.2 m."""

SHAPES = {
    "hand": [[0, 0, 0], [61, 0, 0], [17, 72, 0], [-33, 25, 40], [40, 38, -52]],
    "arm": [[0, 0, 0], [89, 0, 0], [31, 51, 0], [-12, 44, 66], [58, -20, 35]],
    "back": [[0, 0, 0], [103, 0, 0], [45, 67, 0], [-28, 37, 78], [70, 23, -41]],
}


@pytest.fixture
def targets():
    """Three targets of five balls whose distances all differ."""
    return [BodyTarget(name, np.array(points, float)) for name, points in SHAPES.items()]


@pytest.fixture
def make_scene():
    """A function that poses targets at random, hides balls, adds noise and stray points, and knows the truth."""

    def make(seed, targets, n_points=40, hidden=0.2, noise=NOISE):
        rng = np.random.default_rng(seed)
        room, middle = np.array([400.0, 300.0, 400.0]), np.array([0.0, 0.0, 1200.0])
        poses, points, owner = [], [], []
        for number, target in enumerate(targets):
            turn = matrix_from_vector(rng.normal(size=3) * 2)
            pose = transform_from(turn, middle + rng.uniform(-0.6, 0.6, 3) * room)
            seen = rng.uniform(size=len(target.points)) >= hidden
            poses.append(pose)
            points.append((target.points @ turn.T + pose[:3, 3])[seen])
            owner += [(number, int(ball)) for ball in np.flatnonzero(seen)]
        strays = max(n_points - len(owner), 0)
        points.append(middle + rng.uniform(-1, 1, (strays, 3)) * room)
        owner += [(-1, -1)] * strays
        order = rng.permutation(len(owner))
        placed = np.concatenate(points)[order]
        placed = placed + rng.normal(size=placed.shape) * noise
        n = len(placed)
        covariance = np.tile(np.diag(np.maximum(np.square(noise), 1e-12)), (n, 1, 1))
        found = StereoPoints(placed, covariance, np.arange(n), np.arange(n), np.zeros(n), np.zeros(n, bool))
        return SimpleNamespace(points=found, poses=poses, owner=[owner[index] for index in order])

    return make
