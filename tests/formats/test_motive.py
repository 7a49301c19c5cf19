from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from skelgen.model import PointCloud, Trajectories

FIRST_MM = [[500, 600, 700], [-500, -600, -700]]
EXACT = 1e-9  # mm: a decimal times a thousand rounds in the last of 16 digits


def test_metres_become_millimetres_and_empty_cells_gaps(put, motive_text):
    take = read_take(put("take.csv", motive_text))
    assert isinstance(take, Trajectories)
    np.testing.assert_allclose(take.positions[0], FIRST_MM, atol=EXACT)
    assert take.seen[:, 1].tolist() == [True, False, True]
    assert (take.names, take.rate) == (("LKNE", "RKNE"), 120.0)


def test_left_out_bodies_and_prefixes_are_noticed(put, motive_text):
    notices = " ".join(read_take(put("take.csv", motive_text)).notices)
    assert "Rigid Body" in notices
    assert "Bob:" in notices


def test_millimetres_stay(edited, motive_text):
    take = read_take(edited("mm.csv", motive_text, "Units,Meters", "Units,Millimeters"))
    np.testing.assert_array_equal(take.positions[0], np.array(FIRST_MM) / 1000)


def test_rigid_body_markers_serve_where_no_others_are(put, motive_text):
    take = read_take(
        put(
            "rbm.csv", motive_text.replace("Marker,", "Rigid Body Marker,").replace(",Marker\r", ",Rigid Body Marker\r")
        )
    )
    np.testing.assert_allclose(take.positions[0], FIRST_MM, atol=EXACT)
    assert any("models are taken" in notice for notice in take.notices)


def test_measured_markers_are_preferred_to_modelled_ones(put, motive_text):
    lines = motive_text.split("\r\n")
    lines[2] = ",,Rigid Body,Rigid Body,Rigid Body Marker,Rigid Body Marker,Rigid Body Marker,Marker,Marker,Marker"
    assert read_take(put("both.csv", "\r\n".join(lines))).n_markers == 1


def test_export_without_markers_says_what_to_do(refused, put, motive_text):
    assert "export with markers" in refused(put("bodies.csv", motive_text.replace("Marker", "Bone")))


def test_semicolons_with_decimal_commas_are_understood(put, motive_text):
    german = motive_text.replace(",", ";").replace(".", ",")
    np.testing.assert_allclose(read_take(put("de.csv", german)).positions[0], FIRST_MM, atol=EXACT)


def test_commas_for_both_say_what_to_do(refused, put, motive_text):
    lines = motive_text.split("\r\n")
    lines[7:] = [line.replace(".", ",") for line in lines[7:]]
    assert "decimal points" in refused(put("de.csv", "\r\n".join(lines)))


def test_unlabelled_markers_are_left_out_beside_labelled_ones(put, motive_text):
    take = read_take(put("some.csv", motive_text.replace("Bob:RKNE", "Unlabeled 1234")))
    assert take.names == ("LKNE",)


def test_nothing_but_unlabelled_markers_is_a_point_cloud(put, motive_text):
    text = motive_text.replace("Bob:RKNE", "Unlabeled 1234").replace("Bob:LKNE", "Unlabeled 7")
    take = read_take(put("none.csv", text))
    assert isinstance(take, PointCloud)
    assert take.points_per_frame.tolist() == [2, 1, 2]


def test_duplicate_label_is_named(refused, put, motive_text):
    assert "'Bob:LKNE'" in refused(put("two.csv", motive_text.replace("RKNE", "LKNE")))


@pytest.mark.parametrize("line", ["Frame,Time", ",Name,"])
def test_missing_title_line_is_a_format_error(refused, put, motive_text, line):
    lines = [text for text in motive_text.split("\r\n") if not text.startswith(line)]
    refused(put("no.csv", "\r\n".join(lines)))


def test_missing_frames_are_an_error(refused, put, motive_text):
    assert "3 frames are announced" in refused(put("cut.csv", motive_text[: motive_text.index("2,0.0167")]))
