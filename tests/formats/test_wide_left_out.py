"""Columns of wide tables that are no points, and cells in which nothing is seen."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from tests.formats.wide_rows import rows


@pytest.mark.parametrize("names", [("Acc", "Gyr"), ("ground_force_v", "ground_force_p"), ("hip_angle", "hip_moment")])
def test_forces_and_accelerations_are_no_points(refused, put, names):
    titles = ",".join(f"{name}_{axis}" for name in names for axis in "xyz")
    assert f"left out: {names[0]}, {names[1]}; nothing else" in refused(put("imu.csv", f"{titles}\n{rows()}"))


def test_signals_of_inertial_sensors_and_force_plates_are_no_points(refused, put):
    assert "a table needs titles" in refused(put("imu.csv", "t,ax,ay,az,gx,gy,gz\n" + rows("{1},")))


def test_torques_beside_their_forces_are_no_points(put):
    plate = ",".join(f"{what}{axis}_plate" for what in "FT" for axis in "xyz")
    take = read_take(put("plate.csv", f"a_x,a_y,a_z,b_x,b_y,b_z,{plate}\n{rows(after=',1,2,3,4,5,6')}"))
    assert take.names == ("a", "b")


@pytest.mark.parametrize("word", ["conf", "likelihood", "Score"])
def test_points_of_which_a_tracker_is_not_sure_at_all_are_unseen(put, word):
    """It writes 0 beside a place that stands for none."""
    titles = ",".join(f"{name}_{end}" for name in ("hip", "knee") for end in ("x", "y", "z", word))
    take = read_take(put("sure.csv", f"{titles}\n1,2,3,0.9,-7,-8,-9,0.0000\n1,2,3,0.5,4,5,6,0.7\n"), recorded_unit="mm")
    assert np.isnan(take.positions[:, :, 0]).tolist() == [[False, True], [False, False]]
    assert any("1 position is unseen, as the columns of confidence say" in notice for notice in take.notices)
    unsure = read_take(put("unsure.csv", f"{titles}\n1,2,3,0,7,8,9,0\n1,2,3,0,4,5,6,0\n"), recorded_unit="mm")
    assert np.isfinite(unsure.positions).all()


def test_rates_and_scales_beside_points_are_left_out(put):
    axes = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "wx", "wy", "wz", "sx", "sy", "sz")
    text = ",".join(f"{name}_{axis}" for name in ("knee", "hip") for axis in axes) + "\n"
    assert read_take(put("rates.csv", text + ",".join("123" * 10) + "\n")).names == ("knee", "hip")
    assert read_take(put("bodies.csv", text.replace("_v", "_r") + ",".join("123" * 10) + "\n")).n_bodies == 2


@pytest.mark.parametrize(
    "titles",
    [
        ["FreeAcc_X", "FreeAcc_Y", "FreeAcc_Z", "Acc_X", "Acc_Y", "Acc_Z"],
        ["Lumbar/Accelerometer/X", "Lumbar/Accelerometer/Y", "Lumbar/Accelerometer/Z", "dv[1]", "dv[2]", "dv[3]"],
        ["v_x", "v_y", "v_z", "Mag_X", "Mag_Y", "Mag_Z"],
        [f"FP{n}_{what}{axis}" for n in (1, 2) for what in "FM" for axis in "xyz"],
    ],
)
def test_sensors_and_force_plates_are_no_points(refused, put, titles):
    assert refused(put("sensors.csv", ",".join(["time", *titles]) + "\n" + ",".join("1" * (len(titles) + 1)) + "\n"))


def test_outputs_of_models_are_no_points_unless_asked_for(put):
    names = ("LASI", "RASI", "LHipAngles", "Ann:RKneeMoment", "LAnklePower")
    text = ",".join(f"{name}_{axis}" for name in names for axis in "xyz") + "\n"
    path = put("outputs.csv", text + ",".join(map(str, range(15))) + "\n")
    assert read_take(path).names == ("LASI", "RASI")
    assert read_take(path, points="all").n_markers == 5


def test_velocities_beside_points_are_left_out(put):
    head = "nose_x,nose_y,nose_z,tail_x,tail_y,tail_z,nose_vel_x,nose_vel_y,nose_vel_z\n"
    take = read_take(put("both.csv", head + rows(after=",1,2,3")))
    assert take.names == ("nose", "tail")
    assert "no points, and left out: nose_vel" in take.notices


@pytest.mark.parametrize("gap", ["-9999", "-1", "9999999", "-3.697314E+28", "NA", "-1.#IND", "1.#QNAN0"])
def test_numbers_and_words_that_stand_for_gaps_are_unseen(put, gap):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n100,200,300,400,500,600\n" + f"100,200,300,{gap},{gap},{gap}\n" * 2
    take = read_take(put("gaps.csv", text))
    assert take.seen.tolist() == [[True, True], [True, False], [True, False]]


def test_point_that_stands_still_where_its_coordinates_are_equal_is_seen(put):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n" + "100,200,300,500,500,500\n" * 3
    assert read_take(put("still.csv", text)).seen.all()


def test_points_that_move_along_a_diagonal_are_seen(put):
    text = "a_x,a_y,a_z,b_x,b_y,b_z\n" + "".join(f"{n % 9},{n % 9},{n % 9},1,2,3\n" for n in range(1, 40))
    assert read_take(put("diagonal.csv", text)).positions[3, 0].tolist() == [4000.0] * 3


def test_orientations_without_positions_are_no_points(refused, put):
    titles = ",".join(f"{name}.{axis}" for name in ("Head", "Arm") for axis in "wxyz")
    text = f"timestamp,{titles}\n" + "".join(f"{n / 50},0.6,0.8,0,0,1,0,0,0\n" for n in range(3))
    assert "quaternions without positions" in refused(put("pose.csv", text))


def test_derivatives_and_channels_of_force_plates_are_no_points(put):
    """As D-Flow writes force plates."""
    names = ("LASI.Pos", "RASI.Pos", "FP1.Cop", "FP1.For", "FP2.Mom", "hand_jerk")
    titles = ",".join(f"{name}{axis}" for name in names for axis in "XYZ")
    take = read_take(put("dflow.csv", f"{titles}\n0.1,0.9,0,-0.1,0.9,0,{'700,' * 12}\n"))
    assert take.names == ("LASI", "RASI")
    assert take.positions[0, 0].tolist() == [100, 900, 0]


def test_directions_beside_points_are_left_out(put):
    titles = ",".join(f"{name}_{axis}" for name in ("head", "hand", "gaze") for axis in "xyz")
    rows = "".join(f"0.1,1.6,0.{n},0.4,1.1,0.{n},0,0.6,0.8\n" for n in range(3))
    take = read_take(put("gaze.csv", f"{titles}\n{rows}"))
    assert take.names == ("head", "hand")
    assert any("directions" in notice and "gaze" in notice for notice in take.notices)


@pytest.mark.parametrize("gap", [".", "missing", "undefined", "inf", "<NA>"])
def test_other_words_stand_for_gaps_too(put, gap):
    content = f"a_x,a_y,a_z,b_x,b_y,b_z\n101,102,103,{gap},{gap},{gap}\n101,102,103,104,105,106\n"
    assert read_take(put("gaps.csv", content)).seen.tolist() == [[True, False], [True, True]]


def test_deviations_of_positions_are_no_points(put):
    titles = "a_x,a_y,a_z,b_x,b_y,b_z,b_std_x,b_std_y,b_std_z"
    assert read_take(put("std.csv", f"{titles}\n" + rows(after=",1,2,3"))).names == ("a", "b")


@pytest.mark.parametrize(
    "words",
    [
        *["valid 1 0", "valid True False", "valid yes no", "valid T F", "valid ok lost"],
        *["occluded visible occluded", "hidden no yes", "valid interpolated lost"],
    ],
)
def test_points_are_unseen_where_a_column_of_flags_says_so(put, words):
    title, seen, hidden = words.split()
    first = "ok" if seen == "interpolated" else seen  # what a first row says shows that these are flags
    titles = f"time,a_x,a_y,a_z,a_{title},b_x,b_y,b_z,b_{title}"
    rows = f"0,1,2,3,{first},4,5,6,{first}\n0.02,1,2,4,{seen},4,5,7,{hidden}\n"
    take = read_take(put("flags.csv", f"{titles}\n{rows}"))
    assert (take.names, take.seen.tolist()) == (("a", "b"), [[True, True], [True, False]])


@pytest.mark.parametrize("cell", ["N/A", "missing", "lost"])
def test_words_beside_flags_are_no_numbers(put, cell):
    titles = "time,a_x,a_y,a_z,a_valid,b_x,b_y,b_z,b_valid"
    take = read_take(put("gap.csv", f"{titles}\n0,1,2,3,1,4,5,6,1\n0.02,1,{cell},4,1,4,5,7,1\n"))
    assert take.seen.tolist() == [[True, True], [False, True]]


def test_accelerations_of_sensors_beside_joints_are_no_points(put):
    """As Axis Studio writes them."""
    titles = [
        f"{name}-{what}-{axis}"
        for what in ("Joint-Posi", "Sensor-Acce")
        for name in ("Hips", "Spine")
        for axis in "xyz"
    ]
    take = read_take(put("neuron.csv", ",".join(["Frame", *titles]) + "\n" + rows("{0},", ",0.1,0.2,9.8,0.1,0.2,9.8")))
    assert take.n_markers == 2
    assert any("no points, and left out: Hips-Sensor-Acce" in notice for notice in take.notices)


@pytest.mark.parametrize("title", ["visibility_{}", "conf{}", "v{}", "valid_{}"])
def test_flags_may_stand_before_numbers_of_points(put, title):
    titles = ",".join(f"x_{n},y_{n},z_{n},{title.format(n)}" for n in range(2))
    take = read_take(put("landmarks.csv", f"{titles}\n1,2,3,1,4,5,6,0\n1,2,3,1,4,5,7,1\n"), recorded_unit="mm")
    assert take.seen.tolist() == [[True, False], [True, True]]


def test_of_landmarks_in_images_and_in_the_world_the_latter_are_points(put):
    names = [f"{name}{world}" for world in ("", "_world") for name in ("HIP", "KNEE")]
    titles = ",".join(f"{name}_{axis}" for name in names for axis in "xyz")
    rows = "".join(f"0.5,0.6,-0.1,0.5,0.7,-0.1,0.1,0.2,0.{n},0.4,0.5,0.{n}\n" for n in range(3))
    take = read_take(put("landmarks.csv", f"{titles}\n{rows}"))
    assert take.names == ("HIP_world", "KNEE_world")
    assert any("points beside those called world, and left out: HIP, KNEE" in notice for notice in take.notices)


def test_points_that_were_written_at_times_of_their_own_are_refused(put, refused):
    """As PlotJuggler joins topics of ROS."""
    titles = ",".join(f"/mocap/{name}/position/{axis}" for name in "ab" for axis in "xyz")
    rows = "".join(f"{n / 100},1,2,{n},,,\n{n / 100 + 0.004},,,,4,5,{n}\n" for n in range(9))
    assert "interpolate at common times" in refused(put("topics.csv", f"__time,{titles}\n{rows}"))


def test_only_marker_that_is_seen_is_read(put):
    """Beside one that never is."""
    rows = "".join(f"{n / 100},1,2,{n},,,\n" for n in range(9))
    take = read_take(
        put("one.csv", "time," + ",".join(f"{name}_{axis}" for name in "ab" for axis in "xyz") + f"\n{rows}")
    )
    assert take.names == ("a",)
    assert any("never seen: b" in notice for notice in take.notices)


def test_times_that_make_another_rate_than_stated_are_told(put):
    titles = "time," + ",".join(f"{name}_{axis}" for name in "ab" for axis in "xyz")
    rows = "".join(f"{n / 100},1,2,{n},4,5,{n}\n" for n in range(9))
    take = read_take(put("rates.csv", f"fps: 25\n{titles}\n{rows}"))
    assert take.rate == 25.0
    assert any("the times make 100 Hz" in notice for notice in take.notices)


def test_biases_of_sensors_are_no_points(put):
    names = ["pos_x,pos_y,pos_z,rot_x,rot_y,rot_z,rot_w", "bias_g_x,bias_g_y,bias_g_z", "bias_a_x,bias_a_y,bias_a_z"]
    rows = "".join(f"{n / 10},{n},2,3,0,0,0,1,0,0,0,0,0,0\n" for n in range(1, 4))
    take = read_take(put("odometry.csv", f"timestamp,{','.join(names)}\n{rows}"))
    assert (take.n_frames, take.n_bodies) == (3, 1)
