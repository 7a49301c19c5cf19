"""Sensors that slip, or are exchanged, within a take."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skelgen
from skelgen.model import Poses
from skelgen.simulation import simulate
from skelgen.stages.joints import slips_moved_back
from skelgen.stages.joints.sensor_slips import find_sensor_slips
from skelgen.stages.repair import exchanged_back

N_FRAMES, FRAME = 400, 230


@pytest.fixture(scope="module")
def human():
    """Sensors of a human with errors of 0.5 mm and 0.1 degrees, and the limbs of its joints."""
    truth = simulate("human", seed=3, n_frames=N_FRAMES).truth
    random = np.random.default_rng(0)
    poses = truth.world_from_limb.copy()
    poses[..., :3, 3] += random.normal(0, 0.5, (*poses.shape[:2], 3))
    turns = Rotation.from_rotvec(random.normal(0, np.deg2rad(0.1), (poses.shape[0] * poses.shape[1], 3))).as_matrix()
    poses[..., :3, :3] = poses[..., :3, :3] @ turns.reshape(*poses.shape[:2], 3, 3)
    return poses, truth


def slipped(poses, limb, size):
    moved = poses.copy()
    shift = np.eye(4)
    shift[:3, 3] = np.array([0.6, 0.0, 0.8]) * size
    moved[FRAME:, limb] = poses[FRAME:, limb] @ shift
    return moved


def test_sensors_that_stay_are_not_told(human):
    poses, truth = human
    assert find_sensor_slips(poses, truth.edges) == ()


@pytest.mark.parametrize("size", [10.0, 25.0])
def test_a_slip_is_found_with_its_frame_and_size(human, size):
    poses, truth = human
    for limb in (0, 3):
        (slip,) = find_sensor_slips(slipped(poses, limb, size), truth.edges)
        assert slip.limb == limb
        assert abs(slip.frame - FRAME) <= 2
        assert slip.size == pytest.approx(size, rel=0.25)


def test_exchanged_sensors_are_exchanged_back(human):
    poses, truth = human
    exchanged = poses.copy()
    exchanged[FRAME:, [4, 7]] = poses[FRAME:, [7, 4]]
    exchanged[FRAME - 3 : FRAME, 4] = np.nan
    back, found = exchanged_back(exchanged)
    assert found == ((4, 7, FRAME),)
    np.testing.assert_array_equal(back[FRAME:], poses[FRAME:])
    take = Poses(exchanged, truth.limb_names, 100.0)
    notices = skelgen.reconstruct(take, until="labels").reports["labels"].notices
    one, other = truth.limb_names[4], truth.limb_names[7]
    assert f"the sensors of {one} and {other} are exchanged from frame {FRAME} on; they are exchanged back" in notices


def test_sensors_that_stay_where_they_are_are_left_alone(human):
    poses, _ = human
    back, found = exchanged_back(poses)
    assert found == () and back is poses


@pytest.mark.parametrize("limb", [0, 3, 6])
@pytest.mark.parametrize("size", [12.0, 40.0])
def test_a_sensor_that_slipped_is_moved_back(human, limb, size):
    poses, truth = human
    take = Poses(slipped(poses, limb, size), truth.limb_names, 100.0)
    moved, (slip,) = slips_moved_back(take)
    assert slip.limb == limb
    away = np.linalg.norm((moved.world_from_body - poses)[FRAME + 3 :, limb, :3, 3], axis=1).mean()
    assert away < 0.25 * size
    other = [body for body in range(len(truth.limb_names)) if body != limb]
    np.testing.assert_array_equal(moved.world_from_body[:, other], take.world_from_body[:, other])


def test_a_sensor_that_slips_and_turns_is_moved_back_as_far_as_its_joints_tell(human):
    """The trunk has five joints, which tell its turn, too."""
    poses, truth = human
    limb = int(np.bincount(truth.edges.ravel()).argmax())
    turned = poses.copy()
    slip = np.eye(4)
    slip[:3, :3], slip[:3, 3] = Rotation.from_rotvec([0.1, -0.05, 0.08]).as_matrix(), [12.0, -9.0, 10.0]
    turned[FRAME:, limb] = poses[FRAME:, limb] @ slip
    moved, _ = slips_moved_back(Poses(turned, truth.limb_names, 100.0))
    left = np.linalg.inv(poses[FRAME + 3 :, limb]) @ moved.world_from_body[FRAME + 3 :, limb]
    assert np.linalg.norm(left[:, :3, 3], axis=1).mean() < 4.0
    assert np.degrees(Rotation.from_matrix(left[:, :3, :3]).magnitude().mean()) < 2.5


def test_sensors_that_stay_are_not_moved(human):
    poses, truth = human
    take = Poses(poses, truth.limb_names, 100.0)
    assert slips_moved_back(take) == (take, ())


def test_the_skeleton_is_right_after_a_slip(human):
    """Without moving it back the joints are some 6 mm off, and the tree may be wrong."""
    poses, truth = human
    take = Poses(slipped(poses, 3, 25.0), truth.limb_names, 100.0)
    project = skelgen.reconstruct(take, until="joints")
    told = [one for one in project.reports["labels"].notices if " slips at frame " in one]
    assert len(told) == 1 and truth.limb_names[3] in told[0]
    found = {frozenset(edge) for edge in project.topology.edges.tolist()}
    assert found == {frozenset(edge) for edge in truth.edges.tolist()}
    clean = skelgen.reconstruct(Poses(poses, truth.limb_names, 100.0), until="joints")
    np.testing.assert_allclose(project.topology.edges, clean.topology.edges)
