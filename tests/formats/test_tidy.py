"""Tidy tables, a row per frame and point: three frames of two points in mm."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

ROWS = [(f, name, f + 100.0, 10.0 * k, -5.5) for f in range(3) for k, name in enumerate(("knee", "ankle"))]


def table(titles: str, row: str, rows: list[tuple[object, ...]]) -> str:
    return titles + "\n" + "".join(row.format(*cells) + "\n" for cells in rows)


FREEMOCAP = table(
    "frame,timestamp,timestamp_by_camera,model,keypoint,x,y,z,reprojection_error",
    "{0},0.0{0},\"{{'Camera_0': 0.1, 'Camera_1': 0.2}}\",mediapipe_body,{1},{2},{3},{4},0.5",
    ROWS,
)


@pytest.mark.parametrize(
    "content",
    [
        table("frame,keypoint,x,y,z", "{0},{1},{2},{3},{4}", ROWS),
        table("Marker;Z;Y;X;Frame", "{1};{4};{3};{2};{0}", ROWS[::-1]),
        table("bodypart\ttime\tx\ty\tz", "{1}\t0.0{0}\t{2}\t{3}\t{4}", ROWS),
        FREEMOCAP,
        FREEMOCAP.replace("\n", "\r\n"),
    ],
    ids=("plain", "any order", "times alone", "freemocap", "of windows"),
)
def test_points_are_sorted_into_frames(put, content):
    path = put("points.csv", content)
    take = read_take(path)
    assert recognise(path).name == "tidy-csv"
    assert sorted(take.names) == ["ankle", "knee"]
    knee = take.positions[:, take.names.index("knee")]
    np.testing.assert_array_equal(knee, [[100.0, 0.0, -5.5], [101.0, 0.0, -5.5], [102.0, 0.0, -5.5]])


def test_times_tell_the_rate(put):
    assert read_take(put("points.csv", FREEMOCAP)).rate == 100.0


@pytest.mark.parametrize("title", ["joint_idx", "Keypoint No", "marker number", "obj_id"])
def test_points_may_be_numbered(put, title):
    text = f"frame,{title},x,y,z\n" + "".join(f"{frame},{n},{n},2,3\n" for frame in range(3) for n in range(4))
    assert read_take(put("numbered.csv", text)).names == ("0", "1", "2", "3")


def test_point_without_a_row_or_a_number_is_unseen(put):
    content = table("frame,keypoint,x,y,z", "{0},{1},{2},{3},{4}", ROWS[:-1]).replace("100.0,0.0,-5.5", ",,nan")
    assert read_take(put("gaps.csv", content)).seen.tolist() == [[False, True], [True, True], [True, False]]


def test_points_of_one_name_are_told_apart_by_their_model(put):
    twice = [(f, model, f + 100.0) for f in range(3) for model in ("body", "hand")]
    content = table("frame,model,keypoint,x,y,z", "{0},{1},right_wrist,{2},0,900", twice)
    assert read_take(put("twice.csv", content)).names == ("body_right_wrist", "hand_right_wrist")


@pytest.mark.parametrize(
    ("row", "sentence"), [("1,knee,5", "cut off"), ("1,knee,5,oops,7", "oops"), (",knee,5,6,7", "without a frame")]
)
def test_rows_that_cannot_be_read_are_told(refused, put, row, sentence):
    assert sentence in refused(put("odd.csv", f"frame,keypoint,x,y,z\n0,knee,1,2,3\n{row}\n"))


@pytest.mark.parametrize(
    ("titles", "row"),
    [
        ("frame,marker,pos_x,pos_y,pos_z", "{0},{1},{2},{3},{4}"),
        ("Frame,Time (ms),Marker Name,X (mm),Y (mm),Z (mm)", "{0},{0}0,{1},{2},{3},{4}"),
        ("frame,marker_id,x_mm,y_mm,z_mm", "{0},{1},{2},{3},{4}"),
        ("frame,marker,pos_x_mm,pos_y_mm,pos_z_mm", "{0},{1},{2},{3},{4}"),
        ("frame,marker,Position X (mm),Position Y (mm),Position Z (mm)", "{0},{1},{2},{3},{4}"),
        ("frame,marker,x_coord,y_coord,z_coord", "{0},{1},{2},{3},{4}"),
        ("id;frame_no;x;y;z", "{1};{0};{2};{3};{4}"),
        ("video_frame,segment,x_mm,y_mm,z_mm", "{0},{1},{2},{3},{4}"),
    ],
)
def test_titles_may_hold_units_and_other_words(put, titles, row):
    take = read_take(put("points.csv", table(titles, row, ROWS)))
    assert (take.names, take.rate) == (("knee", "ankle"), 100.0)
    np.testing.assert_array_equal(take.positions[:, 0, 0], [100.0, 101.0, 102.0])


def test_points_without_names_are_a_cloud(put):
    take = read_take(put("cloud.csv", table("frame,x,y,z", "{0},{2},{3},{4}", ROWS)))
    assert take.n_frames == 3
    assert sorted(take.frame(1)[:, 1].tolist()) == [0.0, 10.0]


def test_single_point_without_a_name_is_refused(refused, put):
    assert "one position per frame" in refused(put("one.csv", table("time,x,y,z", "{0},{2},{3},{4}", ROWS[::2])))


def test_rows_with_quaternions_are_bodies(put):
    content = table("time,body,x,y,z,qx,qy,qz,qw", "0.0{0},{1},{2},{3},{4},0,0,0.6,0.8", ROWS)
    take = read_take(put("bodies.csv", content))
    assert (take.names, take.rate) == (("knee", "ankle"), 100.0)
    np.testing.assert_allclose(take.world_from_body[2, 1, :2, (0, 3)], [[0.28, 0.96], [102.0, 10.0]])


def test_rows_with_angles_are_bodies(put):
    content = table("time,body,x,y,z,Rx [deg],Ry [deg],Rz [deg]", "0.0{0},{1},{2},{3},{4},0,0,90", ROWS)
    take = read_take(put("bodies.csv", content))
    np.testing.assert_allclose(take.world_from_body[2, 1, :2, 0], [0, 1], atol=1e-12)
    np.testing.assert_allclose(read_take(put("bodies.csv", content)).world_from_body[2, 1, :2, 3], [102.0, 10.0])


def test_single_body_with_a_rotation_is_read(put):
    take = read_take(put("one.csv", "time,x,y,z,qx,qy,qz,qw\n" + "".join(f"0.0{f},1,2,3,0,0,0,1\n" for f in range(3))))
    assert (take.names, take.rate, take.n_frames) == (("body",), 100.0, 3)


def test_bodies_that_nothing_tells_apart_are_refused_where_some_are_missing(refused, put):
    rows = "".join(f"{f},1,2,3,0,0,0,1\n" for f in (0, 0, 1))
    assert "no column says which" in refused(put("some.csv", f"frame,x,y,z,qx,qy,qz,qw\n{rows}"))


def test_comments_may_stand_above_the_titles_and_rows_that_repeat_a_point_are_told(put):
    content = "# made by a simulator\n" + table("tick,rb_id,x,y,z", "{0},{1},{2},{3},{4}", [*ROWS, ROWS[0]])
    take = read_take(put("points.csv", content))
    assert (take.names, take.n_frames) == (("knee", "ankle"), 3)
    assert any("1 row is of a point that its frame has already" in notice for notice in take.notices)


def test_blanks_may_part_cells(put):
    content = "# frame time marker x y z cond\n" + "".join(
        f"{frame} {frame / 480:.6f} {marker} 100 200.5 300 4\n" for frame in range(3) for marker in (7, 8)
    )
    take = read_take(put("phase.txt", content))
    assert (take.n_frames, take.names, take.rate) == (3, ("7", "8"), pytest.approx(480, rel=1e-3))


def test_row_with_more_words_than_titles_is_refused_where_blanks_part_cells(refused, put):
    assert ":3:" in refused(put("words.txt", "frame name x y z\n1 a 1 2 3\n1 left hand 1 2 3\n"))


def test_names_count_before_numbers_of_points(put):
    rows = "0,4,11,nose,1,2,3\n0,4,12,ear,1,2,4\n"
    assert read_take(put("joints.csv", "frame,id,joint,joint_name,x,y,z\n" + rows)).names == ("nose", "ear")


@pytest.mark.parametrize("title", ["handedness", "type"])
def test_points_that_a_frame_has_twice_are_parted_by_their_side(put, title):
    """As MediaPipe's hands; where each point is there once, such a column may be another in every row."""
    rows = [f"{frame},{side},{point},1,{frame},{point}" for frame in (1, 2) for side in ("l", "r") for point in (0, 1)]
    titles = f"frame,{title},landmark_index,x,y,z\n"
    take = read_take(put("hands.csv", titles + "\n".join(rows)))
    assert take.names == ("l_0", "l_1", "r_0", "r_1")
    assert not any("already" in notice for notice in take.notices)
    once = read_take(put("once.csv", titles + "1,seen,0,1,2,3\n1,seen,1,1,2,4\n2,filled,0,1,2,3\n2,seen,1,1,2,4\n"))
    assert once.names == ("0", "1")


