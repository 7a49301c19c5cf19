"""pandas and polars are the judges: they must read back the very numbers that the project holds."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from skelgen_formats import tables
from skelgen_formats.registry import write_file

from skelgen.errors import WriteError
from skelgen.geometry.rotations import matrix_from_quaternion
from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.kinematics.joints.angles import angles_over_time


def read_with(library, path):
    """A mapping from column to values, whichever library and format."""
    frames = pytest.importorskip(library, reason=f"needs {library}: pip install {library}")
    read = frames.read_parquet if path.suffix == ".parquet" else frames.read_csv
    table = read(path)
    return {name: table[name].to_numpy() for name in table.columns}


@pytest.fixture(
    params=[("pandas", "w.table.csv"), ("pandas", "w.parquet"), ("polars", "w.table.csv"), ("polars", "w.parquet")],
    ids=str,
)
def read(request, small_project, tmp_path):
    library, name = request.param
    if name == "w.parquet":
        pytest.importorskip("pyarrow", reason="needs pyarrow: pip install 'skelgen-mocap[tables]'")

    def by_table(**options):
        paths = write_file(small_project, tmp_path / name, **options)
        return dict(zip(tables.TABLES, (read_with(library, path) for path in paths), strict=True))

    return by_table


def vectors(table, pattern):
    return np.stack([table[pattern.format(axis)].astype(float) for axis in "xyz"], axis=-1)


def all_angles(project):
    joints, motion = project.skeleton.joints, project.motion
    return np.rad2deg(np.concatenate([angles_over_time(joint, motion) for joint in joints], axis=1))


def test_markers_come_back_exactly(read, small_project):
    table, motion = read()["markers"], small_project.motion
    shape = motion.marker_positions.shape
    assert np.array_equal(vectors(table, "{}_mm").reshape(shape), small_project.trajectories.positions, equal_nan=True)
    assert np.array_equal(vectors(table, "model_{}_mm").reshape(shape), motion.marker_positions, equal_nan=True)
    assert np.array_equal(table["residual_mm"].reshape(shape[:2]), motion.residuals, equal_nan=True)
    assert table["marker"].tolist() == list(small_project.trajectories.names) * motion.n_frames
    assert np.array_equal(table["time_s"], np.repeat(motion.times, shape[1]))
    assert np.array_equal(table["frame"], np.repeat(np.arange(shape[0]), shape[1]))


def test_limbs_come_back_exactly_as_quaternions_and_as_matrices(read, small_project):
    table, motion = read()["limbs"], small_project.motion
    shape = motion.world_from_limb.shape[:2]
    assert np.array_equal(vectors(table, "{}_mm").reshape(*shape, 3), motion.world_from_limb[..., :3, 3])
    cells = [table[f"r{row}{column}"] for row in (1, 2, 3) for column in (1, 2, 3)]
    assert np.array_equal(np.stack(cells, axis=-1).reshape(*shape, 3, 3), motion.rotations)
    quaternions = np.stack([table[f"q{letter}"] for letter in "wxyz"], axis=-1).reshape(*shape, 4)
    assert np.abs(matrix_from_quaternion(quaternions) - motion.rotations).max() < 1e-14
    assert np.array_equal(table["seen"].astype(bool).reshape(shape), motion.limb_seen)
    assert table["limb"].tolist() == [f"limb{limb}" for limb in range(shape[1])] * shape[0]


def test_joints_come_back_exactly_in_the_unit_wanted(read, small_project):
    table, motion = read(unit="m")["joints"], small_project.motion
    assert np.array_equal(vectors(table, "{}_m").reshape(motion.joint_positions.shape), motion.joint_positions * 1e-3)
    assert table["joint"].tolist() == list(small_project.skeleton.joint_names) * motion.n_frames


def test_angles_come_back_exactly(read, small_project):
    table = read()["angles"]
    posture = posture_of(small_project.skeleton, small_project.motion, small_project.trajectories.positions)
    assert np.array_equal(table["value_deg"].reshape(-1, 4), all_angles(small_project))
    assert np.array_equal(table["std_deg"].reshape(-1, 4), np.rad2deg(np.concatenate(posture.angle_std, axis=1)))
    assert table["angle"].tolist()[:4] == ["turn", "x", "y", "z"]


def test_angles_of_a_wheel_go_on_over_full_turns_and_chunks(wheel_project, tmp_path):
    paths = write_file(wheel_project, tmp_path / "w.table.csv")
    turned = read_with("pandas", paths[2])["value_deg"].reshape(-1, 4)[:, 0]
    assert np.abs(turned - np.linspace(0, 3600, len(turned))).max() < 1e-9


def test_long_takes_are_whole(make_project, tmp_path):
    project = make_project(n_frames=2100)  # longer than what is in memory at once
    _, joints, angles, _ = (read_with("pandas", path) for path in write_file(project, tmp_path / "w.table.csv"))
    motion = project.motion
    assert np.array_equal(vectors(joints, "{}_mm").reshape(motion.joint_positions.shape), motion.joint_positions)
    assert np.array_equal(angles["value_deg"].reshape(-1, 4), all_angles(project))


def test_without_pyarrow_the_extra_is_named(small_project, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(WriteError, match=r"skelgen-mocap\[tables\]"):
        write_file(small_project, tmp_path / "w.parquet")
    assert list(tmp_path.iterdir()) == []
