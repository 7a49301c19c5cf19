"""Kinematic loops in the skeleton: closed as the user states, nearer to the truth, with notices."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.inverse.inverse_kinematics import solve
from skelgen.kinematics.inverse.loop_closure import loop_gaps
from skelgen.model import Limbs, Trajectories
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

LENGTHS = (300.0, 120.0, 280.0, 200.0)  # mm: ground, crank, coupler and rocker of a four-bar linkage
N_FRAMES, NOISE = 300, 0.5
CLOSED = 0.01  # mm; a hundredth of the noise is 0.005


def four_bar(seed):
    """A four-bar linkage that turns three times while it is carried about, with four markers on each bar."""
    random = np.random.default_rng(seed)
    ground, crank, coupler, rocker = LENGTHS
    turn = np.linspace(0, 6 * np.pi, N_FRAMES)
    first = crank * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    way = np.array([ground, 0.0]) - first
    reach = np.linalg.norm(way, axis=1)
    bend = np.arccos((coupler**2 + reach**2 - rocker**2) / (2 * coupler * reach))
    second_angle = np.arctan2(way[:, 1], way[:, 0]) + bend
    end = first + coupler * np.stack([np.cos(second_angle), np.sin(second_angle)], axis=1)
    angles = (0 * turn, turn, second_angle, np.arctan2(end[:, 1], end[:, 0] - ground))
    origins = (0 * first, 0 * first, first, np.tile([ground, 0.0], (N_FRAMES, 1)))
    carried = matrix_from_vector(np.cumsum(random.normal(size=(N_FRAMES, 3)) * 0.02, axis=0))
    shift = np.cumsum(random.normal(size=(N_FRAMES, 1, 3)) * 5, axis=0)
    markers = []
    for angle, origin, length in zip(angles, origins, LENGTHS, strict=True):
        points = random.uniform(-60, 60, (4, 3)) + np.array([length / 2, 0.0, 0.0])
        turned = np.einsum("fij,mj->fmi", matrix_from_vector(angle[:, np.newaxis] * [0.0, 0.0, 1.0]), points)
        turned[..., :2] += origin[:, np.newaxis]
        markers.append(turned)
    true = np.einsum("fij,fmj->fmi", carried, np.concatenate(markers, axis=1)) + shift
    noisy = true + NOISE * random.normal(size=true.shape)
    take = Trajectories(noisy, tuple(f"M{marker}" for marker in range(16)), 100.0)
    return SimpleNamespace(take=take, true=true, limbs=Limbs(np.repeat(np.arange(4), 4), np.zeros((16, 16))))


@pytest.fixture(scope="module", params=range(3))
def linkage(request):
    """A linkage with its tree, its skeleton with an open and with a closed loop, and what was said."""
    case = four_bar(request.param)
    case.topology = find_joints(case.take, case.limbs)
    case.open = fit_skeleton(case.take, case.limbs, case.topology)
    case.closed = fit_skeleton(case.take, case.limbs, case.topology, SkeletonParameters(loops="found"))
    return case


def error(case, fitted):
    return np.sqrt(((fitted[1].marker_positions - case.true) ** 2).sum(axis=2).mean())


def test_loop_is_open_unless_it_is_wished_closed(linkage):
    assert len(linkage.topology.loops) == 1
    assert linkage.open[0].loops == ()


def test_closed_loop_stays_closed_in_every_frame(linkage):
    (joint,) = linkage.closed[0].loops
    assert {joint.parent, joint.child} == set(linkage.topology.loops[0])
    assert loop_gaps(*linkage.closed).max() < CLOSED


def test_closed_loop_is_nearer_to_the_truth(linkage):
    assert error(linkage, linkage.closed) < 0.95 * error(linkage, linkage.open)


def test_bars_keep_their_lengths(linkage):
    """From hinge to hinge across the axis, the loop's joint included."""
    skeleton = linkage.closed[0]
    ends = {limb: [place for _, place in skeleton.joints_of(limb)] for limb in range(4)}
    (ring,) = skeleton.loops
    ends[ring.parent].append(ring.position_in_parent)
    ends[ring.child].append(ring.position_in_child)
    axis = skeleton.joints[0].axis
    for limb, length in enumerate(LENGTHS):
        way = ends[limb][0] - ends[limb][1]
        assert np.linalg.norm(way - (way @ axis) * axis) == pytest.approx(length, abs=0.5)


def test_place_of_the_loop_is_as_open_as_hinges_are(linkage):
    (joint,) = linkage.closed[0].loops
    axis = linkage.closed[0].joints[0].axis
    assert axis @ joint.covariance @ axis > 30.0**2
    across = np.eye(3) - np.outer(axis, axis)
    assert np.trace(across @ joint.covariance @ across) < 1.0


def test_inverse_kinematics_keeps_the_loop_closed(linkage):
    skeleton, motion = linkage.closed
    posture = solve(skeleton, linkage.take.positions[:20])
    np.testing.assert_allclose(posture.world_from_limb, motion.world_from_limb[:20], atol=0.01)


def test_gap_before_and_after_is_a_notice(linkage, notices):
    pair = "; ".join(f"limb{a}, limb{b}" for a, b in linkage.topology.loops)
    fit_skeleton(linkage.take, linkage.limbs, linkage.topology, SkeletonParameters(loops=pair), monitor=notices)
    (notice,) = (sentence for sentence in notices.sentences if "loop" in sentence)
    assert "is closed: its ends were 0." in notice
    assert "the residual of a coordinate is" in notice


def test_limbs_that_are_joined_close_no_loop(linkage):
    first, second = linkage.topology.edges[0]
    with pytest.raises(InputError, match="joined by the tree already"):
        fit_skeleton(
            linkage.take, linkage.limbs, linkage.topology, SkeletonParameters(loops=f"limb{first}, limb{second}")
        )


def test_loop_that_was_found_but_does_not_hold_stays_open(linkage, notices):
    parents = linkage.topology.parents
    apart = [
        (a, b)
        for a in range(4)
        for b in range(a)
        if (b, a) not in linkage.topology.loops and parents[a] != b and parents[b] != a
    ]
    wrong = replace(linkage.topology, loops=tuple(apart[:1]))
    skeleton, _ = fit_skeleton(linkage.take, linkage.limbs, wrong, SkeletonParameters(loops="found"), monitor=notices)
    assert skeleton.loops == ()
    assert any("form no loop" in sentence for sentence in notices.sentences)


def test_only_the_whole_chain_closes_loops(linkage, notices):
    wish = SkeletonParameters(loops="found", fit="root-outward")
    skeleton, _ = fit_skeleton(linkage.take, linkage.limbs, linkage.topology, wish, monitor=notices)
    assert skeleton.loops == ()
    assert any("loops stay open" in sentence for sentence in notices.sentences)


def test_bodies_apart_close_no_loop(linkage):
    parted = JointParameters(parted="limb0, limb1; limb0, limb2; limb0, limb3", separate=True)
    topology = find_joints(linkage.take, linkage.limbs, parted)
    with pytest.raises(InputError, match="separate bodies"):
        fit_skeleton(linkage.take, linkage.limbs, topology, SkeletonParameters(loops="limb0, limb2"))