@pytest.mark.parametrize("titles", ["frame,marker,axis,value", "frame,bodypart,coord,position_mm"])
def test_coordinates_may_stand_in_a_row_each(put, titles):
    rows = "".join(
        f"{frame},{name},{axis},{10 * place + frame}\n"
        for frame in (1, 2)
        for place, name in ((1, "hip"), (2, "toe"))
        for axis in "xzy"[: 3 - (frame == 2 and place == 2)]
    )
    take = read_take(put("long.csv", f"{titles}\n{rows}"), **({} if "mm" in titles else {"recorded_unit": "mm"}))
    assert take.names == ("hip", "toe")
    np.testing.assert_array_equal(take.positions[0], [[11] * 3, [21] * 3])
    assert take.seen.tolist() == [[True, True], [True, False]]
    assert not any("already" in notice for notice in take.notices)


@pytest.mark.parametrize("titles", ["time,frame_id", "stamp.sec,stamp.nanosec,child_frame_id", "time,child"])
def test_frames_of_ros_are_the_names_of_bodies(put, titles):
    times = ["0", "0.02"] if "nano" not in titles else ["7,990000000", "8,10000000"]
    rows = "".join(f"{time},{name},1,2,3,0,0,0,1\n" for time in times for name in ("hip", "toe"))
    take = read_take(put("tf.csv", f"{titles},tx,ty,tz,qx,qy,qz,qw\n{rows}"))
    assert (take.names, take.n_frames, take.rate) == (("hip", "toe"), 2, pytest.approx(50.0))


