from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from skelgen_formats.registry import (
    COLUMNS,
    formats_table,
    known_formats,
    read_take,
    recognise,
    write_file,
)

from docs.generated import formats_markdown
from skelgen.errors import FormatError, WriteError
from skelgen.model import PointCloud, Project, Trajectories

MARKER_FILES = ("c3d", "trc", "csm", "qualisys", "motive")
OWN_FILES = (*MARKER_FILES, "mfml", "poses-csv")
WRITTEN_MARKERS = ("c3d", "trc", "csm")

# C3D holds f32, with 24 bits for a metre and more in mm; the text formats hold every digit of float64.
TOLERANCE_MM = {"c3d": 2000 * 2.0**-24, "trc": 0.0, "csm": 0.0}


@pytest.mark.parametrize("name", OWN_FILES)
def test_content_is_recognised_whatever_the_suffix_is(valid_file, tmp_path, name):
    stranger = tmp_path / "file.dat"
    stranger.write_bytes(valid_file(name).read_bytes())
    assert recognise(stranger).name == name


@pytest.mark.parametrize("name", OWN_FILES)
def test_format_can_be_named_instead_of_recognised(valid_file, name):
    assert read_take(valid_file(name), name).n_frames > 0


@pytest.mark.parametrize("name", WRITTEN_MARKERS)
def test_written_markers_read_back(walk, tmp_path, name):
    path = tmp_path / f"walk.{name}"
    assert write_file(walk, path) == [path]
    back = read_take(path)
    np.testing.assert_allclose(back.positions, walk.positions, rtol=0, atol=TOLERANCE_MM[name])
    assert (back.names, back.rate, back.name) == (walk.names, walk.rate, path.name)


@pytest.mark.parametrize("name", WRITTEN_MARKERS)
def test_writing_twice_gives_the_same_bytes(walk, tmp_path, name):
    first, second = tmp_path / "1" / f"walk.{name}", tmp_path / "2" / f"walk.{name}"
    write_file(walk, first)
    write_file(walk, second)
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("name", [*WRITTEN_MARKERS, "mfml"])
def test_project_is_written_by_its_markers(walk, tmp_path, name):
    path = tmp_path / f"walk.{name}"
    write_file(Project(walk), path)
    assert read_take(path).n_frames == walk.n_frames


