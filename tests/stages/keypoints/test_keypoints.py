"""Keypoints sit on joints: they are told from markers, and the bones between them become the skeleton.

The body of the tests is exact: seventeen joints of a person whose limbs swing, bones of constant length.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.errors import InputError
from skelgen.geometry.keypoints import joint_of_name, keypoint_evidence
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.marker_sets import MARKER_SETS
from skelgen.model import Trajectories
from skelgen.stages.keypoints import find_keypoint_limbs

BONES = {  # point: the one that its bone begins in, and the way to it in mm
    "Hip": ("", (0, 0, 1000)),
    "RHip": ("Hip", (0, -100, 0)),
    "RKnee": ("RHip", (0, 0, -420)),
    "RAnkle": ("RKnee", (0, 0, -410)),
    "RHeel": ("RAnkle", (-50, 0, -60)),
    "RBigToe": ("RAnkle", (150, 0, -60)),
    "LHip": ("Hip", (0, 100, 0)),
    "LKnee": ("LHip", (0, 0, -420)),
    "LAnkle": ("LKnee", (0, 0, -410)),
    "Neck": ("Hip", (0, 0, 500)),
    "Head": ("Neck", (0, 0, 200)),
    "RShoulder": ("Neck", (0, -180, 0)),
    "RElbow": ("RShoulder", (0, 0, -280)),
    "RWrist": ("RElbow", (0, 0, -260)),
    "LShoulder": ("Neck", (0, 180, 0)),
    "LElbow": ("LShoulder", (0, 0, -280)),
    "LWrist": ("LElbow", (0, 0, -260)),
}
STIFF = {"RHip": "Hip", "LHip": "Hip", "RShoulder": "Neck", "LShoulder": "Neck", "RBigToe": "RHeel"}  # turn with it
N_FRAMES = 150
EXACT = 1e-5  # mm: what holds a bone against turning about itself pulls with 1e-9 of its length


@pytest.fixture(scope="module")
def body() -> Trajectories:
    rng, times = np.random.default_rng(2), np.arange(N_FRAMES) / 30.0
    turns, places = {}, {}
    for name, (begin, way) in BONES.items():
        phases, sizes = rng.uniform(0, 6, 3), rng.uniform(0.2, 0.5, 3)
        own = matrix_from_vector(sizes * np.sin(times[:, None] * rng.uniform(2, 5, 3) + phases))
        above = turns[begin] if begin else np.eye(3)
        turns[name] = turns[STIFF[name]] if name in STIFF else above @ own
        places[name] = (places[begin] if begin else 0.0) + turns[name] @ np.array(way, dtype=float)
    return Trajectories(np.stack([*places.values()], axis=1), tuple(places), 30.0, are_keypoints=True)


def estimated(body: Trajectories, noise: float) -> Trajectories:
    """The body as a network sees it, noise in mm."""
    return replace(body, positions=body.positions + np.random.default_rng(0).normal(0, noise, body.positions.shape))


def points_of_limbs(take: Trajectories) -> set[frozenset[str]]:
    limbs = find_keypoint_limbs(take)
    return {frozenset(take.names[point] for point in limbs.markers_of(limb)) for limb in range(limbs.n_limbs)}


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        ("RShoulder", ("r", "shoulder")),
        ("left_hip", ("l", "hip")),
        ("KneeLeft", ("l", "knee")),
        ("ankle_r", ("r", "ankle")),
        ("body:Right Wrist", ("r", "wrist")),
        ("R.Knee.Lat", ("", "")),
        ("LELB", ("", "")),
        ("r_knee_study", ("", "")),
        ("Neck", ("", "")),
    ],
)
def test_joint_is_read_from_the_names_that_tools_give(name, joint):
    assert joint_of_name(name) == joint


def test_keypoints_are_told_by_bones_of_constant_length(body):
    nameless = [f"point {number}" for number in range(body.n_markers)]
    assert "constant length" in keypoint_evidence(nameless, body.positions)


def test_noisy_keypoints_are_told_by_their_names_alone(body):
    noisy = estimated(body, 10.0)
    assert "names" in keypoint_evidence(noisy.names, noisy.positions)
    assert keypoint_evidence([f"p{number}" for number in range(17)], noisy.positions) == ""


@pytest.mark.parametrize("marker_set", MARKER_SETS)
def test_exact_markers_on_limbs_are_not_keypoints(marker_set):
    take = skelgen.simulate("human", motion="walk", marker_set=marker_set, n_frames=100, noise=0.0).take
    assert keypoint_evidence(take.names, take.positions) == ""


def test_bones_are_those_of_the_body(body):
    single = ["RKnee", "RAnkle", "LKnee", "LAnkle", "Head", "RElbow", "RWrist", "LElbow", "LWrist"]
    several = [{"Hip", "RHip", "LHip"}, {"Neck", "RShoulder", "LShoulder"}, {"RHeel", "RBigToe"}]
    wanted = {frozenset([name]) for name in single} | {frozenset(names) for names in several}
    assert points_of_limbs(body) == wanted


def test_arms_and_legs_are_found_in_noise(body):
    found = points_of_limbs(estimated(body, 15.0))
    assert {frozenset([name]) for name in ("RKnee", "RAnkle", "LKnee", "LElbow", "LWrist", "RWrist")} <= found


def test_skeleton_of_exact_keypoints_is_exact(body):
    project = skelgen.reconstruct(body)
    assert np.nanmax(project.motion.residuals) < EXACT
    assert project.limbs.limb_of_marker[body.names.index("Hip")] == 0
    turns = project.motion.rotations
    assert np.abs(turns @ turns.swapaxes(-1, -2) - np.eye(3)).max() < EXACT
    for joint in project.skeleton.joints:
        assert joint.kind == "ball"


def test_joints_lie_on_the_points(body):
    project = skelgen.reconstruct(body)
    distances = np.linalg.norm(project.motion.joint_positions[:, :, None] - body.positions[:, None], axis=3)
    assert distances.min(axis=2).max() < EXACT


def test_noise_of_keypoints_is_not_made_larger(body):
    project = skelgen.reconstruct(estimated(body, 10.0))
    errors = np.linalg.norm(project.motion.marker_positions - body.positions, axis=2)
    assert np.sqrt((errors**2).mean()) < np.sqrt(3) * 10.0


def test_bone_between_two_points_turns_about_itself_as_little_as_it_can(body):
    project = skelgen.reconstruct(body)
    limb = int(project.limbs.limb_of_marker[body.names.index("RKnee")])
    turns, parent = project.motion.rotations, int(project.skeleton.parents[limb])
    relative = turns[:, parent].swapaxes(1, 2) @ turns[:, limb]
    arm = project.skeleton.marker_offsets[body.names.index("RKnee")]
    axes = np.stack([relative[:, 2, 1] - relative[:, 1, 2], relative[:, 0, 2] - relative[:, 2, 0]], axis=1)
    axes = np.column_stack([axes, relative[:, 1, 0] - relative[:, 0, 1]])
    assert np.abs(axes @ arm).max() < EXACT * np.linalg.norm(arm)


def test_gap_of_a_point_is_bridged_and_marked(body):
    positions = body.positions.copy()
    positions[50:60, body.names.index("RWrist")] = np.nan
    project = skelgen.reconstruct(replace(body, positions=positions))
    limb = int(project.limbs.limb_of_marker[body.names.index("RWrist")])
    assert np.array_equal(np.flatnonzero(~project.motion.limb_seen[:, limb]), np.arange(50, 60))
    assert np.isfinite(project.motion.joint_positions).all()


def test_root_can_be_stated_and_nothing_else(body):
    project = skelgen.reconstruct(body, root="LElbow")
    assert project.limbs.limb_of_marker[body.names.index("LElbow")] == 0
    with pytest.raises(InputError, match="named by one of them"):
        skelgen.reconstruct(body, root="limb3")
    with pytest.raises(InputError, match="bones between them"):
        skelgen.reconstruct(body, n_limbs=3)


def test_file_of_keypoints_is_told_and_can_be_read_as_markers(body, tmp_path):
    file = skelgen.write(body, tmp_path / "body.trc")[0]
    take = skelgen.read(file)
    assert take.are_keypoints
    assert any("keypoints" in notice for notice in take.notices)
    assert not skelgen.read(file, points="markers").are_keypoints
    markers = skelgen.write(skelgen.simulate("rods", n_frames=30).take, tmp_path / "rods.trc")[0]
    assert not skelgen.read(markers).are_keypoints
    assert skelgen.read(markers, points="keypoints").are_keypoints


def test_project_of_keypoints_goes_on_from_its_file(body, tmp_path):
    project = skelgen.reconstruct(body, until="limbs")
    file = skelgen.write(project, tmp_path / "body.skelgen")[0]
    again = skelgen.reconstruct(skelgen.load(file))
    assert again.take.are_keypoints
    assert again.skeleton.n_limbs == project.limbs.n_limbs


def test_bones_are_called_by_the_points_that_they_end_in(body):
    project = skelgen.reconstruct(body)
    sided = {f"{side} {name}" for side in ("left", "right") for name in ("upper arm", "forearm", "thigh", "shank")}
    assert set(project.limbs.names) == {"pelvis", "chest", "head", "right foot"} | sided
    assert project.skeleton.limb_names == project.limbs.names
    assert {"left knee", "neck", "right ankle", "waist"} <= set(project.skeleton.joint_names)
