"""The whole capture on rendered images in which balls touch, hide each other and fall onto one epipolar line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.recording import ball_positions
from skelgen.capture.bodies import resolved_points
from skelgen.capture.bodies.design import propose_targets
from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import MotionCapture
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.capture.simulated_rig.scene import Wandering, scene_of_bodies, wandering_poses
from skelgen.geometry.rotations import vector_from_matrix
from skelgen.model.rig import BodyTarget

WRONG, WRONG_TURN = 2.0, 2.0  # mm and degrees: what no pose may be off


def passing():
    """Three targets that pass before each other."""
    rng, rig = np.random.default_rng(0), reference_rig()
    targets = propose_targets([BodyTarget(f"body{i}", rng.uniform(-50, 50, (5, 3))) for i in range(3)])
    return SimulatedRig(scene_of_bodies(targets, wandering_poses(rig, 200, 3, Wandering(spread=60.0), seed=1)), rig)


@pytest.fixture(scope="module", params=[passing, lambda: simulated_rig("arm", n_frames=200)], ids=["passing", "arm"])
def seen(request):
    """A source, and every fourth of its frames as it was captured, with what is visible of each ball in both images."""
    source, frames = request.param(), []
    with MotionCapture(source.settings, threads=False) as capture:
        for index in range(0, 200, 4):
            pair, truth = source.render(index)
            visible = np.minimum(truth.left.visible, truth.right.visible)
            frames.append((index, capture.see(pair), visible))
    return source, frames


def test_there_are_balls_that_touch_and_balls_that_are_hidden(seen):
    _, frames = seen
    assert sum(any(balls.touching.any() for balls in captured.views) for _, captured, _ in frames) > 25
    assert sum((visible < 0.5).any() for *_, visible in frames) > 5


def test_no_pose_is_wrong(seen):
    source, frames = seen
    for index, captured, _ in frames:
        for number, target in enumerate(source.settings.bodies):
            if target.name in captured.bodies:
                pose, true = captured.bodies[target.name].world_from_body, source.scene.world_from_body[index, number]
                assert np.linalg.norm((pose - true) @ np.append(target.points.mean(axis=0), 1.0)) < WRONG
                turn = vector_from_matrix(pose[:3, :3] @ true[:3, :3].T)
                assert np.degrees(np.linalg.norm(turn)) < WRONG_TURN


def test_bodies_of_which_four_balls_are_seen_are_found(seen):
    source, frames = seen
    found, possible = 0, 0
    for _, captured, visible in frames:
        for number, target in enumerate(source.settings.bodies):
            can_be = (visible[source.scene.body_of_ball == number] >= 0.5).sum() >= 4
            possible += can_be
            found += can_be and target.name in captured.bodies
    assert found >= 0.95 * possible > 100  # others have balls that hide each other but for a crescent


def test_candidates_that_share_a_ball_are_resolved_by_the_bodies(seen):
    source, frames = seen
    n_ambiguous = 0
    for index, captured, _ in frames:
        n_ambiguous += int(captured.points.ambiguous.sum())
        kept = resolved_points(captured.points, captured.bodies.values())
        for side in (captured.points.left[kept], captured.points.right[kept]):
            assert len(set(side.tolist())) == len(side)
        at = ball_positions(source.settings.bodies, captured)
        away = np.linalg.norm(at - source.scene.points[index], axis=1)
        assert np.nanmax(away, initial=0.0) < 5.0  # mm: a ghost is as far off as balls are apart
    assert n_ambiguous > 20


@pytest.mark.parametrize("noise", [0.1, 0.02])
def test_predicted_poses_of_rendered_targets_are_never_worse(noise):
    """The noise that the rig states is far too large, or nearly right."""
    source, errors = simulated_rig("arm", n_frames=60), {}
    settings = replace(source.settings, rig=replace(source.settings.rig, noise=noise))
    pairs = [source.render(index)[0] for index in range(60)]
    for prediction in (None, PredictionParameters()):
        with MotionCapture(settings, prediction, threads=False) as capture:
            found = [capture.see(pair).bodies for pair in pairs]
        for number, target in enumerate(settings.bodies):
            true = source.scene.world_from_body[:, number] @ np.append(target.points.mean(axis=0), 1.0)
            middles = [
                bodies[target.name].world_from_body @ np.append(target.points.mean(axis=0), 1.0) - true[frame]
                for frame, bodies in enumerate(found)
                if target.name in bodies
            ]
            errors.setdefault(target.name, []).append(np.sqrt((np.array(middles) ** 2).sum(axis=1).mean()))
    for raw, smooth in errors.values():
        assert smooth < 1.02 * raw


def test_limits_of_the_search_come_from_the_settings():
    source = simulated_rig("arm", n_frames=1)
    points = MotionCapture(source.settings, threads=False).see(source.render(0)[0]).points
    narrow = replace(source.settings, search={"max_distance": 0.01})
    noisy = replace(points, points=points.points + np.random.default_rng(0).normal(size=points.points.shape) / 10)
    assert len(MotionCapture(source.settings, threads=False).recognise(noisy, 0.0)[0]) == 3
    assert len(MotionCapture(narrow, threads=False).recognise(noisy, 0.0)[0]) == 0


def test_smoothed_poses_are_no_worse_where_the_noise_of_the_rig_was_never_measured():
    """With 0.1 px, many times too much, balls that are half hidden counted as much as others."""
    source = simulated_rig("arm", n_frames=240, seed=5)
    shown, torso = range(90, 240), source.settings.bodies[0]
    middle, squares = np.append(torso.points.mean(axis=0), 1.0), []
    settings = replace(source.settings, rig=replace(source.settings.rig, noise=0.1))
    pairs = [source.render(index)[0] for index in shown]
    for prediction in (None, PredictionParameters()):
        with MotionCapture(settings, prediction, threads=False) as capture:
            bodies = [capture.see(pair).bodies.get(torso.name) for pair in pairs]
        poses = zip(bodies, source.scene.world_from_body[shown.start :, 0], strict=True)
        off = [((body.world_from_body - true) @ middle)[:3] for body, true in poses if body is not None]
        squares.append(np.square(off).sum(axis=1).mean())
    assert squares[1] < squares[0]