@pytest.mark.parametrize("name", WRITTEN_MARKERS)
def test_points_without_labels_are_refused_with_advice(cloud, tmp_path, name):
    with pytest.raises(WriteError, match="mfml"):
        write_file(cloud, tmp_path / f"cloud.{name}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [*WRITTEN_MARKERS, "mfml"])
def test_bodies_are_refused_by_marker_formats_with_advice(sensors, tmp_path, name):
    with pytest.raises(WriteError, match="poses-csv"):
        write_file(sensors, tmp_path / f"sensors.{name}")


@pytest.mark.parametrize("name", OWN_FILES)
def test_empty_file_is_a_format_error(refused, put, valid_file, name):
    path = put(valid_file(name).name, b"")
    assert "empty" in refused(path)
    assert "empty" in refused(path, name)


@pytest.mark.parametrize("name", OWN_FILES)
def test_foreign_content_under_the_suffix_is_a_format_error(refused, put, valid_file, name):
    refused(put(valid_file(name).name, b"This is a letter, not a recording.\nYours, B.\n"))


@pytest.mark.parametrize("name", OWN_FILES)
def test_missing_file_and_folder_are_format_errors(refused, tmp_path, name):
    assert "cannot be read" in refused(tmp_path / "absent", name)
    assert "cannot be read" in refused(tmp_path, name)


@pytest.mark.parametrize("name", MARKER_FILES)
def test_whole_frames_of_a_cut_file_are_read(put, valid_file, name):
    content = valid_file(name).read_bytes()
    missing = 600 if name == "c3d" else 60 if name in {"trc", "csm"} else 12  # more than a block, or than a cell
    whole, cut = read_take(valid_file(name)), read_take(put(f"cut.{name}", content[:-missing]), name)
    assert 0 < cut.n_frames < whole.n_frames
    seen = cut.seen
    np.testing.assert_array_equal(cut.positions[seen], whole.positions[: cut.n_frames][seen])
    assert any("cut off" in notice for notice in cut.notices)


def test_unknown_option_is_named(walk, tmp_path):
    with pytest.raises(WriteError, match="has no option 'colour'"):
        write_file(walk, tmp_path / "walk.csm", colour="red")


def test_one_marker_in_two_frames_is_a_valid_file(tmp_path):
    take = Trajectories(np.ones((2, 1, 3)), ("only",), 50.0)
    for name in WRITTEN_MARKERS:
        write_file(take, tmp_path / f"one.{name}")
        np.testing.assert_array_equal(read_take(tmp_path / f"one.{name}").positions, take.positions)


@pytest.mark.parametrize("name", WRITTEN_MARKERS)
def test_take_in_which_nothing_is_seen_is_a_format_error(refused, tmp_path, name):
    path = tmp_path / f"blind.{name}"
    write_file(Trajectories(np.full((3, 2, 3), np.nan), ("a", "b"), 50.0), path)
    assert "no marker is seen in any frame" in refused(path)


@pytest.mark.parametrize("name", WRITTEN_MARKERS)
def test_marker_that_is_never_seen_is_dropped_with_a_notice(walk, tmp_path, name):
    positions = walk.positions.copy()
    positions[:, 2] = np.nan
    path = tmp_path / f"walk.{name}"
    write_file(Trajectories(positions, walk.names, walk.rate), path)
    back = read_take(path)
    assert "C7" not in back.names
    assert any("never seen: C7" in notice for notice in back.notices)


@pytest.mark.parametrize("name", ["c3d", "trc"])
def test_unlabelled_trajectories_are_left_out_beside_labelled_ones(walk, tmp_path, name):
    path = tmp_path / f"walk.{name}"
    write_file(Trajectories(walk.positions, ("*12", "RFHD", "C7", "CLAV", "T10", "STRN"), 120.0), path)
    back = read_take(path)
    assert isinstance(back, Trajectories)
    assert back.names == ("RFHD", "C7", "CLAV", "T10", "STRN")
    assert any("unlabelled: *12" in notice for notice in back.notices)


def test_nothing_but_unlabelled_trajectories_is_a_point_cloud(walk, tmp_path):
    path = tmp_path / "walk.c3d"
    write_file(Trajectories(walk.positions, tuple(f"*{number}" for number in range(6)), 120.0), path)
    back = read_take(path)
    assert isinstance(back, PointCloud)
    assert back.points_per_frame.tolist() == [6, 6, 6, 5, 5, 5, 6, 6, 6, 6, 6, 5]


def test_prefixes_are_kept_where_names_would_become_equal(tmp_path):
    path = tmp_path / "plates.c3d"
    write_file(Trajectories(np.ones((2, 2, 3)), ("Shank:1", "Thigh:1"), 50.0), path)
    assert read_take(path).names == ("Shank:1", "Thigh:1")


def test_failed_writing_leaves_the_old_file(walk, tmp_path):
    path = tmp_path / "walk.csm"
    path.write_text("precious")
    clash = Trajectories(walk.positions[:, :2], ("left hip", "left_hip"), 120.0)
    with pytest.raises(WriteError, match="left_hip"):
        write_file(clash, path)
    assert [file.name for file in tmp_path.iterdir()] == ["walk.csm"]
    assert path.read_text() == "precious"


def test_table_has_a_row_for_every_format():
    assert [row[0] for row in formats_table()] == [entry.name for entry in known_formats()]
    assert all(len(row) == len(COLUMNS) for row in formats_table())


def test_page_of_formats_is_up_to_date():
    page = Path(__file__).parents[2] / "docs" / "formats.md"
    assert page.read_text(encoding="utf-8") == formats_markdown(), "run python docs/generated.py"


def test_error_for_an_unknown_file_lists_the_formats(put):
    with pytest.raises(FormatError, match="known are c3d"):
        recognise(put("photo.jpg", b"\xff\xd8\xff\xe0 and so on"))


def test_who_wants_a_page_is_told_what_writes_it(walk, tmp_path):
    with pytest.raises(WriteError, match="`skelgen report` writes a page"):
        write_file(walk, tmp_path / "walk.html")
