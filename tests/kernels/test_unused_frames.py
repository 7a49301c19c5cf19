"""Stages call kernels with some of a take's frames: those that show nothing, or are too many, are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.geometry.rotations import matrix_from_vector

pytestmark = pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning:skelgen._kernels")  # said uncompiled only

N_FRAMES = 48
FEW = {"skeleton": {"refine_samples": 24, "samples": 12}}
ALIKE = 3.0  # half of the frames know limbs sqrt(2) times worse; memory that is no one's is wrong by 200 times


@pytest.fixture(scope="module")
def sensors() -> skelgen.Poses:
    """Two bodies that turn about a point of both, as noisy sensors tell it."""
    rng, turns = np.random.default_rng(3), 1.5 * np.sin(0.7 * np.arange(N_FRAMES)[:, np.newaxis] * [1.0, 1.7, 2.3])
    poses = np.tile(np.eye(4), (N_FRAMES, 2, 1, 1))
    poses[:, :, :3, :3] = matrix_from_vector(np.stack([turns[::-1], turns], axis=1))
    poses[:, 0, :3, 3] = rng.normal(size=(N_FRAMES, 3)) * 50
    joint = poses[:, 0, :3, :3] @ [200.0, 0.0, 30.0] + poses[:, 0, :3, 3]
    poses[:, 1, :3, 3] = joint - poses[:, 1, :3, :3] @ [-150.0, 20.0, 0.0] + rng.normal(size=(N_FRAMES, 3)) * 0.3
    return skelgen.Poses(poses, ("upper", "lower"), 60.0)


def test_deviations_of_sensors_hold_with_a_frame_in_which_no_body_is_seen(sensors):
    poses = np.array(sensors.world_from_body)
    poses[20] = np.nan
    assert_deviates_like(sensors, skelgen.reconstruct(replace(sensors, world_from_body=poses)))


def test_deviations_of_sensors_hold_with_more_frames_than_are_fitted(sensors):
    assert_deviates_like(sensors, skelgen.reconstruct(sensors, parameters=FEW))


@pytest.mark.parametrize("labelled", [True, False])
def test_takes_of_markers_are_fitted_to_some_of_their_frames(labelled):
    take = skelgen.simulate("tree:2", n_frames=N_FRAMES, noise=0.1, labelled=labelled).take
    if labelled:
        positions = np.array(take.positions)
        positions[20:22] = np.nan
        take = replace(take, positions=positions)
    motion = skelgen.reconstruct(take, n_limbs=2, parameters=FEW).motion
    assert np.isfinite(motion.joint_positions).all()
    assert np.nanmax(motion.residuals) < 1.0  # mm; ten times the noise


def assert_deviates_like(sensors: skelgen.Poses, project: skelgen.Project) -> None:
    """The joint is known as well as from all frames."""
    wanted = skelgen.reconstruct(sensors).skeleton.joints[0].std
    ratio = project.skeleton.joints[0].std / wanted
    assert 1 / ALIKE < ratio.min() <= ratio.max() < ALIKE
