"""Distances learned frame by frame, against their moments; rigid neighbours, against a body that is rigid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skelgen._kernels.marker_history import (
    LEAST_COMMON,
    LEAST_NEIGHBOURS,
    DistanceTables,
    Neighbours,
    find_neighbours,
    learn_distances,
    write_deviations,
    write_misfits,
)
from skelgen.geometry.rotations import matrix_from_vector

N_SLOTS, N_FRAMES, LONG = 6, 400, 1000
RIGID, LOOSE = np.array([1, 2, 3, 5]), 4


def empty_tables() -> DistanceTables:
    return DistanceTables(*np.zeros((3, N_SLOTS, N_SLOTS)))


def pairs(positions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(positions[..., :, np.newaxis, :] - positions[..., np.newaxis, :, :], axis=-1)


@pytest.fixture
def frames() -> np.ndarray:
    """Frames of five markers in slots 1 to 5: all are on one body that moves, but the one in slot 4 also sways."""
    rng = np.random.default_rng(0)
    body = 100.0 * rng.normal(size=(5, 3))
    turns = matrix_from_vector(rng.normal(size=(N_FRAMES, 3)))
    positions = body @ turns.swapaxes(1, 2)
    positions[:, LOOSE - 1] += 20.0 * rng.normal(size=(N_FRAMES, 3))
    return positions


@pytest.fixture
def learned(frames) -> DistanceTables:
    tables = empty_tables()
    for positions in frames:
        learn_distances(tables, np.arange(1, 6), positions, LONG)
    return tables


def neighbours_of(tables: DistanceTables, slots: np.ndarray, visible: np.ndarray, most: int) -> Neighbours:
    shape = (len(slots), most)
    numbers = np.empty((len(slots), 1 + most), dtype=np.intp), np.empty(shape, dtype=np.intp)
    found = Neighbours(*numbers, np.empty(shape), np.empty(shape))
    find_neighbours(tables, slots, visible, LONG, 1.0, found)
    return found


def test_mean_and_variance_of_distances_are_those_of_all_frames(frames, learned):
    np.testing.assert_allclose(learned.mean[1:, 1:], pairs(frames).mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(learned.variance[1:, 1:], pairs(frames).var(axis=0), rtol=1e-9, atol=1e-9)
    assert (learned.common[1:, 1:] == N_FRAMES).all()
    assert not learned.common[0].any()


def test_a_window_forgets_what_was_before(frames):
    tables = empty_tables()
    for positions in [*frames, *[frames[0]] * 100]:
        learn_distances(tables, np.arange(1, 6), positions, 3)
    np.testing.assert_allclose(tables.mean[1:, 1:], pairs(frames[0]), rtol=1e-9)


def test_deviations_are_known_after_some_frames(frames):
    tables, deviations = empty_tables(), np.empty((1, 2))
    for count, positions in enumerate(frames):
        write_deviations(tables, np.array([1]), np.array([2, LOOSE]), LONG, 1.0, deviations)
        assert np.isfinite(deviations).all() == (count >= LEAST_COMMON)
        learn_distances(tables, np.arange(1, 6), positions, LONG)
    assert deviations[0, 0] < deviations[0, 1]


def test_neighbours_are_the_most_rigid_visible_markers(learned):
    found = neighbours_of(learned, RIGID, np.arange(6), 3)
    for row, slot in enumerate(RIGID):
        assert set(found.slots[row]) == set(RIGID)
        assert found.slots[row, 0] == slot
        np.testing.assert_array_equal(found.order[row], found.slots[row, 1:])
        assert (np.diff(found.deviations[row]) >= 0.0).all()
        np.testing.assert_array_equal(found.means[row], learned.mean[slot, found.order[row]])


def test_places_of_neighbours_that_are_not_there_are_empty(learned):
    found = neighbours_of(learned, np.array([1]), np.array([3, 1, 0, 2]), 6)
    assert sorted(found.slots[0, 1:3]) == [2, 3]
    assert (found.order[0, 2:] == -1).all()
    assert np.isinf(found.deviations[0, 2:]).all()


def test_equally_rigid_neighbours_are_taken_as_they_come():
    tables = empty_tables()
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for _ in range(LEAST_COMMON):
        learn_distances(tables, np.arange(4), corners, LONG)
    assert neighbours_of(tables, np.array([0]), np.array([2, 3, 1]), 2).slots[0].tolist() == [0, 2, 3]


def test_only_the_place_of_a_marker_keeps_its_distances(frames, learned):
    visible = RIGID[1:]
    found = neighbours_of(learned, np.array([1, LOOSE]), visible, len(visible))
    own, misfits = frames[-1][0], np.empty((2, 2))
    write_misfits(np.array([own, own + 10.0]), frames[-1][visible - 1], found, misfits)
    assert misfits[0, 0] < 1e-9
    off = np.linalg.norm(own + 10.0 - frames[-1][visible - 1], axis=1) - learned.mean[1, visible]
    order = found.order[0]
    assert misfits[1, 0] == pytest.approx(math.sqrt(np.mean((off[order] / found.deviations[0]) ** 2)))


def test_too_few_neighbours_say_nothing(frames, learned):
    visible, misfits = RIGID[1:LEAST_NEIGHBOURS], np.empty((1, 1))
    found = neighbours_of(learned, np.array([1]), visible, 6)
    write_misfits(frames[-1][:1], frames[-1][visible - 1], found, misfits)
    assert np.isinf(misfits).all()