def test_frame_ids_that_are_numbers_count_frames(put):
    take = read_take(put("ids.csv", "frame_id,marker,x,y,z\n1,a,1,2,3\n1,b,1,2,4\n2,a,1,2,3\n2,b,1,2,4\n"))
    assert (take.names, take.n_frames) == (("a", "b"), 2)


def test_position_may_stand_in_one_cell(put):
    rows = "".join(f'{frame},{name},"[1.0, 2.0, {frame}.5]"\n' for frame in (1, 2) for name in "ab")
    take = read_take(put("lists.csv", f"frame,name,position\n{rows}"), recorded_unit="mm")
    assert take.names == ("a", "b")
    np.testing.assert_array_equal(take.positions[:, 0], [[1, 2, 1.5], [1, 2, 2.5]])


def test_words_of_a_title_may_meet_at_a_capital(put):
    """As scripts of Vicon's DataStream write segments."""
    titles = "FrameNumber,SubjectName,SegmentName,TX,TY,TZ,RX,RY,RZ"
    rows = "".join(f"{frame},Ann,{name},1,2,900,0,0,0\n" for frame in range(2) for name in ("Hip", "Knee"))
    assert read_take(put("segments.csv", f"{titles}\n{rows}")).names == ("Hip", "Knee")


@pytest.mark.parametrize(
    ("title", "words"),
    [
        *[("Occluded", "True 0"), ("isOccluded", "1 0"), ("lost", "true 0"), ("TrackingState", "NotTracked Inferred")],
        *[("visible", "F T"), ("valid", "no yes"), ("status", "lost ok"), ("confidence", "0 0.9")],
        *[
            ("residual", "-1 0"),
            ("occluded", "occluded visible"),
            ("lost", "lost tracked"),
            ("visibility", "false true"),
        ],
    ],
)
def test_point_that_a_flag_calls_hidden_is_unseen(put, title, words):
    hidden, seen = words.split()
    rows = "".join(f"{frame},{name},1,2,3,{hidden if name == 'b' else seen}\n" for frame in range(2) for name in "abc")
    assert read_take(put("flags.csv", f"frame,marker,x,y,z,{title}\n{rows}")).names == ("a", "c")


