"""Joints: an exact gradient, the true tree, solvers that agree, and limbs of one or two markers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from joblib import parallel_config

from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.evaluation.joints import joint_distances
from skelgen.model import Limbs, Project, StageReport, Trajectories
from skelgen.progress import SILENT
from skelgen.stages.classic.joint_solver import joint_cost
from skelgen.stages.joints import JointConstraints, JointParameters, find_joints
from skelgen.stages.joints.pairs import Guessing
from skelgen.stages.joints.search import PairSearch
from skelgen.stages.joints.segments import make_segments, sample_frames

STRUCTURES = ("rods", "human", "quadruped", "tree:8", "classic-human")
FAULTS = {"noise": 0.5, "dropouts": 0.05}
DESCENT = JointParameters(solver="conjugate-gradient", tolerance=1e-9, max_iterations=2000)
ENOUGH_LIMBS = 21  # 210 pairs: for fewer no processes are started
EXACT = 1e-2  # mm: what the issue asks of joints in exact takes


@pytest.fixture(scope="session")
def joined(true_limbs):
    """Run the stage on the true limbs."""

    def run(case, parameters=None, **options):
        return find_joints(case.take, true_limbs(case), parameters, **options)

    return run


def edges(topology):
    return {frozenset(edge) for edge in topology.edges.tolist()}


def raw_errors(topology, truth):
    """Mean distance [mm] of each raw joint from the true one of the same two limbs, hinges across their axis."""
    index = {frozenset(edge): column for column, edge in enumerate(truth.edges.tolist())}
    true_of_joint = np.array([index[frozenset(edge)] for edge in topology.edges.tolist()])
    return np.nanmean(joint_distances(topology.raw_joint_positions, true_of_joint, truth), axis=0)


@pytest.mark.parametrize("alpha", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("gaps", [False, True])
def test_gradient_of_the_joint_cost_is_its_slope(alpha, gaps):
    random = np.random.default_rng(0)
    markers = random.normal(size=(6, 5, 3)) * 100
    if gaps:
        markers[[0, 2, 2, 5], [1, 0, 4, 3]] = np.nan
    cost, joint, step = joint_cost(markers, alpha), random.normal(size=(6, 3)) * 50, 1e-4
    slopes = np.empty(joint.shape)
    for index in np.ndindex(joint.shape):
        shift = np.zeros(joint.shape)
        shift[index] = step
        slopes[index] = (cost(joint + shift)[0] - cost(joint - shift)[0]) / (2 * step)
    np.testing.assert_allclose(cost(joint)[1], slopes, rtol=1e-6, atol=1e-6)


def test_joint_cost_is_the_formula_of_the_seed():
    random = np.random.default_rng(1)
    markers, joint = random.normal(size=(7, 4, 3)), random.normal(size=(7, 3))
    markers[3, 2] = np.nan
    distance = np.linalg.norm(joint[:, None] - markers, axis=2)
    expected = np.mean(np.nanvar(distance, axis=0) + 0.3 * np.nanmean(distance, axis=0))
    assert joint_cost(markers, 0.3)(joint)[0] == pytest.approx(expected)


@pytest.mark.parametrize("faults", [{}, FAULTS], ids=["exact", "noisy with gaps"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", STRUCTURES)
def test_tree_is_the_true_one(simulated, joined, name, seed, faults):
    case = simulated(name, seed, **faults)
    assert edges(joined(case)) == {frozenset(edge) for edge in case.truth.edges.tolist()}


@pytest.mark.parametrize("name", ["rods", "human", "quadruped", "tree:8"])
def test_raw_joints_of_exact_takes_are_exact(simulated, joined, name):
    case = simulated(name)
    assert raw_errors(joined(case), case.truth).max() < EXACT


@pytest.mark.parametrize("name", ["rods", "human", "tree:8"])
def test_conjugate_gradients_find_the_tree_of_the_closed_form(simulated, joined, name):
    case = simulated(name)
    few_frames = JointParameters(solver="conjugate-gradient", samples=60)
    assert edges(joined(case, few_frames)) == edges(joined(case))


def test_conjugate_gradients_place_exact_joints_where_the_closed_form_does(simulated, joined):
    case = simulated("rods")
    closed, descended = joined(case), joined(case, DESCENT)
    np.testing.assert_array_equal(closed.parents, descended.parents)
    gap = np.linalg.norm(closed.raw_joint_positions - descended.raw_joint_positions, axis=2)
    assert gap.max() < 0.1  # mm: the descent stops where the cost is flat
    assert (descended.n_iterations > 0).all()
    assert (closed.n_iterations == 0).all()


@pytest.mark.parametrize("method", ["polak-ribiere", "fletcher-reeves"])
def test_both_directions_of_descent_find_the_tree_of_noisy_rods(simulated, joined, method):
    case = simulated("rods", **FAULTS)
    parameters = JointParameters(solver="conjugate-gradient", method=method)
    assert edges(joined(case, parameters)) == {frozenset(edge) for edge in case.truth.edges.tolist()}


@pytest.mark.parametrize("method", ["polak-ribiere", "fletcher-reeves"])
def test_conjugate_gradients_place_the_joints_of_limbs_with_two_markers(simulated, joined, notices, method):
    case = simulated("classic-human", seed=1, n_frames=120)  # whose right arm is stuck half-way between its limbs
    parameters = JointParameters(solver="conjugate-gradient", method=method, samples=60, absolute_tolerance=1e-13)
    topology = joined(case, parameters, monitor=notices)
    assert edges(topology) == {frozenset(edge) for edge in case.truth.edges.tolist()}
    assert raw_errors(topology, case.truth).max() < EXACT
    assert not [sentence for sentence in notices.sentences if "stuck" in sentence]


def test_descent_that_stays_stuck_is_noticed(simulated, joined, notices):
    case = simulated("rods")
    middle, rear, front = (case.truth.limb_names.index(f"{name} rod") for name in ("middle", "rear", "front"))
    stated = JointConstraints(joined=[tuple(sorted((rear, front))), tuple(sorted((middle, rear)))])
    joined(case, JointParameters(solver="conjugate-gradient"), constraints=stated, monitor=notices)
    assert [sentence for sentence in notices.sentences if "is stuck" in sentence and f"limb {front}" in sentence]


def test_annealed_joints_are_decided_by_the_seed(simulated, joined):
    case = simulated("rods", n_frames=200, **FAULTS)
    parameters = JointParameters(solver="conjugate-gradient", anneal=True, max_iterations=10)
    first, again, other = (joined(case, parameters, seed=seed).raw_joint_positions for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_number_of_processes_changes_nothing(simulated, joined):
    case = simulated(f"tree:{ENOUGH_LIMBS}", n_frames=60, **FAULTS)
    parameters = JointParameters(solver="conjugate-gradient", max_iterations=3)
    alone = joined(case, parameters)
    with parallel_config("loky", n_jobs=2):
        shared = joined(case, parameters)
    for field in dataclasses.fields(alone):
        np.testing.assert_array_equal(getattr(alone, field.name), getattr(shared, field.name))


def test_moving_the_world_moves_the_joints(simulated, joined, moved_world):
    case = simulated("human", **FAULTS)
    moved = dataclasses.replace(
        case, take=dataclasses.replace(case.take, positions=moved_world.points(case.take.positions))
    )
    still, carried = joined(case), joined(moved)
    np.testing.assert_array_equal(still.parents, carried.parents)
    np.testing.assert_allclose(
        carried.raw_joint_positions, moved_world.points(still.raw_joint_positions), atol=1e-5
    )  # mm: rounding, enlarged along hinges by the weak pull that settles them


def test_root_is_the_limb_with_most_joints(simulated, joined):
    topology = joined(simulated("quadruped"))
    degree = np.bincount(topology.edges.ravel())
    assert degree[topology.roots[0]] == degree.max()


def test_costs_are_symmetric_and_least_at_the_joints(simulated, joined):
    topology = joined(simulated("rods", **FAULTS))
    costs = topology.joint_costs
    np.testing.assert_array_equal(costs, costs.T)
    np.testing.assert_array_equal(np.diag(costs), 0)
    kept = [costs[parent, child] for parent, child in topology.edges]
    assert max(kept) < costs[1, 2]  # front and rear rod share no joint


@pytest.fixture(scope="session")
def two_bodies(simulated):
    """Two sets of rods in one take: the first is seen in the first half only, the second in the second."""
    first, second = simulated("rods", 0, n_frames=400), simulated("rods", 1, n_frames=400)
    positions = np.concatenate([first.take.positions, second.take.positions + 5000.0], axis=1)
    positions[200:, :9], positions[:200, 9:] = np.nan, np.nan
    limbs = Limbs(np.concatenate([first.truth.limb_of_marker, second.truth.limb_of_marker + 3]), np.zeros((18, 18)))
    return Trajectories(positions, tuple(map(str, range(18))), 100.0, "two bodies"), limbs


def test_bodies_never_seen_together_are_separate_trees(two_bodies, notices):
    topology = find_joints(*two_bodies, monitor=notices)
    assert edges(topology) == {frozenset(pair) for pair in ((0, 1), (0, 2), (3, 4), (3, 5))}
    assert len(topology.roots) == 2
    assert "separate bodies" in " ".join(notices.sentences)
    assert np.isnan(topology.joint_costs[0, 3])


def kept_markers(case, numbers):
    """The take and its true limbs with some of the markers."""
    names = tuple(case.take.names[number] for number in numbers)
    take = dataclasses.replace(case.take, positions=case.take.positions[:, numbers], names=names)
    return take, Limbs(case.truth.limb_of_marker[numbers], np.zeros((len(numbers), len(numbers))))


@pytest.mark.parametrize("n_kept", [1, 2])
def test_limb_of_few_markers_is_joined_where_it_truly_hangs(simulated, n_kept):
    case = simulated("rods", n_frames=600)
    numbers = [*range(6), *range(6, 6 + n_kept)]
    topology = find_joints(*kept_markers(case, numbers))
    assert topology.parents.tolist() == [-1, 0, 0]
    assert raw_errors(topology, case.truth).max() < EXACT


def test_chain_of_two_marker_limbs_is_joined_in_its_true_order(simulated):
    case = simulated("rods", n_frames=600)
    topology = find_joints(*kept_markers(case, [0, 1, 3, 4, 6, 7]))
    assert edges(topology) == {frozenset((0, 1)), frozenset((0, 2))}


def test_take_with_one_limb_has_no_joints(simulated):
    topology = find_joints(*kept_markers(simulated("rods"), [0, 1, 2]))
    assert topology.n_joints == 0
    assert topology.raw_joint_positions.shape == (300, 0, 3)


def test_limbs_that_are_all_left_out_are_refused(simulated):
    take = simulated("rods").take
    with pytest.raises(InputError, match="no marker belongs to a limb"):
        find_joints(take, Limbs(np.full(9, -1), np.zeros((9, 9))))


def test_noisy_raw_joints_score_near_the_noise(simulated, joined, true_limbs):
    case = simulated("human", n_frames=600, **FAULTS)
    report = StageReport()
    project = Project(case.take).with_trajectories(case.take, report).with_limbs(true_limbs(case), report)
    scores = evaluate(project.with_topology(joined(case), report), case.truth).joints
    assert np.mean([score.raw_mean for score in scores]) < 1.5  # mm, at 0.5 mm noise: no chain has been fitted yet


def test_sampled_frames_exist_whatever_the_length() -> None:
    for n_frames in range(1, 400):
        for samples in (30, 50, 100):
            assert sample_frames(n_frames, JointParameters(samples=samples))[-1] < n_frames


def test_a_joint_about_which_markers_hardly_turn_is_guessed_near_them():
    """Markers that move in a plane lie on a sphere without bounds about the body that they move against."""
    random, frames = np.random.default_rng(0), np.arange(100)
    body = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0], [0.0, 150.0, 80.0]])
    other = np.array([300.0, 0.0, 0.0]) + random.normal(size=(100, 1, 3)) * [40.0, 40.0, 0.0]
    markers = [np.repeat(body[np.newaxis], 100, axis=0), other]
    search = PairSearch(make_segments(markers, frames), frames, Guessing(JointParameters(), 0), SILENT)
    assert search.guesses()[0, 1].distance < np.linalg.norm([300.0, 150.0, 80.0])
