"""Tables of bodies: points with quaternions or angles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skelgen_formats.registry import read_take, write_file

from skelgen.model import Poses


def two_rows(titles: str, cells: str) -> str:
    """A table of a thigh and a shank at 100 Hz, with the same cells twice."""
    names = ",".join(titles.format(n=name) for name in ("thigh", "shank"))
    return f"time,{names}\n" + "".join(f"{t},{cells}\n" for t in (0, 0.01))


@pytest.mark.parametrize(
    "titles",
    [
        "{n}_x,{n}_y,{n}_z,{n}_qx,{n}_qy,{n}_qz,{n}_qw",
        "{n}.pose.position.x,{n}.pose.position.y,{n}.pose.position.z,"
        "{n}.pose.orientation.x,{n}.pose.orientation.y,{n}.pose.orientation.z,{n}.pose.orientation.w",
        "{n} Pos X,{n} Pos Y,{n} Pos Z,{n} Rot X,{n} Rot Y,{n} Rot Z,{n} Rot W",
        "{n}-px,{n}-py,{n}-pz,{n}-qx,{n}-qy,{n}-qz,{n}-qw",
        "tx_{n},ty_{n},tz_{n},qx_{n},qy_{n},qz_{n},qw_{n}",
        "{n}_pos_x,{n}_pos_y,{n}_pos_z,"
        "{n}_orientation_Quat_x,{n}_orientation_Quat_y,{n}_orientation_Quat_z,{n}_orientation_Quat_w",
    ],
)
def test_points_with_quaternions_are_bodies(put, titles):
    take = read_take(put("bodies.csv", two_rows(titles, "0.1,0.2,0.3,0,0,0,1,0.4,0.5,0.6,0,0,0.6,0.8")))
    assert (take.rate, [name.partition(".")[0] for name in take.names]) == (100.0, ["thigh", "shank"])
    np.testing.assert_allclose(take.world_from_body[1, 1, :3, 3], [400, 500, 600])
    np.testing.assert_allclose(take.world_from_body[1, 1, :2, 0], [0.28, 0.96])


def test_axes_may_stand_before_the_words_of_a_single_body(put):
    titles = "Frame time(ms),x position,y position,z position,w rotation,x rotation,y rotation,z rotation"
    take = read_take(put("body.csv", f"{titles}\n0,1,2,3,0.8,0,0,0.6\n8,1,2,3,0.8,0,0,0.6\n"))
    assert (take.names, take.rate) == (("body",), pytest.approx(125.0))
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0.28, 0.96])


def test_body_that_a_tracker_lost_is_unseen(put):
    """NatNet gives place 0, 0, 0 and no rotation; a body that never leaves the origin is there."""
    titles = ",".join(f"{name}_{axis}" for name in ("base", "hand") for axis in ("x", "y", "z", "qx", "qy", "qz", "qw"))
    row = "0,0,0,0,0,0,1,{0},{0},{0},0,0,0,1\n"
    take = read_take(put("lost.csv", f"{titles}\n{row.format(1)}{row.format(0)}"))
    assert np.isnan(take.world_from_body[:, :, 0, 0]).tolist() == [[False, False], [False, True]]


def test_tools_of_ndi_are_bodies_beside_their_markers(put):
    tool = "Frame#,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error,Marker0.Status,Tx,Ty,Tz,Marker1.Status,Tx,Ty,Tz"
    row = "7,1,0,0,0,10,20,300,0.1,OK,11,21,301,OK,12,20,302"
    path = put("tools.csv", f"Tools,{tool},{tool}\n" + f"2,{row},{row}\n" * 2)
    assert read_take(path).n_markers == 4
    assert read_take(path, bodies=True).names == ("body", "body_2")


ROLL = "{n}_x,{n}_y,{n}_z,{n}_roll (deg),{n}_pitch (deg),{n}_yaw (deg)"
NAVIGATED = [[0, -1, 0], [0.5, 0, 0.75**0.5], [-(0.75**0.5), 0, 0.5]]  # by hand: R = Rz(90) Ry(60) Rx(0), below


@pytest.mark.parametrize(
    "titles",
    [
        ROLL,
        "{n}_x,{n}_y,{n}_z,{n}_roll,{n}_pitch,{n}_yaw",
        "{n} X [m],{n} Y [m],{n} Z [m],{n} Roll,{n} Pitch,{n} Yaw",
    ],
)
def test_roll_pitch_and_yaw_turn_bodies(put, titles):
    take = read_take(put("bodies.csv", two_rows(titles, "0.1,0.2,0.3,10,20,30,0.4,0.5,0.6,0,60,90")))
    assert (take.rate, take.names) == (100.0, ("thigh", "shank"))
    np.testing.assert_allclose(take.world_from_body[1, 1, :3, :3], NAVIGATED, atol=1e-12)
    assert any("R = Rz Ry Rx" in notice for notice in take.notices)


@pytest.mark.parametrize("order", ["auto", "vector", "zyx"])
@pytest.mark.parametrize(
    "titles", ["{n}_tx,{n}_ty,{n}_tz,{n}_rx,{n}_ry,{n}_rz", "{n}PosX,{n}PosY,{n}PosZ,{n}RotX,{n}RotY,{n}RotZ"]
)
def test_angles_about_axes_turn_bodies_in_the_stated_order(put, titles, order):
    text = ",".join(titles.format(n=name) for name in ("thigh", "shank")) + "\n" + "1,2,3,1.5,0,0.5,4,5,6,0,0,0\n" * 2
    take = read_take(put("bodies.csv", text), angle_order=order)
    expected = {
        "auto": Rotation.from_euler("XYZ", [1.5, 0, 0.5]),
        "zyx": Rotation.from_euler("ZYX", [0.5, 0, 1.5]),
        "vector": Rotation.from_rotvec([1.5, 0, 0.5]),
    }
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], expected[order].as_matrix(), atol=1e-12)


def test_bodies_without_names_have_the_angles_beside_their_places(put):
    text = "Frame,Tx,Ty,Tz,Rx,Ry,Rz,Tx,Ty,Tz,Rx,Ry,Rz\n" + "1,1,2,3,0,0,0,4,5,6,0,0,90\n" * 2
    take = read_take(put("bodies.csv", text))
    np.testing.assert_allclose(take.world_from_body[0, :, 0, 0], [1, 0], atol=1e-12)


def test_order_of_the_columns_is_that_of_the_axes(put):
    """NDI writes the angles of a tool before its place, z first, and the tool's markers behind it."""
    tool = "Frame,Rz,Ry,Rx,Tx,Ty,Tz,Error,Marker1 Status,Tx,Ty,Tz"
    row = "1,90,60,0,1,2,3,0.1,OK,4,5,6"
    take = read_take(put("tools.csv", f"{tool},{tool}\n" + f"{row},{row}\n" * 2), bodies=True)
    np.testing.assert_allclose(take.world_from_body[0, :, :3, :3], [NAVIGATED] * 2, atol=1e-12)
    np.testing.assert_array_equal(take.world_from_body[0, :, :3, 3], [[1000, 2000, 3000]] * 2)


