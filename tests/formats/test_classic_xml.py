from __future__ import annotations

import re
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from skelgen_formats.classic_xml import read_classic_xml
from skelgen_formats.registry import read_take, write_file

import skelgen
from skelgen.errors import FormatError, MissingResultError, SkelgenError, WriteError
from skelgen.model import Project, StageReport, Trajectories

ROUND_TRIP_MM = 1e-9  # metres in double have steps of 1e-13; composing three poses adds a few
NANOMETRE = 2e-6  # mm; ten digits of places within ten metres, some bones deep
KB_PER_MB = 1024  # ru_maxrss counts kilobytes


def written(value, path, detail="all"):
    return write_file(value, path, xml_detail=detail)


@pytest.fixture(scope="module")
def file(small_project, tmp_path_factory):
    return written(small_project, tmp_path_factory.mktemp("xml") / "walk.xml")[0]


@pytest.fixture(scope="module")
def tree(file):
    return etree.parse(file)


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=ROUND_TRIP_MM)


def test_file_is_well_formed_with_the_parts_of_the_seed_in_order(tree):
    parts = [element.tag for element in tree.getroot()]
    assert parts == [
        "MarkerNames",
        "StatsElements",
        "SkeletonAndAnimation",
        "RawJointPositions",
        "FinalJointPositions",
        "MarkerPositions",
    ]


def test_motion_comes_back(file, small_project):
    back = read_classic_xml(file).motion
    assert_close(back.world_from_limb, small_project.motion.world_from_limb)
    assert_close(back.joint_positions, small_project.motion.joint_positions)
    assert_close(back.marker_positions, small_project.motion.marker_positions)
    assert_close(back.residuals, small_project.motion.residuals)
    assert np.array_equal(back.limb_seen, small_project.motion.limb_seen)
    assert back.rate == small_project.motion.rate


@pytest.mark.parametrize("detail", ["motion", "joints"])
def test_less_detail_holds_the_same_motion_in_a_fraction_of_the_size(file, small_project, tmp_path, detail):
    short = written(small_project, tmp_path / "short.xml", detail=detail)[0]
    back, made = read_classic_xml(short), small_project.motion
    assert back.detail == detail
    np.testing.assert_allclose(back.motion.world_from_limb, made.world_from_limb, rtol=0, atol=1e-5)
    np.testing.assert_allclose(back.motion.joint_positions, made.joint_positions, rtol=0, atol=1e-5)
    np.testing.assert_allclose(back.motion.marker_positions, made.marker_positions, rtol=0, atol=1e-5)
    assert np.isnan(back.trajectories.positions).all()
    assert back.trajectories.names == small_project.trajectories.names
    assert short.stat().st_size < file.stat().st_size / (2 if detail == "motion" else 1.5)


def test_project_is_written_with_little_detail_unless_more_is_asked_for(small_project, tmp_path):
    skelgen.write(small_project, tmp_path / "short.xml")
    with pytest.raises(FormatError, match="--xml-detail all"):
        skelgen.read(tmp_path / "short.xml")
    skelgen.write(small_project, tmp_path / "long.xml", xml_detail="all")
    assert skelgen.read(tmp_path / "long.xml").names == small_project.trajectories.names


def test_weight_in_the_statistics_is_that_of_the_value_beside_it(small_project, tmp_path):
    project = replace(small_project, _topology=replace(small_project.topology, alpha=0.1, final_alpha=0.3))
    stats = read_classic_xml(written(project, tmp_path / "a.xml")[0]).joint_stats
    assert {one.alpha for one in stats} == {0.3}


def test_skeleton_comes_back(file, small_project):
    back, made = read_classic_xml(file).skeleton, small_project.skeleton
    assert np.array_equal(back.parents, made.parents)
    assert np.array_equal(back.limb_of_marker, made.limb_of_marker)
    assert_close(back.marker_offsets, made.marker_offsets)
    assert_close(back.marker_std[:-1], made.marker_std[:-1])
    assert_close(back.reference_pose, made.reference_pose)


def test_joints_come_back(file, small_project):
    for back, made in zip(read_classic_xml(file).skeleton.joints, small_project.skeleton.joints, strict=True):
        assert (back.parent, back.child, back.kind) == (made.parent, made.child, made.kind)
        assert_close(back.position_in_parent, made.position_in_parent)
        assert_close(back.std, made.std)
        assert (back.axis is None) == (made.axis is None)


