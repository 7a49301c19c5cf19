"""Filled positions in files: only if wanted, never taken for measured ones."""

from __future__ import annotations

import csv

import ezc3d
import numpy as np
import pytest
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import MissingResultError, WriteError
from skelgen.model import Project
from skelgen.model.filled import Filled, PositionSource

MARKER_SUFFIXES = [".c3d", ".trc", ".csm"]
FILE_DIGITS = 1e-3  # mm; C3D keeps 7 digits of some metres


@pytest.fixture
def filled(walk) -> Filled:
    """The walk with the gap of LFHD filled by zeros but one, and that of T10 left empty."""
    positions, source = walk.positions.copy(), np.where(walk.seen, PositionSource.MEASURED, PositionSource.NONE)
    positions[3:6, 0], source[3:6, 0] = [1.0, 2.0, 3.0], PositionSource.LIMB
    std = np.where(source == PositionSource.LIMB, 1.5, np.where(walk.seen, 0.0, np.nan))
    return Filled(walk, positions, source.astype(np.intp), std)


@pytest.mark.parametrize("suffix", MARKER_SUFFIXES)
def test_filled_positions_are_not_written_unless_wanted(filled, tmp_path, suffix):
    files = write_file(filled, tmp_path / f"walk{suffix}")
    assert files == [tmp_path / f"walk{suffix}"]
    assert np.array_equal(read_take(files[0]).seen, filled.measured.seen)


@pytest.mark.parametrize("suffix", MARKER_SUFFIXES)
def test_filled_positions_come_back_with_a_table_beside_them(filled, tmp_path, suffix):
    path, table = write_file(filled, tmp_path / f"walk{suffix}", filled=True)
    written = read_take(path)
    assert np.array_equal(np.isnan(written.positions), np.isnan(filled.positions))
    assert np.nanmax(np.abs(written.positions - filled.positions)) < FILE_DIGITS
    with table.open(encoding="utf-8") as stream:
        rows = list(csv.reader(stream))[1:]
    assert rows == [[str(frame), "LFHD", "limb", "1.500"] for frame in (3, 4, 5)]


def test_c3d_marks_filled_positions_as_its_convention_has_it(filled, tmp_path):
    path, _ = write_file(filled, tmp_path / "walk.c3d", filled=True)
    marks = ezc3d.c3d(str(path))["data"]["meta_points"]
    residuals, cameras = marks["residuals"][0].T, marks["camera_masks"].any(axis=0).T
    assert np.array_equal((residuals == 0) & ~cameras, filled.filled)
    assert np.array_equal((residuals > 0) & cameras, filled.measured.seen)
    assert np.array_equal(residuals < 0, filled.source == PositionSource.NONE)


def test_reading_computed_positions_is_told(filled, tmp_path):
    path, _ = write_file(filled, tmp_path / "walk.c3d", filled=True)
    assert any("3 positions are marked as computed" in notice for notice in read_take(path).notices)


def test_a_take_without_skeleton_cannot_be_filled(walk, tmp_path):
    with pytest.raises(WriteError, match="give a project that is fitted"):
        write_file(walk, tmp_path / "walk.trc", filled=True)
    with pytest.raises(MissingResultError):
        write_file(Project(walk).with_trajectories(walk, None), tmp_path / "walk.trc", filled=True)
    assert list(tmp_path.iterdir()) == []


def test_readers_do_not_take_the_option(walk, tmp_path):
    (path,) = write_file(walk, tmp_path / "walk.trc")
    with pytest.raises(WriteError, match="no option 'filled'"):
        read_take(path, filled=True)
