"""Joints that hold for a part of a take: found with their frames, and none where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skelgen
from skelgen.app.report import write_report
from skelgen.app.stage_summary import stage_pointers
from skelgen.app.tables import project_tables
from skelgen.geometry.frame_rate import with_rate
from skelgen.model import Poses
from skelgen.model.joint_spans import JointSpan
from skelgen.simulation import simulate
from skelgen.simulation.motion import smooth_curves
from skelgen.stages.joints import find_joint_spans

SENSORS = {"n_frames": 600, "sensors": True, "noise": 0.5, "turn_noise": 0.1}
FEW_FRAMES = 4
"""Partners come near each other, and part, by a few mm in so many frames."""


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("structure", ["human", "quadruped"])
@pytest.mark.parametrize("hold", ["partners", "tool"])
def test_a_hold_is_found_with_its_limbs_and_frames(hold, structure, seed):
    subjects = 2 if hold == "partners" else 1
    simulated = simulate(structure, seed=seed, hold=hold, subjects=subjects, **SENSORS)
    truth = simulated.truth
    (span,), _ = find_joint_spans(simulated.take.world_from_body, truth.parents, truth.rate)
    assert list(span.limbs) == sorted(truth.hold_limbs[0].tolist())
    assert abs(np.array([span.first_frame, span.last_frame]) - truth.hold_frames[0]).max() <= FEW_FRAMES
    assert span.is_fixed == (hold == "tool")
    assert span.gap < 3.0 and span.gap_beyond > 50.0


@pytest.mark.parametrize("motion", ["random", "walk", "squat", "reach", "jump"])
@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_found_where_nobody_holds_anything(motion, seed):
    simulated = simulate("human", seed=seed, motion=motion, **SENSORS)
    assert find_joint_spans(simulated.take.world_from_body, simulated.truth.parents, 100.0) == ((), ())


def test_limbs_whose_common_neighbours_stand_still_are_not_joined():
    """While knee and ankle are stiff, pelvis and foot keep the hip in common."""
    simulated = simulate("human", seed=4, **SENSORS)
    truth, world = simulated.truth, simulated.take.world_from_body.copy()
    names = list(truth.limb_names)
    thigh, shank, foot = (names.index(f"left {limb}") for limb in ("thigh", "shank", "foot"))
    on_thigh = np.linalg.inv(world[200, thigh]) @ world[200, [shank, foot]]
    world[200:450, [shank, foot]] = world[200:450, [thigh]] @ on_thigh
    assert find_joint_spans(world, truth.parents, 100.0)[0] == ()


def test_a_joint_of_the_tree_that_is_let_go_is_told_and_cut():
    """The tool is in the hand most of the time: the tree joins both, and is a tree of the human alone afterwards."""
    simulated = simulate("human", seed=1, **{**SENSORS, "n_frames": 1200, "hold": "tool"})
    truth, (first, last) = simulated.truth, simulated.truth.hold_frames[0].tolist()
    shown = slice(first - 40, last + 40)
    take = Poses(simulated.take.world_from_body[shown], simulated.take.names, 100.0)
    hand, tool = sorted(truth.hold_limbs[0].tolist())
    whole = truth.parents.copy()
    whole[tool] = hand
    (span,), parted = find_joint_spans(take.world_from_body, whole, 100.0)
    assert span.limbs == (hand, tool)
    assert parted == tuple((limb, tool) for limb in range(tool))
    project = skelgen.reconstruct(take, until="joints")
    assert {frozenset(edge) for edge in project.topology.edges.tolist()} == {frozenset(e) for e in truth.edges.tolist()}
    assert (project.topology.spans[0].first_frame, project.topology.spans[0].last_frame) == (40, last - first + 40)


def test_hands_of_one_body_that_are_clasped_for_a_while_are_found():
    """The second arm reaches for the first hand by inverse kinematics: its joints hold all the time."""
    simulated = simulate("human", seed=2, n_frames=800)
    truth, random = simulated.truth, np.random.default_rng(0)
    names = list(truth.limb_names)
    chest, hand = names.index("chest"), names.index("left hand")
    arm = [names.index(f"right {limb}") for limb in ("upper arm", "forearm", "hand")]
    poses, (first, last), length = truth.world_from_limb.copy(), (250, 550), 700.0
    frames = np.arange(len(poses))
    clasped = np.clip(1 - np.maximum(first - frames, frames - last) / 60.0, 0.0, 1.0)[:, np.newaxis]
    shoulder = np.einsum("fij,j->fi", poses[:, chest, :3, :3], [0.0, -185.0, 300.0]) + poses[:, chest, :3, 3]
    palm = np.einsum("fij,j->fi", poses[:, hand, :3, :3], [0.0, 0.0, -100.0]) + poses[:, hand, :3, 3]
    turn = Rotation.from_rotvec(smooth_curves(random, len(poses), 100.0, 3, (0.2, 0.8))).as_matrix()
    free = shoulder + 250.0 * smooth_curves(random, len(poses), 100.0, 3, (0.2, 0.8)) + [500.0, -300.0, 0.0]
    target = clasped * palm + (1 - clasped) * free
    wrist = target - turn @ [0.0, 0.0, -90.0]
    way = wrist - shoulder
    away = np.linalg.norm(way, axis=1, keepdims=True)
    aside = np.cross(way, np.array([0.0, 0.0, 3.0]) + smooth_curves(random, len(poses), 100.0, 3, (0.1, 0.3)))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    elbow = shoulder + way / 2 + aside * np.sqrt(length**2 - away**2 / 4)
    for limb, start, end in ((arm[0], shoulder, elbow), (arm[1], elbow, wrist)):
        along = (end - start) / length
        poses[:, limb, :3, :3] = np.stack([np.cross(aside, along), aside, along], axis=2)
        x = poses[:, limb, :3, 0] / np.linalg.norm(poses[:, limb, :3, 0], axis=1, keepdims=True)
        poses[:, limb, :3, :3] = np.stack([x, np.cross(along, x), along], axis=2)
        poses[:, limb, :3, 3] = start
    poses[:, arm[2], :3, :3], poses[:, arm[2], :3, 3] = turn, wrist
    poses[..., :3, 3] += random.normal(0, 0.5, (*poses.shape[:2], 3))
    (span,), parted = find_joint_spans(poses, truth.parents, 100.0)
    assert parted == ()
    assert span.limbs == (hand, arm[2]) and not span.is_fixed
    assert abs(span.first_frame - first) <= FEW_FRAMES and abs(span.last_frame - last) <= FEW_FRAMES


def test_a_large_slip_of_a_sensor_is_no_joint_for_a_span():
    simulated = simulate("human", seed=0, **SENSORS)
    world = simulated.take.world_from_body.copy()
    world[300:, 3, :3, 3] += 100.0 * world[300:, 3, :3, 0]
    assert find_joint_spans(world, simulated.truth.parents, 100.0) == ((), ())


def test_the_project_holds_and_tells_spans(tmp_path):
    simulated = simulate("human", seed=3, hold="tool", **SENSORS)
    truth = simulated.truth
    project = skelgen.reconstruct(simulated.take, until="joints")
    (span,) = project.topology.spans
    first, last = truth.hold_frames[0].tolist()
    told = [one for one in project.reports["joints"].notices if "only" in one]
    hand, tool = (truth.limb_names[limb] for limb in span.limbs)
    assert len(told) == 1
    assert told[0].startswith(f"{hand} and {tool} are fixed to each other in frames {first} to {last} only")
    saved = skelgen.load(skelgen.write(project, tmp_path / "take.skelgen")[0])
    (again,) = saved.topology.spans
    assert (again.limbs, again.first_frame, again.last_frame, again.is_fixed) == (span.limbs, first, last, True)
    np.testing.assert_array_equal(again.in_first, span.in_first)
    assert [one.frame for one in stage_pointers(project, "joints") if one.sentence == told[0]] == [first]
    (row,) = project_tables(project)["joint_spans"]
    assert (row["joint"], row["first_frame"], row["last_frame"]) == (f"{hand}-{tool}", first, last)
    page = write_report(project, tmp_path / "take.html").read_text()
    assert "Joints that hold for a part of the take only" in page
    assert project.topology.for_take(50).spans == ()
    (half,) = with_rate(project, 50.0).topology.spans
    assert (half.first_frame, half.last_frame) == (round(first / 2), round(last / 2))


def test_takes_of_a_body_that_is_known_are_searched_too():
    simulated = simulate("rods", seed=3, **{**SENSORS, "n_frames": 900}, hold="tool")
    first, last = simulated.truth.hold_frames[0].tolist()
    known = skelgen.reconstruct(simulated.take)
    again = skelgen.apply_subject(simulated.take, known)
    (span,) = again.topology.spans
    assert abs(span.first_frame - first) <= FEW_FRAMES and abs(span.last_frame - last) <= FEW_FRAMES
    assert span.sentence(again.limbs.names) in again.reports["joints"].notices


def test_a_span_calls_limbs_as_other_notices_do():
    span = JointSpan((0, 1), 3, 9, np.zeros(3), np.zeros(3), gap=1.0, gap_beyond=50.0)
    assert span.sentence(("limb0", "hammer")).startswith("limb 0 and hammer are joined in frames 3 to 9 only")