def test_names_may_stand_over_places_and_angles(put):
    text = ",thigh,,,,,,shank\nFrame,X,Y,Z,RX,RY,RZ,X,Y,Z,RX,RY,RZ\n" + "1,1,2,3,0,0,0,4,5,6,0,0,90\n" * 2
    take = read_take(put("bodies.csv", text))
    assert take.names == ("thigh", "shank")
    np.testing.assert_allclose(take.world_from_body[0, :, 0, 0], [1, 0], atol=1e-12)


def test_angles_are_left_out_where_points_are_asked_for(put):
    titles = ",".join(f"{name}_pos_{axis},{name}_rot_{axis}" for name in ("thigh", "shank") for axis in "xyz")
    path = put("euler.csv", f"{titles}\n" + "1,90,2,90,3,90,4,90,5,90,6,90\n" * 2)
    take = read_take(path, points="markers")
    assert take.names == ("thigh", "shank")
    assert "rotations other than unit quaternions are left out: thigh, shank" in take.notices


def test_angles_beside_places_are_no_points(put):
    text = "Rx,Ry,Rz,a_tx,a_ty,a_tz,a_rx,a_ry,a_rz,b_x,b_y,b_z\n" + "9,8,7,100,200,300,1,2,3,400,500,600\n" * 2
    assert read_take(put("angles.csv", text)).names == ("a", "b")


