from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.registry import write_file
from skelgen_formats.summary_json import summary

from skelgen.errors import WriteError
from skelgen.model import Labelling, Project, StageReport
from skelgen.model.labelling import Agreement, Doubt, Tracklets


def strict(text):
    """Parse JSON and refuse NaN and Infinity, which Python would let pass."""

    def refuse(word):
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.fixture
def told(small_project, tmp_path):
    return strict(write_file(small_project, tmp_path / "walk.json")[0].read_text())


def test_every_part_is_there(told, small_project):
    assert told["take"]["name"] == small_project.name
    assert (told["n_frames"], told["rate"], told["seed"]) == (12, 100.0, 7)
    assert told["tree"]["parents"] == [1, -1, 1]
    assert told["left_out_markers"] == ["M<9>&"]
    assert set(told["stages"]) == {"labels", "limbs", "joints", "skeleton"}
    assert told["stages"]["joints"]["seconds"] == 0.25
    assert told["versions"]["numpy"] == np.__version__


def test_notices_of_stages_call_limbs_by_their_names(small_project):
    report = StageReport({}, 0.1, ("limb 2 hangs on limb 1",))
    project = replace(small_project, reports={**small_project.reports, "joints": report})
    told = summary(project.with_limb_names(("head", "pelvis", "tail")))
    assert told["stages"]["joints"]["notices"] == ["tail hangs on pelvis"]


def test_residuals_are_means_over_the_frames_in_which_a_marker_is_seen(told, small_project):
    residuals = small_project.motion.residuals
    for limb in told["limbs"]:
        for marker in limb["markers"]:
            assert marker["residual_mean"] == pytest.approx(np.nanmean(residuals[:, marker["index"]]))
        assert limb["residual_mean"] == pytest.approx(np.nanmean(residuals[:, [m["index"] for m in limb["markers"]]]))


def test_joints_are_told_with_their_positions_and_kinds(told, small_project):
    for joint, made in zip(told["joints"], small_project.skeleton.joints, strict=True):
        assert (joint["parent"], joint["child"], joint["kind"]) == (made.parent, made.child, made.kind)
        assert joint["position_in_parent"] == made.position_in_parent.tolist()
        assert joint["std"] == made.std.tolist()
        assert joint["axis"] == (None if made.axis is None else made.axis.tolist())
        assert joint["std_in_child"] == made.std_in_child.tolist()
        assert joint["axis_std"] == (None if made.axis_std is None else made.axis_std.tolist())


def test_joints_are_told_with_angles_and_range_of_motion(told, small_project):
    hinge, ball = told["joints"]
    assert [angle["name"] for angle in hinge["angles"]] == ["turn"]
    assert [angle["name"] for angle in ball["angles"]] == ["x", "y", "z"]
    assert all(angle["low"] <= angle["high"] and angle["std"] > 0 for angle in ball["angles"])
    ranges = [turn["range"] for turn in ball["range_of_motion"]]
    assert ranges == sorted(ranges, reverse=True)
    assert hinge["not_determined"] is None


def test_places_of_markers_are_told_with_their_deviations(told, small_project):
    markers = [marker for limb in told["limbs"] for marker in limb["markers"]]
    assert len(markers) == (small_project.skeleton.limb_of_marker >= 0).sum()
    for marker in markers:
        skeleton, index = small_project.skeleton, marker["index"]
        assert marker["offset"] == skeleton.marker_offsets[index].tolist()
        assert marker["offset_std"] == skeleton.offset_std[index].tolist()
        assert marker["noise"] == skeleton.marker_noise[index]


def test_lengths_name_the_joints_between_which_they_are_measured(told, small_project):
    (length,) = told["lengths"]
    assert (length["limb"], length["from"], length["to"]) == (1, "limb1-limb0", "limb1-limb2")
    assert length["length"] == small_project.skeleton.lengths[0, 1]
    assert length["std"] == 0.7


def test_nan_becomes_null(told):
    assert told["stages"]["labels"]["parameters"]["worst"] is None


def test_same_project_gives_the_same_text(small_project, tmp_path):
    first, second = (write_file(small_project, tmp_path / name)[0] for name in ("a.json", "b.json"))
    assert first.read_bytes() == second.read_bytes()


def test_unfinished_project_tells_null_for_what_is_missing(small_project):
    told = summary(Project(small_project.take))
    assert told["n_frames"] == 12
    assert all(told[key] is None for key in ("labels", "limbs", "tree", "joints", "lengths", "residual_mean"))
    json.dumps(told, allow_nan=False)


def test_doubts_about_labels_are_told_by_name(small_project):
    trajectories = small_project.trajectories
    confidence = np.where(trajectories.seen, 0.5, np.nan)
    doubt = Doubt(1, 2, 4, "rival", 0, 0.25, "because")
    left_out = np.arange(trajectories.n_frames)
    labelling = Labelling(confidence, (doubt,), (), left_out, classic=Agreement("sets", 7, 90, 0.75))
    project = Project(small_project.take).with_trajectories(trajectories, StageReport(), labelling)
    told = json.loads(json.dumps(summary(project), allow_nan=False))["labels"]
    assert told["confidence"] == dict.fromkeys(trajectories.names, 0.5)
    assert told["doubtful_spans"][0]["marker"] == trajectories.names[1]
    assert told["doubtful_spans"][0]["rival"] == trajectories.names[0]
    assert told["n_points_left_out"] == left_out.sum()
    assert told["classic"]["n_markers"] == 7


def test_a_question_about_a_point_tells_which_one(small_project):
    trajectories = small_project.trajectories
    nothing = np.zeros(trajectories.n_frames, dtype=int)
    left_out = Tracklets([0], [-1], [3], [9], [40], [5], [[1.5, 2.0, 3.0]])
    confidence = np.where(trajectories.seen, 1.0, np.nan)
    labelling = Labelling(confidence, (), (), nothing, left_out)
    project = Project(small_project.take).with_trajectories(trajectories, StageReport(), labelling)
    (told,) = json.loads(json.dumps(summary(project)))["labels"]["questions"]
    assert (told["first_frame"], told["point"], told["position"]) == (3, 5, [1.5, 2.0, 3.0])


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.take, tmp_path / "walk.json")
