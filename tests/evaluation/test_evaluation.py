"""A perfect result scores perfectly; a result with stated errors scores exactly those."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skelgen
from skelgen.errors import InputError
from skelgen.evaluation import evaluate, evaluation_tables
from skelgen.model import Limbs, Poses, Project, StageReport, Topology, Trajectories
from skelgen.simulation import SimulatedTake, Truth, simulate

ROUNDING = 1e-9  # mm


def with_parents(project: Project, parents: np.ndarray) -> Project:
    """The result up to the joints, with another tree."""
    old = project.topology
    n = len(old.n_iterations)
    topology = Topology(parents, old.joint_costs, old.raw_joint_positions, np.zeros(n, int), np.zeros(n), 0.1)
    return project.with_topology(topology, StageReport())


def with_limbs(project: Project, limb_of_marker: np.ndarray) -> Project:
    return project.with_limbs(Limbs(limb_of_marker, project.limbs.distance_deviation), StageReport())


def turned(simulated: SimulatedTake) -> SimulatedTake:
    """The same take in a world that is turned and shifted."""
    turn, shift = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(), np.array([100.0, -2000.0, 30.0])
    truth = simulated.truth
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = turn, shift
    changed = dataclasses.replace(
        truth,
        joint_positions=truth.joint_positions @ turn.T + shift,
        joint_axes=truth.joint_axes @ turn.T,
        marker_positions=truth.marker_positions @ turn.T + shift,
        world_from_limb=world @ truth.world_from_limb,
    )
    take = simulated.take
    return SimulatedTake(dataclasses.replace(take, positions=take.positions @ turn.T + shift), changed)


def test_a_perfect_result_scores_perfectly(human: SimulatedTake, perfect) -> None:
    scores = evaluate(perfect(human), human.truth)
    assert scores.limbs.is_exact and scores.limbs.adjusted_rand == 1.0
    assert scores.topology.is_exact and len(scores.topology.found) == 14
    assert scores.worst_joint_error == scores.mean_length_error == scores.mean_marker_deviation == 0
    assert [joint.kind_found for joint in scores.joints] == list(human.truth.joint_kinds)


@pytest.mark.parametrize("name", ["rods", "classic-human", "quadruped", "tree:9"])
def test_every_structure_can_be_evaluated(name: str, perfect) -> None:
    simulated = simulate(name, n_frames=10)
    scores = evaluate(perfect(simulated), simulated.truth)
    assert scores.limbs.is_exact and scores.topology.is_exact and scores.worst_joint_error == 0


def test_a_labelled_take_has_no_label_score(human: SimulatedTake, perfect) -> None:
    assert evaluate(perfect(human), human.truth).labels is None


def test_stages_that_have_not_run_are_left_out(human: SimulatedTake, perfect) -> None:
    done = perfect(human)
    labelled = Project(human.take).with_trajectories(human.take, StageReport())
    joined = done.with_topology(done.topology, StageReport())
    assert evaluate(Project(human.take), human.truth).as_mapping()["limbs"] is None
    assert evaluate(labelled, human.truth).limbs is None
    assert evaluate(done.with_limbs(done.limbs, StageReport()), human.truth).topology is None
    assert evaluate(joined, human.truth).joints[0].mean is None
    assert evaluate(joined, human.truth).joints[0].raw_mean == 0


def test_joints_that_are_off_by_a_vector_are_off_by_its_length(perfect, moved) -> None:
    rods = simulate("rods", n_frames=20)
    project = perfect(rods)
    project = project.with_skeleton(project.skeleton, moved(rods.truth, np.array([3.0, 0.0, 4.0])), StageReport())
    for joint in evaluate(project, rods.truth).joints:
        assert (joint.mean, joint.median, joint.maximum) == pytest.approx((5.0, 5.0, 5.0))


def shifted_along_hinges(truth: Truth, size: float) -> np.ndarray:
    is_hinge = np.array([kind == "hinge" for kind in truth.joint_kinds])
    return np.where(is_hinge[:, None], size * truth.joint_axes, 0.0)


def test_a_hinge_may_lie_anywhere_on_its_axis(human: SimulatedTake, perfect, moved) -> None:
    project, shift = perfect(human), shifted_along_hinges(human.truth, 30.0)
    project = project.with_skeleton(project.skeleton, moved(human.truth, shift), StageReport())
    scores = evaluate(project, human.truth)
    assert scores.worst_joint_error < ROUNDING
    assert scores.mean_length_error < ROUNDING


def test_a_hinge_off_its_axis_is_an_error(human: SimulatedTake, perfect, moved) -> None:
    project, axes = perfect(human), shifted_along_hinges(human.truth, 1.0)
    across = np.cross(axes, [0.0, 0.0, 1.0])
    across *= 2.0 / np.maximum(np.linalg.norm(across, axis=2, keepdims=True), 1e-9)
    project = project.with_skeleton(project.skeleton, moved(human.truth, across), StageReport())
    errors = {joint.kind_true: joint.mean for joint in evaluate(project, human.truth).joints}
    assert errors["hinge"] == pytest.approx(2.0)
    assert errors["ball"] == errors["universal"] == 0


def test_a_longer_limb_is_a_length_error(perfect, moved) -> None:
    rods = simulate("rods", n_frames=20)
    project, along = perfect(rods), rods.truth.world_from_limb[:, 0, :3, 0]
    shift = np.stack([np.zeros_like(along), 6.0 * along], axis=1)  # the front joint, outward
    project = project.with_skeleton(project.skeleton, moved(rods.truth, shift), StageReport())
    (length,) = evaluate(project, rods.truth).lengths
    assert (length.true, length.found, length.error) == pytest.approx((350.0, 356.0, 6.0))
    assert (length.limb, length.is_across_hinges) == ("middle rod", False)


def test_markers_that_are_off_by_a_distance_say_so(human: SimulatedTake, perfect, moved) -> None:
    project = perfect(human)
    project = project.with_skeleton(project.skeleton, moved(human.truth, marker_shift=2.0), StageReport())
    scores = evaluate(project, human.truth)
    assert [marker.from_tracked for marker in scores.markers] == pytest.approx([2.0] * 45)
    assert [marker.from_true for marker in scores.markers] == pytest.approx([2.0] * 45)
    assert scores.limb_deviations["left hand"] == pytest.approx(2.0)


def test_noise_shows_against_the_tracked_but_not_the_true_markers(perfect) -> None:
    noisy = simulate("human", n_frames=400, noise=1.0)
    scores = evaluate(perfect(noisy), noisy.truth)
    assert scores.mean_marker_deviation == pytest.approx(np.sqrt(8 / np.pi), rel=0.01)  # mean of a Maxwell variable
    assert max(marker.from_true for marker in scores.markers) == 0


def test_a_marker_on_the_wrong_limb_is_not_exact(human: SimulatedTake, perfect) -> None:
    limbs = human.truth.limb_of_marker.copy()
    limbs[0] = 1
    scores = evaluate(with_limbs(perfect(human), limbs), human.truth)
    assert 0.9 < scores.limbs.adjusted_rand < 1
    assert not scores.limbs.is_exact


def test_a_marker_left_out_is_not_exact(human: SimulatedTake, perfect) -> None:
    limbs = human.truth.limb_of_marker.copy()
    limbs[0] = -1
    scores = evaluate(with_limbs(perfect(human), limbs), human.truth)
    assert (scores.limbs.n_left_out, scores.limbs.is_exact) == (1, False)


def test_one_limb_for_everything_is_chance(human: SimulatedTake, perfect) -> None:
    scores = evaluate(with_limbs(perfect(human), np.zeros(45, dtype=int)), human.truth)
    assert scores.limbs.adjusted_rand == pytest.approx(0.0, abs=1e-12)
    assert (scores.limbs.n_limbs_found, scores.limbs.n_limbs_true) == (1, 15)


def test_a_limb_on_the_wrong_parent_is_one_missed_and_one_extra_joint(human: SimulatedTake, perfect) -> None:
    names, parents = list(human.truth.limb_names), human.truth.parents.copy()
    parents[names.index("left hand")] = names.index("chest")
    topology = evaluate(with_parents(perfect(human), parents), human.truth).topology
    assert topology.missed == ("left forearm - left hand",)
    assert topology.extra == ("chest - left hand",)
    assert len(topology.found) == 13 and not topology.is_exact


def test_another_root_is_the_same_tree(perfect) -> None:
    rods = simulate("rods", n_frames=10)
    scores = evaluate(with_parents(perfect(rods), np.array([1, -1, 0])), rods.truth)
    assert scores.topology.is_exact


def test_turning_the_world_changes_no_score(human: SimulatedTake, perfect, moved) -> None:
    figures = []
    for simulated, vector in ((human, [0.0, 0.0, 5.0]), (turned(human), turned_vector([0.0, 0.0, 5.0]))):
        project = perfect(simulated)
        motion = moved(simulated.truth, np.array(vector))
        project = project.with_skeleton(project.skeleton, motion, StageReport())
        scores = evaluate(project, simulated.truth)
        figures.append([joint.mean for joint in scores.joints] + [length.found for length in scores.lengths])
    assert figures[0] == pytest.approx(figures[1], abs=ROUNDING)


def turned_vector(vector: list[float]) -> np.ndarray:
    return Rotation.from_rotvec([0.4, -1.1, 2.0]).apply(vector)


def test_renumbering_limbs_and_markers_changes_no_score(human: SimulatedTake, perfect) -> None:
    rng, project = np.random.default_rng(0), perfect(human)
    markers, limbs = rng.permutation(45), rng.permutation(15)
    old = project.trajectories
    names = tuple(old.names[marker] for marker in markers)
    project = project.with_trajectories(Trajectories(old.positions[:, markers], names, old.rate), StageReport())
    limb_of_marker = np.argsort(limbs)[human.truth.limb_of_marker[markers]]
    project = project.with_limbs(Limbs(limb_of_marker, np.zeros((45, 45))), StageReport())
    scores = evaluate(project, human.truth)
    assert scores.limbs.is_exact


def test_names_survive_what_formats_do_to_them(human: SimulatedTake) -> None:
    names = tuple(name.upper().replace(" ", "_") for name in human.take.names)
    take = dataclasses.replace(human.take, names=names)
    project = Project(take).with_trajectories(take, StageReport())
    project = project.with_limbs(Limbs(human.truth.limb_of_marker, np.zeros((45, 45))), StageReport())
    assert evaluate(project, human.truth).limbs.is_exact


def test_a_marker_that_was_parted_is_the_one_that_it_was(human: SimulatedTake) -> None:
    positions = np.concatenate([human.take.positions, human.take.positions[:, :1]], axis=1)
    positions[20:, 0], positions[:20, -1] = np.nan, np.nan
    names = (*human.take.names, f"{human.take.names[0]}_2")
    take = dataclasses.replace(human.take, positions=positions, names=names)
    limbs = Limbs(np.append(human.truth.limb_of_marker, human.truth.limb_of_marker[0]), np.zeros((46, 46)))
    project = Project(human.take).with_trajectories(take, StageReport()).with_limbs(limbs, StageReport())
    assert evaluate(project, human.truth).limbs.is_exact
    moved = Limbs(np.append(human.truth.limb_of_marker, 1), np.zeros((46, 46)))
    assert not evaluate(project.with_limbs(moved, StageReport()), human.truth).limbs.is_exact


def test_a_result_is_plain_json(human: SimulatedTake, perfect) -> None:
    text = json.dumps(evaluate(perfect(human), human.truth).as_mapping(), allow_nan=False)
    assert json.loads(text)["summary"]["mean_joint_error"] == 0


def test_tables_name_every_limb_and_joint(human: SimulatedTake, perfect) -> None:
    scores = evaluate(perfect(human), human.truth)
    tables = evaluation_tables(scores)
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    text = "\n".join(line for table in tables for line in table.lines())
    assert all(name in text for name in (*human.truth.joint_names, *human.truth.marker_names))


def test_an_empty_evaluation_has_no_tables(human: SimulatedTake) -> None:
    assert evaluation_tables(evaluate(Project(human.take), human.truth)) == ()


def test_a_truth_with_other_frames_is_an_input_error(human: SimulatedTake, perfect) -> None:
    with pytest.raises(InputError, match="40"):
        evaluate(perfect(human), simulate("human", n_frames=41).truth)


def test_a_truth_with_other_markers_is_an_input_error(human: SimulatedTake, perfect) -> None:
    with pytest.raises(InputError, match="knows no marker"):
        evaluate(perfect(human), simulate("rods", n_frames=40).truth)


def test_a_take_of_poses_has_no_scores_before_its_joints(human: SimulatedTake) -> None:
    poses = Poses(human.truth.world_from_limb, human.truth.limb_names, 100.0)
    assert evaluation_tables(evaluate(Project(poses), human.truth)) == ()


def test_bodies_are_scored_by_the_markers_in_their_trees(perfect) -> None:
    two = simulate("rods", n_frames=10, subjects=2)
    project = perfect(two)
    scores = evaluate(project, two.truth).bodies
    assert (scores.n_bodies_found, scores.n_bodies_true, scores.share, scores.is_exact) == (2, 2, 1.0, True)
    parents = project.topology.parents.copy()
    parents[np.flatnonzero(parents < 0)[1]] = 0
    n = len(parents) - 1
    raw = np.zeros((10, n, 3))
    topology = Topology(parents, project.topology.joint_costs, raw, np.zeros(n, int), np.zeros(n), 0.1)
    joined = evaluate(project.with_topology(topology, StageReport()), two.truth)
    assert (joined.bodies.n_bodies_found, joined.bodies.share, joined.bodies.is_exact) == (1, 0.5, False)
    assert ("bodies", "1 of 2") in evaluation_tables(joined)[0].rows


def test_takes_of_sensors_are_scored_by_tree_joints_and_spans():
    case = simulate("human", seed=3, n_frames=600, hold="tool", sensors=True, noise=0.5, turn_noise=0.1)
    scores = evaluate(skelgen.reconstruct(case.take), case.truth)
    assert scores.topology.is_exact and scores.worst_joint_error < 1.0
    assert (scores.spans.n_true, scores.spans.n_found, scores.spans.n_extra) == (1, 1, 0)
    assert scores.spans.frames_off <= 1
    assert any(row[0].startswith("joints that hold for a span") for row in evaluation_tables(scores)[0].rows)
    assert json.dumps(scores.as_mapping(), allow_nan=False)


def test_bodies_that_the_truth_does_not_know_are_refused():
    case = simulate("rods", n_frames=50, sensors=True)
    other = dataclasses.replace(case.take, names=("a", "b", "c"))
    with pytest.raises(InputError, match="the truth has no limb 'a'"):
        evaluate(skelgen.reconstruct(other, until="labels"), case.truth)
