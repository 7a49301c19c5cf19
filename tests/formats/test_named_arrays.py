"""Arrays of points in .npz and .mat in other orders than (frames, points, 3): three points that move, in mm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat
from skelgen_formats.registry import read_take

N_FRAMES = 40
PLACES = np.array([[0.0, 0, 900], [300, 40, 500], [250, -70, 100], [20, 300, 700]])
POSITIONS = PLACES + 50.0 * np.sin(np.arange(N_FRAMES) / 10)[:, np.newaxis, np.newaxis]
NAMES = ["hip", "knee", "toe", "hand"]


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 0, 2), (2, 0, 1), (2, 1, 0), (1, 2, 0), (0, 2, 1)])
def test_axes_may_stand_in_any_order(tmp_path, axes, named):
    np.savez(tmp_path / "points.npz", points=POSITIONS.transpose(axes), **({"labels": NAMES} if named else {}))
    take = read_take(tmp_path / "points.npz")
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert any("is taken as 40 frames of 4 points" in notice for notice in take.notices) == (axes != (0, 1, 2))


def test_fourth_coordinate_of_ones_is_left_out(tmp_path):
    """As ezc3d and pyomeca have points: x, y, z and 1, points, frames."""
    points = np.concatenate([POSITIONS, np.ones((N_FRAMES, 4, 1))], axis=2).transpose(2, 1, 0)
    np.savez(tmp_path / "points.npz", points=points, frequency=50.0)
    take = read_take(tmp_path / "points.npz")
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert take.rate == pytest.approx(50.0)


def test_points_may_have_arrays_of_their_own(tmp_path):
    np.savez(tmp_path / "points.npz", **dict(zip(NAMES, POSITIONS.swapaxes(0, 1), strict=True)))
    take = read_take(tmp_path / "points.npz")
    assert list(take.names) == NAMES
    np.testing.assert_array_equal(take.positions, POSITIONS)


def test_coordinates_may_have_arrays_of_their_own(tmp_path):
    np.savez(tmp_path / "points.npz", **{axis: POSITIONS[:, :, index] for index, axis in enumerate("xyz")})
    np.testing.assert_array_equal(read_take(tmp_path / "points.npz").positions, POSITIONS)


def test_points_are_unseen_where_an_array_of_flags_says_so(tmp_path):
    valid = np.arange(N_FRAMES)[:, np.newaxis] != [3, 5, 5, 9]
    for flags in (valid, np.where(valid, "yes", "no")):
        np.savez(tmp_path / "points.npz", positions=POSITIONS, names=NAMES, valid=flags)
        np.testing.assert_array_equal(read_take(tmp_path / "points.npz").seen, valid)


@pytest.mark.parametrize("shape", [(4,), (4, 4, 4), (1, 4, 4), (4, 0)])
def test_flags_of_another_shape_than_the_points_say_nothing_of_them(tmp_path, shape):
    np.savez(
        tmp_path / "points.npz", positions=POSITIONS[:4], names=NAMES, valid=np.arange(np.prod(shape)).reshape(shape)
    )
    assert read_take(tmp_path / "points.npz").seen.tolist() == [[True] * 4] * 4


def test_poses_are_bodies(tmp_path, refused):
    poses = np.tile(np.eye(4), (N_FRAMES, 4, 1, 1))
    poses[:, :, :3, 3] = POSITIONS
    np.savez(tmp_path / "poses.npz", poses=poses, names=NAMES)
    take = read_take(tmp_path / "poses.npz")
    assert list(take.names) == NAMES
    np.testing.assert_allclose(take.world_from_body, poses)
    sevens = np.concatenate([POSITIONS[:, :3], np.tile([0, 0, 0, 1.0], (N_FRAMES, 3, 1))], axis=2)
    np.save(tmp_path / "sevens.npy", sevens)
    assert "no array of the shape" in refused(tmp_path / "sevens.npy")


def test_rotations_alone_are_no_points(tmp_path, refused):
    np.savez(tmp_path / "rotations.npz", R=np.tile(np.eye(3), (N_FRAMES, 1, 1)))
    assert "no array of the shape" in refused(tmp_path / "rotations.npz")
    np.savez(tmp_path / "both.npz", R=np.tile(np.eye(3), (N_FRAMES, 1, 1)), X=POSITIONS)
    np.testing.assert_array_equal(read_take(tmp_path / "both.npz").positions, POSITIONS)
    np.savez(tmp_path / "three.npz", poses=np.tile(np.eye(4), (3, 1, 1)))
    assert read_take(tmp_path / "three.npz").names == ("body 1",)


def test_names_that_fit_no_axis_are_told(tmp_path, refused):
    np.savez(tmp_path / "points.npz", points=POSITIONS.transpose(2, 1, 0), names=NAMES[:3])
    assert "3 names, and an array points" in refused(tmp_path / "points.npz")


@pytest.mark.parametrize(
    "held",
    [
        {"markers": dict(zip(NAMES, POSITIONS.swapaxes(0, 1), strict=True)), "info": {"freq": 50.0}},
        {"d": {"data": POSITIONS.reshape(N_FRAMES, -1), "markerName": np.array([NAMES], dtype=object).T, "freq": 50}},
        {"points": POSITIONS.transpose(2, 1, 0), "labels": np.array(NAMES, dtype=object), "rate": 50.0},
    ],
    ids=("a field for each", "MoCap Toolbox", "an array"),
)
def test_structs_and_arrays_of_matlab_are_read(tmp_path, held):
    savemat(tmp_path / "points.mat", held)
    take = read_take(tmp_path / "points.mat")
    assert (list(take.names), take.rate) == (NAMES, pytest.approx(50.0))
    np.testing.assert_array_equal(take.positions, POSITIONS)


def cell(value: object) -> np.ndarray:
    """A cell array of one, as Visual3D puts around each signal."""
    held = np.empty((1, 1), dtype=object)
    held[0, 0] = value
    return held


RESIDUALS = np.zeros((N_FRAMES, 1))
ELEMENTS = [(name, POSITIONS[:, n]) for n, name in enumerate(NAMES)]


@pytest.mark.parametrize(
    "held",
    [
        {name: cell(np.hstack([POSITIONS[:, n], RESIDUALS])) for n, name in enumerate(NAMES)}
        | {"FRAME_RATE": cell(50.0), "FILE_NAME": cell("a.c3d")},
        {"data": {name: {"line": POSITIONS[:, n], "event": {}} for n, name in enumerate(NAMES)}, "freq": 50.0},
        {"markers": np.array(ELEMENTS, dtype=[("name", object), ("xyz", object)]), "fs": 50.0},
        {name: POSITIONS[:, n] for n, name in enumerate(NAMES)} | {"grf": np.ones((N_FRAMES * 10, 3)), "fs": 50.0},
    ],
    ids=("Visual3D", "biomechZoo", "a struct of several elements", "beside forces"),
)
def test_structs_and_cells_of_programs_are_read(tmp_path, held):
    savemat(tmp_path / "points.mat", held)
    take = read_take(tmp_path / "points.mat")
    assert (list(take.names), take.rate) == (NAMES, pytest.approx(50.0))
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert any("arrays left out: grf" in notice for notice in take.notices) == ("grf" in held)


def test_poses_of_theia_are_bodies(tmp_path):
    poses = np.tile(np.eye(4), (N_FRAMES, len(NAMES), 1, 1))
    poses[..., :3, 3] = POSITIONS / 1e3
    held = {f"{name}_4X4": cell(np.hstack([poses[:, n].reshape(-1, 16), RESIDUALS])) for n, name in enumerate(NAMES)}
    savemat(tmp_path / "theia.mat", held | {"FRAME_RATE": cell(85.0)})
    take = read_take(tmp_path / "theia.mat")
    assert (list(take.names), take.rate) == (NAMES, pytest.approx(85.0))
    np.testing.assert_allclose(take.world_from_body[..., :3, 3], POSITIONS)


@pytest.mark.parametrize("key", ["body_pos_w", "position", "joint_positions"])
def test_positions_are_told_from_velocities_by_their_name(tmp_path, key):
    arrays = {
        key: POSITIONS,
        "body_lin_vel_w": np.gradient(POSITIONS, axis=0),
        "body_quat_w": np.ones((*POSITIONS.shape[:2], 4)) / 2,
    }
    np.savez(tmp_path / "robot.npz", body_names=NAMES, fps=50, **arrays)
    take = read_take(tmp_path / "robot.npz")
    assert list(take.names) == NAMES
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert "arrays left out: body_lin_vel_w, body_quat_w" in take.notices


TITLES = [f"{name}_{axis}" for name in NAMES for axis in "XYZ"]


def test_columns_may_have_titles(tmp_path):
    """As arrays of their own, beside one array, and as fields of a structured one."""
    columns = dict(zip(TITLES, POSITIONS.reshape(N_FRAMES, -1).T, strict=True))
    np.savez(tmp_path / "own.npz", fs=120.0, **columns)
    savemat(tmp_path / "own.mat", {"fs": 120.0, **columns})
    titled = {"data": POSITIONS.reshape(N_FRAMES, -1), "freq": 120.0}
    savemat(tmp_path / "one.mat", {**titled, "colheaders": np.array(TITLES, dtype=object)})
    np.savez(tmp_path / "one.npz", **titled, columns=TITLES, index=np.arange(N_FRAMES))
    np.save(tmp_path / "fields.npy", np.array([*zip(*columns.values(), strict=True)], [(t, float) for t in TITLES]))
    for file in tmp_path.iterdir():
        take = read_take(file)
        assert list(take.names) == NAMES, file
        np.testing.assert_array_equal(take.positions, POSITIONS)
        assert take.rate == (100.0 if file.suffix == ".npy" else 120.0)


def test_archive_of_objects_alone_is_told(tmp_path, refused):
    np.savez(tmp_path / "h36m.npz", positions_3d=np.array({"S1": POSITIONS}, dtype=object))
    assert "holds pickled objects, which are never loaded" in refused(tmp_path / "h36m.npz")


def test_coordinates_in_structs_and_points_in_cells_are_read(tmp_path):
    fields = {name: dict(zip("xyz", POSITIONS[:, at].T, strict=True)) for at, name in enumerate(NAMES)}
    savemat(tmp_path / "structs.mat", {"m": fields, "fs": 50.0})
    cells = np.empty(len(NAMES), dtype=object)
    cells[:] = [*POSITIONS.swapaxes(0, 1)]
    savemat(tmp_path / "cells.mat", {"pos": cells, "label": np.array(NAMES, dtype=object), "Fs": 50.0})
    for file in tmp_path.iterdir():
        take = read_take(file)
        assert (list(take.names), take.rate) == (NAMES, 50.0), file
        np.testing.assert_array_equal(take.positions, POSITIONS)


def test_fourth_number_between_0_and_1_is_a_confidence(tmp_path):
    grades = np.full((N_FRAMES, 3, 1), 0.75)
    grades[3, 1] = 0.0
    np.savez(tmp_path / "keypoints.npz", keypoints3d=np.concatenate([POSITIONS[:, :3], grades], axis=2))
    take = read_take(tmp_path / "keypoints.npz")
    assert np.argwhere(~take.seen).tolist() == [[3, 1]]
    np.testing.assert_array_equal(take.positions[:3], POSITIONS[:3, :3])


@pytest.mark.parametrize("axes", [(0, 1, 2, 3), (1, 0, 2, 3), (0, 1, 3, 2)])
def test_axis_of_people_parts_their_points(tmp_path, axes):
    people = np.stack([POSITIONS, POSITIONS + 1000.0], axis=1)
    np.savez(tmp_path / "people.npz", pose=people.transpose(axes), joint_names=NAMES)
    take = read_take(tmp_path / "people.npz")
    assert take.names == tuple(f"{person}:{name}" for person in (1, 2) for name in NAMES)
    np.testing.assert_array_equal(take.positions, people.reshape(N_FRAMES, 8, 3))
    assert "pose is taken as 40 frames of 2 people with 4 points each" in take.notices


def test_names_may_stand_three_times_beside_the_columns(tmp_path):
    signals = {"VideoSignals": POSITIONS.reshape(N_FRAMES, 12), "VideoFrameRate": 50.0}
    savemat(tmp_path / "signals.mat", signals | {"VideoSignals_headers": np.repeat(NAMES, 3).astype(object)})
    take = read_take(tmp_path / "signals.mat")
    assert (list(take.names), take.rate) == (NAMES, 50.0)
    np.testing.assert_array_equal(take.positions, POSITIONS)


def test_structs_with_the_same_names_are_trials_of_which_the_first_is_read(tmp_path):
    fields = {name: POSITIONS[:, at] for at, name in enumerate(NAMES)}
    savemat(tmp_path / "trials.mat", {"walk1": fields, "walk2": {name: one + 1 for name, one in fields.items()}})
    take = read_take(tmp_path / "trials.mat")
    assert list(take.names) == NAMES
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert "structs with the same names are left out, but the first: walk2" in take.notices


def test_matrix_of_characters_names_the_points(tmp_path):
    savemat(tmp_path / "names.mat", {"data": POSITIONS.reshape(N_FRAMES, 12), "labels": np.array(NAMES), "x": []})
    assert list(read_take(tmp_path / "names.mat").names) == NAMES


def test_points_of_four_rows_are_read(tmp_path):
    savemat(
        tmp_path / "rows.mat",
        {name: np.vstack([POSITIONS[:, at].T, np.ones(N_FRAMES)]) for at, name in enumerate(NAMES)},
    )
    np.testing.assert_array_equal(read_take(tmp_path / "rows.mat").positions, POSITIONS)


@pytest.mark.parametrize("axes", [(0, 1, 2), (0, 2, 1)])
def test_predictions_of_one_animal_are_read_beside_empty_labels(tmp_path, axes):
    """Without an axis of animals, or with one."""
    pred = POSITIONS.transpose(axes)
    for predictions in (pred, pred[:, np.newaxis]):
        savemat(
            tmp_path / "pred.mat", {"pred": predictions, "data": np.zeros_like(pred), "sampleID": np.arange(N_FRAMES)}
        )
        np.testing.assert_array_equal(read_take(tmp_path / "pred.mat").positions, POSITIONS)


def test_landmarks_in_the_world_are_told_from_those_in_images(tmp_path):
    np.savez(tmp_path / "pose.npz", pose_landmarks=POSITIONS / 2e3, pose_world_landmarks=POSITIONS)
    take = read_take(tmp_path / "pose.npz")
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert "arrays left out: pose_landmarks" in take.notices


def test_state_says_where_points_are_unseen(tmp_path):
    lost = np.arange(N_FRAMES)[:, np.newaxis] == [3, 5, 5, 9]
    arrays = {"positions": POSITIONS, "names": NAMES}
    np.savez(tmp_path / "words.npz", **arrays, status=np.where(lost, "lost", "ok"))
    np.testing.assert_array_equal(read_take(tmp_path / "words.npz").seen, ~lost)
    np.savez(tmp_path / "codes.npz", **arrays, status=lost.astype(int))
    assert read_take(tmp_path / "codes.npz").seen.all()


@pytest.mark.parametrize(("word", "flags", "n_seen"), [("occluded", 1, 0), ("valid", 0, N_FRAMES)])
def test_flags_of_a_single_point(tmp_path, word, flags, n_seen):
    """One that alone is called hidden is; one that alone is never called valid may have no flag."""
    points = {name: POSITIONS[:, at] for at, name in enumerate(NAMES)}
    np.savez(tmp_path / "one.npz", **points, **{f"{NAMES[0]}.{word}": np.full(N_FRAMES, flags)})
    take = read_take(tmp_path / "one.npz")
    assert len(take.names) == len(NAMES) - (n_seen == 0)
    assert (NAMES[0] in take.names) == (n_seen > 0)


@pytest.mark.parametrize(("struct", "n_unseen"), [("gaze", 0), ("body", 4)])
def test_flags_in_a_struct_are_those_of_its_points(tmp_path, struct, n_unseen):
    structs = {"body": {"markers": POSITIONS}, "gaze": {"ray": 1.0}}
    structs[struct]["valid"] = (np.arange(N_FRAMES) != 7).astype(float)
    savemat(tmp_path / "structs.mat", structs)
    assert (~read_take(tmp_path / "structs.mat").seen).sum() == n_unseen


def test_flags_of_four_points_of_people_are_no_confidences_of_places(tmp_path):
    people = np.stack([POSITIONS, POSITIONS + 1000.0], axis=1)
    seen = np.arange(N_FRAMES)[:, np.newaxis, np.newaxis] != [[3, 5, 5, 9], [1, 2, 3, 4]]
    np.savez(tmp_path / "people.npz", keypoints=people, visible=seen.astype(float))
    np.testing.assert_array_equal(read_take(tmp_path / "people.npz").seen, seen.reshape(N_FRAMES, 8))
