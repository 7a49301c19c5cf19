from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from skelgen.model import PointCloud, Poses, Trajectories

FIRST = [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]


def test_export_reads_with_its_gap(put, qualisys_text):
    take = read_take(put("hip.tsv", qualisys_text))
    assert isinstance(take, Trajectories)
    assert (take.names, take.rate) == (("hip", "knee"), 100.0)
    np.testing.assert_array_equal(take.positions[0], FIRST)
    assert take.seen[:, 1].tolist() == [True, True, False]


@pytest.mark.parametrize("gap", ["\t\t\t", "\tNULL\tNULL\tNULL", "\tNaN\tNaN\tNaN"])
def test_other_ways_to_write_a_gap(edited, qualisys_text, gap):
    take = read_take(edited("gap.tsv", qualisys_text, "\t0.000\t0.000\t0.000", gap))
    assert take.seen[:, 1].tolist() == [True, True, False]


def test_decimal_commas_are_understood(put, qualisys_text):
    head, data = qualisys_text.split("knee Z")
    take = read_take(put("comma.tsv", head + "knee Z" + data.replace(".", ",")))
    np.testing.assert_array_equal(take.positions[0], FIRST)


@pytest.mark.parametrize("n_leading", [0, 1, 2])
def test_older_files_without_titles_and_with_fewer_columns_read(put, qualisys_text, n_leading):
    lines = [line for line in qualisys_text.split("\r\n") if not line.startswith("Frame")]
    data = ["\t".join(line.split("\t")[2 - n_leading :]) if line[:1].isdigit() else line for line in lines]
    take = read_take(put("old.tsv", "\n".join(data)))
    np.testing.assert_array_equal(take.positions[0], FIRST)


def test_2d_export_is_refused_with_advice(refused, edited, qualisys_text):
    assert "export the 3D data" in refused(edited("2d.tsv", qualisys_text, "INCLUDED\t3D", "INCLUDED\t2D"))


BODIES = (
    "FILE_VERSION\t2.0.0\nNO_OF_FRAMES\t2\nNO_OF_BODIES\t1\nFREQUENCY\t100\nDATA_INCLUDED\t6D\nBODY_NAMES\tship\n"
    "Frame\tTime\tship X\tY\tZ\tRoll\tPitch\tYaw\tResidual\t" + "\t".join(f"Rot[{n}]" for n in range(9)) + "\n"
    "1\t0.00000\t-194.9\t2.2\t0.9\t0.0\t0.0\t90.0\t4.9\t0.0\t1.0\t0.0\t-1.0\t0.0\t0.0\t0.0\t0.0\t1.0\n"
    "2\t0.01000" + "\t0.000" * 16 + "\n"
)


BARE = BODIES.replace("Frame\tTime\tship ", "").replace("\n1\t0.00000\t", "\n").replace("\n2\t0.01000\t", "\n")


@pytest.mark.parametrize("text", [BODIES, BODIES.replace("FILE_VERSION\t2.0.0\n", ""), BARE])
def test_6d_export_is_read_as_bodies(put, text):
    take = read_take(put("ship_6D.tsv", text))
    assert isinstance(take, Poses)
    assert (take.names, take.rate) == (("ship",), 100.0)
    yawed = [[0, -1, 0, -194.9], [1, 0, 0, 2.2], [0, 0, 1, 0.9], [0, 0, 0, 1]]  # by 90 degrees about z
    np.testing.assert_allclose(take.world_from_body[0, 0], yawed, atol=1e-12)
    assert np.isnan(take.world_from_body[1]).all()


def test_6d_export_that_is_cut_off_says_so(edited):
    take = read_take(edited("cut.tsv", BODIES, "FRAMES\t2", "FRAMES\t3"))
    assert any("the file is cut off" in notice for notice in take.notices)


def test_matrix_that_is_no_rotation_names_frame_and_body(refused, edited):
    assert "frame 1: the matrix of body 1" in refused(edited("odd.tsv", BODIES, "\t-1.0\t", "\t-0.5\t"))


@pytest.mark.parametrize("key", ["MARKER_NAMES", "FREQUENCY"])
def test_missing_header_line_is_named(refused, edited, qualisys_text, key):
    assert key in refused(edited("no.tsv", qualisys_text, key, "NOTHING"))


def test_label_that_stands_twice_gets_a_number(edited, qualisys_text):
    assert read_take(edited("two.tsv", qualisys_text, "\tknee\r\n", "\thip\r\n")).names == ("hip", "hip_2")