def test_names_of_limbs_and_joints_come_back(small_project, tmp_path):
    first = replace(small_project.skeleton.joints[0], name='the "hinge" <left>')
    skeleton = replace(small_project.skeleton, joints=(first, *small_project.skeleton.joints[1:]))
    project = small_project.with_skeleton(skeleton, small_project.motion, StageReport())
    project = project.with_limb_names(("left forearm", "chest & neck", "Schläger"))
    back = read_classic_xml(written(project, tmp_path / "named.xml")[0]).skeleton
    assert back.limb_names == project.skeleton.limb_names
    assert [joint.name for joint in back.joints] == [first.name, ""]
    assert back.joint_names == project.skeleton.joint_names


def test_files_without_names_number_the_limbs_and_names_that_stand_twice_are_refused(file, tmp_path):
    text = file.read_text(encoding="utf-8")
    (tmp_path / "old.xml").write_text(re.sub(r' NAME="[^"]*"', "", text), encoding="utf-8")
    old = read_classic_xml(tmp_path / "old.xml").skeleton
    assert (old.limb_names, {joint.name for joint in old.joints}) == (("limb0", "limb1", "limb2"), {""})
    (tmp_path / "twice.xml").write_text(text.replace('NAME="limb2"', 'NAME="limb1"'), encoding="utf-8")
    with pytest.raises(FormatError, match="limb1"):
        read_classic_xml(tmp_path / "twice.xml")


def test_deviations_come_back(file, small_project):
    back, made = read_classic_xml(file).skeleton, small_project.skeleton
    assert_close(back.offset_std[:-1], made.offset_std[:-1])
    assert np.array_equal(back.marker_noise[:-1], made.marker_noise[:-1])
    for found, joint in zip(back.joints, made.joints, strict=True):
        for name in ("covariance", "covariance_in_child", "axis_std", "second_axis_std", "turn_covariance"):
            value = getattr(joint, name)
            assert getattr(found, name) is None if value is None else np.array_equal(getattr(found, name), value)


def test_deviations_that_were_not_estimated_are_not_there(small_project, tmp_path):
    bare = {"covariance": None, "covariance_in_child": None, "turn_covariance": None}
    bare |= {"axis_std": None, "second_axis_std": None}
    joints = tuple(replace(joint, **bare) for joint in small_project.skeleton.joints)
    skeleton = replace(small_project.skeleton, joints=joints, offset_std=None, marker_noise=None)
    project = small_project.with_skeleton(skeleton, small_project.motion, StageReport())
    back = read_classic_xml(written(project, tmp_path / "bare.xml")[0]).skeleton
    assert back.offset_std is None
    assert back.joints[0].covariance is None
    assert back.joints[0].std_in_child is None


def test_both_axes_of_a_universal_joint_come_back(small_project, tmp_path):
    first, *others = small_project.skeleton.joints
    axes = {"axis": np.array([0.0, 0.6, 0.8]), "second_axis": np.array([1.0, 0.0, 0.0])}
    joints = (replace(first, kind="universal", **axes), *others)
    skeleton = replace(small_project.skeleton, joints=joints)
    project = small_project.with_skeleton(skeleton, small_project.motion, StageReport())
    back = read_classic_xml(written(project, tmp_path / "two.xml")[0]).skeleton.joints
    assert back[0].kind == "universal"
    assert_close(back[0].axis, axes["axis"])
    assert_close(back[0].second_axis, axes["second_axis"])
    assert back[1].second_axis is None


def test_tracked_markers_come_back_exactly_with_their_names_and_gaps(file, small_project):
    back = read_classic_xml(file).trajectories
    assert np.array_equal(back.positions, small_project.trajectories.positions, equal_nan=True)
    assert back.names == small_project.trajectories.names
    assert back.name == small_project.name


def test_directions_that_motion_leaves_open_come_back(small_project, tmp_path):
    joints = tuple(replace(joint, open_directions=2, usual_directions=1) for joint in small_project.skeleton.joints)
    project = replace(small_project, _skeleton=replace(small_project.skeleton, joints=joints))
    back = read_classic_xml(written(project, tmp_path / "open.xml")[0]).skeleton.joints
    assert {(joint.open_directions, joint.usual_directions) for joint in back} == {(2, 1)}
    assert not any(joint.is_determined for joint in back)


def test_joints_that_the_marker_set_places_come_back_as_such(small_project, tmp_path):
    first, *others = small_project.skeleton.joints
    skeleton = replace(small_project.skeleton, joints=(replace(first, is_placed_by_marker_set=True), *others))
    file = written(replace(small_project, _skeleton=skeleton), tmp_path / "set.xml")[0]
    back = [joint.is_placed_by_marker_set for joint in read_classic_xml(file).skeleton.joints]
    assert back == [True, *[False] * len(others)]


