"""Bodies with poses as a hierarchy: found, given, rooted, played back."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import find_hierarchy, without_residual
from skelgen.kinematics.hierarchy import joint_gaps
from skelgen.model import Poses
from skelgen.simulation import simulate

NOISE = {"shift": 2.0, "turn": 0.01}  # mm, rad: a magnetic sensor
HELD = 1e-3  # mm: what the ridge of the closed form leaves


@pytest.fixture(scope="module")
def sensors():
    """`sensors(name, seed, shift, turn)`: a sensor somewhere on every limb, with errors; its `.mount` on the limb."""

    def make(name, seed=0, shift=0.0, turn=0.0, n_frames=600):
        random, truth = np.random.default_rng(seed), simulate(name, seed=seed, n_frames=n_frames).truth
        mount = np.tile(np.eye(4), (truth.n_limbs, 1, 1))
        mount[:, :3, :3] = matrix_from_vector(random.normal(size=(truth.n_limbs, 3)))
        mount[:, :3, 3] = random.normal(size=(truth.n_limbs, 3)) * 60
        world = truth.world_from_limb @ mount
        world[..., :3, :3] @= matrix_from_vector(turn * random.normal(size=(*world.shape[:2], 3)))
        world[..., :3, 3] += shift * random.normal(size=(*world.shape[:2], 3))
        return SimpleNamespace(poses=Poses(world, truth.limb_names, 100.0), truth=truth, mount=mount)

    return make


def edges(parents):
    return {frozenset((int(parent), child)) for child, parent in enumerate(parents) if parent >= 0}


@pytest.mark.parametrize("name", ["rods", "human", "tree:8"])
@pytest.mark.parametrize("noise", [{}, NOISE], ids=["exact", "noisy"])
def test_hierarchy_and_kinds_are_found(sensors, name, noise):
    case = sensors(name, 1, **noise)
    found = find_hierarchy(case.poses)
    true = {frozenset(edge): kind for edge, kind in zip(case.truth.edges.tolist(), case.truth.joint_kinds, strict=True)}
    assert edges(found.parents) == set(true)
    for child, joint in found.joints.items():
        assert joint.kind == true[frozenset((child, int(found.parents[child])))]


def test_places_are_within_their_deviations(sensors):
    inside = []
    for seed in range(6):
        case = sensors("rods", seed, **NOISE)
        names = case.poses.names
        parents = {names[child]: names[parent] for parent, child in case.truth.edges}
        found = find_hierarchy(case.poses, parents)
        for joint, (parent, child) in enumerate(case.truth.edges):
            place = np.append(case.truth.positions_in_parent[joint], 1.0)
            true = (np.linalg.inv(case.mount[parent]) @ place)[:3]
            fit = found.joints[int(child)].fit
            inside.append(np.abs(fit.in_parent - true) < 2.6 * fit.std[0])
    assert np.mean(inside) > 0.93  # 99 % intervals of 36 coordinates


def test_root_is_the_body_with_most_joints_or_the_one_asked_for(sensors):
    poses = sensors("rods").poses
    assert poses.names[int(np.flatnonzero(find_hierarchy(poses).parents < 0)[0])] == "middle rod"
    asked = find_hierarchy(poses, "rear rod")
    assert asked.parents[poses.names.index("rear rod")] == -1


def test_given_hierarchy_is_obeyed(sensors):
    poses = sensors("rods").poses
    found = find_hierarchy(poses, {"middle rod": "rear rod", "front rod": "rear rod", "rear rod": None})
    rear = poses.names.index("rear rod")
    assert sorted(found.parents.tolist()) == sorted([-1, rear, rear])


@pytest.mark.parametrize("parents", [{"middle rod": "nobody"}, {"rear rod": "front rod", "front rod": "rear rod"}])
def test_impossible_hierarchies_are_refused(sensors, parents):
    with pytest.raises(InputError):
        find_hierarchy(sensors("rods").poses, parents)


def test_markers_are_refused_with_what_finds_theirs():
    with pytest.raises(InputError, match="the poses are Trajectories"):
        find_hierarchy(simulate("rods", n_frames=5).take)


def test_playback_without_residual_holds_all_joints_together(sensors):
    case = sensors("human", 2, **NOISE)
    found = find_hierarchy(case.poses)
    played = without_residual(case.poses, found)
    gaps = joint_gaps(played)
    assert max(gaps[child, found.parents[child]] for child in found.joints) < HELD
    np.testing.assert_array_equal(played.world_from_body[..., :3, :3], case.poses.world_from_body[..., :3, :3])
    root = int(np.flatnonzero(found.parents < 0)[0])
    np.testing.assert_array_equal(played.world_from_body[:, root], case.poses.world_from_body[:, root])


def test_lengths_between_joints_are_the_true_ones(sensors):
    case = sensors("human", 1, **NOISE)
    truth = case.truth
    for length in find_hierarchy(case.poses).lengths:
        joints = []
        for other in (length.first, length.second):
            pair = {case.poses.names.index(length.body), case.poses.names.index(other)}
            joints.append([set(edge) for edge in truth.edges.tolist()].index(pair))
        if length.is_determined:
            first, second = (truth.joint_positions[0, joint] for joint in joints)
            true = float(np.linalg.norm(first - second))
            assert length.length == pytest.approx(true, abs=4 * length.std + 5.0)  # hinges: 5 mm along the axis


@pytest.fixture
def parallelogram():
    """Four rods joined by hinges in a plane, which turns with the first."""
    swing = np.sin(np.linspace(0, 30, 400))
    bodies = np.tile(np.eye(4), (400, 4, 1, 1))
    for side in (1, 3):
        bodies[:, side, :3, :3] = matrix_from_vector(np.outer(swing, [0.0, 0, 1]))
    bodies[:, 2, :3, 3] = 300 * np.stack([np.cos(swing), np.sin(swing), 0 * swing], axis=1)
    bodies[:, 3, :3, 3] = [200.0, 0, 0]
    plane = np.tile(np.eye(4), (400, 1, 1, 1))
    plane[:, 0, :3, :3] = matrix_from_vector(np.stack([swing, swing[::-1], swing**2], axis=1))
    return Poses(plane @ bodies, ("base", "left", "top", "right"), 100.0)


def test_a_closed_loop_is_reported_once(parallelogram):
    found = find_hierarchy(parallelogram)
    assert [joint.kind for joint in found.joints.values()] == ["hinge"] * 3
    assert len(found.loops) == 1
    assert [joint.kind for joint in found.loop_joints] == ["hinge"]


def test_lengths_of_a_closed_loop_are_those_of_its_rods(parallelogram):
    lengths = {length.body: length.length for length in find_hierarchy(parallelogram).lengths}
    assert lengths == pytest.approx({"base": 200, "left": 300, "top": 200, "right": 300}, abs=0.1)


def test_stated_loops_are_obeyed(parallelogram):
    chain = {"base": None, "left": "base", "top": "left", "right": "top"}
    assert find_hierarchy(parallelogram, chain, loops=()).loops == ()
    found = find_hierarchy(parallelogram, chain, loops=[("base", "right")])
    assert found.loops == ((0, 3),)
    place = parallelogram.world_from_body[:, [0, 3]]
    fit = found.loop_joints[0].fit
    ends = [
        pose[:, :3, :3] @ at + pose[:, :3, 3]
        for pose, at in zip(place.swapaxes(0, 1), (fit.in_parent, fit.in_child), strict=True)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=0.01)


def test_a_tree_has_no_loop(sensors):
    assert find_hierarchy(sensors("tree:8", 1).poses).loops == ()


def test_bodies_never_seen_together_are_separate_trees(sensors):
    case = sensors("rods")
    world = np.array(case.poses.world_from_body)
    world[:300, 0], world[300:, 1:] = np.nan, np.nan
    found = find_hierarchy(Poses(world, case.poses.names, 100.0))
    assert (found.parents < 0).sum() == 2


def test_known_kinds_are_obeyed(sensors):
    poses = sensors("rods").poses
    found = find_hierarchy(poses, types={"front rod": "hinge"})
    assert found.joints[poses.names.index("front rod")].kind == "hinge"
    with pytest.raises(InputError, match="slider"):
        find_hierarchy(poses, types={"front rod": "slider"})
