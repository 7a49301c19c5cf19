"""What the 3-D view takes from a project for a frame, and where it finds what is meant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_gui.model.picture import N_AGES, Canvas, take_picture, trail_lines
from skelgen_gui.model.scene import Scene, State, joint_covariances
from skelgen_gui.model.selection import BONE, JOINT, MARKER, Pick, distances_to_lines, markers_within, pick
from skelgen_gui.model.view_camera import find_floor, round_step
from skelgen_gui.model.view_state import Shown
from skelgen_gui.model.viewpoint import DOWN, Viewpoint
from skelgen_gui.model.wording import about

from skelgen.app.drawing.poses import find_bones
from skelgen.model import PointCloud, Poses, Project, Trajectories

ROUNDING = 1e-9


@pytest.fixture
def scene(walked):
    return Scene(walked[0])


@pytest.fixture
def picture(scene):
    """Frame 20 of `walked`, looked at from obliquely before it."""
    return picture_of(scene, Shown())


def picture_of(scene, shown):
    viewpoint = Viewpoint(azimuth=0.5, elevation=0.2).fitted(scene.inliers, 900, 700)
    return take_picture(scene.at(20), Canvas(viewpoint, 900, 700), shown, 50.0, 20)


def chain_edges(n_limbs):
    return np.array([[limb, limb + 1] for limb in range(n_limbs - 1)], dtype=np.intp).reshape(-1, 2)


def test_markers_are_where_they_were_measured_and_else_where_the_skeleton_places_them(scene, walked):
    project = walked[0]
    for frame in range(0, 400, 37):
        snapshot, seen = scene.at(frame), project.trajectories.seen[frame]
        assert (snapshot.markers[seen] == project.trajectories.positions[frame, seen]).all()
        assert (snapshot.markers[~seen] == project.motion.marker_positions[frame, ~seen]).all()
        assert ((snapshot.state == State.FILLED) == ~seen).all()


def test_markers_of_low_confidence_are_doubtful(walked):
    project = walked[0]
    confidence = np.where(np.isnan(project.labelling.confidence), np.nan, 1.0)
    confidence[20, :3] = np.where(np.isnan(confidence[20, :3]), np.nan, 0.5)
    doubtful = replace(project, _labelling=replace(project.labelling, confidence=confidence))
    seen = project.trajectories.seen[20, :3]
    assert seen.any()
    state = Scene(doubtful).at(20).state
    assert (state[:3][seen] == State.DOUBTFUL).all()
    assert (state[3:] != State.DOUBTFUL).all()


def test_before_the_first_stage_points_are_loose_and_markers_have_no_limb(walked):
    project = walked[0]
    labelled = Scene(Project(project.take))
    assert (labelled.limb_of_marker == -1).all()
    assert not (labelled.at(0).state == State.FILLED).any()
    cloud = Scene(Project(PointCloud(np.arange(9.0).reshape(3, 3), np.array([0, 2, 3]), np.array([0.0, 0.01]))))
    assert cloud.n_markers == 0
    assert cloud.at(0).unlabelled.shape == (2, 3)
    bodies = Scene(Project(Poses(np.broadcast_to(np.eye(4), (3, 2, 4, 4)), ("left", "right"), 100.0)))
    assert bodies.at(0).unlabelled.shape == (2, 3)


def test_variances_are_those_of_the_motion_or_else_turn_with_the_parents(walked):
    project, frames = walked[0], np.array([7, 300])
    variances = np.einsum("fjii->fji", joint_covariances(project, frames))
    assert variances == pytest.approx(project.motion.joint_std[frames] ** 2)
    without = replace(project, _motion=replace(project.motion, joint_std=None))
    traces = np.trace(joint_covariances(without, frames), axis1=2, axis2=3)
    assert traces == pytest.approx(np.tile([float((joint.std**2).sum()) for joint in project.skeleton.joints], (2, 1)))


def test_ellipsoids_of_joints_hold_their_true_places_as_often_as_they_claim(walked):
    project, truth = walked
    frames = np.arange(0, 400, 10)
    nearest = np.linalg.norm(
        project.motion.joint_positions[0, :, np.newaxis] - truth.joint_positions[0, np.newaxis], axis=2
    ).argmin(axis=1)
    balls = [index for index, joint in enumerate(project.skeleton.joints) if joint.kind == "ball"]
    error = (project.motion.joint_positions[frames] - truth.joint_positions[frames][:, nearest])[:, balls]
    covariances = joint_covariances(project, frames)[:, balls]
    squares = np.einsum("fji,fji->fj", error, np.linalg.solve(covariances, error[..., np.newaxis])[..., 0])
    assert 0.85 < (squares < 7.815).mean() <= 1.0  # the 95 % point of chi-squared with three degrees of freedom


def test_the_covariances_of_a_frame_are_those_of_its_block(walked):
    scene = Scene(walked[0])
    for frame in (399, 0, 63, 64, 130, 200, 260, 0):
        assert scene.at(frame).covariances == pytest.approx(joint_covariances(walked[0], np.array([frame]))[0])


def test_axes_of_hinges_are_those_of_the_simulation(scene, walked):
    project, truth = walked
    snapshot, compared = scene.at(50), 0
    for (place, direction), joint in zip(snapshot.axes, scene.axis_joints.tolist(), strict=True):
        if project.skeleton.joints[joint].kind != "hinge":
            continue
        true = np.argmin(np.linalg.norm(truth.joint_positions[50] - place, axis=1))
        assert abs(direction @ truth.joint_axes[50, true]) > np.cos(np.radians(5))
        compared += 1
    assert compared


@pytest.mark.parametrize(
    ("edges", "limb_of_marker", "bones"),
    [
        (
            chain_edges(3),
            [0, 1, 2, 2],
            {(0, 2), (0, 1), (1, 8), (8, 4), (8, 5)},
        ),  # two joints; markers 2 .. 5, middles 6 .. 8
        (chain_edges(1), [0, 0], {(2, 0), (2, 1)}),  # a limb alone: from its middle
        (np.array([[0, 1], [0, 2], [0, 3]]), [0, 1, 2, 3, -1], {(8, 0), (8, 1), (8, 2), (0, 4), (1, 5), (2, 6)}),
    ],
)
def test_bones_go_between_joints_and_end_limbs_end_amid_their_markers(edges, limb_of_marker, bones):
    found = find_bones(edges, np.array(limb_of_marker))
    assert {(int(start), int(end)) for start, end in found.ends} == bones


def test_a_trunk_is_drawn_alike_whichever_of_its_neighbours_it_hangs_on():
    limbs = np.array([0, 1, 2, 3])
    hanging = find_bones(np.array([[1, 0], [0, 2], [0, 3]]), limbs)  # limb 0 has three joints; middles begin with 7
    assert {(7, 0), (7, 1), (7, 2)} == {tuple(ends) for ends in hanging.ends.tolist() if 7 in ends}


def test_a_bone_that_starts_in_the_middle_of_a_limb_starts_between_its_joints():
    joints = np.array([[0.0, 0, 0], [4, 0, 0], [0, 8, 0]])
    bones = find_bones(np.array([[0, 1], [0, 2], [0, 3]]), np.array([0, 1, 2, 3]))
    middle = bones.place(joints, np.zeros((4, 3)))[0, 0]
    assert middle == pytest.approx(joints.mean(axis=0))


def test_trails_end_in_the_frame_and_their_other_points_stay_while_it_moves_on(walked):
    project = walked[0]
    fine = replace(project.trajectories, rate=1000.0)  # 400 frames: a trail of 0.3 s takes every fourth
    scene = Scene(Project(fine))
    trails = [scene.trail(frame, 0.3) for frame in (350, 351)]
    assert np.array_equal(trails[0][-1], fine.positions[350], equal_nan=True)
    assert np.array_equal(trails[0][1:-1], trails[1][1:-1], equal_nan=True)


def test_the_past_of_points_without_names_is_that_of_the_frames_before(walked):
    points = np.arange(30.0).reshape(10, 3)
    cloud = Scene(Project(PointCloud(points, np.array([0, 2, 4, 7, 10]), np.arange(4) / 100)))
    assert np.array_equal(cloud.past_points(3, 0.02), points[2:7])
    assert len(cloud.past_points(0, 1.0)) == 0
    assert len(Scene(walked[0]).past_points(3, 1.0)) == 0


def test_trails_break_where_a_marker_is_unseen_and_are_parted_by_limb_and_age():
    places = np.zeros((9, 3, 2))
    places[:, :, 0] = np.arange(9)[:, np.newaxis]
    places[4, 0] = np.nan
    parts = trail_lines(places, np.array([1, 0, 1]))
    assert [(limb, age) for limb, age, _ in parts] == [(limb, age) for limb in (0, 1) for age in range(N_AGES)]
    assert sum(len(lines) for limb, _, lines in parts if limb == 0) == 8
    assert sum(len(lines) for limb, _, lines in parts if limb == 1) == 16 - 2
    assert all((lines[:, 1, 0] - lines[:, 0, 0] == 1).all() for _, _, lines in parts)


def test_the_axis_that_points_up_is_found(walked):
    project = walked[0]
    assert Scene(project).up == 2
    turned = project.take.positions[:, :, [1, 2, 0]]  # z becomes y
    assert Scene(Project(replace(project.take, positions=turned))).up == 1


def test_the_floor_lies_below_what_is_seen_and_reaches_beyond_it(scene):
    floor = find_floor(scene.sample, scene.inliers, scene.size, scene.up)
    corners = floor.lines.reshape(-1, 3)
    assert floor.height <= np.nanpercentile(scene.sample[..., 2], 1)
    assert (corners[:, :2].min(axis=0) < scene.inliers[:, :2].min(axis=0)).all()
    assert (corners[:, :2].max(axis=0) > scene.inliers[:, :2].max(axis=0)).all()
    assert np.linalg.norm(floor.lines[:, 1] - floor.lines[:, 0], axis=1) == pytest.approx(floor.spacing)


@pytest.mark.parametrize(("value", "step"), [(1.0, 1), (1.99, 1), (2.0, 2), (730, 500), (0.034, 0.02), (10, 10)])
def test_steps_are_one_two_or_five(value, step):
    assert round_step(value) == pytest.approx(step)


def test_what_is_hidden_cannot_be_picked(scene):
    everything, nothing = picture_of(scene, Shown()), picture_of(scene, Shown(False, False, joints=False, bones=False))
    x, y = everything.markers[0]
    assert pick(everything, x, y) is not None
    assert pick(nothing, x, y) is None


def test_what_is_clicked_is_found(picture):
    alone = [
        index
        for index, place in enumerate(picture.markers)
        if np.sort(np.linalg.norm(np.concatenate([picture.markers, picture.joints]) - place, axis=1))[1] > 20
    ]
    assert alone
    for marker in alone:
        assert pick(picture, *(picture.markers[marker] + 3)) == Pick(MARKER, marker)
    assert pick(picture, 1.0, 1.0) is None


def test_of_two_that_cover_each_other_the_one_in_front_is_meant(picture):
    places, depths = picture.markers.copy(), picture.marker_depths.copy()
    places[1], depths[:2] = places[0], [2000.0, 1000.0]
    assert pick(replace(picture, markers=places, marker_depths=depths), *places[0]) == Pick(MARKER, 1)


def test_joints_come_before_bones_and_bones_are_met_along_their_length(picture):
    alone = replace(picture, markers=np.full_like(picture.markers, np.nan))
    joint = alone.joints[2]
    assert pick(alone, *joint).kind == JOINT
    bones = replace(alone, joints=np.full_like(alone.joints, np.nan))
    lengths = np.linalg.norm(bones.bones[:, 1] - bones.bones[:, 0], axis=1)
    longest = int(np.argmax(lengths))
    found = pick(bones, *bones.bones[longest].mean(axis=0))
    assert found.kind == BONE


def test_the_distance_to_a_line_ends_at_its_ends():
    lines = np.array([[[0.0, 0], [10, 0]], [[0, 0], [0, 0]]])
    assert distances_to_lines(lines, np.array([5.0, 3.0]))[0] == pytest.approx(3.0, abs=ROUNDING)
    assert distances_to_lines(lines, np.array([13.0, 4.0])) == pytest.approx([5.0, np.hypot(13, 4)], abs=ROUNDING)


def test_a_rectangle_holds_exactly_the_markers_that_are_drawn_in_it(picture):
    left, top = 380.0, 250.0
    right, bottom = 520.0, 480.0
    x, y = picture.markers.T
    inside = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
    assert 0 < inside.sum() < len(x)
    assert markers_within(picture, left, top, right, bottom) == frozenset(np.flatnonzero(inside).tolist())


def test_an_ellipsoid_of_equal_deviations_is_drawn_as_a_circle_of_their_size(scene):
    snapshot = scene.at(20)
    round_one = replace(snapshot, covariances=np.broadcast_to(4.0 * np.eye(3), snapshot.covariances.shape))
    viewpoint = Viewpoint(azimuth=0.5, elevation=0.2).fitted(scene.inliers, 900, 700)
    picture = take_picture(round_one, Canvas(viewpoint, 900, 700), Shown(uncertainty=True), 50.0, magnification=10)
    radii = np.linalg.norm(picture.ellipses[:, 0] - picture.joints[:, np.newaxis], axis=2)
    wanted = 10 * 2.0 * viewpoint.focal(700) / picture.joint_depths
    assert radii == pytest.approx(np.broadcast_to(wanted[:, np.newaxis], radii.shape))


def test_a_take_in_which_nothing_is_seen_has_no_size():
    unseen = Scene(Project(Trajectories(np.full((5, 2, 3), np.nan), ("a", "b"), 100.0)))
    assert len(unseen.inliers) == 0
    assert unseen.size == 0.0
    assert np.isnan(unseen.middle(0)).all()


def test_the_floor_of_an_axis_that_points_down_lies_where_that_is_largest(scene):
    turn = np.diag([1.0, -1.0, -1.0])
    above = find_floor(scene.sample, scene.inliers, scene.size, 2)
    below = find_floor(scene.sample @ turn, scene.inliers @ turn, scene.size, 2 + DOWN)
    assert below.height == pytest.approx(-above.height)
    assert below.spacing == above.spacing
    assert below.below(np.zeros((1, 3)))[0, 2] == pytest.approx(below.height)


@pytest.mark.parametrize(
    ("path", "up"),
    [
        ("arm/arm-4-2-3_clean_120fps.c3d", 2),
        ("arm/arm-4-4-4_clean_30fps.c3d", 2),
        ("hand/recording.tsv", 2),
        ("human/markers_Squat2.trc", 1),
        ("human/nick_freeform_001.c3d", 1),
        ("mouse/mouse_S15.c3d", 2),
        ("rods_pendulum/pendulum_01.c3d", 2),
        ("wheelchair/racing_full.c3d", 1),
        ("wheelchair/walkingOptiTrack.c3d", 2),
    ],
)
def test_the_axis_that_points_up_is_found_in_recordings(recording, path, up):
    assert Scene(Project(recording(path))).up == up


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"open_directions": 3}, "its place is a choice: the motion does not determine it"),
        ({"is_placed_by_marker_set": True}, "placed by the marker set: the motion does not determine it"),
        (
            {"open_directions": 3, "usual_directions": 3},
            "placed by what is usual of bodies: the motion does not determine it",
        ),
    ],
)
def test_a_joint_that_motion_does_not_determine_is_marked_and_says_who_places_it(walked, changed, words):
    first, *others = (replace(joint, open_directions=0) for joint in walked[0].skeleton.joints)
    skeleton = replace(walked[0].skeleton, joints=(replace(first, **changed), *others))
    scene = Scene(replace(walked[0], _skeleton=skeleton))
    assert scene.open_joints == {0}
    assert words in about(Pick(JOINT, 0), scene, scene.at(0))
