"""Takes that leave things open, through all stages: no crash, no NaN, never a reflection, and a sentence."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

import skelgen
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import Project, Trajectories
from skelgen.simulation import simulate

N_FRAMES = 300
POINTS = np.array([[60.0, 0, 0], [-40, 50, 10], [-40, -50, -10], [10, 20, 50]])
LINE = np.array([[0.0, 0, 30], [0, 0, 60], [0, 0, 100], [0, 0, 150]])
JOINT = np.array([0.0, 0.0, 150.0])
NOISE = 0.3  # mm
MEAN_RESIDUAL = 2 * NOISE  # mm, of a distance: 1.6 times the noise where the limbs are as they were made


def named(positions: np.ndarray) -> Trajectories:
    """A take of markers M0, M1, ..."""
    return Trajectories(positions, tuple(f"M{index}" for index in range(positions.shape[1])), 100.0)


def two_limbs(second: np.ndarray = POINTS, degrees: float = 40.0) -> np.ndarray:
    """Two limbs that meet in a ball joint; the first has the four points, the second those that are given."""
    random, times = np.random.default_rng(0), np.arange(N_FRAMES)[:, None] / 100
    upper = matrix_from_vector(0.6 * np.sin(2 * np.pi * np.array([0.7, 1.1, 0.5]) * times))
    turn = matrix_from_vector(np.deg2rad(degrees) * np.sin(2 * np.pi * np.array([1.3, 0.9, 1.7]) * times))
    places = [np.einsum("fij,nj->fni", upper, POINTS), np.einsum("fij,nj->fni", upper @ turn, second + JOINT)]
    places[1] += (upper @ JOINT)[:, None]
    exact = np.concatenate(places, axis=1)
    return exact + NOISE * random.normal(size=exact.shape)


def with_gaps(first_limb_in: slice, second_limb_in: slice) -> np.ndarray:
    """Two limbs that are seen in some frames only."""
    positions = two_limbs()
    hidden = np.ones((N_FRAMES, 8), dtype=bool)
    hidden[first_limb_in, :4] = hidden[second_limb_in, 4:] = False
    return np.where(hidden[..., None], np.nan, positions)


def with_copy() -> Trajectories:
    """A human, one of whose markers is there twice."""
    take = simulate("human", seed=1, n_frames=N_FRAMES, noise=NOISE).take
    positions = np.concatenate([take.positions, take.positions[:, :1]], axis=1)
    return dataclasses.replace(take, positions=positions, names=(*take.names, "copy"))


def in_metres_by_mistake() -> Trajectories:
    """Two limbs whose metres were read as millimetres."""
    return named(two_limbs() / 1000)


def with_rare_marker() -> Trajectories:
    """A human, one of whose markers is seen in five frames."""
    take = simulate("human", seed=1, n_frames=N_FRAMES, noise=NOISE).take
    positions = take.positions.copy()
    positions[np.setdiff1d(np.arange(N_FRAMES), [10, 90, 150, 200, 290]), 4] = np.nan
    return dataclasses.replace(take, positions=positions)


def mirrored() -> np.ndarray:
    """Two limbs, the first of which is its own mirror image in the second half."""
    positions = two_limbs()
    positions[N_FRAMES // 2 :, :4, 0] *= -1
    return positions


CASES = {
    "limbs that never move": (lambda: named(two_limbs(degrees=0.0)), "only one limb is found"),
    "collinear markers": (lambda: named(two_limbs(LINE)), "how it turns about that line is not determined"),
    "coincident markers": (with_copy, "pelvis 1 and copy are always in one place"),
    "metres called mm": (in_metres_by_mistake, "the numbers are probably in m, not as stated"),
    "all in one place": (in_metres_by_mistake, "M6 and M7 are always in one place: they count as 8 markers"),
    "mirror image": (lambda: named(mirrored()), "looks like its mirror image in 150 of 300"),
    "marker in five frames": (with_rare_marker, "is seen in 5 frames only"),
    "never together": (lambda: named(with_gaps(slice(0, 150), slice(150, None))), "never seen together"),
    "one marker on a limb": (lambda: named(two_limbs()[:, :5]), "how it turns about that line is not determined"),
}


@pytest.fixture(scope="module", params=CASES)
def outcome(request) -> tuple[Project, str]:
    """What a case was made to, and the sentence that is due."""
    make, sentence = CASES[request.param]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return skelgen.reconstruct(make()), sentence


def test_what_is_not_determined_is_said(outcome):
    project, sentence = outcome
    said = [notice for report in project.reports.values() for notice in report.notices]
    assert any(sentence in notice for notice in said), said


def test_outputs_are_numbers_and_rotations_no_reflections(outcome):
    project, _ = outcome
    skeleton, motion = project.skeleton, project.motion
    on_limb = skeleton.limb_of_marker >= 0
    figures = [skeleton.marker_offsets[on_limb], skeleton.marker_std[on_limb], list(skeleton.lengths.values())]
    figures += [motion.world_from_limb, motion.joint_positions, motion.joint_std, motion.marker_positions[:, on_limb]]
    figures += [part for joint in skeleton.joints for part in (joint.position_in_parent, joint.std)]
    assert all(np.isfinite(figure).all() for figure in figures)
    np.testing.assert_allclose(np.linalg.det(motion.rotations), 1.0, atol=1e-9)


@pytest.mark.parametrize("outcome", [name for name in CASES if name != "mirror image"], indirect=True)
def test_markers_stay_where_they_are(outcome):  # no rigid limb explains its own mirror image
    assert np.nanmean(outcome[0].motion.residuals) < MEAN_RESIDUAL


@pytest.mark.parametrize("place", [np.zeros((1, 8, 3)), np.ones((1, 8, 3)), 100 * POINTS[None].repeat(2, axis=1)])
def test_take_in_which_nothing_moves_is_refused(place):
    with pytest.raises(skelgen.SkelgenError, match="nothing moves"):
        skelgen.reconstruct(named(np.tile(place, (N_FRAMES, 1, 1))))