def test_orders_in_which_bodies_do_not_jump_are_named(put):
    """A body turns through gimbal lock of z-x-y, which its angles are about, though their columns are x, y, z."""
    times = np.linspace(0, 10, 1000)[:, np.newaxis]
    turned = Rotation.from_rotvec(3.0 * np.sin(times * [0.7, 1.4, 2.1] + [0, 1, 2]))
    angles = turned.as_euler("ZXY")[:, [1, 2, 0]].tolist()
    titles = ",".join(f"{name}_{axis}" for name in ("thigh", "shank") for axis in ("x", "y", "z", "rx", "ry", "rz"))
    rows = [",".join(["1,2,3", *map(str, angle), "4,5,6,0,0,0"]) for angle in angles]
    path = put("jump.csv", f"{titles}\n" + "\n".join(rows))
    assert any(notice.endswith("smoothly with `--angle-order zxy`") for notice in read_take(path).notices)
    assert not any("smoothly" in notice for notice in read_take(path, angle_order="zxy").notices)


@pytest.mark.parametrize("cell", ["_r{0}{1}", "_R[{0}][{1}]", "_rot_{0}_{1}", " mat({0},{1})"])
@pytest.mark.parametrize("first", [0, 1])
def test_matrices_in_columns_turn_bodies(put, cell, first):
    cells = [cell.format(row, column) for row in range(first, first + 3) for column in range(first, first + 3)]
    titles = ",".join(f'"{name}{end}"' for name in ("thigh", "shank") for end in ("_x", "_y", "_z", *cells))
    row = "1,2,3,0,-1,0,1,0,0,0,0,1,4,5,6,0,0,0,0,0,0,0,0,0\n"
    take = read_take(put("matrices.csv", f"{titles}\n{row}{row.replace('0,0,0,0,0,0,0,0,0', '1,0,0,0,1,0,0,0,1')}"))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert np.isnan(take.world_from_body[:, 1, 0, 0]).tolist() == [True, False]


def test_poses_of_limbs_that_skelgen_wrote_as_a_table_come_back(make_project, tmp_path):
    project = make_project(n_frames=5)
    paths = write_file(project, tmp_path / "walk.table.csv")
    take = read_take(next(path for path in paths if ".limbs." in path.name))
    assert set(take.names) == {*project.skeleton.limb_names}
    order = [take.names.index(name) for name in project.skeleton.limb_names]
    np.testing.assert_allclose(take.world_from_body[:, order], project.motion.world_from_limb, atol=1e-6)


def test_matrix_without_a_name_belongs_to_the_place_beside_it(put):
    cells = ",".join(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
    take = read_take(put("one.csv", f"time,{cells},tx,ty,tz\n" + "0,0,-1,0,1,0,0,0,0,1,1,2,3\n" * 2))
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, :], [[0, -1, 0, 1000], [1, 0, 0, 2000]], atol=1e-9)


def test_axes_of_a_body_without_its_position_are_no_points(refused, put):
    content = "X1,X2,X3,Y1,Y2,Y3,Z1,Z2,Z3\n" + "0.6,-0.8,0,0.8,0.6,0,0,0,1\n" * 2
    assert "axes of a body without its position" in refused(put("axes.csv", content))
    assert read_take(put("points.csv", content.replace("0.6,-0.8", "0.6,-0.9"))).names == ("1", "2", "3")


ASL = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"


@pytest.mark.parametrize("more", ["", ", v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"])
def test_trajectory_of_euroc_is_a_body(put, more):
    rows = "".join(f"{stamp},1,2,3,0.6,0,0,0.8{',0' * more.count('x') * 3}\n" for stamp in (10**18, 10**18 + 5_000_000))
    take = read_take(put("data.csv", f"{ASL}{more}\n{rows}"))
    assert (take.names, take.rate) == (("body",), pytest.approx(200.0))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [1000, 2000, 3000])
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [-0.28, 0.96])


def test_body_without_a_rotation_is_unseen(put):
    take = read_take(put("data.csv", f"{ASL}\n1000000000,1,2,3,0,0,0,0\n1010000000,1,2,3,1,0,0,0\n"))
    assert np.isnan(take.world_from_body[:, 0, 0, 0]).tolist() == [True, False]


QUARTER = [0, -1, 0, 1, 0, 0, 0, 0, 1]  # Rz(90), row by row


