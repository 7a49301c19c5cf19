"""Faults have the size that was asked for, and the truth knows what they were."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import ParameterError
from skelgen.model import PointCloud, Trajectories
from skelgen.simulation import SimulationParameters, Structure, Truth, simulate
from skelgen.simulation.articulated import LimbModel
from skelgen.simulation.markers import BURST_FRAMES, DUPLICATE_OFFSET, EDGE_FRAMES, dropouts, edge_jumps, merged_points
from skelgen.simulation.visibility import camera_ring, seen_by_cameras

FAULTS = {"noise": 1.0, "soft_tissue": 2.0, "dropouts": 0.1, "n_cameras": 4, "ghosts": 3.0, "labelled": False}
FAULTS |= {"merged": 60.0, "duplicates": 1.0, "edge_jumps": 5.0}


def runs_of(lost: np.ndarray) -> np.ndarray:
    """Lengths of the runs of lost frames of all markers."""
    steps = np.diff(np.pad(lost.astype(int), ((1, 1), (0, 0))), axis=0)
    return np.nonzero(steps.T == -1)[1] - np.nonzero(steps.T == 1)[1]


def test_without_faults_the_take_is_the_truth() -> None:
    simulated = simulate("human", n_frames=50)
    assert isinstance(simulated.take, Trajectories)
    assert np.array_equal(simulated.take.positions, simulated.truth.marker_positions)
    assert simulated.take.names == simulated.truth.marker_names


def test_the_same_seed_gives_the_same_bits() -> None:
    first, again = (simulate("human", n_frames=60, seed=7, **FAULTS) for _ in range(2))
    assert first.take.points.tobytes() == again.take.points.tobytes()
    assert first.truth.marker_of_point.tobytes() == again.truth.marker_of_point.tobytes()


def test_faults_do_not_change_the_motion() -> None:
    clean, faulty = simulate("human", n_frames=60, seed=7), simulate("human", n_frames=60, seed=7, **FAULTS)
    assert np.array_equal(clean.truth.world_from_limb, faulty.truth.world_from_limb)


def test_another_seed_gives_another_motion() -> None:
    first, other = (simulate("human", n_frames=10, seed=seed).truth for seed in (1, 2))
    assert not np.allclose(first.joint_positions, other.joint_positions)


def test_noise_has_its_standard_deviation() -> None:
    simulated = simulate("human", n_frames=1000, noise=0.5)
    error = simulated.take.positions - simulated.truth.marker_positions
    assert error.std() == pytest.approx(0.5, rel=0.01)  # of 135,000 numbers: 0.2 %
    assert abs(error.mean()) < 0.01


def test_soft_tissue_motion_has_its_standard_deviation_and_is_smooth() -> None:
    simulated = simulate("human", n_frames=1000, soft_tissue=3.0)
    slide = simulated.take.positions - simulated.truth.marker_positions
    assert np.sqrt((slide**2).sum(axis=2).mean(axis=0) / 3) == pytest.approx(3.0)  # rotations keep the square sum
    assert np.abs(np.diff(slide, axis=0)).max() < 1.0  # mm in 10 ms


@pytest.mark.parametrize("fraction", [0.02, 0.05, 0.3, 0.8])
def test_dropouts_lose_their_fraction(fraction: float) -> None:
    lost = dropouts(3000, 40, fraction, np.random.default_rng(0))
    assert lost.mean() == pytest.approx(fraction, rel=0.1)


def test_dropouts_come_as_single_frames_and_as_bursts() -> None:
    lengths = runs_of(dropouts(3000, 40, 0.02, np.random.default_rng(0)))
    assert (lengths == 1).sum() > 100
    assert (lengths >= BURST_FRAMES[0]).sum() > 20
    assert lengths.max() < 2 * BURST_FRAMES[1]


def test_points_carry_the_identity_of_their_marker() -> None:
    simulated = simulate("human", n_frames=80, labelled=False, ghosts=2.0, dropouts=0.1)
    assert isinstance(simulated.take, PointCloud)
    markers = simulated.truth.marker_of_point
    frames = np.repeat(np.arange(80), simulated.take.points_per_frame)
    real = markers >= 0
    assert np.array_equal(simulated.take.points[real], simulated.truth.marker_positions[frames[real], markers[real]])


def test_points_are_in_random_order() -> None:
    markers = simulate("human", n_frames=80, labelled=False).truth.marker_of_point.reshape(80, -1)
    assert (np.sort(markers, axis=1) == np.arange(markers.shape[1])).all()
    assert len(np.unique(markers, axis=0)) == 80


def test_ghosts_have_their_number_and_lie_near_the_body() -> None:
    simulated = simulate("rods", n_frames=5000, labelled=False, ghosts=2.0, walk=0.0)
    ghosts = simulated.take.points[simulated.truth.marker_of_point < 0]
    body = simulated.truth.marker_positions.reshape(-1, 3)
    assert len(ghosts) / 5000 == pytest.approx(2.0, rel=0.1)  # about 3300 births: 2 %
    assert ((ghosts >= body.min(axis=0)) & (ghosts <= body.max(axis=0))).all()


def test_merged_markers_become_their_mean_and_are_nobody() -> None:
    places = np.array([[0.0, 0, 0], [8, 0, 0], [16, 0, 0], [100, 0, 0], [np.nan] * 3])
    apart, frames, points = merged_points(np.stack([places, places * 2]), 10.0)
    assert frames.tolist() == [0]  # the third is near the second, so all three merge
    assert points.tolist() == [[8.0, 0, 0]]
    assert np.isnan(apart[0, :, 0]).tolist() == [True] * 3 + [False, True]
    assert np.array_equal(apart[1], places * 2, equal_nan=True)


def test_merged_takes_have_no_two_markers_nearer_than_the_resolution() -> None:
    simulated = simulate("human", n_frames=300, labelled=False, merged=60.0)
    markers, frames = simulated.truth.marker_of_point, np.repeat(np.arange(300), simulated.take.points_per_frame)
    assert (markers < 0).sum() > 50
    for frame in range(0, 300, 10):
        own = simulated.take.points[(frames == frame) & (markers >= 0)]
        apart = np.linalg.norm(own[:, None] - own, axis=2)
        assert (apart[np.triu_indices(len(own), 1)] > 60.0).all()


def test_duplicates_lie_beside_the_point_of_their_marker() -> None:
    simulated = simulate("rods", n_frames=4000, labelled=False, duplicates=0.5, noise=1.0)
    markers, frames = simulated.truth.marker_of_point, np.repeat(np.arange(4000), simulated.take.points_per_frame)
    order = np.lexsort((markers, frames))
    double = (np.diff(frames[order]) == 0) & (np.diff(markers[order]) == 0)
    apart = np.linalg.norm(np.diff(simulated.take.points[order], axis=0)[double], axis=1)
    assert apart == pytest.approx(DUPLICATE_OFFSET)
    assert double.mean() * 9.5 == pytest.approx(0.5, rel=0.15)  # about 360 births, some at one marker: 5-10 %


def test_positions_jump_only_where_visibility_begins_or_ends() -> None:
    still = np.zeros((400, 3, 3))
    still[100:150, 0] = np.nan
    jumped = edge_jumps(still, 4.0, np.random.default_rng(0))
    moved = np.flatnonzero(jumped[:, 0, 0] != 0)
    expected = [*range(100 - EDGE_FRAMES, 150 + EDGE_FRAMES)]
    assert moved.tolist() == expected
    assert (jumped[:, 1:] == 0).all()


def test_edge_jumps_have_their_standard_deviation() -> None:
    options = {"n_frames": 3000, "dropouts": 0.3, "seed": 1}
    with_jumps, without = (simulate("rods", edge_jumps=size, **options).take.positions for size in (4.0, 0.0))
    jumps = (with_jumps - without)[(with_jumps != without) & ~np.isnan(without)]
    assert jumps.std() == pytest.approx(4.0, rel=0.05)  # of some 3000 numbers: 1.3 %


def test_more_cameras_see_more() -> None:
    seen = [simulate("human", n_frames=100, n_cameras=n).take.seen.mean() for n in (2, 4, 8, 16)]
    assert seen == sorted(seen)
    assert 0.02 < seen[0] < 0.9 < seen[-1] < 1


def lone_post() -> Structure:
    """A post of 100 mm radius along z, with one marker 300 mm in front of it."""
    segment, marker = np.array([[0.0, 0.0, -500.0], [0.0, 0.0, 500.0]]), np.array([[300.0, 0.0, 0.0]])
    return Structure(
        "post",
        (LimbModel("post", "", "free", np.zeros(3), segment, 100.0, marker, np.eye(3), np.zeros(3), np.zeros(3)),),
    )


@pytest.mark.parametrize(("cameras", "is_seen"), [([3000.0, 2000.0], True), ([3000.0, -3000.0], False)])
def test_a_limb_hides_what_is_behind_it(cameras: list[float], is_seen: bool) -> None:
    places = np.array([[x, 0.0, 100.0] for x in cameras])
    seen = seen_by_cameras(lone_post(), np.eye(4)[None, None], np.array([[[300.0, 0.0, 0.0]]]), places)
    assert seen.tolist() == [[is_seen]]


def test_occlusion_agrees_with_sampled_lines_of_sight() -> None:
    truth: Truth = simulate("rods", n_frames=40, seed=2).truth
    cameras = camera_ring(truth.marker_positions, 3)
    fat = Structure("fat", tuple(_with_radius(limb, 60.0) for limb in _rods()))
    seen = seen_by_cameras(fat, truth.world_from_limb, truth.marker_positions, cameras)
    clearance = np.stack([_sampled_clearance(fat, truth, camera) for camera in cameras])
    decided = (np.abs(clearance - 60.0) > 3.0).all(axis=0)  # mm: sampling misses the closest points by less
    assert decided.mean() > 0.5
    assert np.array_equal(seen[decided], ((clearance > 60.0).sum(axis=0) >= 2)[decided])


def _rods() -> tuple[LimbModel, ...]:
    from skelgen.simulation import rods_chain

    return rods_chain().limbs


def _with_radius(limb: LimbModel, radius: float) -> LimbModel:
    import dataclasses

    return dataclasses.replace(limb, radius=radius)


def _sampled_clearance(structure: Structure, truth: Truth, camera: np.ndarray) -> np.ndarray:
    """Smallest distance of sampled lines of sight from sampled limbs, shape (n_frames, n_markers)."""
    sight = truth.marker_positions - camera
    reach = 1 - 25.0 / np.linalg.norm(sight, axis=2, keepdims=True)
    rays = camera + np.linspace(0, 1, 300)[:, None, None, None] * (reach * sight)
    nearest = np.full(sight.shape[:2], np.inf)
    for limb, poses in zip(structure.limbs, truth.world_from_limb.swapaxes(0, 1), strict=True):
        for fraction in np.linspace(0, 1, 60):
            point = limb.segment[0] + fraction * (limb.segment[1] - limb.segment[0])
            world = poses[:, :3, :3] @ point + poses[:, :3, 3]
            nearest = np.minimum(nearest, np.linalg.norm(rays - world[:, None], axis=3).min(axis=0))
    return nearest


@pytest.mark.parametrize(
    "options",
    [
        {"noise": -1.0},
        {"n_frames": 0},
        {"ghosts": 1.0},
        {"n_cameras": 1},
        {"merged": 5.0},
        {"duplicates": 1.0},
        {"velocity": 3},
    ],
)
def test_bad_options_are_parameter_errors(options: dict[str, float]) -> None:
    with pytest.raises(ParameterError):
        simulate("rods", **options)


def test_options_change_the_parameters() -> None:
    parameters = SimulationParameters(n_frames=20, rate=50.0)
    take = simulate("rods", parameters=parameters, n_frames=30).take
    assert (take.n_frames, take.rate) == (30, 50.0)


def test_a_single_frame_can_be_simulated() -> None:
    assert simulate("rods", n_frames=1, soft_tissue=1.0, ghosts=1.0, labelled=False, dropouts=0.1).take.n_frames == 1
