"""Takes: point clouds, labelled markers, bodies with orientation."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model import PointCloud, Poses, Trajectories


@pytest.fixture
def cloud():
    """Three frames with 2, 0 and 1 points."""
    points = np.arange(9.0).reshape(3, 3)
    return PointCloud(points, [0, 2, 2, 3], [0.0, 0.01, 0.02], {"n_blobs": [2, 3, 4]}, "cloud")


@pytest.fixture
def markers():
    """Two markers in three frames, one of them unseen in the second."""
    positions = np.arange(18.0).reshape(3, 2, 3)
    positions[1, 0] = np.nan
    return Trajectories(positions, ("a", "b"), 50.0, "walk")


def test_point_cloud_gives_its_frames(cloud):
    assert (cloud.n_frames, cloud.n_points) == (3, 3)
    assert cloud.points_per_frame.tolist() == [2, 0, 1]
    assert [len(frame) for frame in cloud] == [2, 0, 1]
    np.testing.assert_array_equal(cloud.frame(2), [[6, 7, 8]])


def test_rate_of_a_point_cloud_is_that_of_the_median_step():
    times = [0.0, 0.01, 0.02, 0.03, 0.5]
    assert PointCloud(np.zeros((0, 3)), [0] * 6, times).rate == pytest.approx(100)
    assert PointCloud(np.zeros((0, 3)), [0, 0], [7.0]).rate == 1.0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"frame_starts": [0, 2, 1, 3]}, "rise from 0 to the number of points, 3"),
        ({"frame_starts": [1, 2, 2, 3]}, "rise from 0"),
        ({"frame_starts": [0, 2, 2, 2]}, "rise from 0"),
        ({"times": [0.0, 0.02, 0.01]}, "go back at frame 2"),
        ({"times": [0.0, 0.01]}, r"times has shape \(2,\)"),
        ({"points": np.full((3, 3), np.nan)}, "points holds values that are not finite"),
        ({"attributes": {"n_blobs": [1.0]}}, "n_blobs has shape"),
    ],
)
def test_inconsistent_point_clouds_are_refused(cloud, change, sentence):
    with pytest.raises(InputError, match=sentence):
        dataclasses.replace(cloud, **change)


def test_attributes_cannot_be_changed(cloud):
    with pytest.raises(TypeError):
        cloud.attributes["n_blobs"] = np.zeros(3)
    with pytest.raises(ValueError, match="read-only"):
        cloud.attributes["n_blobs"][0] = 0


def test_markers_know_when_they_are_seen(markers):
    assert markers.seen.tolist() == [[True, True], [False, True], [True, True]]
    assert (markers.n_frames, markers.n_markers) == (3, 2)
    np.testing.assert_allclose(markers.times, [0, 0.02, 0.04])


def test_half_seen_marker_is_unseen(markers):
    positions = markers.positions.copy()
    positions[2, 1, 2] = np.nan
    again = dataclasses.replace(markers, positions=positions)
    assert np.isnan(again.positions[2, 1]).all()
    assert not again.positions.flags.writeable


@pytest.mark.parametrize("field", ["positions", "names", "rate"])
def test_values_are_frozen(markers, field):
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(markers, field, None)


def test_positions_are_a_read_only_copy():
    given = np.zeros((2, 1, 3))
    take = Trajectories(given, ["a"], 1)
    given[0] = 7
    assert (take.positions == 0).all()
    with pytest.raises(ValueError, match="read-only"):
        take.positions[0] = 1
    assert take.names == ("a",)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"names": ("a", "a")}, "two markers are called 'a'"),
        ({"names": ("a",)}, "1 marker name where 2 belong"),
        ({"rate": 0.0}, "must be above 0"),
        ({"positions": np.zeros((3, 2))}, "positions has shape"),
        ({"positions": np.full((3, 2, 3), np.inf)}, "not finite"),
    ],
)
def test_bad_markers_are_refused(markers, change, sentence):
    with pytest.raises(InputError, match=sentence):
        dataclasses.replace(markers, **change)


def test_takes_of_no_frames_are_values_too():
    take = Trajectories(np.zeros((0, 2, 3)), ("a", "b"), 100)
    assert take.n_frames == 0
    assert take.times.shape == (0,)


def test_body_with_one_unknown_number_is_unseen():
    pose = np.tile(np.eye(4), (2, 1, 1, 1))
    pose[1, 0, 0, 3] = np.nan
    poses = Poses(pose, ("sensor",), 100.0)
    assert np.isnan(poses.world_from_body[1]).all()
    assert np.isfinite(poses.world_from_body[0]).all()


@pytest.mark.parametrize("diagonal", [(1, 1, -1), (2, 1, 1), (1, 0.99, 1), (1e308, 1e308, 1)])
def test_matrix_that_is_no_rotation_is_refused(diagonal):
    pose = np.eye(4)
    pose[:3, :3] = np.diag(diagonal)
    with np.errstate(all="raise"), pytest.raises(InputError, match="not a proper rotation"):
        Poses(pose[None, None], ("sensor",), 100.0)


def test_array_in_metres_becomes_labelled_markers_in_mm():
    take = Trajectories.from_array(np.full((4, 2, 3), 0.5), 100.0, "m", names=("knee", "ankle"), name="walk")
    assert (take.names, take.rate, take.name, take.notices) == (("knee", "ankle"), 100.0, "walk", ())
    np.testing.assert_array_equal(take.positions, 500.0)


def test_masked_positions_are_unseen():
    array = np.ma.masked_equal(np.arange(1, 19).reshape(3, 2, 3) * 100, 800)
    take = Trajectories.from_array(array, 100.0)
    assert take.seen.tolist() == [[True, True], [False, True], [True, True]]


def test_masked_positions_of_a_list_of_frames_are_unseen():
    array = np.ma.masked_equal(np.arange(1, 19).reshape(3, 2, 3) * 100, 800)
    take = Trajectories.from_array(list(array), 100.0)
    assert take.seen.tolist() == [[True, True], [False, True], [True, True]]


def test_masked_positions_that_nobody_can_write_to_are_unseen():
    array = pickle.loads(pickle.dumps(np.ma.masked_equal(np.arange(1.0, 19.0).reshape(3, 2, 3), 8.0)))  # its own data
    array.flags.writeable = False
    assert Trajectories(array, ("A", "B"), 100.0).seen.tolist() == [[True, True], [False, True], [True, True]]


def test_markers_of_an_array_without_names_are_numbered():
    assert Trajectories.from_array([[[1, 2, 3], [400, 500, 600]]], 100.0).names == ("M1", "M2")


def test_zeros_in_an_array_are_gaps_and_a_notice_says_so():
    array = np.full((3, 2, 3), 100.0)
    array[:, 1] = 900.0
    array[1, 0] = 0.0
    with pytest.warns(UserWarning, match=r"1 position is exactly \(0, 0, 0\) and was taken as a gap"):
        take = Trajectories.from_array(array, 100.0)
    assert take.seen.tolist() == [[True, True], [False, True], [True, True]]
    assert "taken as a gap" in take.notices[0]
    assert Trajectories.from_array(array, 100.0, zeros_are_gaps=False).seen.all()
    assert not np.isnan(array).any()


@pytest.mark.parametrize(("scale", "unit", "sentence"), [(1.0, "mm", "give unit='m'"), (1000.0, "m", "give unit='mm'")])
def test_array_in_another_unit_than_stated_is_warned_of(scale, unit, sentence):
    array = np.array([[[0.1, 0.2, 0.9], [0.4, 0.1, 1.8]]]) * scale
    with pytest.warns(UserWarning, match=sentence):
        Trajectories.from_array(array, 100.0, unit)


@pytest.mark.parametrize(
    ("array", "unit", "sentence"),
    [
        (np.zeros((5, 6)), "mm", r"shape \(5, 6\); it must be \(n_frames, n_markers, 3\), so reshape it"),
        (np.ones((5, 2, 3)), "km", "no unit 'km'; units are mm, cm, m, inch"),
        (np.full((5, 2, 3), np.inf), "mm", "not finite"),
        (np.zeros((0, 2, 3)), "mm", r"shape \(0, 2, 3\), that is no frame"),
        (np.zeros((5, 0, 3)), "mm", r"shape \(5, 0, 3\), that is no marker"),
        ("walk.c3d", "mm", r"real numbers with the shape \(n_frames, n_markers, 3\), .*; it is 'walk.c3d'"),
        ([[[1, 2, 3]], [[1, 2]]], "mm", "all rows of one length"),
        (np.ones((5, 2, 3)) + 1j, "mm", "real numbers"),
    ],
)
def test_array_that_is_no_take_is_refused(array, unit, sentence):
    with pytest.raises(InputError, match=sentence):
        Trajectories.from_array(array, 100.0, unit)


def test_a_text_is_no_list_of_names():
    with pytest.raises(InputError, match="must be several texts, as in a list, not 'abc'"):
        Trajectories.from_array(100.0 * np.arange(1.0, 46.0).reshape(5, 3, 3), 100.0, names="abc")