def test_file_that_is_cut_off_is_read_so_far(put, qualisys_text):
    for end in ("3\t0.02", "3\t0.02\t"):
        take = read_take(put("cut.tsv", qualisys_text[: qualisys_text.index("3\t0.02")] + end[7:]))
        assert take.n_frames == 2
        assert any("3 frames are announced and 2 are there" in notice for notice in take.notices)


ODD = (
    "NO_OF_FRAMES\t2\nNO_OF_MARKERS\t2\nFREQUENCY\t100.000 \nDESCRIPTION\t--\nTIME_STAMP\t2022-06-03, 10:47:36\n"
    "DATA_INCLUDED\t3D\nMARKER_NAMES\thip\tknee\n1.5\t2\t3\t4\t5\t6\n1.6\t2\t3\t4\t5\t6\n"
)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("DESCRIPTION\t--", "DESCRIPTION -- ", ("hip", "knee")),
        ("NO_OF_MARKERS\t2", "NO_OF_MARKERS\t3", ("hip", "knee")),
        ("hip\tknee", "hip\tknee\tankle", ("hip", "knee")),
        ("hip\tknee", "hip", ("hip",)),
    ],
)
def test_header_that_scripts_changed_is_decided_by_the_columns(put, old, new, names):
    take = read_take(put("odd.tsv", ODD.replace(old, new)))
    assert take.names == names
    assert take.positions[0, 0].tolist() == [1.5, 2.0, 3.0]


def test_trajectories_without_a_name_are_a_cloud(put):
    cloud = read_take(put("cloud.tsv", ODD.replace("\thip\tknee", "\t")))
    assert isinstance(cloud, PointCloud)
    assert cloud.n_points == 4


def test_latin1_names_read(put, qualisys_text):
    content = qualisys_text.replace("knee", "hüfte").encode("latin-1")
    assert read_take(put("umlaut.tsv", content)).names == ("hip", "hüfte")


def test_real_recording_is_a_hand_in_millimetres(recording):
    take = read_take(recording("hand/recording.tsv"))
    assert take.positions.shape == (6000, 21, 3)
    assert 300 < np.nanmax(np.abs(take.positions)) < 1500


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_table_that_a_spreadsheet_saved_is_read(put, qualisys_text, delimiter):
    whole, saved = (
        read_take(put(f"{n}.tsv", qualisys_text.replace("\t", part))) for n, part in enumerate(("\t", delimiter))
    )
    assert saved.names == whole.names
    np.testing.assert_array_equal(saved.positions, whole.positions)


def test_export_of_velocities_is_refused_with_advice(refused, edited, qualisys_text):
    assert "holds VELOCITY; export the 3D data" in refused(
        edited("v.tsv", qualisys_text, "INCLUDED\t3D", "INCLUDED\tVelocity")
    )


SEGMENTS = (
    "NO_OF_FRAMES\t2\nNO_OF_CAMERAS\t12\nFREQUENCY\t85\nTIME_STAMP\t\nREFERENCE\tGLOBAL\nSCALE\t1.00000\n"
    "SOLVER\tAnimation\nFrame\tTime\tHips\tX\tY\tZ\tQX\tQY\tQZ\tQW\tSpine\tX\tY\tZ\tQX\tQY\tQZ\tQW\n"
    "1\t0.0\t\t10\t20\t900\t0\t0\t0\t1\t\t11\t20\t1000\t0\t0\t0.6\t0.8\n"
    "2\t0.01176\t\t10\t20\t900\t0\t0\t0\t1\t\t\t\t\t\t\t\t\n"
)


def test_segments_of_a_skeleton_are_bodies(put):
    take = read_take(put("walk_s_Ann.tsv", SEGMENTS))
    assert (take.names, take.rate) == (("Hips", "Spine"), 85.0)
    np.testing.assert_allclose(take.world_from_body[0, 1, :3, 3], [11, 20, 1000])
    np.testing.assert_allclose(take.world_from_body[0, 1, :2, 0], [0.28, 0.96])
    assert np.isnan(take.world_from_body[:, :, 0, 0]).tolist() == [[False, False], [False, True]]


def test_segments_in_coordinates_of_their_parents_are_refused_with_advice(refused, put):
    sentence = refused(put("local.tsv", SEGMENTS.replace("GLOBAL", "LOCAL")))
    assert "export the skeleton with the reference Global" in sentence
