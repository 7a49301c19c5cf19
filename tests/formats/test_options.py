"""Axes and units are obeyed by every format that offers them: what is read back tells."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import known_formats, read_take, write_file

from skelgen.errors import ParameterError

READ_BACK = ("c3d", "trc", "csm")
F32_MM = 2000 * 2.0**-24  # rounding of coordinates within two metres to f32, in any unit
F64_MM = 1e-9  # two roundings of metres in mm


def offering(name):
    return [
        entry.name
        for entry in known_formats()
        if entry.write is not None and name in {option.name for option in entry.options}
    ]


def test_every_format_with_positions_for_other_programs_offers_axes():
    markers, skeletons = (
        {"c3d", "trc", "csm"},
        {"classic-xml", "cal3d", "bvh", "gltf", "usd", "opensim", "urdf", "mjcf"},
    )
    tables = {"joints-csv", "poses-csv", "table-csv", "table-parquet", "c3d-joints"}
    assert set(offering("axes")) == markers | skeletons | tables


@pytest.mark.parametrize("name", READ_BACK)
def test_markers_are_written_with_y_up(walk, tmp_path, name):
    write_file(walk, tmp_path / f"walk.{name}", axes="z-to-y")
    x, y, z = np.moveaxis(walk.positions, -1, 0)
    back = read_take(tmp_path / f"walk.{name}").positions
    assert np.allclose(back, np.stack([x, z, -y], axis=-1), rtol=0, atol=F32_MM, equal_nan=True)


@pytest.mark.parametrize("unit", ["cm", "m"])
@pytest.mark.parametrize("name", ["c3d", "trc"])
def test_files_that_say_their_unit_read_back_in_mm(walk, tmp_path, name, unit):
    write_file(walk, tmp_path / f"walk.{name}", unit=unit)
    back = read_take(tmp_path / f"walk.{name}").positions
    tolerance = F32_MM if name == "c3d" else F64_MM
    assert np.allclose(back, walk.positions, rtol=0, atol=tolerance, equal_nan=True)


def test_numbers_of_a_file_without_unit_are_in_the_unit_wanted(walk, tmp_path):
    write_file(walk, tmp_path / "walk.csm", unit="m")
    back = read_take(tmp_path / "walk.csm").positions
    assert np.allclose(back, walk.positions / 1000, rtol=0, atol=F64_MM, equal_nan=True)
    assert "in m, written" in (tmp_path / "walk.csm").read_text()


def test_bodies_are_written_in_other_axes_and_units(sensors, tmp_path):
    write_file(sensors, tmp_path / "s.poses.csv", axes="z-to-y", unit="m")
    back = read_take(tmp_path / "s.poses.csv").world_from_body
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    expected = turn @ sensors.world_from_body[..., :3, :]
    # Positions go through two roundings, rotations through a quaternion.
    assert np.allclose(back[..., :3, :], expected, rtol=0, atol=1e-9, equal_nan=True)


def test_columns_of_joints_name_their_unit(small_project, tmp_path):
    write_file(small_project, tmp_path / "j.joints.csv", unit="m")
    header, first = (tmp_path / "j.joints.csv").read_text().splitlines()[:2]
    assert header.split(",")[2] == "limb1-limb0_x_m"
    x = small_project.motion.joint_positions[0, 0, 0]
    assert first.split(",")[2] == f"{x / 1000:.9f}"


def test_bones_are_written_in_the_unit_wanted(small_project, tmp_path):
    def numbers(unit):
        write_file(small_project, tmp_path / f"{unit}.xsf", unit=unit)
        texts = (tmp_path / f"{unit}.xaf").read_text().split("<TRANSLATION>")[1:]
        return np.array([[float(word) for word in text.split("<")[0].split()] for text in texts])

    assert np.allclose(numbers("m") * 1000, numbers("mm"), rtol=1e-8, atol=1e-6)  # nine digits are written


def test_filled_markers_are_turned_with_the_rest(small_project, tmp_path):
    write_file(small_project, tmp_path / "a.trc", filled=True)
    write_file(small_project, tmp_path / "b.trc", filled=True, axes="z-to-y")
    x, y, z = np.moveaxis(read_take(tmp_path / "a.trc").positions, -1, 0)
    # Filling works on turned data as on the others, up to rounding in its least squares.
    back = read_take(tmp_path / "b.trc").positions
    assert np.allclose(back, np.stack([x, z, -y], axis=-1), rtol=0, atol=1e-6, equal_nan=True)


def test_every_format_with_an_axes_option_offers_the_rate():
    assert set(offering("rate")) == set(offering("axes")) | {"angles-csv"}


@pytest.mark.parametrize("name", READ_BACK)
def test_markers_are_written_at_another_rate_with_gaps_kept(walk, tmp_path, name):
    write_file(walk, tmp_path / f"walk.{name}", rate=60.0)
    back = read_take(tmp_path / f"walk.{name}")
    assert back.rate == 60.0
    assert np.allclose(back.positions, walk.positions[::2], rtol=0, atol=F32_MM, equal_nan=True)


def test_joints_and_angles_are_written_at_another_rate(small_project, tmp_path):
    for name in ("j.joints.csv", "j.angles.csv"):
        write_file(small_project, tmp_path / name, rate=50.0)
        lines = (tmp_path / name).read_text().splitlines()[1:]
        assert [float(line.split(",")[1]) for line in lines] == [0.0, 0.02, 0.04, 0.06, 0.08, 0.1]


def test_bad_rate_is_refused_with_its_bounds(walk, tmp_path):
    with pytest.raises(ParameterError, match=r"rate is -5; it must lie in 0 .. 100000 Hz"):
        write_file(walk, tmp_path / "walk.trc", rate=-5)