@pytest.mark.parametrize(
    ("cell", "first", "by_rows"),
    [("{n}_rot_{k}", 0, True), ("{n} R({k})", 1, True), ("{n}_dcm{k}", 0, True), ("{n} Rot[{k}]", 0, False)],
)
def test_matrices_of_numbered_cells_turn_bodies(put, cell, first, by_rows):
    """Track Manager calls cells Rot[0] to Rot[8], column by column."""
    titles = "{n}_x,{n}_y,{n}_z," + ",".join(cell.replace("{k}", str(k)) for k in range(first, first + 9))
    matrix = np.reshape(QUARTER, (3, 3))
    cells = ",".join(map(str, (matrix if by_rows else matrix.T).ravel()))
    take = read_take(put("flat.csv", two_rows(titles, f"100,2,3,{cells},400,5,6,{cells}")))
    np.testing.assert_allclose(take.world_from_body[:, :, :3, :3], np.broadcast_to(matrix, (2, 2, 3, 3)), atol=1e-12)
    assert any("row by row" in notice for notice in take.notices) == by_rows


def test_bodies_of_ros_2_have_the_names_in_their_cells(put):
    pose = "rigidbodies{0}.pose.position.{1},rigidbodies{0}.pose.orientation.{1}"
    poses = [",".join(pose.format(n, axis) for axis in "xyz") + f",rigidbodies{n}.pose.orientation.w" for n in (0, 1)]
    titles = ",".join(f"rigidbodies{n}.rigid_body_name,{poses[n]}" for n in (0, 1))
    take = read_take(put("ros2.csv", f"{titles}\n" + 2 * "thigh,1,0,2,0,3,0,1,shank,1,0,2,0,4,0,1\n"))
    assert take.names == ("thigh", "shank")


def test_rotations_of_others_than_the_points_are_told(put):
    titles = "a_x,a_y,a_z,b_x,b_y,b_z,torso_qw,torso_qx,torso_qy,torso_qz"
    take = read_take(put("torso.csv", f"{titles}\n" + "1,2,3,4,5,6,1,0,0,0\n" * 2))
    assert "rotations without positions are left out: torso" in take.notices


@pytest.mark.parametrize("first", [0, 1])
def test_poses_of_four_rows_and_columns_are_bodies(put, first):
    pose = np.array([[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]])
    cells = [f"{{n}}_m{row + first}{column + first}" for row in range(4) for column in range(4)]
    values = ",".join(map(str, [*pose.ravel(), *pose.ravel()]))
    take = read_take(put("poses.csv", two_rows(",".join(cells), values)), recorded_unit="mm")
    assert take.names == ("thigh", "shank")
    np.testing.assert_allclose(take.world_from_body[0, 1], pose, atol=1e-12)


def test_components_of_quaternions_may_be_numbered(put):
    titles = "{n}_x,{n}_y,{n}_z,{n}_q0,{n}_q1,{n}_q2,{n}_q3"
    take = read_take(put("numbered.csv", two_rows(titles, "1,2,3,1,0,0,0,4,5,6,0.8,0,0,0.6")))
    np.testing.assert_allclose(take.world_from_body[1, 1, :2, 0], [0.28, 0.96])


def test_angles_of_unity_turn_about_y_x_and_z(put):
    titles = ",".join(f"{{n}}.{what}.{axis}" for what in ("position", "eulerAngles") for axis in "xyz")
    take = read_take(put("unity.csv", two_rows(titles, "1,2,3,10,20,330,4,5,6,10,20,330")))
    expected = Rotation.from_euler("YXZ", [20, 10, 330], degrees=True).as_matrix()
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, :3], expected, atol=1e-12)


def test_bodies_of_track_manager_without_its_header_are_read(put):
    titles = [f"ship {axis}" for axis in "XYZ"] + ["ship Roll", "ship Pitch", "ship Yaw", "ship Residual"]
    titles += [f"ship Rot[{k}]" for k in range(9)]
    rows = "".join(f"{n}\t{n / 100}\t1\t2\t3\t0\t0\t90\t0.1\t0\t1\t0\t-1\t0\t0\t0\t0\t1\n" for n in (1, 2))
    take = read_take(put("6d.tsv", "Frame\tTime\t" + "\t".join(titles) + "\n" + rows))
    assert take.names == ("ship",)
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0, 1], atol=1e-12)


def test_angles_may_have_a_word_of_their_own(put):
    """As loggers of the Unreal engine write them."""
    titles = "{n}_Loc_X,{n}_Loc_Y,{n}_Loc_Z,{n}_Rot_Pitch,{n}_Rot_Yaw,{n}_Rot_Roll"
    take = read_take(put("unreal.csv", two_rows(titles, "0.1,0.2,0.3,0,90,0,0.4,0.5,0.6,0,0,0")))
    assert take.names == ("thigh", "shank")
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0, 1], atol=1e-9)


