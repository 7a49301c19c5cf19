"""The public face."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.errors import FormatError, InputError, WriteError


@pytest.mark.usefixtures("stand_ins")
def test_take_becomes_a_finished_project(waving):
    project = skelgen.reconstruct(waving, n_limbs=2, seed=5, parameters={"joints": {"alpha": 0.2}})
    assert project.seed == 5
    assert project.topology.alpha == 0.2
    assert project.motion.joint_positions.shape == (20, 1, 3)


def test_something_else_than_a_take_is_refused():
    with pytest.raises(InputError, match="not list"):
        skelgen.reconstruct([1, 2, 3])


def test_take_comes_back_from_a_marker_file(waving, tmp_path):
    assert skelgen.write(waving, tmp_path / "w.trc") == [tmp_path / "w.trc"]
    again = skelgen.read(tmp_path / "w.trc")
    np.testing.assert_allclose(again.positions, waving.positions, atol=1e-3)  # mm: text with fewer digits


def test_project_file_is_written_and_its_take_read(small_project, tmp_path):
    (path,) = skelgen.write(small_project, tmp_path / "w.skelgen")
    assert skelgen.read(path).names == small_project.take.names


def test_bare_take_fits_into_a_project_file(waving, tmp_path):
    skelgen.write(waving, tmp_path / "w.skelgen")
    assert skelgen.read(tmp_path / "w.skelgen", format="skelgen").rate == waving.rate


def test_project_file_knows_no_options(waving, tmp_path):
    with pytest.raises(WriteError, match="without options"):
        skelgen.write(waving, tmp_path / "w.skelgen", digits=3)
    skelgen.write(waving, tmp_path / "w.skelgen")
    with pytest.raises(InputError, match="without options"):
        skelgen.read(tmp_path / "w.skelgen", timestamp_unit="ms")


def test_absent_file_is_a_format_error(tmp_path):
    with pytest.raises(FormatError, match=r"absent.c3d"):
        skelgen.read(tmp_path / "absent.c3d")
