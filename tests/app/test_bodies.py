"""A take of several bodies: a project and a file for each."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.bone_profiles import with_bone_names

import skelgen
from skelgen.app.advice import advice_on
from skelgen.app.bodies import join_bodies, split_bodies
from skelgen.app.constraints import RunOptions
from skelgen.app.corrections import without_correction
from skelgen.app.export import export_formats, export_path, export_project, preview_export
from skelgen.app.pipeline import run_stages
from skelgen.app.subject import joined_subjects
from skelgen.errors import InputError, WriteError
from skelgen.model import PointCloud, Project
from skelgen.model.limbs import body_and_limb
from skelgen.simulation import simulate

PAIRS = ("upper arm", "forearm", "hand", "thigh", "shank", "foot")
SEGMENTS = {"pelvis", "chest", "head", *(f"{side} {name}" for side in ("left", "right") for name in PAIRS)}


@pytest.fixture(scope="module")
def two():
    """Two sets of rods in one take; their tables."""
    return skelgen.reconstruct(skelgen.simulate("rods", n_frames=200, subjects=2, seed=1, noise=0.2).take)


@pytest.fixture(scope="module")
def two_people():
    """Two people of 15 segments each, whose markers say on which they are."""
    return skelgen.reconstruct(skelgen.simulate("human", n_frames=150, subjects=2, seed=1, noise=0.2).take)


def test_bodies_have_names_limbs_and_markers(two):
    assert [body.name for body in two.bodies] == ["body1", "body2"]
    assert sorted(np.concatenate([body.markers for body in two.bodies]).tolist()) == list(range(18))
    assert all(two.topology.parents[body.root] == -1 and body.root in body.limbs for body in two.bodies)


def test_each_body_is_a_project_with_its_part_of_all_results(two):
    for body, alone in zip(two.bodies, skelgen.split_bodies(two), strict=True):
        assert alone.skeleton.roots.tolist() == [body.limbs.tolist().index(body.root)]
        assert np.array_equal(alone.motion.marker_positions, two.motion.marker_positions[:, body.markers])
        joints = [index for index, joint in enumerate(two.skeleton.joints) if joint.parent in body.limbs]
        assert np.array_equal(alone.motion.joint_positions, two.motion.joint_positions[:, joints])
        whole = [two.motion.joint_angles[joint].values for joint in joints]
        np.testing.assert_allclose(np.hstack([one.values for one in alone.motion.joint_angles]), np.hstack(whole))
        assert set(alone.skeleton.lengths.values()) <= set(two.skeleton.lengths.values())


@pytest.mark.parametrize("suffix", [".bvh", ".c3d", ".skelgen"])
def test_a_file_for_each_body(two, suffix, tmp_path):
    files = skelgen.write(two, tmp_path / f"take_{{body}}{suffix}")
    assert [file.name for file in files] == [f"take_body{number}{suffix}" for number in (1, 2)]
    assert all(file.stat().st_size for file in files)


def test_one_body_is_one_file_and_the_project_itself(tmp_path):
    one = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    assert skelgen.split_bodies(one) == (one,)
    assert [file.name for file in skelgen.write(one, tmp_path / "{body}.bvh")] == ["body1.bvh"]


def test_bodies_need_joints(tmp_path):
    with pytest.raises(WriteError, match="run the stages first"):
        skelgen.write(Project(simulate("rods", n_frames=10).take), tmp_path / "{body}.bvh")
    c3d = next(entry for entry in export_formats() if entry.name == "c3d")
    project = Project(simulate("rods", n_frames=10).take)
    assert "run the stages first" in preview_export(project, c3d, tmp_path / "{body}.c3d", {}).obstacle


def test_summary_lists_bodies(two, tmp_path):
    file = skelgen.write(two, tmp_path / "take.json")[0]
    bodies = json.loads(file.read_text())["bodies"]
    assert [(body["name"], len(body["limbs"]), len(body["markers"])) for body in bodies] == [
        ("body1", 3, 9),
        ("body2", 3, 9),
    ]
    assert bodies[0]["probability"] > 0.9


def test_subjects_calibrated_each_by_itself_label_a_take_of_both(tmp_path):
    alone = [simulate("rods", seed=seed, n_frames=300, noise=0.2) for seed in (1, 1_000_004)]
    subjects = [skelgen.reconstruct(one.take) for one in alone]
    skelgen.write(subjects[1], tmp_path / "second.skelgen")
    both = simulate("rods", seed=1, subjects=2, n_frames=200, noise=0.2, dropouts=0.05, labelled=False)
    project = skelgen.apply_subject(both.take, [subjects[0], tmp_path / "second.skelgen"])
    scores = skelgen.evaluate(project, both.truth)
    assert scores.labels.idf1 > 0.99
    assert scores.bodies.is_exact
    lengths = [subject.skeleton.lengths.values() for subject in subjects]
    assert sorted(project.skeleton.lengths.values()) == sorted(length for some in lengths for length in some)


def test_limbs_of_two_people_are_called_by_their_body_and_alone_as_those_of_one(two_people):
    names = two_people.limbs.names
    assert [set(map(body_and_limb, names[first : first + 15])) for first in (0, 15)] == [
        {(body, name) for name in SEGMENTS} for body in ("body1", "body2")
    ]
    assert {"body1: left elbow", "body2: left elbow"} <= set(two_people.skeleton.joint_names)
    for body in skelgen.split_bodies(two_people):
        assert SEGMENTS == set(body.limbs.names) == set(body.skeleton.limb_names)
        assert "left elbow" in body.skeleton.joint_names


def test_people_hang_on_their_pelvis_and_a_root_that_is_called_by_its_name_is_that_of_each_body(two_people):
    again = run_stages(two_people, "joints", "joints", options=RunOptions(root="chest"))
    for project, root in ((two_people, "pelvis"), (again, "chest")):
        names = [body_and_limb(project.limbs.names[limb])[1] for limb in project.topology.roots]
        assert names == [root, root]


def test_bone_names_of_a_rig_are_those_of_each_body(two_people):
    whole = with_bone_names(two_people, "mixamo").skeleton
    alone = [with_bone_names(body, "mixamo").skeleton for body in skelgen.split_bodies(two_people)]
    wanted = {"mixamorig:Hips", "mixamorig:RightForeArm", "mixamorig:LeftFoot"}
    assert all(wanted <= set(one.limb_names) and len(one.limb_names) == 15 for one in alone)
    assert {f"{body}: {name}" for body in ("body1", "body2") for name in wanted} <= set(whole.limb_names)
    assert [whole.limb_names[root] for root in whole.roots] == ["body1: mixamorig:Hips", "body2: mixamorig:Hips"]


def test_bodies_are_called_as_their_skeletons_and_limbs_as_calibrated(tmp_path):
    alone = [simulate("human", seed=seed, n_frames=150, noise=0.2).take for seed in (1, 1_000_004)]
    anna, ben = (
        skelgen.reconstruct(replace(one, name=name)) for one, name in zip(alone, ("anna.c3d", "ben"), strict=True)
    )
    both = simulate("human", seed=1, subjects=2, n_frames=60, noise=0.2).take
    project = skelgen.apply_subject(both, [anna, ben])
    assert [body.name for body in project.bodies] == ["anna", "ben"]
    assert project.limbs.names[:2] == ("anna: pelvis", "anna: chest") == project.skeleton.limb_names[:2]
    assert skelgen.split_bodies(project)[1].skeleton.limb_names == ben.skeleton.limb_names
    files = skelgen.write(project, tmp_path / "{body}.bvh", bone_names="mixamo")
    assert [file.name for file in files] == ["anna.bvh", "ben.bvh"]
    assert all("ROOT mixamorig:Hips" in file.read_text() for file in files)
    assert skelgen.apply_subject(alone[0], anna).limbs.names == anna.limbs.names
    renamed = skelgen.correct(project, "name", [project.trajectories.names[0]], "hip")
    assert renamed.limbs.names == ("hip", *project.limbs.names[1:])
    assert [body.name for body in renamed.bodies] == ["anna", "ben"]
    assert without_correction(renamed, 0).limbs.names == project.limbs.names


@pytest.mark.parametrize("motion", ["squat", "reach"])
def test_people_too_near_each_other_for_distances_are_parted_by_joints_where_their_number_is_stated(motion):
    options = {"marker_set": "animation-41", "motion": motion, "n_frames": 400, "noise": 0.3, "apart": 500.0}
    take = simulate("human", subjects=2, seed=2, **options).take
    bare = replace(take, names=tuple(f"m{marker}" for marker in range(take.n_markers)))
    project = skelgen.reconstruct(bare, parameters={"limbs": {"n_bodies": 2}})
    assert sorted(body.markers.tolist() for body in project.bodies) == [list(range(41)), list(range(41, 82))]
    assert all(0.5 < body.probability < 0.9 for body in project.bodies)
    assert any(notice.startswith("2 bodies, as stated") for notice in project.reports["limbs"].notices)


def test_what_bodies_look_like_is_told_of_each(two_people):
    bare = replace(
        two_people.trajectories, names=tuple(f"m{marker}" for marker in range(len(two_people.trajectories.names)))
    )
    project = skelgen.reconstruct(bare)
    told = " ".join(project.reports["skeleton"].notices)
    assert all(f"the limbs of {body.name} are those of a person" in told for body in project.bodies)
    assert not re.search(r"limbs? \d", told)


def test_a_tool_beside_rods_is_the_second_body_where_two_are_stated():
    take = simulate("rods", hold="tool", seed=1, n_frames=400, noise=0.3).take
    project = skelgen.reconstruct(take, parameters={"limbs": {"n_bodies": 2}})
    assert [body.markers.tolist() for body in project.bodies] == [list(range(9)), [9, 10, 11]]


def test_a_body_that_is_not_there_is_named_once_and_names_without_that_of_the_body_are_no_others():
    options = {"motion": "reach", "marker_set": "animation-41", "n_frames": 150, "noise": 0.3}
    takes = [simulate("human", seed=seed, **options).take for seed in (1, 2)]
    known = [skelgen.reconstruct(replace(take, name=name)) for take, name in zip(takes, ("anna", "ben"), strict=True)]
    project = skelgen.apply_subject(takes[0], known)
    told = project.reports["labels"].notices
    assert "no frame shows ben: leave its skeleton out" in told
    assert not any("no frame shows:" in notice or "named otherwise" in notice for notice in told)
    assert not any("more cameras" in sentence for sentence in advice_on(project))


@pytest.mark.parametrize("labelled", [True, False])
def test_of_two_bodies_that_are_alike_one_is_labelled_whole_and_the_other_is_said_to_be_absent(labelled):
    take = simulate("rods", seed=1, n_frames=200, noise=0.3, dropouts=0.05, labelled=labelled).take
    known = skelgen.reconstruct(simulate("rods", seed=1, n_frames=240, noise=0.3).take)
    alike = [replace(known, take=replace(known.take, name=name)) for name in ("anna", "ben")]
    project = skelgen.apply_subject(take, alike)
    seen = project.trajectories.seen
    assert seen[:, :9].mean() > 0.9
    assert not seen[:, 9:].any()
    told = project.reports["labels"].notices
    assert "no frame shows ben: leave its skeleton out" in told
    assert any(notice.startswith("not all of anna and ben are there; ben is taken as absent") for notice in told)


def test_limbs_and_joints_of_two_bodies_are_named_each_and_errors_name_what_there_is(two):
    first, second = (two.trajectories.names[int(body.markers[0])] for body in two.bodies)
    named = skelgen.correct(skelgen.correct(two, "name", [first], "hips"), "name", [second], "hips")
    assert {"hips", "body2: hips"} <= set(named.limbs.names)
    assert all("hips" in body.skeleton.limb_names for body in skelgen.split_bodies(named))
    with pytest.raises(InputError, match=f"no joint between the limbs of {first} and {second}: .* is joined to"):
        skelgen.correct(two, "name-joint", [first, second], "waist")
    markers = ["anna: tip", "ben: tip", *two.trajectories.names[2:]]
    with pytest.raises(InputError, match=r"or name one of anna: tip, ben: tip$"):
        skelgen.correct(two.renamed(markers), "name", ["tip"], "hips")


def test_corrections_of_a_project_stay_when_skeletons_are_applied_to_it(two):
    named = skelgen.correct(two, "name", [two.trajectories.names[0]], "hips")
    again = skelgen.apply_subject(named, two)
    assert "hips" in again.limbs.names


def test_of_two_bodies_that_are_alike_the_one_that_comes_later_shares_no_points_with_the_other():
    options = {"marker_set": "animation-41", "noise": 0.3, "seed": 1}
    known = skelgen.reconstruct(simulate("human", motion="walk", n_frames=240, **options).take)
    one, other = (simulate("human", motion=motion, n_frames=300, **options).take for motion in ("reach", "walk"))
    later = np.where(
        np.arange(300)[:, np.newaxis, np.newaxis] < 180, np.nan, other.positions + np.array([0.0, 1200.0, 0.0])
    )
    both = np.concatenate([one.positions, later], axis=1)
    seen = ~np.isnan(both[:, :, 0])
    cloud = PointCloud(both[seen], np.append(0, np.cumsum(seen.sum(axis=1))), one.times)
    alike = [replace(known, take=replace(known.take, name=name)) for name in ("anna", "ben")]
    found = skelgen.apply_subject(cloud, alike).trajectories.seen
    assert abs(found[:, :41].sum() - 41 * 300) + abs(found[:, 41:82].sum() - 41 * 120) < 41


def test_skeletons_of_takes_that_are_called_alike_are_called_by_their_files(tmp_path):
    rom = skelgen.reconstruct(replace(simulate("rods", seed=1, n_frames=80).take, name="rom.c3d"))
    files = [skelgen.write(rom, tmp_path / f"{name}.skelgen")[0] for name in ("anna", "ben")]
    assert [body.name for body in joined_subjects(files).bodies] == ["anna", "ben"]
    assert [body.name for body in joined_subjects([rom, rom]).bodies] == ["rom 1", "rom 2"]


def test_joined_bodies_come_apart_again_as_they_were():
    one, other = (
        skelgen.reconstruct(simulate("rods", seed=seed, n_frames=length).take) for seed, length in ((1, 80), (2, 120))
    )
    first, second = split_bodies(join_bodies([one, other]))
    for before, after in ((one, first), (other, second)):
        assert list(after.skeleton.lengths.values()) == list(before.skeleton.lengths.values())
        np.testing.assert_array_equal(after.skeleton.marker_offsets, before.skeleton.marker_offsets)
    assert first.trajectories.names[0] == f"{one.name}: {one.trajectories.names[0]}"
    np.testing.assert_array_equal(second.motion.world_from_limb, other.motion.world_from_limb)


def test_subjects_must_be_given():
    with pytest.raises(InputError, match="no calibrated skeleton"):
        skelgen.apply_subject(simulate("rods", n_frames=10).take, [])


def test_the_window_exports_each_body_to_a_file_of_its_own(two, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    path = export_path(tmp_path, "take_{body}", bvh)
    named = ["take_body1.bvh", "take_body2.bvh"]
    assert [planned.name for planned in preview_export(two, bvh, path, {}).files] == named
    assert [file.name for file in export_project(two, bvh, path, {})] == named
    assert sorted(file.name for file in tmp_path.iterdir()) == named


def test_what_each_file_will_hold_is_told_of_each_body(two, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    told = preview_export(two, bvh, tmp_path / "take_{body}.bvh", {}).contents
    alike = "3 limbs and 2 joints in 200 frames at 100 Hz"
    assert told == f"take_body1.bvh: {alike}; take_body2.bvh: {alike}"


def test_a_folder_for_each_body(two, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    named = [tmp_path / body / "x.bvh" for body in ("body1", "body2")]
    assert skelgen.write(two, tmp_path / "{body}" / "x.bvh") == named
    assert export_project(two, bvh, tmp_path / "{body}" / "x.bvh", {}) == named
    assert all(file.stat().st_size for file in named)


@pytest.mark.parametrize("name", ["{Body}.bvh", "{body}_{take}.bvh", "{Body}/x.bvh"])
def test_braces_that_stand_for_nothing_are_refused(two, name, tmp_path):
    with pytest.raises(WriteError, match=r"\} stands for nothing; \{body\} stands for"):
        skelgen.write(two, tmp_path / name)


def test_a_take_has_no_bodies_to_write(two, tmp_path):
    with pytest.raises(WriteError, match="run the stages first"):
        skelgen.write(two.take, tmp_path / "{body}.c3d")


def test_notes_with_a_file_for_each_body_are_those_of_the_files(two, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    whole, parts = (preview_export(two, bvh, tmp_path / name, {}).remarks for name in ("x.bvh", "{body}.bvh"))
    assert any("2 bodies hang on one root" in remark for remark in whole)
    assert "2 bodies share this file; the name x_{body}.bvh writes each to a file of its own." in whole
    assert not any("bodies" in remark for remark in parts)
    assert len(parts) == len(set(parts)) > 0


def test_a_pose_at_rest_is_that_of_one_body_in_a_file_of_its_own(two_people, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    names = ("x.bvh", "{body}.bvh")
    whole, parts = (preview_export(two_people, bvh, tmp_path / name, {"rest": "t-pose"}).remarks for name in names)
    assert "Bones rest in the reference pose: a t-pose is that of one body in a file of its own." in whole
    assert not any("rest in the reference" in remark for remark in parts)


def test_a_note_on_one_body_begins_with_the_name_of_its_file(two_people, tmp_path):
    bvh = next(entry for entry in export_formats() if entry.name == "bvh")
    odd = next(limb for limb, name in enumerate(two_people.limbs.names) if name == "body2: head")
    names = ["body2: antenna" if limb == odd else name for limb, name in enumerate(two_people.limbs.names)]
    options = {"bone_names": "mixamo"}
    remarks = preview_export(two_people.with_limb_names(names), bvh, tmp_path / "{body}.bvh", options).remarks
    assert "body2.bvh: Mixamo has no bone for antenna: left out." in remarks