def test_rotations_that_are_read_are_not_told_to_be_left_out(put):
    titles = ",".join(f"X{n},Y{n},Z{n},qo{n},qx{n},qy{n},qz{n}" for n in "ab")
    take = read_take(put("aurora.csv", f"{titles}\n" + "1,2,3,1,0,0,0,4,5,6,1,0,0,0\n" * 2))
    assert take.n_bodies == 2
    assert not any("left out" in notice for notice in take.notices)


def test_bodies_whose_titles_stand_again_have_the_names_in_their_cells(put):
    """A recorder of the Kinect repeats all titles for each joint, and names it in a cell before its place."""
    joint = "Joint,Status,PositionX,PositionY,PositionZ,RotationW,RotationX,RotationY,RotationZ"
    row = "Hip,TRACKED,0.1,0.2,0.3,1,0,0,0,Knee,INFERRED,0.4,0.5,0.6,0.8,0,0,0.6"
    take = read_take(
        put("kinect.csv", f"EventIndex,Time,{joint},{joint}\n" + "".join(f"{n},{n / 50},{row}\n" for n in (0, 1)))
    )
    assert (take.names, take.rate) == (("Hip", "Knee"), 50.0)
    np.testing.assert_allclose(take.world_from_body[1, 1, :3, 3], [400, 500, 600])
    np.testing.assert_allclose(take.world_from_body[1, 1, :2, 0], [0.28, 0.96])


@pytest.mark.parametrize(
    "title", ["{n}_r{c}", "quat_{n}_{c}", "quat_{c}_{n}", "{n}_{c}quat", "{n}_att_{c}", "rot_{c}_{n}"]
)
def test_quaternions_may_be_titled_in_other_ways(put, title):
    columns = [f"{n}_{a}" for n in "ab" for a in "xyz"] + [title.format(n=n, c=c) for n in "ab" for c in "xyzw"]
    rows = "".join(f"{n},2,3,4,5,6,0,0,0.6,0.8,0,0,0,1\n" for n in range(3))
    take = read_take(put("bodies.csv", ",".join(columns) + "\n" + rows))
    assert isinstance(take, Poses)
    assert take.names == ("a", "b")
    np.testing.assert_allclose(take.world_from_body[0, 0, 1, 0], 0.96)


@pytest.mark.parametrize("title", ["{w}_{n}", "rot_{a}_{n}", "{n}_{a}_rot", "euler_{n}_{a}"])
def test_angles_may_be_titled_in_other_ways(put, title):
    turns = [title.format(n=n, a=a, w=w) for n in "ab" for a, w in (("x", "roll"), ("y", "pitch"), ("z", "yaw"))]
    columns = [f"{n}_{a}" for n in "ab" for a in "xyz"] + turns
    rows = "".join(f"{n},2,3,4,5,6,0,0,90,0,0,{n}\n" for n in range(3))
    take = read_take(put("bodies.csv", ",".join(columns) + "\n" + rows))
    assert isinstance(take, Poses)
    np.testing.assert_allclose(take.world_from_body[0, 0, 1, 0], 1.0)


@pytest.mark.parametrize("titles", ["x,y,z,x.1,y.1,z.1,w", "x,y,z,x,y,z,w"])
def test_x_y_z_and_w_right_behind_a_place_are_its_quaternion(put, titles):
    rows = "".join(f"{n / 50},{n},2,3,0,0.6,0,0.8\n" for n in range(1, 4))
    take = read_take(put("bag.csv", f"Time,{titles}\n{rows}"))
    np.testing.assert_allclose(take.world_from_body[:, 0, :3, 3], [[1000 * n, 2000, 3000] for n in range(1, 4)])
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 0], [0.28, 0, -0.96], atol=1e-12)


@pytest.mark.parametrize(
    "titles", ["x,y,z,w,x,y,z,x,y,z,w,x,y,z", "x,y,z,x.1,y.1,z.1,w,x.2,y.2,z.2,x.3,y.3,z.3,w.1,x.4"]
)
def test_x_y_z_and_w_of_unlike_order_are_left_as_points(put, titles):
    cells = ",".join(f"{0.1 * n:.1f}" for n in range(titles.count(",") + 1))
    take = read_take(put("bag.csv", f"Time,{titles}\n" + "".join(f"{n / 50},{cells}\n" for n in range(3))))
    assert take.names == ("0", "1", "2", "3")


