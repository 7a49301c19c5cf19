"""Two readers that are not ours are the judges: ezc3d and c3d."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.motion_csv import joint_names
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError

F32_MM = 4000 * 2.0**-24  # rounding of coordinates within four metres


@pytest.fixture
def path(small_project, tmp_path):
    return write_file(small_project, tmp_path / "walk.joints.c3d")[0]


def test_ezc3d_finds_markers_and_joints_and_tells_them_apart(path, small_project):
    import ezc3d

    content = ezc3d.c3d(str(path))
    labels = content["parameters"]["POINT"]["LABELS"]["value"]
    assert labels == [*small_project.trajectories.names, *joint_names(small_project.skeleton)]
    n_markers = small_project.trajectories.n_markers
    points = np.moveaxis(content["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    assert np.abs(points[:, n_markers:] - small_project.motion.joint_positions).max() < F32_MM
    residuals = content["data"]["meta_points"]["residuals"][0].T
    assert (residuals[:, n_markers:] == 0).all()
    expected = np.where(small_project.trajectories.seen, 1, -1)
    assert np.array_equal(residuals[:, :n_markers], expected)


def test_c3d_finds_the_joints_in_their_places(path, small_project):
    c3d = pytest.importorskip("c3d", reason="needs c3d: pip install c3d")
    with path.open("rb") as stream:
        frames = [points[:, :3] for _, points, _ in c3d.Reader(stream).read_frames()]
    joints = np.array(frames)[:, small_project.trajectories.n_markers :]
    assert np.abs(joints - small_project.motion.joint_positions).max() < F32_MM


def test_joints_are_read_back_as_points(path, small_project):
    take = read_take(path)
    assert take.names[-2:] == joint_names(small_project.skeleton)


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.joints.c3d")
