"""Joints of each kind, fitted to the poses of two bodies: exact on exact poses, deviations that hold on noisy ones."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import fit_joint
from skelgen.kinematics.joints.relative_poses import relative_poses

TYPES = ("ball", "hinge", "universal", "rigid")
EXACT = 1e-6  # mm, rad
COVERAGE = (0.90, 0.98)  # of 95 % intervals, over all coordinates
N_TAKES = 60  # with 3 coordinates or more: the coverage is known to some 2 %
RMS_TOLERANCE = 0.15  # relative, of a root mean square over so many takes

by_kind = pytest.mark.parametrize("kind", TYPES)
turning = pytest.mark.parametrize("kind", ["ball", "hinge", "universal"])
known = pytest.mark.parametrize("is_known", [True, False], ids=["covariances", "poses alone"])


@pytest.fixture(scope="module")
def fitted(tracked_joint):
    """`fitted(kind, is_known, **options)`: cases and fits of many takes."""
    done = {}

    def fit(kind, is_known=True, n_takes=N_TAKES, **options):
        key = (kind, is_known, n_takes, *sorted(options.items()))
        if key not in done:
            cases = [tracked_joint(kind, seed, **options) for seed in range(n_takes)]
            covariances = [case.covariances if is_known else None for case in cases]
            done[key] = [
                (case, fit_joint(kind, case.poses, "upper", "lower", one))
                for case, one in zip(cases, covariances, strict=True)
            ]
        return done[key]

    return fit


def across(kind, case):
    """Projection onto what can be told of (in parent, in child): not along a hinge's axis."""
    keep = np.eye(6)
    if kind == "hinge":
        keep[:3, :3] -= np.outer(case.first, case.first)
        keep[3:, 3:] -= np.outer(case.second, case.second)
    return keep


def errors(kind, case, fit):
    """Error of the place [mm] and its deviation, shapes (6,)."""
    keep = across(kind, case)
    error = keep @ np.concatenate([fit.in_parent - case.in_parent, fit.in_child - case.in_child])
    return error, np.sqrt(np.diag(keep @ fit.covariance @ keep.T))


def same_way(axis, wanted):
    return axis * np.sign(axis @ wanted)


@turning
def test_exact_poses_give_the_exact_joint(tracked_joint, kind):
    case = tracked_joint(kind, noise=0.0)
    fit = fit_joint(kind, case.poses, "upper", "lower")
    assert np.abs(errors(kind, case, fit)[0]).max() < EXACT
    assert fit.gap < EXACT


@pytest.mark.parametrize("kind", ["hinge", "universal"])
def test_exact_poses_give_the_exact_axes(tracked_joint, kind):
    case = tracked_joint(kind, noise=0.0)
    fit = fit_joint(kind, case.poses, "upper", "lower")
    np.testing.assert_allclose(same_way(fit.axis_in_parent, case.first), case.first, atol=EXACT)
    np.testing.assert_allclose(same_way(fit.axis_in_child, case.second), case.second, atol=EXACT)


@turning
@known
def test_stated_deviations_of_the_place_hold(fitted, kind, is_known):
    pairs = [errors(kind, *one) for one in fitted(kind, is_known)]
    inside = [np.abs(error) < 1.96 * std for error, std in pairs]
    assert COVERAGE[0] <= np.mean(inside) <= COVERAGE[1]
    found = np.sqrt(np.mean([error @ error for error, _ in pairs]))
    stated = np.sqrt(np.mean([std @ std for _, std in pairs]))
    assert found == pytest.approx(stated, rel=RMS_TOLERANCE)


@pytest.mark.parametrize("kind", ["hinge", "universal"])
@known
def test_stated_deviations_of_the_axes_hold(fitted, kind, is_known):
    inside = []
    for case, fit in fitted(kind, is_known):
        error = np.concatenate(
            [
                same_way(fit.axis_in_parent, case.first) - case.first,
                same_way(fit.axis_in_child, case.second) - case.second,
            ]
        )
        inside.append(np.abs(error) < 1.96 * np.sqrt(np.diag(fit.axis_covariance)))
    assert COVERAGE[0] <= np.mean(inside) <= COVERAGE[1]