def test_raw_joints_come_back_exactly_with_unknown_frames(file, small_project):
    back = read_classic_xml(file).raw_joint_positions
    assert np.array_equal(back, small_project.topology.raw_joint_positions, equal_nan=True)


def test_file_is_recognised_and_read_as_a_take(file, small_project):
    assert isinstance(read_take(file, "classic-xml"), Trajectories)
    assert read_take(file).n_markers == small_project.trajectories.n_markers


def test_offsets_are_relative_to_the_center_of_mass_of_the_limb(file, small_project):
    offsets = read_classic_xml(file).offsets_from_center
    for limb in range(small_project.skeleton.n_limbs):
        markers = small_project.skeleton.markers_of(limb)
        assert_close(offsets[markers].mean(axis=0), 0.0)
        made = small_project.skeleton.marker_offsets[markers]
        assert_close(offsets[markers] - offsets[markers[0]], made - made[0])


def test_root_stands_at_zero_and_its_place_is_in_the_local_translation(tree, small_project):
    root = tree.xpath("//BONE[@PARENT='-1']")[0]
    vectors = {vector.get("name"): [float(item.get("val")) for item in vector] for vector in root.iterfind("vector")}
    assert vectors["TRANSLATION"] == [0, 0, 0]
    place = small_project.skeleton.reference_pose[int(root.get("BONEID")), :3, 3]
    assert_close(vectors["LOCALTRANSLATION"], -place)


def test_unseen_marker_carries_no_tracked_vector(tree):
    names = tree.xpath("//Frame[@FrameIndex='0']/Bone/Marker[@id='0']/vector/@name")
    assert names == ["FinalMarkerPosition"]


def test_left_out_marker_keeps_its_tracked_positions_only(tree):
    assert set(tree.xpath("//Frame/Bone[@id='-1']/Marker/vector/@name")) == {"OrgMarkerPosition"}


def test_statistics_are_mean_and_deviation_of_marker_joint_distances(file, small_project):
    stats = read_classic_xml(file).joint_stats[1]
    tracked, raw = small_project.trajectories.positions, small_project.topology.raw_joint_positions[:, 1]
    for one in (*stats.first, *stats.second):
        distances = np.linalg.norm(tracked[:, one.marker] - raw, axis=1)
        assert (one.mean, one.sigma) == pytest.approx((np.nanmean(distances), np.nanstd(distances)))
    assert stats.n_iterations == small_project.topology.n_iterations[1]
    assert stats.value == small_project.topology.values[1]
    assert {one.marker for one in stats.first} == set(small_project.skeleton.markers_of(stats.first_bone).tolist())


def test_several_roots_and_a_single_frame_come_back(make_project, tmp_path):
    project = make_project(parents=(-1, 0, -1, 2), n_frames=1)
    back = read_classic_xml(written(project, tmp_path / "two.xml")[0])
    assert_close(back.motion.world_from_limb, project.motion.world_from_limb)
    assert_close(back.skeleton.reference_pose, project.skeleton.reference_pose)


def test_compact_file_is_half_as_large_and_comes_back_to_a_nanometre(file, small_project, tmp_path):
    (path,) = write_file(small_project, tmp_path / "compact.xml", compact=True, xml_detail="all")
    assert path.stat().st_size < 0.55 * file.stat().st_size
    assert etree.parse(path).find(".//vec_elem") is None
    back, motion = read_classic_xml(path), small_project.motion
    assert np.abs(back.motion.world_from_limb - motion.world_from_limb).max() < NANOMETRE
    assert np.abs(back.motion.joint_positions - motion.joint_positions).max() < NANOMETRE
    apart = back.trajectories.positions - small_project.trajectories.positions
    assert np.nanmax(np.abs(apart)) < NANOMETRE
    assert np.array_equal(np.isnan(apart), np.isnan(small_project.trajectories.positions))


def test_same_project_gives_the_same_bytes(file, small_project, tmp_path):
    again = write_file(small_project, tmp_path / "again.xml", "classic-xml", xml_detail="all")[0]
    assert again.read_bytes() == file.read_bytes()


def test_name_that_xml_cannot_hold_is_refused_and_leaves_nothing(small_project, tmp_path):
    take = replace(small_project.trajectories, names=("bad\x00", *small_project.trajectories.names[1:]))
    project = replace(small_project, _trajectories=take)
    with pytest.raises(WriteError, match="XML forbids"):
        written(project, tmp_path / "x.xml")
    assert list(tmp_path.iterdir()) == []


