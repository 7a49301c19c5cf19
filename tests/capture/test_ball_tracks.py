"""Wrong pairs of balls are told by the images before; right ones stay."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.ball_tracks import BallPairs
from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import MotionCapture
from skelgen.capture.optics import match_and_triangulate, project
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.values import Balls
from skelgen.geometry.rotations import matrix_from_vector

RATE, N_FRAMES = 60.0, 240
FAR = 10.0  # mm from every ball: no noise puts a point there


def balls(centres, rng):
    n = len(centres)
    seen = centres + 0.1 * rng.normal(size=centres.shape)
    return Balls(seen, np.full(n, 20.0), np.full(n, 10.0), np.full(n, 0.1), np.zeros(n, dtype=bool))


@pytest.fixture(scope="module", params=[0.0, 0.3], ids=["as calibrated", "turned by 0.3 px"])
def counts(request):
    """Wrong points and right ones, as found and with the balls followed; a part of the balls is hidden at times."""
    source, rng = simulated_rig("tree:4", n_frames=N_FRAMES, seed=1), np.random.default_rng(0)
    rig = source.settings.rig
    pose = rig.right.camera_from_world.copy()
    pose[:3, :3] = matrix_from_vector(np.array([request.param / rig.right.matrix[0, 0], 0.0, 0.0])) @ pose[:3, :3]
    known, memory = replace(rig, right=replace(rig.right, camera_from_world=pose)), BallPairs((640, 480), (640, 480))
    n_wrong, n_right = np.zeros(2), np.zeros(2)
    for frame in range(N_FRAMES):
        there = source.scene.points[frame]
        seen = [there[rng.uniform(size=len(there)) > 0.02] for _ in "lr"]
        sides = [balls(project(eye, some), rng) for eye, some in zip((rig.left, rig.right), seen, strict=True)]
        points = match_and_triangulate(*sides, known)
        for way, found in enumerate((points, memory.resolved(*sides, points, frame / RATE))):
            away = np.linalg.norm(found.points[:, np.newaxis] - there, axis=2).min(axis=1)
            n_wrong[way] += (away > FAR).sum()
            n_right[way] += (away <= FAR).sum()
    return n_wrong, n_right


def test_most_wrong_pairs_are_left_out(counts):
    n_wrong, _ = counts
    assert n_wrong[0] > 100
    assert n_wrong[1] < 0.35 * n_wrong[0]


def test_right_pairs_stay(counts):
    _, n_right = counts
    assert n_right[1] > 0.995 * n_right[0]


def test_the_capture_follows_balls_where_it_predicts():
    source = simulated_rig("arm", n_frames=20)
    pairs = [source.render(index)[0] for index in range(20)]
    found = []
    for prediction in (PredictionParameters(balls=False), PredictionParameters()):
        with MotionCapture(source.settings, prediction, threads=False) as capture:
            found.append([capture.see(pair) for pair in pairs])
    assert sum(len(one.points) for one in found[1]) < sum(len(one.points) for one in found[0])
    for one, other in zip(*found, strict=True):
        assert set(one.bodies) == set(other.bodies)
