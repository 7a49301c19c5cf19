"""Limbs of soft bodies are revised by what all pairs of markers say."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import LimbConstraints, find_limbs
from skelgen.stages.limbs.distances import distance_deviations
from skelgen.stages.limbs.pair_evidence import log_odds
from skelgen.stages.limbs.revision import are_plates, deformation, revised

PEOPLE = {
    "landing.trc": 0.8,
    "walk.trc": 0.9,
    "treadmill.trc": 0.9,
    "punch.c3d": 0.9,
    "flips.c3d": 0.9,
    "kicks.c3d": 0.9,
}

LEAST_PURITY = 0.9  # markers on the limb of their body; a landing's forearms do not turn


@pytest.fixture
def person(recording):
    """A recorded person whose markers have numbers for names, and what an expert says of it."""

    def read(path):
        truth = np.load(recording.folder / "bodies" / f"{path.split('.')[0]}.truth.npz")
        take = recording(f"bodies/{path}")
        index = {name.split(":")[-1].strip().lower(): marker for marker, name in enumerate(take.names)}
        kept = [index[str(label).split(":")[-1].strip().lower()] for label in truth["labels"]]
        return Trajectories(take.positions[:, kept], tuple(map(str, kept)), take.rate), truth

    return read


@pytest.mark.parametrize(("path", "least"), PEOPLE.items())
def test_trees_of_people_are_those_of_an_expert(person, path, least):
    take, truth = person(path)
    limbs = find_limbs(take)
    shares = [truth["allowed"][limbs.markers_of(limb)].sum(axis=0) for limb in range(limbs.n_limbs)]
    bodies = [np.flatnonzero(share == share.max()).tolist() for share in shares]
    found = {
        frozenset((a, b)) for one, other in find_joints(take, limbs).edges for a in bodies[one] for b in bodies[other]
    }
    carried = truth["allowed"].any(axis=0)
    true = {
        frozenset((body, int(p))) for body, p in enumerate(truth["parent"]) if p >= 0 and carried[body] and carried[p]
    }
    assert len(true & found) / len(true) >= least
    assert (limbs.limb_of_marker >= 0).all()


def test_odds_are_symmetric_and_have_no_scale(simulated):
    positions = np.asarray(simulated("human", 0, soft_tissue=3.0, noise=0.5).take.positions)[::10]
    odds = log_odds(positions)
    np.testing.assert_array_equal(odds, odds.T)
    np.testing.assert_allclose(odds, log_odds(10 * positions), atol=1e-6)


def test_odds_of_markers_that_are_seldom_seen_are_numbers(simulated):
    positions = np.asarray(simulated("human", 0, soft_tissue=3.0, noise=0.5).take.positions)[::10].copy()
    positions[3:, 0] = np.nan
    positions[:15, 1], positions[15:, 2] = np.nan, np.nan
    odds = log_odds(positions)
    assert np.isfinite(odds).all()
    assert odds[0, 5] == odds[1, 2] == 0


@pytest.mark.parametrize("seed", range(3))
def test_limbs_that_all_bend_alike_are_rigid_bodies_whatever_is_worn(simulated, seed):
    simulation = simulated("human:4", seed, soft_tissue=3.0, noise=0.3, n_frames=600)
    found, true = find_limbs(simulation.take).limb_of_marker, np.asarray(simulation.truth.limb_of_marker)
    np.testing.assert_array_equal(found[:, np.newaxis] == found, true[:, np.newaxis] == true)


def test_white_noise_is_no_bending(simulated) -> None:
    for tissue, bend in ((0.0, False), (3.0, True)):
        simulation = simulated("human", 0, soft_tissue=tissue, noise=0.5, n_frames=600)
        positions, groups = simulation.take.positions, np.asarray(simulation.truth.limb_of_marker)
        deviations = distance_deviations(positions, np.arange(len(positions)))
        assert deformation(groups, deviations, positions) == (bend, False)


@pytest.mark.parametrize("worn", ["plug-in-gait", "cast", "animation-41", "opencap"])
def test_people_whose_limbs_bend_alike_have_the_limbs_of_their_set(worn) -> None:
    simulation = simulate("human", seed=2, motion="walk", marker_set=worn, n_frames=200, soft_tissue=4.0, noise=0.3)
    found, true = find_limbs(simulation.take).limb_of_marker, np.asarray(simulation.truth.limb_of_marker)
    np.testing.assert_array_equal(found[:, np.newaxis] == found, true[:, np.newaxis] == true)


def test_gait_in_a_set_of_legs_has_one_pelvis_and_feet_without_ankles(recording) -> None:
    take = recording("wild/BMClab_walk.trc")
    limb = find_limbs(take).limb_of_marker
    of = {name: int(limb[marker]) for marker, name in enumerate(take.names)}
    assert len({of[f"{side}.{name}"] for side in "LR" for name in ("ASIS", "PSIS")}) == 1
    for side in "LR":
        assert len({of[f"{side}.{name}"] for name in ("Heel", "MT1", "MT2", "MT5")}) == 1
        assert len({of[f"{side}.{name}"] for name in ("Heel", "Ankle", "Knee", "ASIS")}) == 4


def test_knees_and_ankles_of_a_squat_in_clusters_are_on_thighs_and_shanks(recording) -> None:
    take = recording("human/markers_Squat2.trc")
    limb = find_limbs(take).limb_of_marker
    of = {name: int(limb[marker]) for marker, name in enumerate(take.names)}
    for side in "LR":
        assert len({of[f"{side}{name}"] for name in ("THI", "THI2", "THI3", "KNE")}) == 1
        assert len({of[f"{side}{name}"] for name in ("TIB", "TIB2", "TIB3", "ANK")}) == 1
        assert len({of[f"{side}{name}"] for name in ("HEE", "TOE", "LatFoot")}) == 1


def test_a_landing_that_lacks_every_seventh_marker_has_its_limbs(person) -> None:
    take, truth = person("landing.trc")
    kept = np.sort(np.random.default_rng(0).permutation(take.n_markers)[: round(0.85 * take.n_markers)])
    limbs = find_limbs(Trajectories(take.positions[:, kept], tuple(take.names[one] for one in kept), take.rate))
    shares = [truth["allowed"][kept][limbs.markers_of(limb)].sum(axis=0) for limb in range(limbs.n_limbs)]
    assert sum(share.max() for share in shares) / len(kept) > LEAST_PURITY


def test_revision_obeys_what_the_user_states(simulated):
    take = simulated("human", 0, soft_tissue=3.0, noise=0.5).take
    names = take.names
    loose = np.random.default_rng(0).normal(0.0, 5.0, (take.n_frames, take.n_markers // 2, 3))  # limbs bend unlike
    positions = np.concatenate(
        [take.positions[:, : loose.shape[1]] + loose, take.positions[:, loose.shape[1] :]], axis=1
    )
    take = Trajectories(positions, names, take.rate)
    stated = LimbConstraints(together=[(names[0], names[-1])], apart=[(names[0], names[1])])
    limb = find_limbs(take, constraints=stated).limb_of_marker
    assert limb[0] == limb[-1]
    assert limb[0] != limb[1]


def test_rigid_limbs_with_poses_are_plates_and_others_are_not() -> None:
    rigid, soft = (simulate("human", n_frames=200, soft_tissue=tissue, noise=0.3) for tissue in (0.0, 3.0))
    limb = np.asarray(rigid.truth.limb_of_marker)
    positions = np.array(rigid.take.positions)
    assert are_plates(positions, limb) and not are_plates(np.asarray(soft.take.positions), limb)
    assert are_plates(positions, limb + 3)  # of a second body, whose limbs do not begin with the first
    assert not are_plates(positions, np.where(np.arange(len(limb)) < 2, limb.max() + 1, limb))  # a limb without poses
    positions[::2, 0] = positions[1::2, 1] = np.nan  # never together, and the white noise of neighbours in time unknown
    assert are_plates(positions, limb)
    assert not are_plates(positions, np.full(len(limb), -1))


@pytest.mark.parametrize(("deviation", "n_limbs"), [(0.5, 2), (2.0, 3)])
def test_a_marker_that_is_rigid_with_its_limb_stays_there_though_pairs_doubt_it(deviation, n_limbs) -> None:
    groups = np.repeat([0, 1], 3)
    same = groups[:, np.newaxis] == groups
    steady = np.where(same, np.where(groups == 0, deviation, 1.0), 20.0)  # mm
    odds = np.where(same, 3.0, -5.0)
    odds[0, 1:3] = odds[1:3, 0] = -0.9
    free = LimbConstraints().of_markers(tuple("abcdef"))
    assert len(np.unique(revised(groups, odds, free, steady))) == n_limbs