def test_take_without_skeleton_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="run the four stages"):
        written(small_project.trajectories, tmp_path / "x.xml")
    with pytest.raises(MissingResultError):
        written(Project(small_project.trajectories), tmp_path / "x.xml")


BROKEN = {
    "broken": ("</SKELETON>", "</SKELETTON>", "broken XML"),
    "foreign": ("MotionCapture", "COLLADA", "the root element is <COLLADA>"),
    "version": ('version="1" ', 'version="9" ', "version 9"),
    "unit": ('unit="mm"', 'unit="m"', "must be 'mm'"),
    "word": ('TIME="0.0"', 'FRAMEID="zero"', "broken XML|whole number"),
    "order": ('FRAMEID="3"', 'FRAMEID="4"', "has FRAMEID 4 where 3 belongs"),
    "place": ('pos="1"', 'pos="2"', "pos"),
    "number": ('Alpha="0.0"', 'Alpha="much"', "no number: much"),
    "cycle": ('PARENT="-1"', 'PARENT="0"', "form no tree"),
    "name": ('name="FinalMarkerPosition"', 'name="Other"', "called 'Other'"),
    "kind": ('KIND="hinge"', 'KIND="glue"', "type 'glue'"),
    "frames": ('<JointFrame FrameIndex="11">', '<Nothing FrameIndex="11">', "broken XML|frames"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_file_is_a_format_error_that_says_what(case, file, tmp_path):
    old, new, message = BROKEN[case]
    bad = tmp_path / "bad.xml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    count = -1 if case in {"foreign", "place"} else 1
    bad.write_text(text.replace(old, new, count), encoding="utf-8")
    with pytest.raises(FormatError, match=message):
        read_classic_xml(bad)


def test_error_names_the_line(file, tmp_path):
    lines = file.read_text(encoding="utf-8").split("\n")
    at = next(number for number, line in enumerate(lines) if "<BONE " in line)
    lines[at] = lines[at].replace("BONEID", "BONE_ID")
    bad = tmp_path / "bad.xml"
    bad.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(FormatError, match=f"bad.xml:{at + 1}: <BONE> lacks the attribute BONEID"):
        read_classic_xml(bad)


def test_document_types_are_refused_so_that_no_entity_is_ever_expanded(file, tmp_path):
    bad = tmp_path / "bad.xml"
    text = file.read_text(encoding="utf-8")
    bad.write_text(text.replace("<MotionCapture", '<!DOCTYPE MotionCapture [<!ENTITY a "b">]>\n<MotionCapture', 1))
    with pytest.raises(FormatError, match="document type"):
        read_classic_xml(bad)


def test_missing_empty_and_truncated_files_are_format_errors(file, tmp_path):
    (tmp_path / "empty.xml").write_bytes(b"")
    (tmp_path / "cut.xml").write_bytes(file.read_bytes()[:-5000])
    for name in ("missing.xml", "empty.xml", "cut.xml"):
        with pytest.raises(FormatError, match=name):
            read_classic_xml(tmp_path / name)


@settings(max_examples=60, deadline=None)
@given(at=st.floats(0, 1), length=st.integers(0, 60), patch=st.binary(max_size=8))
def test_mutated_file_is_read_or_a_skelgen_error(file, tmp_path_factory, at, length, patch):
    data = file.read_bytes()
    start = int(at * len(data))
    bad = tmp_path_factory.getbasetemp() / "mutated.xml"
    bad.write_bytes(data[:start] + patch + data[start + length :])
    try:
        read_classic_xml(bad)
    except SkelgenError as error:
        assert "mutated.xml" in str(error)


MEMORY_SCRIPT = """
import resource, sys
import lxml.etree
from skelgen_formats.classic_xml import read_classic_xml
from pathlib import Path
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
path = Path(sys.argv[1])
before = peak()
read = read_classic_xml(path)
print(peak() - before, path.stat().st_size // 1024, "scipy" in sys.modules)
"""


def test_reading_takes_a_fraction_of_the_size_of_the_file(make_project, tmp_path):
    path = written(make_project(n_frames=2000), tmp_path / "long.xml")[0]
    run = [sys.executable, "-c", MEMORY_SCRIPT, str(path)]
    grown, size, scipy = subprocess.run(run, capture_output=True, text=True, check=True).stdout.split()
    assert int(size) > 10 * KB_PER_MB
    assert int(grown) < int(size)
    assert scipy == "False"


def test_writing_takes_a_fraction_of_the_size_of_the_file(make_project, tmp_path):
    project = make_project(n_frames=2000)
    tracemalloc.start()
    path = written(project, tmp_path / "long.xml")[0]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < path.stat().st_size / 4