def test_positions_and_rotations_below_names_tell_their_columns(put):
    names = "Frame,Time," + ",".join(n for n in "AB" for _ in range(7))
    kinds = ",," + ",".join(["Rotation"] * 4 + ["Position"] * 3 + ["Rotation"] * 4 + ["Position"] * 3)
    rows = "".join(f"{n},{n / 50},0,0,0.6,0.8,1,2,3,0,0,0.6,0.8,4,5,{n}\n" for n in range(3))
    take = read_take(put("rows.csv", f"{names}\n{kinds}\n,,{','.join('XYZWXYZ' * 2)}\n{rows}"))
    assert (take.names, take.rate) == (("A", "B"), pytest.approx(50.0))


@pytest.mark.parametrize(
    ("names", "quantities", "axes"),
    [
        (",,hand,,,,,,", ",,Position,,,Rotation,,,", "Frame,Time,X,Y,Z,X,Y,Z,W"),
        (",,hand,hand,hand,hand,hand,hand,hand", ",,Pos,Pos,Pos,Quat,Quat,Quat,Quat", "Frame,Time,X,Y,Z,X,Y,Z,W"),
        (",,hand,,,,,,", ",,Rotation,,,,Position,,", "Frame,Time,W,X,Y,Z,X,Y,Z"),
        (",,hand,,,,,,", None, "Frame,Time,X,Y,Z,X,Y,Z,W"),
    ],
)
def test_one_name_may_stand_over_place_and_rotation(put, names, quantities, axes):
    cells = {"Rotation": "0.8,0,0,0.6,100,200,300", "Position": "100,200,300,0,0,0.6,0.8"}
    row = cells["Rotation" if axes.startswith("Frame,Time,W") else "Position"]
    head = "\n".join(filter(None, [names, quantities, axes]))
    take = read_take(put("hand.csv", head + f"\n0,0.00,{row}\n1,0.02,{row}\n"))
    assert (take.names, take.rate) == (("hand",), pytest.approx(50.0))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [100, 200, 300])
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0.28, 0.96])


def test_one_name_may_stand_over_place_and_angles_with_their_units(put):
    head = ",hand,,,,,\n,Position (m),,,Rotation (deg),,\nTime,X,Y,Z,X,Y,Z\n"
    take = read_take(put("hand.csv", head + "0,0.1,0.2,0.3,0,0,90\n0.02,0.1,0.2,0.3,0,0,90\n"))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [100, 200, 300])
    np.testing.assert_allclose(take.world_from_body[0, 0, :2, 0], [0, 1], atol=1e-12)


@pytest.mark.parametrize("names", ["", ",a,,,b,,,\n", ",a,a,a,b,b,b,\n"])
def test_w_behind_two_points_is_a_weight_where_it_makes_no_unit_quaternion(put, names):
    rows = "".join(f"{n / 50},1,2,3,40,50,6{n},0.9\n" for n in range(3))
    take = read_take(put("weight.csv", f"{names}time,x,y,z,x,y,z,w\n{rows}"))
    assert (take.rate, take.names) == (pytest.approx(50.0), ("a", "b") if names else ("0", "1"))
    np.testing.assert_allclose(take.positions[2], np.array([[1, 2, 3], [40, 50, 62]]) * 1.0)


@pytest.mark.parametrize("title", ["{}_{axis}", "{}[{at}]", "{}{at}", "{}_{at}"])
@pytest.mark.parametrize("order", [("tvec", "rvec"), ("rvec", "tvec")])
def test_vectors_of_opencv_are_a_place_and_a_rotation(put, title, order):
    titles = [title.format(word, axis=axis, at=at) for word in order for at, axis in enumerate("xyz")]
    vectors = {"tvec": "0.1,0.2,0.3", "rvec": f"0,0,{np.pi / 2:.6f}"}
    cells = ",".join(vectors[word] for word in order)
    rows = "".join(f"{n / 50},{marker},{cells}\n" for n in range(3) for marker in (4, 7))
    take = read_take(put("aruco.csv", f"time,marker_id,{','.join(titles)}\n{rows}"))
    assert (take.names, take.rate) == (("4", "7"), pytest.approx(50.0))
    np.testing.assert_allclose(take.world_from_body[1, 1, :3, 3], [100, 200, 300])
    np.testing.assert_allclose(take.world_from_body[1, 1, :2, 0], [0, 1], atol=1e-6)
