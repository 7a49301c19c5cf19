from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skelgen_formats.registry import read_take, recognise

from skelgen.model import Trajectories

TRAJECTORIES = (
    "Trajectories,,,,,,,\n100,,,,,,,\n,,Ann:LASI,,,Ann:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    "1,0,1.5,2.5,3.5,4.5,5.5,6.5\n2,0,1.6,2.6,3.6,,,\n3,0,1.7,2.7,3.7,4.7,5.7,6.7\n"
)
OUTPUTS = (
    "Model Outputs\n100\n,,Ann:LHipAngles,,\nFrame,Sub Frame,X,Y,Z\n,,deg,deg,deg\n1,0,10,20,30\n2,0,11,21,31\n"
    "3,0,12,22,32\n"
)
DEVICES = "Devices\n1000\n,,Force Plate,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n1,0,0,0,1\n1,1,0,0,2\n"
FIRST = [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]


@pytest.mark.parametrize(
    "text",
    [
        TRAJECTORIES,
        "\n\n" + TRAJECTORIES,
        f"{OUTPUTS}\n{TRAJECTORIES}",
        f"{TRAJECTORIES}\n{OUTPUTS}\n{DEVICES}",
        f"{DEVICES}\n{TRAJECTORIES}\n",
        TRAJECTORIES.replace("\n", "\r\n"),
        TRAJECTORIES.replace(",", "\t"),
        "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in TRAJECTORIES.splitlines()),
    ],
)
def test_trajectories_are_read_wherever_they_stand(put, text):
    path = put("walk.dat", text)
    take = read_take(path)
    assert recognise(path).name == "nexus"
    assert isinstance(take, Trajectories)
    assert (take.names, take.rate) == (("LASI", "RASI"), 100.0)
    np.testing.assert_array_equal(take.positions[0], FIRST)
    assert take.seen.tolist() == [[True, True], [True, False], [True, True]]


def test_other_blocks_are_told(put):
    notices = read_take(put("walk.csv", f"{OUTPUTS}\n{TRAJECTORIES}\n{DEVICES}")).notices
    assert "blocks left out: Model Outputs, Devices" in notices


def test_export_without_trajectories_says_what_to_do(refused, put):
    assert "only Model Outputs, Devices; export ASCII with" in refused(put("angles.csv", f"{OUTPUTS}\n{DEVICES}"))


def test_metres_become_millimetres_and_a_missing_unit_is_told(put):
    take = read_take(put("m.csv", TRAJECTORIES.replace("mm", "m")))
    np.testing.assert_allclose(take.positions[0], np.array(FIRST) * 1000)
    take = read_take(put("none.csv", TRAJECTORIES.replace(",,mm,mm,mm,mm,mm,mm\n", "")))
    np.testing.assert_array_equal(take.positions[0], FIRST)
    assert any("mm is assumed" in notice for notice in take.notices)


def test_velocities_beside_positions_are_passed_over(put):
    text = "Trajectories\n100\n,,A,,,,,,B,,\nFrame,Sub Frame,X,Y,Z,X',Y',Z',X,Y,Z\n,,mm,mm,mm,mm/s,mm/s,mm/s,mm,mm,mm\n"
    take = read_take(put("fast.csv", text + "1,0,1,2,3,9,9,9,4,5,6\n"))
    assert take.names == ("A", "B")
    np.testing.assert_array_equal(take.positions[0], [[1, 2, 3], [4, 5, 6]])


def test_rows_that_end_early_and_frames_that_are_left_out_are_unseen(put):
    text = TRAJECTORIES.replace("2,0,1.6,2.6,3.6,,,\n", "").replace(",4.5,5.5,6.5", "")
    take = read_take(put("gaps.csv", text))
    assert take.seen.tolist() == [[True, False], [False, False], [True, True]]
    assert any("1 row ends before" in notice for notice in take.notices)
    assert any("1 frame is left out" in notice for notice in take.notices)


def test_last_line_that_is_cut_off_is_left_out(put):
    take = read_take(put("cut.csv", TRAJECTORIES.removesuffix(".7,6.7\n")))
    assert take.n_frames == 2
    assert any("cut off" in notice for notice in take.notices)


def test_header_that_is_cut_off_is_an_error(refused, put):
    assert "cut off" in refused(put("cut.csv", "Trajectories\n100\n"))


