"""Takes that leave things open: no crash, no NaN in the output, a sentence that says what is not determined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.progress import Monitor
from skelgen.simulation import simulate
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import find_limbs
from skelgen.stages.skeleton import fit_skeleton

N_FRAMES = 120
RATE = 100.0
POINTS = np.array([[60.0, 0, 0], [-40, 50, 10], [-40, -50, -10], [10, 20, 50]])


class Heard(Monitor):
    """Keeps what is said."""

    def __init__(self) -> None:
        super().__init__()
        self.said: list[str] = []

    def notice(self, text: str) -> None:
        self.said.append(text)


def two_limbs(turn_degrees: float, points: np.ndarray = POINTS, noise: float = 0.3) -> np.ndarray:
    """Two limbs of the same points, joined 150 mm from both; the second turns freely by some degrees."""
    random = np.random.default_rng(0)
    times = np.arange(N_FRAMES)[:, None] / RATE
    first = matrix_from_vector(0.6 * np.sin(2 * np.pi * np.array([0.7, 1.1, 0.5]) * times))
    second = first @ matrix_from_vector(
        np.deg2rad(turn_degrees) * np.sin(2 * np.pi * np.array([1.3, 0.9, 1.7]) * times)
    )
    joint = np.array([0.0, 0.0, 150.0])
    positions = [np.einsum("fij,nj->fni", first, points), np.einsum("fij,nj->fni", second, points + joint)]
    positions[1] += (first @ joint)[:, None]
    return np.concatenate(positions, axis=1) + noise * random.normal(size=(N_FRAMES, 2 * len(points), 3))


def fitted(positions: np.ndarray):
    """Skeleton, motion and notices of two limbs."""
    n_markers = positions.shape[1]
    names = tuple(f"M{index}" for index in range(n_markers))
    take = Trajectories(positions, names, RATE)
    n_each = n_markers // 2
    limbs = Limbs(np.repeat([0, 1], n_each), np.zeros((n_markers, n_markers)))
    heard = Heard()
    topology: Topology = find_joints(take, limbs, monitor=heard)
    skeleton, motion = fit_skeleton(take, limbs, topology, monitor=heard)
    return skeleton, motion, heard.said


def assert_no_nan(skeleton, motion):
    assert np.isfinite(skeleton.marker_offsets).all()
    for joint in skeleton.joints:
        assert np.isfinite(joint.position_in_parent).all()
        assert np.isfinite(joint.std).all()
    assert np.isfinite(motion.world_from_limb).all()
    assert np.isfinite(motion.joint_std).all()
    np.testing.assert_allclose(np.linalg.det(motion.rotations), 1.0, atol=1e-9)  # never a reflection


def test_limbs_that_never_move_against_each_other_say_so():
    skeleton, motion, said = fitted(two_limbs(0.0))
    assert_no_nan(skeleton, motion)
    assert any("its place is not determined" in one or "turns too little" in one for one in said)
    assert np.linalg.norm(skeleton.joints[0].std) > 10.0  # mm


def test_limb_that_no_frame_shows_to_turn_is_not_called_interpolated():
    """Three rods, the last with one marker only."""
    rods = simulate("rods", n_frames=N_FRAMES, noise=0.3).take
    take = Trajectories(rods.positions[:, :7], rods.names[:7], rods.rate)
    limbs, heard = Limbs(np.repeat([0, 1, 2], 3)[:7], np.zeros((7, 7))), Heard()
    motion = fit_skeleton(take, limbs, find_joints(take, limbs), monitor=heard)[1]
    assert not motion.limb_seen[:, 2].any()
    assert "no frame shows enough of limb 2 to tell how it turns" in heard.said
    assert not any("interpolated" in one for one in heard.said)


def test_limbs_that_move_well_are_determined():
    skeleton, motion, said = fitted(two_limbs(40.0))
    assert_no_nan(skeleton, motion)
    assert not any("determined" in one for one in said)
    assert np.linalg.norm(skeleton.joints[0].std) < 1.0  # mm


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.array([[0.0, 0, 0], [0, 50, 0], [0, 100, 0], [0, 150, 0]]), id="collinear"),
        pytest.param(POINTS[[0, 0, 1, 2]], id="coincident"),
        pytest.param(POINTS * [1, 1, 0], id="flat"),
    ],
)
def test_odd_shapes_of_limbs_give_no_nan(points):
    assert_no_nan(*fitted(two_limbs(40.0, points))[:2])


def test_marker_seen_in_five_frames_gives_no_nan():
    positions = two_limbs(40.0)
    positions[5:, 2] = np.nan
    assert_no_nan(*fitted(positions)[:2])


def test_positions_that_are_all_equal_give_no_nan():
    assert_no_nan(*fitted(np.ones((N_FRAMES, 8, 3)))[:2])


def test_exact_positions_give_no_nan():
    assert_no_nan(*fitted(two_limbs(40.0, noise=0.0))[:2])


@pytest.mark.parametrize("n_frames", [3, 40])
def test_bodies_of_one_marker_are_followed_and_nothing_is_known_of_their_rotations(n_frames):
    positions = 100 * np.random.default_rng(0).normal(size=(n_frames, 2, 3))
    limbs = Limbs(np.arange(2), np.zeros((2, 2)))
    topology = Topology(np.full(2, -1), np.zeros((2, 2)), np.zeros((n_frames, 0, 3)), np.zeros(0), np.zeros(0), 0.1)
    skeleton, motion = fit_skeleton(Trajectories(positions, ("a", "b"), RATE), limbs, topology)
    np.testing.assert_allclose(motion.marker_positions, positions, atol=1e-9)
    assert not motion.limb_seen.any()
    assert_no_nan(skeleton, motion)


@pytest.mark.parametrize("seed", range(3))
def test_exact_markers_on_more_limbs_than_there_are_give_no_nan(seed):
    take = simulate("rods", seed=seed, n_frames=14, dropouts=0.1, motion_range=0.1).take
    limbs = find_limbs(take, n_limbs=7)
    skeleton, motion = fit_skeleton(take, limbs, find_joints(take, limbs))
    on_limbs = limbs.limb_of_marker >= 0
    assert_no_nan(
        replace(skeleton, marker_offsets=np.where(on_limbs[:, np.newaxis], skeleton.marker_offsets, 0.0)), motion
    )