@pytest.mark.parametrize("kind", ["hinge", "universal"])
def test_stated_deviations_of_the_angles_hold(fitted, kind):
    inside = []
    for case, fit in fitted(kind)[:20]:
        true = case.angles[:, : fit.angles.shape[1]]
        sign = np.sign(((fit.angles - fit.angles.mean(axis=0)) * (true - true.mean(axis=0))).sum(axis=0))
        error = sign * fit.angles - true
        error -= error.mean(axis=0)  # where the angle is 0 is a convention
        inside.append(np.abs(error) < 1.96 * fit.angle_std)
    assert COVERAGE[0] <= np.mean(inside) <= COVERAGE[1]


def test_stated_deviations_of_a_balls_turns_hold(fitted):
    inside = []
    for case, fit in fitted("ball")[:20]:
        between = matrix_from_vector(fit.angles) @ case.rotations.swapaxes(1, 2)
        small = np.stack([between[:, 2, 1], between[:, 0, 2], between[:, 1, 0]], axis=1)
        inside.append(np.abs(small) < 1.96 * fit.angle_std)
    assert COVERAGE[0] <= np.mean(inside) <= COVERAGE[1]


def test_free_ball_joint_with_20_degrees_of_motion(fitted):
    pairs = [errors("ball", *one) for one in fitted("ball", degrees=10.0, noise=1.0, n_frames=200)]
    found = np.sqrt(np.mean([error[:3] @ error[:3] for error, _ in pairs]))
    stated = np.sqrt(np.mean([std[:3] @ std[:3] for _, std in pairs]))
    assert found <= 5.0  # mm
    assert found == pytest.approx(stated, rel=RMS_TOLERANCE)


def test_a_hinge_taken_for_a_ball_is_not_sure_of_its_place_along_the_axis(tracked_joint):
    inside = []
    for seed in range(20):
        case = tracked_joint("hinge", seed)
        fit = fit_joint("ball", case.poses, "upper", "lower", case.covariances)
        error = (fit.in_parent - case.in_parent) @ case.first
        inside.append(abs(error) < 1.96 * np.sqrt(case.first @ fit.covariance[:3, :3] @ case.first))
    assert np.mean(inside) >= COVERAGE[0]


def test_what_no_frame_tells_is_stated_as_unknown(tracked_joint):
    case = tracked_joint("hinge", noise=0.0)
    fit = fit_joint("ball", case.poses, "upper", "lower")
    both = np.concatenate([case.first, case.second]) / np.sqrt(2)
    assert np.sqrt(both @ fit.covariance @ both) > 500  # mm
    across = np.cross(case.first, [1.0, 0.0, 0.0])
    assert np.sqrt(across @ fit.covariance[:3, :3] @ across) < EXACT


@pytest.mark.parametrize("degrees", [2.0, 5.0])
def test_little_motion_states_the_deviation_that_it_has(fitted, degrees):
    pairs = [errors("ball", *one) for one in fitted("ball", degrees=degrees)]
    found = np.sqrt(np.mean([error @ error for error, _ in pairs]))
    stated = np.sqrt(np.mean([std @ std for _, std in pairs]))
    assert found == pytest.approx(stated, rel=0.25)  # noise as large as the motion


def test_refinement_beats_the_linear_start(fitted):
    from skelgen.kinematics.joints.fit import linear_place

    found, linear = [], []
    for case, fit in fitted("ball", degrees=10.0, noise=1.0, n_frames=200):
        true = np.concatenate([case.in_parent, case.in_child])
        found.append(np.concatenate([fit.in_parent, fit.in_child]) - true)
        linear.append(linear_place(relative_poses(case.poses, 0, 1))[1] - true)
    assert np.square(found).sum() < 0.7 * np.square(linear).sum()


@by_kind
def test_residuals_are_those_that_the_covariances_foretell(fitted, kind):
    assert np.mean([fit.noise for _, fit in fitted(kind)]) == pytest.approx(1.0, rel=0.02)


def test_rigid_bodies_keep_their_relative_pose(fitted):
    inside = []
    for case, fit in fitted("rigid"):
        shift = fit.in_parent - case.rotations[0] @ fit.in_child
        true = case.in_parent - case.rotations[0] @ case.in_child
        inside.append(np.abs(shift - true) < 6 * fit.std[0] + 1.0)  # the child's end has the turn's error besides
    assert np.all(inside)