def test_export_of_workstation_without_sub_frames_is_read(put):
    """Titles in capitals, the rate with its unit, one leading column, and millimetres that nobody states."""
    text = "TRAJECTORIES\n120.00,Hz\n,Ann:LASI,,,Ann:RASI\nField #,X,Y,Z,X,Y,Z\n1, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5\n"
    text += "2,1.6,2.6,3.6,,,\n\nANALOG\n600.00,Hz\nSample #,Fx1\nunits:,N\n1,0.5\n"
    path = put("walk.csv", text)
    take = read_take(path)
    assert recognise(path).name == "nexus"
    assert (take.names, take.rate, take.n_frames) == (("LASI", "RASI"), 120.0, 2)
    np.testing.assert_array_equal(take.positions[0], FIRST)


OBJECTS = (
    "Objects\n100\n,,Wand:Wand,,,,,,,Box:Box,,,,,,\nFrame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ,RX,RY,RZ,RW,TX,TY,TZ\n"
    ",,,,,,mm,mm,mm,,,,,mm,mm,mm\n1,0,0,0,1,0,10,20,30,0,0,0,1,1,2,3\n2,0,0,0,0,1,11,21,31,,,,,,,\n"
)


@pytest.mark.parametrize("text", [OBJECTS, OBJECTS.replace(",,Wand:Wand", ",,Global Angle (Quaternion) Wand:Wand")])
def test_objects_with_quaternions_are_bodies(put, text):
    take = read_take(put("tracker.csv", text))
    assert (take.names, take.rate) == (("Wand", "Box"), 100.0)
    np.testing.assert_allclose(
        take.world_from_body[0, 0], [[-1, 0, 0, 10], [0, -1, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]]
    )
    assert np.isnan(take.world_from_body[1, 1]).all()


HELICAL = (
    "Objects\n100\n,,Wand:Wand,,,,,,Box:Box\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ,RX,RY,RZ,TX,TY,TZ\n"
    ",,deg,deg,deg,mm,mm,mm,deg,deg,deg,mm,mm,mm\n1,0,90,0,90,10,20,30,0,0,0,1,2,3\n2,0,0,0,0,0,0,0,0,0,0,1,2,3\n"
)


@pytest.mark.parametrize(
    ("text", "order", "rotation"),
    [
        (HELICAL, "auto", Rotation.from_rotvec([90, 0, 90], degrees=True)),
        (HELICAL, "xyz", Rotation.from_euler("XYZ", [90, 0, 90], degrees=True)),
        (
            HELICAL.replace(",,Wand", ",,Global Angle (EulerXYZ) Wand"),
            "auto",
            Rotation.from_euler("XYZ", [90, 0, 90], degrees=True),
        ),
        (HELICAL.replace("deg", "rad"), "auto", Rotation.from_rotvec([90, 0, 90])),
    ],
)
def test_objects_with_angles_are_bodies(put, text, order, rotation):
    take = read_take(put("tracker.csv", text), angle_order=order)
    assert take.names == ("Wand", "Box")
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], rotation.as_matrix(), atol=1e-12)
    assert np.isnan(take.world_from_body[1, 0]).all()
    assert any("helical" in notice for notice in take.notices) == (order == "auto" and "Euler" not in text)


def test_objects_without_places_say_what_to_export(refused, put):
    text = OBJECTS.replace("RX,RY,RZ,RW", "AX,AY,AZ,")
    assert "in the block Objects stands over RX, RY, RZ" in refused(put("tracker.csv", text))


@pytest.mark.parametrize("title", ["Angles", "Joint angles of Ann"])
def test_a_first_block_of_any_title_hides_no_trajectories(put, title):
    take = read_take(put("walk.csv", f"{OUTPUTS.replace('Model Outputs', title)}\n{TRAJECTORIES}"))
    assert take.names == ("LASI", "RASI")


def test_blocks_without_frames_or_names_are_refused(refused, put):
    head = "Trajectories\n100\n,,A:LASI,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"
    assert "holds no frame" in refused(put("a.csv", head))
    assert "not exported" in refused(put("b.csv", head.replace("A:LASI", "") + "1,0,1,2,3\n"))


def test_trajectories_whose_first_lines_are_cut_off_are_a_wide_table(put):
    path = put("cut.csv", TRAJECTORIES.partition("100,,,,,,,\n")[2])
    take = read_take(path)
    assert (recognise(path).name, take.names) == ("wide-csv", ("LASI", "RASI"))
    np.testing.assert_array_equal(take.positions[0], FIRST)


def test_counts_of_trajectories_before_them_are_left_out(put):
    counts = "Trajectory Count\n120\n,,Count\nFrame,Sub Frame,Count\n,,\n1,0,2\n2,0,1\n3,0,2\n"
    path = put("walk.csv", f"{counts}\n{TRAJECTORIES.replace('100,', '120,')}")
    assert recognise(path).name == "nexus"
    take = read_take(path)
    assert (take.names, take.rate) == (("LASI", "RASI"), 120.0)
