from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skelgen_formats.registry import read_take

from skelgen.model import PointCloud, Poses, Trajectories

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
    assert "Rigid Body; `--bodies` reads the bodies instead" in notices
    assert "Bob:" in notices


def test_millimetres_stay(edited, motive_text):
    take = read_take(edited("mm.csv", motive_text, "Units,Meters", "Units,Millimeters"))
    np.testing.assert_array_equal(take.positions[0], np.array(FIRST_MM) / 1000)


@pytest.mark.parametrize("kind", ["Rigid Body Marker", "Trained Markerset Marker"])
def test_rigid_body_markers_serve_where_no_others_are(put, motive_text, kind):
    text = motive_text.replace("Marker,", f"{kind},").replace(",Marker\r", f",{kind}\r")
    take = read_take(put("rbm.csv", text))
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


def test_label_that_stands_twice_gets_a_number(put, motive_text):
    take = read_take(put("two.csv", motive_text.replace("RKNE", "LKNE")))
    assert take.names == ("LKNE", "LKNE_2")
    np.testing.assert_allclose(take.positions[0], FIRST_MM, atol=EXACT)


def of_bodies(kind="Rigid Body", version="1.23", rotation="Quaternion", space="Global") -> str:
    """A body turned by 90 degrees about y, in frame 1 unseen, as versions of Motive write it."""
    words = {"1.2": ("", "", "", ""), "1.23": ("", "Name", "ID", ""), "1.25": ("Type", "Name", "ID", "Parent")}[version]
    first, name, identity, parent = words
    titles = [f",{first},{','.join([kind] * 8)}", f",{name}" + ",Foot" * 8, f",{identity}" + ",F1" * 8]
    titles += [f",{parent}" + ",Root" * 8] if parent else []
    return "\r\n".join(
        [
            f"Format Version,{version},Take Name,a,Export Frame Rate,120.000000,Total Exported Frames,2,"
            f"Rotation Type,{rotation},Length Units,Meters,Coordinate Space,{space}",
            "",
            *titles,
            ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error",
            "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,",
            "0,0.000000,0,0.70710678,0,0.70710678,1.5,2.5,-3.5,0.0002",
            "1,0.008333,,,,,,,,",
            "",
        ]
    )


@pytest.mark.parametrize("version", ["1.2", "1.23", "1.25"])
@pytest.mark.parametrize("kind", ["Rigid Body", "Bone"])
def test_bodies_are_read_where_there_are_no_markers(put, kind, version):
    take = read_take(put("bodies.csv", of_bodies(kind, version)))
    assert isinstance(take, Poses)
    assert (take.names, take.rate) == (("Foot",), 120.0)
    turned = [[0, 0, 1, 1500], [0, 1, 0, 2500], [-1, 0, 0, -3500], [0, 0, 0, 1]]
    np.testing.assert_allclose(take.world_from_body[0, 0], turned, atol=1e-6)
    assert np.isnan(take.world_from_body[1]).all()


def test_axes_may_be_titled_in_small_letters(put):
    take = read_take(put("small.csv", of_bodies().replace(",X,Y,Z,W,X", ",X,Y,Z,w,x")))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [1500, 2500, -3500])


def test_bodies_beside_markers_are_read_on_request(put):
    lines = of_bodies().split("\r\n")
    more = (",Marker" * 3, ",toe" * 3, ",T1" * 3, ",Position" * 3, ",X,Y,Z", ",1,2,3", ",4,5,6")
    lines[2:9] = [line + text for line, text in zip(lines[2:9], more, strict=True)]
    path = put("both.csv", "\r\n".join(lines))
    assert read_take(path).names == ("toe",)
    assert read_take(path, bodies=True).names == ("Foot",)


@pytest.mark.parametrize(("order", "angles"), [("XYZ", (90, 0, 90)), ("ZYX", (90, 0, 90))])
def test_angles_turn_bodies_in_the_order_of_their_type(put, order, angles):
    text = of_bodies(rotation=order).replace("X,Y,Z,W,X", "X,Y,Z,,X").replace("0,0.70710678,0,0.70710678", "90,0,90,")
    take = read_take(
        put("euler.csv", text.replace("Rotation,Rotation,Rotation,Rotation", "Rotation,Rotation,Rotation,"))
    )
    rotation = Rotation.from_euler(order, angles, degrees=True)
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], rotation.as_matrix(), atol=1e-12)
    assert np.isnan(take.world_from_body[1]).all()


def test_other_rotations_and_local_coordinates_say_what_to_export(refused, put):
    assert "export with Rotation Type Quaternion" in refused(put("euler.csv", of_bodies(rotation="Matrix")))
    assert "export with global" in refused(put("local.csv", of_bodies(kind="Bone", space="Local")))


def test_column_with_time_codes_is_passed_over(put, motive_text):
    lines = motive_text.split("\r\n")
    codes = ["", "", "", "", "TimeCode", "15:26:46:12.02", "15:26:46:12.03", "15:26:46:12.04"]
    split = [line.split(",", 2) for line in lines[2:10]]
    lines[2:10] = [",".join([*cells[:2], code, *cells[2:]]) for cells, code in zip(split, codes, strict=True)]
    np.testing.assert_allclose(read_take(put("code.csv", "\r\n".join(lines))).positions[0], FIRST_MM, atol=EXACT)


@pytest.mark.parametrize("line", ["Frame,Time", ",Name,"])
def test_missing_title_line_is_a_format_error(refused, put, motive_text, line):
    lines = [text for text in motive_text.split("\r\n") if not text.startswith(line)]
    refused(put("no.csv", "\r\n".join(lines)))


@pytest.mark.parametrize("cut", ["2,0.0167", ".0167", "-0.62"])
def test_file_that_is_cut_off_is_read_so_far(put, motive_text, cut):
    take = read_take(put("cut.csv", motive_text[: motive_text.index(cut)]))
    assert take.n_frames == 2
    assert any("3 frames are announced and 2 are there: the file is cut off" in notice for notice in take.notices)


def test_last_number_that_may_be_cut_is_left_out(put, motive_text):
    assert read_take(put("cut.csv", motive_text.removesuffix("72\r\n"))).n_frames == 3  # nothing says that it is cut
    announced = motive_text.replace("Frames,3", "Frames,4").removesuffix("2\r\n")
    assert read_take(put("cut2.csv", announced)).n_frames == 2


def test_local_coordinates_beside_markers_are_told(edited, motive_text):
    take = read_take(edited("local.csv", motive_text, "Coordinate Space,Global", "Coordinate Space,Local"))
    assert any("coordinates are local" in notice for notice in take.notices)


def test_export_without_its_first_line_is_read_by_its_titles_and_times(put, motive_text):
    take = read_take(put("cut.csv", motive_text.partition("\r\n\r\n")[2]))
    assert (take.names, take.rate) == (("LKNE", "RKNE"), pytest.approx(120.0, rel=1e-2))
    np.testing.assert_allclose(take.positions[0], FIRST_MM, atol=EXACT)
    assert any("metres are assumed" in notice for notice in take.notices)