def test_frames_of_a_hinge_follow_the_convention(tracked_joint):
    fit = fit_joint("hinge", tracked_joint("hinge").poses, "upper", "lower")
    for frame in (fit.parent_from_joint, fit.child_from_joint):
        np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame[:3, :3]) == pytest.approx(1)
        assert frame[:3, 3] @ frame[:3, 1] == pytest.approx(0, abs=1e-9)  # origin in the plane of x and z
        assert frame[:3, 3] @ frame[:3, 0] > 0
    assert fit.axis_in_parent[np.argmax(np.abs(fit.axis_in_parent))] > 0
    assert fit.in_parent @ fit.axis_in_parent + fit.in_child @ fit.axis_in_child == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("kind", ["hinge", "universal"])
def test_frames_and_angles_reproduce_the_relative_rotation(tracked_joint, kind):
    case = tracked_joint(kind, noise=0.0)
    fit = fit_joint(kind, case.poses, "upper", "lower")
    along = np.array([0.0, 0.0, 1.0])
    turn = matrix_from_vector(fit.angles[:, :1] * along)
    if kind == "universal":
        tilt = matrix_from_vector(np.array([fit.between, 0.0, 0.0]))
        turn = turn @ tilt @ matrix_from_vector(fit.angles[:, 1:] * along)
    found = fit.parent_from_joint[:3, :3] @ turn @ fit.child_from_joint[:3, :3].T
    np.testing.assert_allclose(found, case.rotations, atol=EXACT)


@turning
def test_singular_values_tell_how_many_axes_turn(tracked_joint, kind):
    fit = fit_joint(kind, tracked_joint(kind, noise=0.0).poses, "upper", "lower")
    assert (np.diff(fit.singular_values) <= 0).all()
    assert (fit.singular_values[-1] < EXACT) == (kind == "hinge")


@by_kind
def test_exchanged_bodies_give_the_exchanged_joint(tracked_joint, kind):
    poses = tracked_joint(kind).poses
    one, other = fit_joint(kind, poses, 0, 1), fit_joint(kind, poses, 1, 0)
    if kind != "rigid":
        np.testing.assert_allclose(one.in_parent, other.in_child, atol=0.1)  # mm: weighed from one side
    assert one.noise == pytest.approx(other.noise, rel=1e-2)


def test_unseen_frames_have_no_angle(tracked_joint):
    case = tracked_joint("hinge")
    world = np.array(case.poses.world_from_body)
    world[3, 0], world[7, 1] = np.nan, np.nan
    fit = fit_joint("hinge", type(case.poses)(world, case.poses.names, 30.0), 0, 1)
    assert np.flatnonzero(np.isnan(fit.angles[:, 0])).tolist() == [3, 7]
    assert len(fit.frames) == 198


def test_errors_that_last_make_the_joint_less_sure(tracked_joint):
    case = tracked_joint("ball", noise=0.0)
    random = np.random.default_rng(0)
    stds = []
    for each in (1, 20):
        world = np.array(case.poses.world_from_body)
        world[:, 1, :3, 3] += np.repeat(random.normal(size=(200 // each, 3)), each, axis=0)
        stds.append(fit_joint("ball", type(case.poses)(world, case.poses.names, 30.0), 0, 1, size=100.0).std.mean())
    assert stds[1] > 2 * stds[0]  # at most the root of 20


@pytest.mark.parametrize("bodies", [(0, 0), (0, 2), ("upper", "middle"), (-1, 0)])
def test_wrong_bodies_are_refused(tracked_joint, bodies):
    with pytest.raises(InputError):
        fit_joint("ball", tracked_joint("ball").poses, *bodies)


def test_bodies_never_seen_together_are_refused(tracked_joint):
    case = tracked_joint("ball")
    world = np.array(case.poses.world_from_body)
    world[:100, 0], world[100:, 1] = np.nan, np.nan
    with pytest.raises(InputError, match="0 frames"):
        fit_joint("ball", type(case.poses)(world, case.poses.names, 30.0), 0, 1)


def test_covariances_of_another_shape_are_refused(tracked_joint):
    with pytest.raises(InputError, match="covariances"):
        fit_joint("ball", tracked_joint("ball").poses, 0, 1, np.eye(6)[np.newaxis])