@pytest.mark.parametrize(
    ("title", "cell"),
    [
        ("confidence", "0"),
        ("status", "0"),
        ("residual", "-1"),
        ("confidence", "high"),
        ("residual", "-0.05"),
        ("residual", "-"),
    ],
)
def test_what_says_nothing_of_a_point_hides_none(put, title, cell):
    rows = "".join(f"{frame},{name},1,2,3,{cell}\n" for frame in range(2) for name in "abc")
    assert read_take(put("flags.csv", f"frame,marker,x,y,z,{title}\n{rows}")).names == ("a", "b", "c")


@pytest.mark.parametrize("titles", ["time;marker;coordinate;value", "time;marker;axis;coordinate"])
def test_axis_and_value_may_both_be_called_coordinate(put, titles):
    cells = [("X", 1), ("Y", 2), ("Z", 3)]
    rows = "".join(f"{frame / 50};{name};{axis};{n}.5\n" for frame in range(3) for name in "ab" for axis, n in cells)
    take = read_take(put("long.csv", f"{titles}\n{rows}"), recorded_unit="mm")
    assert (take.names, take.positions[1, 0].tolist()) == (("a", "b"), [1.5, 2.5, 3.5])


def test_coordinates_may_have_a_word_before_them(put):
    """As a recorder of UWB tags writes them."""
    titles = "Timestamp (Local),Tag ID,Tag Name,Range_A0 (cm),Computed_X (cm),Computed_Y (cm),Computed_Z (cm)"
    rows = "".join(
        f"02:00:0{f}.5,{n},{name},181,{n + 1},2,{f}\n" for f in range(2) for n, name in enumerate(("Wrist", "Head"))
    )
    take = read_take(put("uwb.csv", f"{titles}\n{rows}"))
    assert take.names == ("Wrist", "Head")
    np.testing.assert_array_equal(take.positions[1], [[10, 20, 10], [20, 20, 10]])


def test_decimal_commas_beside_commas_are_told(refused, put):
    assert "export with decimal points" in refused(put("commas.csv", "frame,marker,x,y,z\n0,a,1,5,2,5,3,5\n"))
    wide = "a_x,a_y,a_z,b_x,b_y,b_z"
    assert "write a title over each column" in refused(put("more.csv", f"{wide}\n1.5,2,3,4,5,6,7\n"))


@pytest.mark.parametrize("name", ["{0}_{1}", "{0}.{1}", "{0}{2}"])
def test_names_with_axes_beside_values_are_points(put, name):
    """As pandas' melt and R's pivot_longer write a wide table, with columns that are no coordinates."""
    titles = [name.format(point, axis, axis.upper()) for point in "ab" for axis in "xyz"]
    rows = [f"{frame},{title},{frame + n}" for frame in range(3) for n, title in enumerate([*titles, "a_score"])]
    take = read_take(put("melted.csv", "\n".join(["frame,variable,value", *rows])), recorded_unit="mm")
    assert take.names == ("a", "b")
    np.testing.assert_array_equal(take.positions[2], [[2, 3, 4], [5, 6, 7]])


