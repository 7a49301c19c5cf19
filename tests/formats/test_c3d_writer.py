"""What is written is what ezc3d writes and what ezc3d and c3d read; neither of them is ours."""

from __future__ import annotations

import io
import resource
import warnings
from dataclasses import replace

import c3d as independent
import ezc3d
import numpy as np
import pytest
from skelgen_formats.c3d.layout import BLOCK, read_layout
from skelgen_formats.c3d.writer import C3dStream, point_words, write_points
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import Trajectories
from skelgen.model.filled import PositionSource

F32_MM = 4000 * 2.0**-24  # rounding of coordinates within four metres


def made(n_frames, n_markers, seed=0):
    """Random markers, and where each position comes from; those from nowhere are unseen."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-2000, 2000, (n_frames, n_markers, 3))
    source = rng.integers(0, len(PositionSource), (n_frames, n_markers))
    positions[source == PositionSource.NONE] = np.nan
    return Trajectories(positions, tuple(f"m{index}" for index in range(n_markers)), 100.0), source


def written_by_ezc3d(take, source, path):
    """The whole file by ezc3d, unseen points as the format has them: at the origin, with residual -1."""
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["RATE"]["value"] = [take.rate]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(take.names)
    content["data"]["points"] = np.concatenate([take.positions.T, np.ones((1, take.n_markers, take.n_frames))])
    masks = np.zeros((7, take.n_markers, take.n_frames), dtype=bool)
    masks[0] = source.T == PositionSource.MEASURED
    residuals = np.where(masks[0], 1.0, np.where(source.T == PositionSource.NONE, -1.0, 0.0))[np.newaxis]
    content["data"]["meta_points"] = {"residuals": residuals, "camera_masks": masks}
    content.write(str(path))


@pytest.mark.parametrize(("n_frames", "n_markers"), [(1, 3), (2, 1), (32, 1), (64, 2), (997, 7), (2, 300)])
def test_header_parameters_and_data_are_those_of_ezc3d(tmp_path, n_frames, n_markers):
    take, source = made(n_frames, n_markers)
    write_points(take, tmp_path / "ours.c3d", "mm", source)
    written_by_ezc3d(take, source, tmp_path / "judge.c3d")
    ours, judge = read_layout(tmp_path / "ours.c3d"), read_layout(tmp_path / "judge.c3d")
    n_bytes = 16 * n_frames * n_markers
    data = [(tmp_path / "ours.c3d", ours), (tmp_path / "judge.c3d", judge)]
    first, second = (path.read_bytes()[layout.data_start :][:n_bytes] for path, layout in data)
    assert first == second
    assert (ours.n_points, ours.n_frames, ours.rate, ours.scale) == (n_markers, n_frames, 100.0, -1.0)
    assert ours.texts("POINT", "LABELS") == judge.texts("POINT", "LABELS")
    for name in ("USED", "SCALE", "RATE", "FRAMES", "UNITS"):
        assert np.array_equal(ours.parameters["POINT", name], judge.parameters["POINT", name])


def test_a_file_is_whole_blocks(tmp_path):
    take, _ = made(5, 3)
    write_points(take, tmp_path / "walk.c3d", "mm")
    assert (tmp_path / "walk.c3d").stat().st_size % BLOCK == 0


def test_unseen_markers_have_residual_minus_one_for_ezc3d(tmp_path):
    take, _ = made(20, 4)
    write_points(take, tmp_path / "walk.c3d", "mm")
    content = ezc3d.c3d(str(tmp_path / "walk.c3d"))
    assert np.array_equal(content["data"]["meta_points"]["residuals"][0].T == -1, ~take.seen)


def test_frames_may_follow_after_the_counts_are_settled():
    content, (take, _) = io.BytesIO(), made(10, 2)
    stream = C3dStream(content, take.names, take.rate, "mm")
    for frame in take.positions:
        stream.append(point_words(frame[np.newaxis]))
        stream.complete_header()
    whole = io.BytesIO()
    at_once = C3dStream(whole, take.names, take.rate, "mm")
    at_once.append(point_words(take.positions))
    at_once.complete_header()
    assert content.getvalue() == whole.getvalue()


def test_many_files_take_no_memory(tmp_path):
    take, source = made(4000, 30)
    write_points(take, tmp_path / "one.c3d", "mm", source)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(10):
        write_points(take, tmp_path / "one.c3d", "mm", source)
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    assert grown < 2 * take.positions.nbytes  # ezc3d keeps twice as much of each file


def test_take_without_frames_is_refused(tmp_path):
    with pytest.raises(WriteError, match="at least one frame"):
        write_file(Trajectories(np.ones((0, 2, 3)), ("a", "b"), 100.0), tmp_path / "walk.c3d")


@pytest.fixture
def with_joints(small_project, tmp_path):
    """The file of a fitted project with its joints as points."""
    return write_file(small_project, tmp_path / "walk.joints.c3d")[0]


def test_ezc3d_finds_markers_and_joints_and_tells_them_apart(with_joints, small_project):
    content = ezc3d.c3d(str(with_joints))
    labels = content["parameters"]["POINT"]["LABELS"]["value"]
    assert labels == [*small_project.trajectories.names, *small_project.skeleton.joint_names]
    n_markers = small_project.trajectories.n_markers
    points = np.moveaxis(content["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    assert np.abs(points[:, n_markers:] - small_project.motion.joint_positions).max() < F32_MM
    residuals = content["data"]["meta_points"]["residuals"][0].T
    assert (residuals[:, n_markers:] == 0).all()
    expected = np.where(small_project.trajectories.seen, 1, -1)
    assert np.array_equal(residuals[:, :n_markers], expected)


def test_joints_that_motion_leaves_open_say_so_in_their_descriptions(small_project, tmp_path):
    first, *others = small_project.skeleton.joints
    joints = (replace(first, open_directions=2), *(replace(one, kind="ball", open_directions=0) for one in others))
    marked = replace(small_project, _skeleton=replace(small_project.skeleton, joints=joints))
    content = ezc3d.c3d(str(write_file(marked, tmp_path / "walk.joints.c3d")[0]))
    told = content["parameters"]["POINT"]["DESCRIPTIONS"]["value"][small_project.trajectories.n_markers :]
    assert told == ["its place is in part a choice: the motion does not determine it", *[""] * len(others)]


def test_hinges_whose_place_along_their_axes_is_open_say_so(small_project, tmp_path):
    first, *others = (replace(one, kind="ball", open_directions=0) for one in small_project.skeleton.joints)
    hinge = replace(first, kind="hinge", axis=np.array([1.0, 0.0, 0.0]), open_directions=1)
    marked = replace(small_project, _skeleton=replace(small_project.skeleton, joints=(hinge, *others)))
    content = ezc3d.c3d(str(write_file(marked, tmp_path / "walk.joints.c3d")[0]))
    told = content["parameters"]["POINT"]["DESCRIPTIONS"]["value"][small_project.trajectories.n_markers :]
    assert told == ["its place along its axis is a choice: the motion does not determine it", *[""] * len(others)]


def test_c3d_finds_the_joints_in_their_places(with_joints, small_project):
    with warnings.catch_warnings(), with_joints.open("rb") as stream:
        warnings.simplefilter("ignore")  # it warns that there are no analogue data
        frames = [points[:, :3] for _, points, _ in independent.Reader(stream).read_frames()]
    joints = np.array(frames)[:, small_project.trajectories.n_markers :]
    assert np.abs(joints - small_project.motion.joint_positions).max() < F32_MM


def test_joints_are_read_back_as_points(with_joints, small_project):
    assert read_take(with_joints, points="all").names[-2:] == small_project.skeleton.joint_names
    assert read_take(with_joints).names == small_project.trajectories.names  # joints are no markers


def test_take_is_refused_where_joints_belong(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.joints.c3d")
