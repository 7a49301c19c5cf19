"""The tree of limbs: margins, loops, separate bodies, constraints, and takes that show too little."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.stages.joints import JointConstraints, JointParameters, JointSearch, find_joints
from skelgen.stages.joints.costs import JointCosts
from skelgen.stages.joints.loops import loop_joints

TISSUE = {"noise": 0.5, "soft_tissue": 3.0}
PLATE = np.array([[60.0, 0.0, 0.0], [-30.0, 50.0, 0.0], [-30.0, -50.0, 10.0], [0.0, 0.0, 60.0]])  # mm


def edges(topology):
    return {frozenset(edge) for edge in topology.edges.tolist()}


def true_edges(truth):
    return {frozenset(edge) for edge in truth.edges.tolist()}


def as_take(limbs):
    """A take, and its limbs, from markers of each limb, shape (n_frames, n_markers, 3)."""
    positions = np.concatenate(limbs, axis=1)
    limb_of_marker = np.repeat(np.arange(len(limbs)), [limb.shape[1] for limb in limbs])
    names = tuple(f"m{number}" for number in range(positions.shape[1]))
    return Trajectories(positions, names, 100.0, "take"), Limbs(limb_of_marker, np.zeros((len(names),) * 2))


def together(first, second, apart):
    """Two simulated takes as one, the second moved by `apart` [mm]."""
    takes = (first.take.positions, second.take.positions + np.array(apart))
    both = np.concatenate([first.truth.limb_of_marker, second.truth.limb_of_marker + first.truth.n_limbs])
    names = tuple(map(str, range(len(both))))
    return Trajectories(np.concatenate(takes, axis=1), names, 100.0, "two"), Limbs(both, np.zeros((len(both),) * 2))


def rigid(poses, noise=0.3, seed=0):
    """Markers of a plate with some poses, shape (n_frames, 4, 4)."""
    points = np.einsum("fij,mj->fmi", poses[:, :3, :3], PLATE) + poses[:, np.newaxis, :3, 3]
    return points + np.random.default_rng(seed).normal(0, noise, points.shape)


def turning(n_frames, about, seed):
    """Poses that turn about a point [mm], about all axes."""
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 3)
    angles = 0.6 * np.sin(np.arange(n_frames)[:, np.newaxis] * np.array([0.07, 0.05, 0.06]) + phases)
    rotations = matrix_from_vector(angles)
    return transform_from(rotations, np.asarray(about) - rotations @ np.asarray(about))


def in_plane(*bodies):
    """Markers of plates that turn by angles about z, at places that are complex numbers."""
    poses = [transform_from(matrix_from_vector(np.outer(turn, [0, 0, 1])), np.stack([one.real, one.imag, 0 * turn], 1))
             for one, turn in bodies]  # fmt: skip
    return as_take([rigid(one, seed=number) for number, one in enumerate(poses)])


@pytest.mark.parametrize(("name", "cameras"), [("human", 0), ("human", 6), ("quadruped", 0), ("tree:8", 6)])
def test_tree_under_soft_tissue_is_the_true_one(simulated, true_limbs, name, cameras):
    case = simulated(name, 1, n_frames=600, n_cameras=cameras, **TISSUE)
    assert edges(find_joints(case.take, true_limbs(case))) == true_edges(case.truth)


@pytest.mark.parametrize("seed", [9, 21, 61])  # axes of two hinges of one limb meet: three joints, two of them true
def test_of_three_joints_in_one_point_the_hinges_are_taken(simulated, true_limbs, seed):
    case = simulated("tree:30", seed, n_frames=1000, noise=1.0)
    assert edges(find_joints(case.take, true_limbs(case))) == true_edges(case.truth)


def test_margin_is_what_the_best_tree_without_the_edge_costs_more(simulated, true_limbs):
    case = simulated("tree:8", **TISSUE)
    topology = find_joints(case.take, true_limbs(case), JointParameters(separate=False))
    whole = best_tree(topology.joint_costs)
    for (parent, child), margin in zip(topology.edges.tolist(), topology.margins, strict=True):
        without = topology.joint_costs.copy()
        without[parent, child] = without[child, parent] = np.inf
        assert best_tree(without) - whole == pytest.approx(margin)


def best_tree(costs):
    """Sum of the costs of the minimum spanning tree (Kruskal)."""
    group, total = np.arange(len(costs)), 0.0
    for first, second in sorted(combinations(range(len(costs)), 2), key=lambda pair: costs[pair]):
        if group[first] != group[second]:
            total += costs[first, second]
            group[group == group[second]] = group[first]
    return total


def test_edge_without_another_has_no_margin():
    topology = Topology([-1, 0], [[0, 3.0], [3.0, 0]], np.zeros((4, 1, 3)), [0], [1.0], 0.1)
    assert np.isnan(topology.margins).all()
    assert topology.rivals.tolist() == [[-1, -1]]


def test_edge_that_could_as_well_be_another_is_told(notices):
    first, second = turning(300, (0, 0, 150), 1), turning(300, (0, 0, 150), 2)
    find_joints(
        *as_take([rigid(np.tile(np.eye(4), (300, 1, 1))), rigid(first, seed=1), rigid(second, seed=2)]),
        monitor=notices,
    )
    assert "but could" in " ".join(notices.sentences)


def test_closed_chain_of_four_limbs_is_a_tree_and_a_loop(notices):
    n_frames = 300
    angle = 0.7 * np.sin(0.05 * np.arange(n_frames))
    swing = matrix_from_vector(np.stack([angle * 0, angle * 0, angle], axis=1))
    ground = np.tile(np.eye(4), (n_frames, 1, 1))
    left, right = (transform_from(swing, np.tile([x, 0.0, 0.0], (n_frames, 1))) for x in (0.0, 400.0))
    bar = transform_from(np.tile(np.eye(3), (n_frames, 1, 1)), swing @ np.array([0.0, 300.0, 0.0]) + [200.0, 0.0, 0.0])
    bodies = [rigid(poses, seed=seed) for seed, poses in enumerate((ground, left, bar, right))]
    topology = find_joints(*as_take(bodies), monitor=notices)
    ring = {frozenset(pair) for pair in ((0, 1), (1, 2), (2, 3), (3, 0))}
    assert edges(topology) < ring
    assert edges(topology) | {frozenset(pair) for pair in topology.loops} == ring
    assert "form a loop" in " ".join(notices.sentences)


def test_a_rocker_that_turns_by_few_degrees_closes_a_loop():
    """A crank of 20 mm that goes round drives a rocker of 100 mm, 160 mm away, by a rod of 140 mm: all in one plane."""
    turned = 0.1 * np.arange(400)
    tip = 20 * np.exp(1j * turned)
    apart = np.abs(160 - tip)
    rod = np.angle(160 - tip) + np.arccos((140**2 + apart**2 - 100**2) / (2 * 140 * apart))
    rocker = np.angle(tip + 140 * np.exp(1j * rod) - 160)
    limbs = (0 * tip, 0 * rod, 80), (0 * tip, turned, 10), (tip, rod, 70), (0 * tip + 160, rocker, 50)
    bodies = [(end + half * np.exp(1j * angle), angle) for end, angle, half in limbs]
    topology = find_joints(*in_plane(*bodies))
    ring = {frozenset(pair) for pair in ((0, 1), (1, 2), (2, 3), (3, 0))}
    assert edges(topology) | {frozenset(pair) for pair in topology.loops} == ring


@pytest.mark.parametrize("n_seen", [900, 120])
def test_hinges_whose_axes_meet_close_no_loop(notices, n_seen):
    """A base, a link that turns about z on it, and one that turns about x on that link: all share the origin."""
    n_frames = 900
    angles = [0.7 * np.sin(pace * np.arange(n_frames)) for pace in (0.05, 0.031)]
    about_z = matrix_from_vector(np.outer(angles[0], [0.0, 0.0, 1.0]))
    about_x = matrix_from_vector(np.outer(angles[1], [1.0, 0.0, 0.0]))
    ground, nowhere = np.tile(np.eye(4), (n_frames, 1, 1)), np.zeros((n_frames, 3))
    bodies = [ground, transform_from(about_z, nowhere), transform_from(about_z @ about_x, nowhere)]
    markers = [rigid(poses, seed=seed) for seed, poses in enumerate(bodies)]
    markers[0][n_seen:] = np.nan
    topology = find_joints(*as_take(markers), monitor=notices)
    assert topology.loops == ()
    assert "loop" not in " ".join(notices.sentences)


@pytest.mark.parametrize("spins", [False, True])
def test_limb_that_slides_along_another_is_a_body_of_its_own_and_is_told(notices, spins):
    """An arm that turns about z on the ground, and a rod that slides along the arm by 100 mm either way."""
    n_frames = 300
    angle, shift = 0.7 * np.sin(0.05 * np.arange(n_frames)), 100 * np.sin(0.031 * np.arange(n_frames))
    arm = matrix_from_vector(np.outer(angle, [0.0, 0.0, 1.0]))
    spin = matrix_from_vector(np.outer(angle[::-1] * spins, [1.0, 0.0, 0.0]))
    along = np.stack([400 + shift, 0 * shift, 0 * shift], axis=1)
    ground, nowhere = np.tile(np.eye(4), (n_frames, 1, 1)), np.zeros((n_frames, 3))
    bodies = [ground, transform_from(arm, nowhere), transform_from(arm @ spin, np.einsum("fij,fj->fi", arm, along))]
    topology = find_joints(*as_take([rigid(poses, seed=seed) for seed, poses in enumerate(bodies)]), monitor=notices)
    assert edges(topology) == {frozenset((0, 1))}
    assert "limb 1 and limb 2 slide along each other" in " ".join(notices.sentences)


def test_a_finger_that_slides_on_a_palm_is_not_joined_to_the_arm(notices):
    """A palm that turns about the end of an arm, and a finger that slides on it across its axis by 15 mm either way."""
    n_frames = 300
    sway, twist = 0.6 * np.sin(0.05 * np.arange(n_frames)), 0.8 * np.sin(0.037 * np.arange(n_frames))
    arm = matrix_from_vector(np.outer(sway, [0.3, 1.0, 0.0]))
    palm = arm @ matrix_from_vector(np.outer(twist, [0.0, 0.0, 1.0]))
    end = np.einsum("fij,j->fi", arm, [0.0, 0.0, 150.0])
    shift = np.stack([0 * sway, 30 + 15 * np.sin(0.023 * np.arange(n_frames)), 60 + 0 * sway], axis=1)
    bodies = [(np.tile(np.eye(3), (n_frames, 1, 1)), 0 * end - [0.0, 0.0, 100.0]), (arm, 0 * end), (palm, end),
              (palm, end + np.einsum("fij,fj->fi", palm, shift))]  # fmt: skip
    limbs = [rigid(transform_from(*body), noise=0.9, seed=seed) for seed, body in enumerate(bodies)]
    assert edges(find_joints(*as_take(limbs), monitor=notices)) == {frozenset((0, 1)), frozenset((1, 2))}
    assert "limb 2 and limb 3 slide along each other" in " ".join(notices.sentences)


def test_a_limb_that_slides_within_a_loop_is_told(notices):
    """A crank of 80 mm that goes round drives a slider on the ground by a rod of 250 mm: all in one plane."""
    turned = 0.1 * np.arange(400)
    tip = 80 * np.exp(1j * turned)
    slider = tip.real + np.sqrt(250**2 - tip.imag**2)
    bodies = (0 * tip, 0 * turned), (0 * tip, turned), (tip, np.angle(slider - tip)), (slider + 0 * tip, 0 * turned)
    topology = find_joints(*in_plane(*bodies), monitor=notices)
    assert edges(topology) == {frozenset(pair) for pair in ((0, 1), (1, 2), (2, 3))}
    assert "limb 0 and limb 3 slide along each other, by 160 mm" in " ".join(notices.sentences)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("names", [("human", "human"), ("rods", "rods"), ("human", "tree:8")])
def test_two_bodies_seen_together_are_two_trees(simulated, names, seed):
    first, second = simulated(names[0], seed, noise=0.5), simulated(names[1], seed + 50, noise=0.5)
    topology = find_joints(*together(first, second, (900.0, 0.0, 0.0)))
    n_limbs = first.truth.n_limbs
    assert edges(topology) == true_edges(first.truth) | {
        frozenset(limb + n_limbs for limb in edge) for edge in true_edges(second.truth)
    }


def test_two_bodies_that_walk_side_by_side_are_two_trees(simulated, notices):
    first, second = simulated("human", 0, noise=0.5), simulated("human", 50, noise=0.5)
    sway = np.arange(300)[:, np.newaxis] * np.array([0.011, 0.007, 0.06])
    roots = [case.truth.world_from_limb[:, 0] for case in (first, second)]
    beside = transform_from(
        matrix_from_vector(0.09 * np.sin(sway) * [0, 0, 1]), [900.0, 0.0, 0.0] + np.sin(sway + 1) * [40.0, 40.0, 15.0]
    )
    carried = roots[0] @ beside @ np.linalg.inv(roots[1])
    points = np.einsum("fij,fmj->fmi", carried[:, :3, :3], second.take.positions) + carried[:, np.newaxis, :3, 3]
    walking = dataclasses.replace(second, take=dataclasses.replace(second.take, positions=points))
    topology = find_joints(*together(first, walking, (0.0, 0.0, 0.0)), monitor=notices)
    assert len(topology.roots) == 2
    assert {limb < first.truth.n_limbs for limb in topology.edges[:, 0]} == {True, False}
    assert "separate bodies" in " ".join(notices.sentences)


def test_two_rigid_bodies_that_nothing_joins_are_two_trees(notices):
    pace = np.outer(np.arange(400), [0.031, 0.043, 0.019])
    turns = [matrix_from_vector(0.6 * np.sin(pace + phase)) for phase in (0.0, 2.0)]
    places = [200 * np.sin(pace[:, [1, 2, 0]] + phase) + [600.0 * phase, 0.0, 0.0] for phase in (0.0, 1.0)]
    bodies = [transform_from(turn, place) for turn, place in zip(turns, places, strict=True)]
    topology = find_joints(*as_take([rigid(poses, seed=seed) for seed, poses in enumerate(bodies)]), monitor=notices)
    assert len(topology.roots) == 2
    assert "nothing holds limb" in " ".join(notices.sentences)


def test_bodies_stay_one_tree_where_that_is_asked(simulated):
    take = together(simulated("rods", 0), simulated("rods", 50), (900.0, 0.0, 0.0))
    assert len(find_joints(*take, JointParameters(separate=False)).roots) == 1


@pytest.mark.parametrize(
    ("path", "n_trees"),
    [
        ("human/nick_freeform_001.c3d", 1),
        ("bone_pin/abdbonepin.trc", 1),
        ("rods_pendulum/pendulum_01.c3d", 1),
        ("wheelchair/racing_full.c3d", 2),
    ],
)
def test_recordings_are_as_many_trees_as_bodies(recording, reconstructed, path, n_trees):
    from skelgen.stages.limbs import find_limbs

    take = recording(path)
    assert len(find_joints(take, find_limbs(take)).roots) == n_trees


@pytest.mark.parametrize("structure", ["rods", "classic-human"])
@pytest.mark.parametrize("seed", range(2))
def test_limbs_of_one_and_two_markers_hang_where_they_truly_do(simulated, structure, seed):
    case = simulated(structure, seed, n_frames=600, noise=0.5)
    owner = case.truth.limb_of_marker
    keep = np.sort(np.concatenate([np.flatnonzero(owner == limb)[: kept_of(limb)] for limb in range(owner.max() + 1)]))
    take = dataclasses.replace(
        case.take, positions=case.take.positions[:, keep], names=tuple(case.take.names[marker] for marker in keep)
    )
    assert edges(find_joints(take, Limbs(owner[keep], np.zeros((len(keep),) * 2)))) == true_edges(case.truth)


def kept_of(limb):
    """Markers that stay on a limb: the last rod has one."""
    return 1 if limb == 2 else 9


@pytest.mark.parametrize("wish", ["limb1, limb2", "front rod 1, rear rod 1"])
def test_joint_that_is_asked_for_is_in_the_tree(simulated, true_limbs, wish):
    case = simulated("rods")
    names = case.take.names
    wish = wish.replace("front rod 1", names[-1]).replace("rear rod 1", names[3])
    topology = find_joints(case.take, true_limbs(case), JointParameters(joined=wish))
    assert frozenset((1, 2)) in edges(topology)


def test_joint_that_is_asked_for_is_in_the_tree_although_others_are_likelier(simulated, true_limbs):
    case = simulated("tree:8", 1, n_frames=600, **TISSUE)
    nearest = JointParameters(n_nearest=1)
    costs = find_joints(case.take, true_limbs(case), nearest).joint_costs
    first, second = np.argwhere(np.isnan(np.triu(costs)))[0].tolist()  # not tried
    stated = JointConstraints(joined=[(first, second)])
    assert frozenset((first, second)) in edges(find_joints(case.take, true_limbs(case), nearest, constraints=stated))


def test_joint_that_only_a_marker_set_asks_for_is_left_out_if_no_frame_shows_both_limbs(true_limbs, simulated, notices):
    case = simulated("rods")
    positions = case.take.positions.copy()
    limb = case.truth.limb_of_marker
    positions[::2, limb == 1], positions[1::2, limb == 2] = np.nan, np.nan
    take = dataclasses.replace(case.take, positions=positions)
    stated = JointConstraints(joined=[(1, 2)], of_person=[(1, 2)])
    topology = find_joints(take, true_limbs(case), constraints=stated, monitor=notices)
    assert frozenset((1, 2)) not in edges(topology)
    assert any("too few frames show both" in notice for notice in notices.sentences)


def test_joint_that_is_refused_is_not_in_the_tree(simulated, true_limbs):
    case = simulated("rods")
    topology = find_joints(case.take, true_limbs(case), JointParameters(parted="limb0, limb2", separate=False))
    assert edges(topology) == {frozenset((0, 1)), frozenset((1, 2))}
    assert np.isnan(topology.joint_costs[0, 2])


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"joined": "limb0"}, "two limbs belong"),
        ({"joined": "limb0, nobody"}, "no limb or marker 'nobody'"),
        ({"joined": "limb0, limb0"}, "twice"),
        ({"joined": "limb0, limb1", "parted": "limb1, limb0"}, "to be joined and not to be"),
        ({"joined": "limb0, limb1; limb1, limb2; limb0, limb2"}, "closes a loop"),
    ],
)
def test_constraints_that_cannot_be_are_refused(simulated, true_limbs, stated, message):
    case = simulated("rods")
    with pytest.raises(InputError, match=message):
        find_joints(case.take, true_limbs(case), JointParameters(**stated))


def is_finite(topology):
    """Whether nothing but places that are not known is NaN."""
    return np.isfinite(topology.values).all() and not np.isinf(topology.joint_costs).any()


def test_limbs_that_never_turn_against_each_other_are_told(notices):
    poses = turning(300, (0, 0, 0), 1)
    shifted = poses @ transform_from(np.eye(3), np.array([0.0, 0.0, 300.0]))
    topology = find_joints(*as_take([rigid(poses), rigid(shifted, seed=1)]), monitor=notices)
    assert is_finite(topology)
    assert "deg beyond what errors of their markers explain" in " ".join(notices.sentences)


def test_take_in_which_nothing_moves_is_told(notices):
    still = np.tile(np.eye(4), (100, 1, 1))
    topology = find_joints(*as_take([rigid(still, 0.0), rigid(still, 0.0) + 300.0]), monitor=notices)
    assert is_finite(topology)
    assert "hardly turn against each other" in " ".join(notices.sentences)
    # Whether the joint is determined is for the skeleton to say, which knows more than their motion
    assert "determined" not in " ".join(notices.sentences)


def test_markers_that_are_all_in_one_place_give_no_nonsense(notices):
    topology = find_joints(*as_take([np.ones((50, 3, 3)), np.ones((50, 2, 3)), np.ones((50, 1, 3))]), monitor=notices)
    assert is_finite(topology)
    assert notices.sentences


def test_coincident_markers_change_no_tree(simulated, true_limbs):
    case = simulated("rods", noise=0.3)
    positions = case.take.positions.copy()
    positions[:, 1] = positions[:, 0]
    topology = find_joints(dataclasses.replace(case.take, positions=positions), true_limbs(case))
    assert edges(topology) == true_edges(case.truth)


def test_limb_that_is_seen_in_five_frames_is_told(simulated, true_limbs, notices):
    case = simulated("rods", noise=0.3)
    positions = case.take.positions.copy()
    positions[5:, 6:] = np.nan
    topology = find_joints(dataclasses.replace(case.take, positions=positions), true_limbs(case), monitor=notices)
    assert is_finite(topology)
    assert {frozenset((0, 1))} <= edges(topology)
    assert notices.sentences


def test_limb_that_is_never_seen_is_a_tree_of_its_own(simulated, true_limbs, notices):
    case = simulated("rods", noise=0.3)
    positions = case.take.positions.copy()
    positions[:, 6:] = np.nan
    topology = find_joints(dataclasses.replace(case.take, positions=positions), true_limbs(case), monitor=notices)
    assert sorted(topology.roots.tolist())[-1] == 2
    assert "never seen together" in " ".join(notices.sentences)


def test_a_search_asked_again_with_other_constraints_finds_what_a_new_one_does(simulated, true_limbs):
    case = simulated("human", 1, n_frames=200, **TISSUE)
    limbs = true_limbs(case)
    search = JointSearch(case.take, limbs)
    first, last = search.find(), find_joints(case.take, limbs).edges[-1].tolist()
    parted = JointConstraints(parted=(tuple(last),))
    again, new = search.find(parted), find_joints(case.take, limbs, constraints=parted)
    assert edges(again) != edges(first)
    np.testing.assert_array_equal(again.parents, new.parents)
    np.testing.assert_array_equal(again.raw_joint_positions, new.raw_joint_positions)


def test_limb_with_one_marker_closes_no_loop():
    """Of a chain of four limbs whose ends seem joined, the last has one marker, whose turns nobody sees."""
    parents, seen = np.array([-1, 0, 1, 2]), np.ones((4, 4))
    costs = JointCosts(comparable=seen, order=seen, squares=seen, expected=seen, turns=seen)
    assert (0, 3) in loop_joints(parents, costs, [3, 3, 3, 2])
    assert loop_joints(parents, costs, [3, 3, 3, 1]) == ((0, 2),)