def test_rows_of_a_name_follow_each_other_where_nothing_counts_frames(put):
    rows = "".join(f"{name},{frame},2,{frame},0,0,0,1\n" for frame in (4, 5) for name in ("hip", "toe"))
    take = read_take(put("poses.csv", f"body,x,y,z,qx,qy,qz,qw\n{rows}"), recorded_unit="mm")
    assert (take.names, take.n_frames) == (("hip", "toe"), 2)
    np.testing.assert_array_equal(take.world_from_body[:, 1, 0, 3], [4.0, 5.0])


@pytest.mark.parametrize("titles", ["id,x,y,z", "marker,x,y,z,qx,qy,qz,qw", "rigid_body_id,pos_x,pos_y,pos_z,rx,ry,rz"])
def test_numbers_of_points_that_recur_are_their_names(put, titles):
    turn = {4: "", 8: ",0,0,0,1", 7: ",0.1,0.2,0.3"}[titles.count(",") + 1]
    rows = "".join(f"{name},{frame},2,{name}{turn}\n" for frame in (4, 5, 6) for name in (7, 8))
    take = read_take(put("ids.csv", f"{titles}\n{rows}"), recorded_unit="mm")
    assert (take.names, take.n_frames) == (("7", "8"), 3)
    places = take.world_from_body[..., :3, 3] if turn else take.positions
    np.testing.assert_array_equal(places[:, 1], [[4, 2, 8], [5, 2, 8], [6, 2, 8]])


@pytest.mark.parametrize("names", ["1234", "1122", "1111"])
def test_numbers_that_count_rows_or_classes_are_no_names(refused, put, names):
    rows = "".join(f"{name},1,2,3\n" for name in names)
    assert "frame, name, x, y, z with a row per point" in refused(put("classes.csv", f"label,x,y,z\n{rows}"))


def test_rows_of_one_body_are_frames(put):
    rows = "".join(f"{frame},2,3,0,0,0,1\n" for frame in (4, 5, 6))
    take = read_take(put("body.csv", f"x,y,z,qx,qy,qz,qw\n{rows}"), recorded_unit="mm")
    np.testing.assert_array_equal(take.world_from_body[:, 0, 0, 3], [4, 5, 6])


def test_quaternion_that_lacks_a_component_is_told(put):
    rows = "".join(f"{frame},{name},1,2,3,0,0,0,1\n" for frame in range(2) for name in "ab")
    take = read_take(put("twice.csv", f"frame,name,x,y,z,qx,qy,qz,qz\n{rows}"))
    assert any("no title names one of w, x, y, z" in notice for notice in take.notices)


def test_marks_between_thousands_are_told(refused, put):
    row = "0;a;1 234;2;3"
    assert "without marks between thousands" in refused(put("marks.csv", f"frame;marker;x;y;z\n{row}\n"))


def test_titles_without_rows_hold_no_frame(refused, put):
    assert "holds no frame" in refused(put("none.csv", "frame,marker,x,y,z\n# no rows\n"))


def test_trials_follow_each_other(put):
    content = "".join(f"{trial},{frame},{name},{x},1,2\n" for trial in "ab" for frame, name, x, *_ in ROWS)
    take = read_take(put("trials.csv", f"trial,frame,marker,x,y,z\n{content}"))
    assert (take.names, take.n_frames, take.seen.all()) == (("knee", "ankle"), 6, True)
    assert take.positions[3:, 0, 0].tolist() == [100.0, 101.0, 102.0]
    assert any(notice.startswith("trial changes: rows of several takes") for notice in take.notices)


