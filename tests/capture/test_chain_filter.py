"""All joint angles in one filter, against the simulated arm whose balls are projected with 0.1 px of noise."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import MotionCapture
from skelgen.capture.optics import match_and_triangulate, project
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.values import Balls
from skelgen.geometry.rotations import vector_from_matrix

RATE, N_FRAMES, SETTLED = 60.0, 150, 20
BODIES, JOINTS = PredictionParameters(), PredictionParameters(joints=True)


@pytest.fixture(scope="module")
def arm():
    return simulated_rig("arm", n_frames=N_FRAMES, seed=2)


def balls(centres, noise, rng):
    n = len(centres)
    seen = centres + noise * rng.normal(size=centres.shape)
    return Balls(seen, np.full(n, 20.0), np.full(n, 10.0), np.full(n, noise), np.zeros(n, dtype=bool))


def captured(arm, prediction, poses=None, hidden=None, speed=1):
    """Bodies and angles of every frame; `hidden` says which balls of which body are covered in a frame."""
    rng, settings = np.random.default_rng(4), arm.settings
    poses, found = arm.scene.world_from_body if poses is None else poses, []
    with MotionCapture(settings, prediction, threads=False) as capture:
        for frame, now in enumerate(poses[::speed]):
            places = []
            for number, (body, pose) in enumerate(zip(settings.bodies, now, strict=True)):
                kept = np.ones(len(body.points), bool)
                if hidden is not None:
                    kept[hidden(frame, number)] = False
                places.append((body.points @ pose[:3, :3].T + pose[:3, 3])[kept])
            sides = [project(eye, np.concatenate(places)) for eye in (settings.rig.left, settings.rig.right)]
            points = match_and_triangulate(*(balls(side, 0.1, rng) for side in sides), settings.rig)
            found.append(capture.recognise(points, frame / RATE))
    return found


def pose_errors(arm, found, poses=None, speed=1):
    """Root mean square error of the middle of each body [mm] after it has settled."""
    poses, errors = arm.scene.world_from_body if poses is None else poses, {}
    for (bodies, _), now in list(zip(found, poses[::speed], strict=True))[SETTLED:]:
        for body, pose in zip(arm.settings.bodies, now, strict=True):
            if body.name in bodies:
                middle = np.append(body.points.mean(axis=0), 1.0)
                errors.setdefault(body.name, []).append((bodies[body.name].world_from_body - pose)[:3] @ middle)
    return {name: np.sqrt((np.array(one) ** 2).sum(axis=1).mean()) for name, one in errors.items()}


def angle_errors(arm, found, speed=1):
    """Errors of the joints' rotations [rad], and these in stated deviations."""
    poses, errors, ratios = arm.scene.world_from_body, {}, {}
    names = [body.name for body in arm.settings.bodies]
    for (_, angles), now in list(zip(found, poses[::speed], strict=True))[SETTLED:]:
        for joint in arm.settings.joints:
            parent, child = now[names.index(joint.parent)], now[names.index(joint.child)]
            turn = (parent @ joint.parent_from_joint)[:3, :3].T @ (child @ joint.child_from_joint)[:3, :3]
            true = vector_from_matrix(turn)[2:] if joint.kind == "hinge" else vector_from_matrix(turn)
            if joint.name in angles:
                off = angles[joint.name].angles - true
                errors.setdefault(joint.name, []).append(off)
                ratios.setdefault(joint.name, []).append(off / angles[joint.name].std)
    return {name: np.sqrt((np.array(one) ** 2).sum(axis=1).mean()) for name, one in errors.items()}, ratios


@pytest.mark.parametrize("speed", [1, 3])
def test_angles_and_poses_are_better_than_those_of_targets_one_by_one(arm, speed):
    raw, alone, together = (captured(arm, how, speed=speed) for how in (None, BODIES, JOINTS))
    for name, error in pose_errors(arm, together, speed=speed).items():
        assert error < 0.95 * pose_errors(arm, raw, speed=speed)[name]
        assert error < 1.02 * pose_errors(arm, alone, speed=speed)[name]
    found, ratios = angle_errors(arm, together, speed)
    for name, error in found.items():
        assert error < 0.95 * angle_errors(arm, raw, speed)[0][name]
        assert (np.abs(ratios[name]) < 1.96).mean() > 0.88


def test_a_target_of_which_two_balls_are_seen_is_followed(arm):
    """Four are needed to find it: the elbow, a hinge, says the rest; nothing is guessed without any ball."""

    def few(frame, body):
        return slice(2, None) if body == 2 and 60 <= frame < 75 else slice(None) if body == 2 and frame == 80 else []

    alone, together = (captured(arm, how, hidden=few) for how in (BODIES, JOINTS))
    assert not any("lower arm" in bodies for bodies, _ in alone[60:75])
    assert all("lower arm" in bodies for bodies, _ in together[60:75])
    assert "lower arm" not in together[80][0]
    names = [body.name for body in arm.settings.bodies]
    for frame in range(60, 75):
        body = together[frame][0]["lower arm"]
        off = body.world_from_body[:3, 3] - arm.scene.world_from_body[frame, names.index("lower arm"), :3, 3]
        assert np.linalg.norm(off) < 2.0  # mm
        assert (np.abs(off) < 5 * np.sqrt(np.diag(body.covariance)[3:])).all()
        assert (body.points >= 0).sum() == 2


def test_joints_with_play_make_nothing_worse(arm):
    poses = arm.scene.world_from_body.copy()
    poses[:, 1, :3, 3] += np.random.default_rng(1).normal(size=(N_FRAMES, 3)) * 1.5  # mm
    raw, together = (pose_errors(arm, captured(arm, how, poses), poses) for how in (None, JOINTS))
    for name, error in together.items():
        assert error < 1.05 * raw[name]


def test_a_target_that_was_away_for_long_begins_anew(arm):
    def away(frame, body):
        return slice(None) if body == 2 and 40 <= frame < 100 else []

    found = captured(arm, JOINTS, hidden=away)
    assert all({"torso", "upper arm"} <= set(bodies) for bodies, _ in found)
    assert not any("lower arm" in bodies for bodies, _ in found[41:100])
    assert all(len(angles) == 2 for _, angles in found[100:])


def test_without_joints_targets_are_filtered_one_by_one(arm):
    settings = replace(arm.settings, joints=())
    points = match_and_triangulate(
        *(balls(np.zeros((0, 2)), 0.1, np.random.default_rng(0)) for _ in "lr"), settings.rig
    )
    with MotionCapture(settings, JOINTS, threads=False) as capture:
        assert capture.recognise(points, 0.0) == ({}, {})
