"""The kind of a joint between two bodies with poses."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.kinematics import TypeLimits, choose_joint_type, fit_joint
from skelgen.kinematics.joints.fit import choose_type
from skelgen.kinematics.joints.relative_poses import relative_poses

KINDS = ("ball", "hinge", "universal", "rigid")

by_kind = pytest.mark.parametrize("kind", KINDS)
known = pytest.mark.parametrize("is_known", [True, False], ids=["covariances", "poses alone"])


@by_kind
@known
@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0])
def test_the_true_kind_is_found(tracked_joint, kind, is_known, noise):
    for seed in range(4):
        case = tracked_joint(kind, seed, noise=noise)
        choice = choose_joint_type(case.poses, 0, 1, case.covariances if is_known else None)
        assert choice.kind == kind
        assert choice.fit.kind == kind


@by_kind
@known
def test_less_motion_than_noise_is_never_called_a_ball(tracked_joint, kind, is_known):
    for seed in range(4):
        case = tracked_joint(kind, seed, noise=2.0, degrees=1.0)
        choice = choose_joint_type(case.poses, 0, 1, case.covariances if is_known else None)
        assert choice.kind in {"rigid", "undetermined"}


@pytest.mark.parametrize("wanted", KINDS)
def test_the_users_kind_is_obeyed(tracked_joint, wanted):
    choice = choose_joint_type(tracked_joint("hinge").poses, 0, 1, wanted=wanted)
    assert choice.kind == choice.fit.kind == wanted


def test_a_stricter_limit_makes_a_sloppy_hinge_something_else(tracked_joint):
    case = tracked_joint("universal", noise=0.1)
    sloppy = TypeLimits(wobble_share=3.0)
    assert choose_type(relative_poses(case.poses, 0, 1), limits=sloppy).kind == "hinge"
    assert choose_joint_type(case.poses, 0, 1).kind == "universal"


def test_sentences_say_what_speaks_for_the_kind(tracked_joint):
    assert "limit" in choose_joint_type(tracked_joint("hinge").poses, 0, 1).sentence
    case = tracked_joint("ball", noise=4.0, degrees=1.0)
    choice = choose_joint_type(case.poses, 0, 1, case.covariances)
    assert choice.kind == "undetermined"
    assert choice.sentence.startswith("not enough motion to tell")


def test_an_unknown_kind_is_refused(tracked_joint):
    with pytest.raises(InputError, match="rigid, hinge, universal, ball"):
        choose_joint_type(tracked_joint("hinge").poses, 0, 1, wanted="slider")
    with pytest.raises(InputError, match="rigid, hinge, universal, ball"):
        fit_joint("slider", tracked_joint("hinge").poses, 0, 1)


def test_singular_values_of_the_mean_rotation_are_reported(tracked_joint):
    evidence = choose_joint_type(tracked_joint("hinge", noise=0.0).poses, 0, 1).evidence
    assert evidence.singular_values[0] == pytest.approx(1, abs=1e-9)
    assert evidence.singular_values[1] < 0.99
    assert list(evidence.type_fits) == ["rigid", "hinge"]
    assert np.rad2deg(evidence.main_turn) == pytest.approx(14, abs=4)  # a sine of 20 degrees