@pytest.mark.parametrize("titles", ["time,space,keypoints,individuals,position", "time,Var2,marker,session,value"])
def test_column_of_axes_is_known_by_what_it_holds(put, titles):
    content = "".join(
        f"0.0{frame},{axis},{name},one,{x + at}\n" for frame, name, x, *_ in ROWS for at, axis in enumerate("xyz")
    )
    take = read_take(put("long.csv", f"{titles}\n{content}"))
    assert (take.names, take.rate) == (("knee", "ankle"), 100.0)
    np.testing.assert_array_equal(take.positions[2], [[102.0, 103.0, 104.0]] * 2)


@pytest.mark.parametrize("titles", ["time,marker,AP,ML,V", "time,marker,East,North,Up"])
def test_directions_in_words_are_axes_of_rows(put, titles):
    take = read_take(
        put("words.csv", titles + "\n" + "".join(f"{n / 50},{name},100,200,{n}\n" for n in range(3) for name in "ab"))
    )
    assert (take.names, take.rate) == (("a", "b"), pytest.approx(50.0))
    np.testing.assert_array_equal(take.positions[2], [[100, 200, 2]] * 2)


def test_units_in_cells_of_rows_count(put):
    rows = "".join(f"{n / 50},{name},1.5 m,2 m,-3 m\n" for n in range(3) for name in "ab")
    np.testing.assert_array_equal(
        read_take(put("units.csv", f"time,marker,x,y,z\n{rows}")).positions[0, 0], [1500, 2000, -3000]
    )


@pytest.mark.parametrize("title", ["node", "LED", "kp", "animal", "Type", "mac"])
def test_column_of_names_is_known_by_what_it_holds(put, title):
    rows = "".join(f"{n},0.9,{name},100,200,{n}\n" for n in range(3) for name in ("knee", "toe"))
    assert read_take(put("any.csv", f"frame,quality,{title},x,y,z\n{rows}")).names == ("knee", "toe")


@pytest.mark.parametrize(
    "before", ["# framerate: 25 fps\n# z: height\n", "Software,X\nFrame rate,25\n\n", "fps = 25\n", "Frame Rate;25;\n"]
)
def test_lines_before_the_titles_tell_the_frame_rate(put, before):
    """As PeTrack and loggers write them."""
    rows = "".join(f"{n},{name},0.{n},1.2,{k}\n" for n in range(3) for k, name in enumerate(("hip", "knee")))
    take = read_take(put("rows.csv", f"{before}frame,marker,x,y,z [cm]\n{rows}"))
    assert (take.rate, take.names) == (25.0, ("hip", "knee"))
    assert take.positions[2].tolist() == [[2.0, 12.0, 0.0], [2.0, 12.0, 10.0]]
    assert not any("frame rate" in notice for notice in take.notices)


@pytest.mark.parametrize("before", ["# angle units: deg\n", "# force unit: N\n", "Mass unit,kg\n"])
def test_units_before_the_titles_that_are_none_of_length_are_told(put, before):
    rows = "".join(f"{n},{name},0.{n},1.2,{k}\n" for n in range(3) for k, name in enumerate(("hip", "knee")))
    take = read_take(put("rows.csv", f"{before}frame,marker,x,y,z\n{rows}"), recorded_unit="m")
    assert take.positions[2].tolist() == [[200.0, 1200.0, 0.0], [200.0, 1200.0, 1000.0]]
    assert any("is none of length" in notice for notice in take.notices)


def test_times_count_more_than_a_rate_before_the_titles(put):
    rows = "".join(f"{n / 100},{name},{n},2,{k}\n" for n in range(9) for k, name in enumerate(("hip", "knee")))
    take = read_take(put("rows.csv", f"# video fps: 25\ntime,marker,x,y,z\n{rows}"))
    assert take.rate == pytest.approx(100.0)


@pytest.mark.parametrize("title", ["{}", "{},,,"])
def test_tables_of_a_point_each_with_frames_are_no_cloud(put, title):
    tables = [title.format(name) + "\nframe,x,y,z\n1,2,3,4\n2,3,4,5\n" for name in ("hip", "knee")]
    assert read_take(put("points.csv", "".join(tables))).names == ("hip", "knee")
