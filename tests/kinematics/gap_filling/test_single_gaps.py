"""Single gaps are filled in four ways, each with the deviation that it has elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.errors import InputError
from skelgen.kinematics.gap_filling.single_gaps import fill_marker, gaps_of
from skelgen.model import Trajectories
from skelgen.model.filled import PositionSource
from skelgen.simulation import simulate

GAP = (200, 229)


@pytest.fixture(scope="module")
def walked():
    """A simulated human with five markers on the chest: one is hidden in a gap; and where it truly is there."""
    take = simulate("human", n_frames=500, noise=0.3).take
    marker = take.names.index("chest 1")
    first, second, third = (take.positions[:, take.names.index(f"chest {number}")] for number in (1, 2, 3))
    more = [(first + second) / 2 + weight * (third - first) for weight in (0.3, 0.7)]
    positions = np.concatenate([take.positions, np.stack(more, axis=1)], axis=1)
    take = Trajectories(positions, (*take.names, "chest 4", "chest 5"), take.rate)
    positions = take.positions.copy()
    truth = positions[GAP[0] : GAP[1] + 1, marker].copy()
    positions[GAP[0] : GAP[1] + 1, marker] = np.nan
    return Trajectories(positions, take.names, take.rate), marker, truth


def mates_of(take, marker):
    limb = take.names[marker].rpartition(" ")[0]
    return [index for index, name in enumerate(take.names) if name.startswith(limb) and index != marker]


@pytest.mark.parametrize(("method", "bound"), [("spline", 60.0), ("rigid", 3.0), ("pattern", 40.0)])
def test_each_way_states_about_the_error_that_it_has(walked, method, bound):
    take, marker, truth = walked
    mates = mates_of(take, marker)
    donors = {"spline": [], "rigid": mates[:3], "pattern": mates[:1]}[method]
    found = fill_marker(take, marker, (0, 499), method, donors)
    np.testing.assert_array_equal(found.frames, np.arange(GAP[0], GAP[1] + 1))
    error = np.sqrt(((found.positions - truth) ** 2).mean())
    stated = np.sqrt((found.std**2).mean())
    assert error < bound
    assert error / 4 < stated < max(4 * error, 1.0)
    assert found.n_trials > 5


def test_a_straight_path_is_filled_exactly_by_a_spline_and_noise_does_not_throw_it():
    time = np.arange(100.0)[:, np.newaxis]
    path = np.hstack([10 * time, 5 * time, 0 * time]) + np.random.default_rng(1).normal(0, 0.5, (100, 3))
    path[40:60] = np.nan
    found = fill_marker(Trajectories(path[:, np.newaxis], ("a",), 100.0), 0, (0, 99), "spline")
    assert np.abs(found.positions - np.hstack([10 * time, 5 * time, 0 * time])[40:60]).max() < 5


def test_gaps_at_the_ends_are_carried_by_mates_and_left_by_a_spline(walked):
    take, marker, _ = walked
    positions = take.positions.copy()
    positions[480:, marker] = np.nan
    cut = Trajectories(positions, take.names, take.rate)
    assert gaps_of(cut.seen[:, marker]) == (GAP, (480, 499))
    assert not len(fill_marker(cut, marker, (480, 499), "spline").frames)
    assert len(fill_marker(cut, marker, (490, 499), "rigid", mates_of(take, marker)[:3]).frames) == 10


def test_a_gap_filled_in_part_is_that_part_of_the_whole(walked):
    take, marker, _ = walked
    whole, part = (fill_marker(take, marker, span, "spline") for span in (GAP, (205, 209)))
    np.testing.assert_array_equal(part.positions, whole.positions[5:10])


def test_ways_without_the_markers_that_they_need_are_refused(walked):
    take, marker, _ = walked
    for method, donors in (("rigid", [marker + 1]), ("pattern", []), ("pattern", [marker]), ("skeleton", [])):
        with pytest.raises(InputError):
            fill_marker(take, marker, GAP, method, donors)


def test_what_is_stated_fills_and_the_rest_is_filled_by_the_skeleton(walked):
    take, marker, _ = walked
    positions = take.positions.copy()
    positions[300:310, 0] = np.nan
    project = skelgen.reconstruct(Trajectories(positions, take.names, take.rate))
    mates = [take.names[index] for index in mates_of(take, marker)]
    name = take.names[marker]
    stated = skelgen.correct(project, "fill", [name, mates[0]], "pattern", GAP)
    assert stated.skeleton is project.skeleton
    filled = skelgen.fill(stated)
    assert set(filled.source[GAP[0] : GAP[1] + 1, marker]) == {PositionSource.PATTERN}
    assert "30 by another marker" in filled.sentence
    own = skelgen.fill(project)
    np.testing.assert_array_equal(filled.positions[300:310, 0], own.positions[300:310, 0])
    again = skelgen.correct(stated, "fill", [name], "skeleton", (200, 209))
    filled = skelgen.fill(again)
    np.testing.assert_array_equal(filled.positions[200:210, marker], own.positions[200:210, marker])
    assert filled.source[210, marker] == PositionSource.PATTERN


def test_a_take_without_a_skeleton_is_filled_where_it_is_stated(walked):
    take, marker, _ = walked
    project = skelgen.reconstruct(take, until="labels")
    filled = skelgen.fill(skelgen.correct(project, "fill", [take.names[marker]], "spline"))
    assert filled.trajectories.seen.all()
