"""A skeleton of one take labels, poses and judges another take of the body, and sees when it is another one."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skelgen
from skelgen.errors import InputError
from skelgen.evaluation.matching import find_identity
from skelgen.model import PointCloud, Project, StageReport, Trajectories
from skelgen.simulation import Structure, simulate
from skelgen.simulation.structures import find_structure
from skelgen.stages.labels import FollowedPoints, LabelParameters, by_track_votes, pose_skeleton, tracked_points
from skelgen.stages.subject import fit_subject
from skelgen.stages.subject.changes import N_SPANS, compare_places

FRAMES = 300
NOISE = 0.5  # mm
SEED = 7
SIDES = ("left", "right")
IDF1 = 0.99  # wanted of labels by a known skeleton


@pytest.fixture(scope="module")
def known() -> Project:
    """The quadruped calibrated on a take of its own, 0.5 mm noise."""
    return skelgen.reconstruct(simulate("quadruped", seed=101, n_frames=FRAMES, noise=NOISE).take)


def take_of(structure="quadruped", **options):
    return simulate(structure, **{"seed": SEED, "n_frames": FRAMES, "noise": NOISE} | options)


def with_limb(name: str, change) -> Structure:
    body = find_structure("quadruped")
    limbs = (change(limb) if name in {limb.name, ""} or name == "*" else limb for limb in body.limbs)
    return Structure(body.name, tuple(limbs))


def slipped(name: str, marker: int, shift) -> Structure:
    def change(limb):
        markers = np.array(limb.markers)
        markers[marker] += shift
        return dataclasses.replace(limb, markers=markers)

    return with_limb(name, change)


def scaled(factor: float) -> Structure:
    def change(limb):
        sizes = {field: factor * np.asarray(getattr(limb, field)) for field in ("joint", "segment", "markers")}
        return dataclasses.replace(limb, **sizes)

    return with_limb("*", change)


def test_markers_that_look_the_same_from_behind_are_told_by_the_pose():
    """Three markers of a limb, two of whose distances are equal to .1 mm, in a fast take with gaps."""
    fast = {"speed": 3.0, "dropouts": 0.2, "dropout_seconds": 0.35, "ghosts": 0.2, "labelled": False}
    limb = {"seed": 4, "spacing": 25.0, "noise": 0.3}
    case = simulate("tree:10", n_frames=1000, **fast, **limb)
    calibrated = skelgen.reconstruct(simulate("tree:10", n_frames=600, **limb).take)
    labels = fit_subject(case.take, calibrated).trajectories
    found = Project(case.take).with_trajectories(labels, StageReport())
    assert find_identity(found, case.truth)[1].idf1 > 0.999


def score(fit, simulated):
    project = Project(simulated.take).with_trajectories(fit.trajectories, StageReport())
    return find_identity(project, simulated.truth)[1].idf1


def test_points_without_names_get_those_of_the_skeleton(known):
    new = take_of(labelled=False, ghosts=0.5, dropouts=0.1)
    fit = fit_subject(new.take, known)
    assert score(fit, new) > IDF1
    right = np.nanmedian(
        np.linalg.norm(fit.trajectories.positions[:, :51] - new.truth.marker_positions, axis=2), axis=0
    )
    assert fit.trajectories.names[:51] == new.truth.marker_names
    assert right.max() < 5 * NOISE  # every marker is the one that its name says
    assert (fit.moved, fit.missing, fit.is_other_subject) == ((), (), False)


def test_bone_lengths_and_places_of_markers_are_those_of_the_skeleton(known):
    fit = fit_subject(take_of().take, known)
    assert fit.skeleton.lengths == known.skeleton.lengths
    assert np.array_equal(fit.skeleton.marker_offsets, known.skeleton.marker_offsets)
    assert np.nanmean(fit.motion.residuals) < 2 * NOISE
    assert fit.labels.by_name


def test_other_names_are_translated(known):
    take = take_of().take
    order = np.random.default_rng(0).permutation(take.n_markers)
    names = tuple(f"M{index:03}" for index in range(take.n_markers))
    fit = fit_subject(Trajectories(take.positions[:, order], names, take.rate, "walk"), known)
    np.testing.assert_allclose(fit.trajectories.positions, take.positions)
    assert any("M000 is " in sentence for sentence in fit.notices)


def test_exchanged_names_are_put_right(known):
    take = take_of().take
    positions = np.array(take.positions)
    positions[100:160, [3, 20]] = positions[100:160, [20, 3]]
    fit = fit_subject(Trajectories(positions, take.names, take.rate, "walk"), known)
    np.testing.assert_allclose(fit.trajectories.positions[:, [3, 20]], take.positions[:, [3, 20]])
    assert fit.moved == ()


def test_legs_that_the_pose_exchanged_for_a_while_are_told_by_their_tracks():
    take = take_of().take
    points = tracked_points(take, LabelParameters())
    left, right = (np.array([take.names.index(f"{side} hind foot {number}") for number in (1, 2, 3)]) for side in SIDES)
    exchanged = np.arange(take.n_markers)
    exchanged[left], exchanged[right] = right, left
    by_pose = np.where(points.frames < FRAMES / 3, exchanged[points.tracks], points.tracks)
    assert (by_pose != points.tracks).any()
    np.testing.assert_array_equal(by_track_votes(points, [by_pose], take.n_markers), points.tracks)


def tracked(tracks, frames, n_frames):
    """Points of tracks, in the order of their frames."""
    starts = np.searchsorted(frames, np.arange(n_frames + 1))
    cloud = PointCloud(np.zeros((len(tracks), 3)), starts, np.arange(n_frames) / 100)
    return FollowedPoints(cloud, np.array(frames), np.array(tracks), ())


def test_track_is_the_marker_for_which_most_frames_vote():
    points = tracked([0, 0, 0, 0, -1], [0, 1, 2, 3, 3], 4)
    ways = [np.array([1, 1, 0, 0, 0]), np.array([1, -1, 1, -1, -1])]
    assert by_track_votes(points, ways, 2).tolist() == [1, 1, 1, 1, -1]


def test_points_that_nobody_follows_are_no_markers():
    points = tracked([-1, -1], [0, 1], 2)
    assert by_track_votes(points, [np.array([0, 0])], 2).tolist() == [-1, -1]


def test_tracks_that_are_seen_together_are_never_one_marker():
    points = tracked([0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 3], 4)
    votes = np.array([1, 1, 1, 1, 1, 1])
    assert by_track_votes(points, [votes], 2).tolist() == [1, 1, -1, 1, -1, 1]


def test_missing_and_new_markers_are_said(known):
    simulated = take_of()
    take = simulated.take
    pose = simulated.truth.world_from_limb[:, 1]
    extra = pose[:, :3, :3] @ np.array([100.0, 0.0, 160.0]) + pose[:, :3, 3]
    positions = np.concatenate([take.positions[:, 2:], extra[:, np.newaxis]], axis=1)
    fit = fit_subject(Trajectories(positions, (*take.names[2:], "saddle"), take.rate, "walk"), known)
    assert fit.missing == (0, 1)
    assert "no frame shows: pelvis 1, pelvis 2" in "; ".join(fit.notices)
    trunk = int(known.limbs.limb_of_marker[known.trajectories.names.index("trunk 1")])
    assert any(f"does not know: saddle on {known.limbs.called(trunk)}" in sentence for sentence in fit.notices)
    assert fit.trajectories.names[-1] == "saddle"


@pytest.mark.parametrize("shift", [8.0, 40.0])
@pytest.mark.parametrize("labelled", [True, False])
def test_marker_that_moved_is_named_and_placed_anew(known, shift, labelled):
    new = take_of(slipped("left thigh", 1, [0.0, 0.0, shift]), labelled=labelled)
    fit = fit_subject(new.take, known)
    assert [known.trajectories.names[marker] for marker in fit.moved] == ["left thigh 2"]
    assert fit.shifts[fit.moved[0]] == pytest.approx(shift, abs=1.0)
    assert np.nanmean(fit.motion.residuals) < 2 * NOISE


@pytest.mark.parametrize("labelled", [True, False])
def test_larger_body_is_another_body(known, labelled):
    new = take_of(scaled(1.06), labelled=labelled)
    with pytest.raises(InputError, match=r"the skeleton explains \d+ % of the positions"):
        fit_subject(new.take, known)


def test_body_of_another_size_is_told_by_all_its_limbs():
    skin = simulate("quadruped", seed=101, n_frames=FRAMES, noise=NOISE, soft_tissue=2.0).take
    calibrated = skelgen.reconstruct(skin)
    said = [
        "; ".join(fit_subject(take_of(body, soft_tissue=2.0).take, calibrated).notices)
        for body in (scaled(1.0), scaled(1.04))
    ]
    assert "limbs are larger" not in said[0]
    assert re.search(r"limbs are larger than in the calibrated take, by [345]\.\d % in the median", said[1])


def test_take_in_another_unit_of_length_is_told(known):
    cloud = take_of(labelled=False).take
    in_metres = dataclasses.replace(cloud, points=cloud.points / 1000.0)
    with pytest.raises(InputError, match="1000 times as close together as the skeleton's markers"):
        fit_subject(in_metres, known)


def test_another_body_is_said_where_many_markers_sit_elsewhere(known):
    rng = np.random.default_rng(0)

    def change(limb):
        return dataclasses.replace(limb, markers=np.asarray(limb.markers) + rng.normal(size=(3, 3)) * 2)

    fit = fit_subject(take_of(with_limb("*", change)).take, known)
    said = "; ".join(fit.notices)
    assert (
        "this is another body, or the markers were put on anew" in said or "have slipped, this is another body" in said
    )


def test_limb_without_markers_is_posed_by_its_neighbours(known):
    simulated = take_of(noise=0.0)
    positions = np.array(simulated.take.positions)
    names = list(known.trajectories.names)
    positions[:, [names.index(f"pelvis {number}") for number in (1, 2, 3)]] = np.nan
    poses = pose_skeleton(known.skeleton, positions)
    limb = int(known.limbs.limb_of_marker[names.index("pelvis 1")])
    carried = poses.markers(known.skeleton)[:, known.limbs.limb_of_marker == limb]
    away = np.linalg.norm(carried - simulated.truth.marker_positions[:, :3], axis=2)
    assert np.median(away) < 10 * NOISE  # its joints are known to half a millimetre, its markers lie 100 mm beside


def test_what_the_calibration_leaves_open_is_no_shift():
    rng = np.random.default_rng(3)
    before, after = 0.1 * rng.normal(size=(2, N_SPANS, 50, 3))
    after[:, :, 0] += 2.0
    sure, unsure = (compare_places(before, after, np.tile(variance * np.eye(3), (50, 1, 1))) for variance in (0, 1.0))
    assert sure.is_moved.all()
    assert not unsure.is_moved.any()


def test_places_of_one_body_differ_as_often_as_the_level_says():
    rng = np.random.default_rng(3)
    before, after = rng.normal(size=(2, N_SPANS, 4000, 3)) * np.array([1.0, 3.0, 0.2])
    p_values = compare_places(before, after, np.zeros((4000, 3, 3))).p_values
    for level in (0.01, 0.1):
        assert (p_values < level).mean() == pytest.approx(level, rel=0.35)  # of 4000: three deviations


def test_places_that_are_shifted_are_found():
    rng = np.random.default_rng(3)
    before, after = rng.normal(size=(2, N_SPANS, 50, 3))
    after[:, 7] += [6.0, 0.0, 0.0]
    test = compare_places(before, after, np.zeros((50, 3, 3)))
    assert np.flatnonzero(test.is_moved).tolist() == [7]
    assert test.distances[7] == pytest.approx(6.0, abs=1.5)


def test_joint_that_hardly_turned_in_the_calibrated_take_is_free_in_the_new_one():
    def stiff(limb):  # a neck that only nods
        return dataclasses.replace(limb, amplitudes=np.array([0.0, 35.0, 0.0])) if limb.name == "head" else limb

    known = skelgen.reconstruct(simulate(with_limb("head", stiff), seed=101, n_frames=FRAMES, noise=NOISE).take)
    head = int(known.limbs.limb_of_marker[known.trajectories.names.index("head 1")])
    joint = next(index for index, one in enumerate(known.skeleton.joints) if one.child == head)
    assert known.skeleton.joints[joint].kind == "hinge"
    fit = fit_subject(take_of().take, known)
    assert fit.skeleton.joints[joint].kind == "ball"
    assert [one.kind for one in fit.skeleton.joints if one.child != head] == [
        one.kind for one in known.skeleton.joints if one.child != head
    ]
    assert np.nanmean(fit.motion.residuals) < 2 * NOISE
