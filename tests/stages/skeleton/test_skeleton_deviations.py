"""Stated deviations of everything that a skeleton holds: as large as the errors are, with white noise."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest

from skelgen.geometry.orientation import fit_transform
from skelgen.kinematics import limb_bodies
from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.kinematics.joints.angles import joint_angles

SEEDS, N_FRAMES, NOISE = range(8), 300, 0.5  # mm
EXACT = 1e-5  # mm: noise counts as a millionth of a mm at least
COVERED = (0.90, 0.98)  # of 95 % intervals: what the issue asks
FRAMES = np.arange(0, N_FRAMES, 5)
FEW = 60
"""Numbers below which coverage scatters by more than the limits: then the root mean square is looked at."""


@pytest.fixture(scope="module")
def scores(simulated, reconstructed, true_limbs):
    """Errors in units of their stated deviations, by what is stated, of random trees of 8 limbs with three markers.

    The true limbs are lined up with those that were found by their markers, which is what deviations count against.
    """
    found = defaultdict(list)
    for seed in SEEDS:
        case = simulated("tree:8", seed, N_FRAMES, noise=NOISE)
        project = reconstructed(case.take, given_limbs=true_limbs(case))
        for what, values in _errors(case.truth, project):
            found[what].append(np.ravel(values))
    return {what: np.concatenate(parts) for what, parts in found.items()}


def _errors(truth, project):
    skeleton = project.skeleton
    turns = []  # rotations found from true limb
    for limb in range(skeleton.n_limbs):
        own = skeleton.markers_of(limb)
        transform = _lined_up(truth, skeleton, limb)
        turns.append(transform[:3, :3])
        true = _seen_from(truth, limb, truth.marker_positions[0, own]) @ transform[:3, :3].T + transform[:3, 3]
        yield "offsets", (skeleton.marker_offsets[own] - true) / skeleton.offset_std[own]
    index = {frozenset(edge): column for column, edge in enumerate(truth.edges.tolist())}
    columns = [index[frozenset((joint.parent, joint.child))] for joint in skeleton.joints]
    posture = posture_of(skeleton, project.motion, project.trajectories.positions, FRAMES)
    rotations = truth.world_from_limb[FRAMES][..., :3, :3] @ np.swapaxes(turns, 1, 2)
    for number, (joint, column) in enumerate(zip(skeleton.joints, columns, strict=True)):
        if joint.kind != truth.joint_kinds[column]:
            continue
        relative = rotations[:, joint.parent].swapaxes(1, 2) @ rotations[:, joint.child]
        std = posture.angle_std[number]
        yield f"angles of a {joint.kind}", (posture.angles[number] - joint_angles(joint, relative)) / std
        if joint.kind == "hinge":
            axis = truth.joint_axes[FRAMES[0], column]
            for limb, stated in ((joint.parent, joint.axis_std), (joint.child, joint.second_axis_std)):
                true = rotations[0, limb].T @ axis
                yield "axes of hinges", (joint.axis - true * np.sign(true @ joint.axis)) / stated
            continue
        places = (joint.parent, joint.position_in_parent, joint.std), (joint.child, np.zeros(3), joint.std_in_child)
        for limb, place, stated in places:
            true = _seen_from(truth, limb, truth.joint_positions[:1, column])[0]
            true = _lined_up(truth, skeleton, limb) @ np.append(true, 1.0)
            yield "joints in both limbs", (place - true[:3]) / stated
        gap = posture.joint_positions[:, number] - truth.joint_positions[FRAMES, column]
        yield "joints in the world", gap / posture.joint_std[:, number]
    for (pair, length), stated in zip(skeleton.lengths.items(), skeleton.length_std, strict=True):
        if all(skeleton.joints[one].kind != "hinge" for one in pair):
            ends = truth.joint_positions[0, [columns[one] for one in pair]]
            yield "lengths", [(length - np.linalg.norm(ends[0] - ends[1])) / stated]


def _seen_from(truth, limb, points):
    pose = truth.world_from_limb[0, limb]
    return (points - pose[:3, 3]) @ pose[:3, :3]


def _lined_up(truth, skeleton, limb):
    own = skeleton.markers_of(limb)
    true = _seen_from(truth, limb, truth.marker_positions[0, own])
    return fit_transform(true, skeleton.marker_offsets[own][np.newaxis], np.ones((1, len(own)), dtype=bool))[0]


@pytest.mark.parametrize(
    "what",
    [
        "offsets",
        "joints in both limbs",
        "joints in the world",
        "angles of a ball",
        "angles of a hinge",
        "angles of a universal",
    ],
)
def test_intervals_hold_the_truth(scores, what):
    assert len(scores[what]) > FEW
    assert COVERED[0] <= (np.abs(scores[what]) <= 1.96).mean() <= COVERED[1]


@pytest.mark.parametrize("what", ["lengths", "axes of hinges"])
def test_few_numbers_err_by_what_is_stated(scores, what):
    assert len(scores[what]) > 20
    assert 0.7 < np.sqrt((scores[what] ** 2).mean()) < 1.3  # 30 numbers scatter by 13 %


def test_place_along_a_hinge_is_as_open_as_its_limb_is_large(simulated, reconstructed, true_limbs):
    case = simulated("tree:8", 0, N_FRAMES, noise=NOISE)
    hinges = [
        joint
        for joint in reconstructed(case.take, given_limbs=true_limbs(case)).skeleton.joints
        if joint.kind == "hinge"
    ]
    assert hinges
    for joint in hinges:
        np.testing.assert_allclose(np.diag(joint.covariance), joint.std**2)
        assert joint.axis @ joint.covariance @ joint.axis > 50.0**2
        across = np.eye(3) - np.outer(joint.axis, joint.axis)
        assert np.trace(across @ joint.covariance) < 1.0


def test_more_noise_makes_everything_less_sure(simulated, reconstructed, true_limbs):
    """Deviations grow in proportion to the noise."""
    quiet, loud = (
        reconstructed(case.take, given_limbs=true_limbs(case)).skeleton
        for case in (simulated("rods", 0, N_FRAMES, noise=size) for size in (0.1, 1.0))
    )
    assert loud.marker_noise[0] / quiet.marker_noise[0] == pytest.approx(10, rel=0.1)
    spreads = [np.linalg.norm(one.offset_std, axis=1) for one in (loud, quiet)]
    np.testing.assert_allclose(spreads[0] / spreads[1], 10, rtol=0.3)
    np.testing.assert_allclose(loud.length_std / quiet.length_std, 10, rtol=0.3)


def test_exact_take_is_all_but_certain(simulated, reconstructed, true_limbs):
    case = simulated("rods")
    skeleton = reconstructed(case.take, given_limbs=true_limbs(case)).skeleton
    assert skeleton.offset_std.max() < EXACT
    assert skeleton.length_std.max() < EXACT
    assert all(joint.std_in_child.max() < EXACT for joint in skeleton.joints)


def test_limbs_calibrated_on_their_own_have_the_shapes_of_the_skeleton(simulated, reconstructed, true_limbs):
    """Distances of markers on a limb, free of any frame; what the chain knows beyond is little."""
    case = simulated("tree:8", 1, N_FRAMES, noise=NOISE)
    skeleton = reconstructed(case.take, given_limbs=true_limbs(case)).skeleton
    bodies = limb_bodies(case.take, true_limbs(case))
    assert len(bodies) == skeleton.n_limbs
    for limb, body in bodies.items():
        own = skeleton.marker_offsets[skeleton.markers_of(limb)]
        alone, chained = (np.linalg.norm(points[1] - points[0]) for points in (body.points, own))
        assert alone == pytest.approx(chained, abs=3 * body.std[1, 0])
        spread = skeleton.offset_std[skeleton.markers_of(limb)]
        assert np.sqrt((spread**2).sum()) < 1.2 * np.sqrt((body.std**2).sum())
