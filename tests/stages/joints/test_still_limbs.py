"""A tree that still limbs alone hold together may be that of several bodies; joints of limbs that move are evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.model import Limbs
from skelgen.simulation import simulate
from skelgen.stages.joints import JointConstraints, find_joints
from skelgen.stages.joints.still_limbs import still_limb_notices

MOVING = np.random.default_rng(0).normal(0.0, 100.0, (50, 6, 3))
STILL = np.zeros((50, 4, 3))


def nameless(take):
    return skelgen.Trajectories(take.positions, [f"M{marker}" for marker in range(take.n_markers)], take.rate)


@pytest.mark.parametrize(("subjects", "marker_set", "n_notices"), [(1, "auto", 0), (2, "none", 1), (2, "auto", 0)])
def test_two_people_who_stand_side_by_side_are_told_and_one_is_not(subjects, marker_set, n_notices):
    options = {"motion": "reach", "marker_set": "animation-41", "n_frames": 300, "soft_tissue": "realistic"}
    apart = {"apart": 300.0} if subjects > 1 else {}
    take = nameless(skelgen.simulate("human", seed=0, noise=0.3, subjects=subjects, **options, **apart).take)
    project = skelgen.reconstruct(take, until="joints", parameters={"limbs": {"marker_set": marker_set}})
    assert sum("may belong to 2 bodies" in notice for notice in project.reports["joints"].notices) == n_notices
    assert len(np.unique(project.limbs.body_of_limb)) == subjects - n_notices


@pytest.mark.parametrize("edges", [[(0, 2), (2, 3), (3, 1)], [(0, 2), (2, 1)]], ids=["two feet", "feet as one limb"])
def test_limbs_that_still_ones_alone_join_may_belong_to_two_bodies(edges):
    limbs = [MOVING, MOVING + 500.0, STILL, STILL + 300.0][: len(edges) + 1]
    (notice,) = still_limb_notices(limbs, np.array(edges))
    assert notice.startswith("limbs 0 and 1 may belong to 2 bodies")
    assert not list(still_limb_notices(limbs, np.array([*edges, (0, 1)])))
    assert not list(still_limb_notices(limbs, np.array([(0, 2)])))


def test_arms_that_move_on_a_still_trunk_are_one_body():
    trunk, unseen = np.zeros((50, 20, 3)), np.full((50, 2, 3), np.nan)
    edges = np.array([(0, 1), (1, 2), (1, 3)])
    assert not list(still_limb_notices([MOVING, trunk, MOVING + 500.0, unseen], edges))


def on_the_floor(limb, seed=0):
    """A tree of eight limbs, one of which is fixed in the room, and their markers."""
    case = simulate("tree:8", seed=seed, n_frames=500)
    room = np.linalg.inv(case.truth.world_from_limb[:, limb])
    positions = np.einsum("fij,fmj->fmi", room[:, :3, :3], case.take.positions) + room[:, np.newaxis, :3, 3]
    positions += np.random.default_rng(seed).normal(0, 0.5, positions.shape)
    limb_of_marker = case.truth.limb_of_marker
    limbs = Limbs(limb_of_marker, np.zeros((len(limb_of_marker),) * 2))
    return replace(case.take, positions=positions), limbs


@pytest.mark.parametrize("limb", range(8))
def test_what_is_fixed_in_the_room_is_the_root(limb):
    assert find_joints(*on_the_floor(limb)).roots.tolist() == [limb]


def test_a_root_that_is_stated_is_the_root_whatever_is_fixed():
    assert find_joints(*on_the_floor(2), constraints=JointConstraints(roots=[5])).roots.tolist() == [5]


@pytest.mark.parametrize("name", ["kicks", "treadmill", "walk"])
def test_what_stands_in_the_room_beside_a_person_is_no_part_of_them(recording, name):
    take = recording(f"bodies/{name}.{'c3d' if name == 'kicks' else 'trc'}")
    rng, middle = np.random.default_rng(0), np.nanmean(take.positions, axis=(0, 1))
    frame = np.tile(middle + rng.normal(0, 400, (3, 3)), (take.n_frames, 1, 1))
    positions = np.concatenate([take.positions, frame + rng.normal(0, 0.1, frame.shape)], axis=1)
    project = skelgen.reconstruct(nameless(skelgen.Trajectories(positions, [*take.names, "a", "b", "c"], take.rate)))
    alone = set(project.limbs.limb_of_marker[-3:].tolist())
    assert len(alone) == 1 and len(project.topology.roots) == 2
    assert alone.isdisjoint(project.topology.edges.ravel().tolist())
