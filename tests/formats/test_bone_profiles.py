"""Bones of a person are called as other programs call them, and what these lack is left out with a word."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.bone_profiles import with_bone_names
from skelgen_formats.options import BONE_NAMES
from skelgen_formats.registry import find_format

import skelgen
from skelgen.app.export import preview_export
from skelgen.app.limb_names import with_stated_names
from skelgen.benchmark.judges import bones_of_bvh
from skelgen.errors import WriteError

MIXAMO = {"Hips", "Spine", "Head"} | {
    side + bone for side in ("Left", "Right") for bone in ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")
}


@pytest.fixture(scope="module")
def person():
    take = skelgen.simulate("human", n_frames=60, seed=1).take
    return skelgen.reconstruct(take, root="pelvis 1")


def test_a_bvh_for_mixamo_has_the_standard_names_and_moves_as_our_own(person, tmp_path):
    skelgen.write(person, tmp_path / "own.bvh")
    skelgen.write(person, tmp_path / "mixamo.bvh", bone_names="mixamo")
    own, mixamo = (bones_of_bvh(tmp_path / f"{name}.bvh", 60) for name in ("own", "mixamo"))
    assert set(mixamo) == {f"mixamorig:{name}" for name in MIXAMO}
    for name, bone in (("left_forearm", "LeftForeArm"), ("pelvis", "Hips"), ("right_foot", "RightFoot")):
        assert np.allclose(own[name], mixamo[f"mixamorig:{bone}"], atol=1e-6)


@pytest.mark.parametrize("profile", BONE_NAMES.choices[1:])
def test_a_bvh_for_every_profile_moves_as_our_own(person, tmp_path, profile):
    path = skelgen.write(person, tmp_path / "a.bvh", bone_names=profile)[0]
    moved = bones_of_bvh(path, 60)
    named = with_bone_names(person, profile).skeleton
    for limb, name in enumerate(named.limb_names):
        markers = named.markers_of(limb)
        if len(markers):  # all but the root of Unreal
            own = person.motion.world_from_limb[:, person.skeleton.limb_of_marker[markers[0]], :3, 3]
            assert np.abs(moved[name][:, :3, 3] - own).max() < 0.01


@pytest.mark.parametrize("profile", BONE_NAMES.choices[1:])
def test_every_profile_calls_each_bone_otherwise(person, profile):
    named = with_bone_names(person, profile)
    lost = person.skeleton.n_limbs - named.skeleton.n_limbs + (profile == "unreal")
    assert lost == (1 if profile == "opensim" else 0)  # the head is part of OpenSim's torso
    assert not set(named.skeleton.limb_names) & {"left thigh", "chest"}
    assert named.motion.joint_positions.shape[1] == named.skeleton.n_joints


def test_places_and_joints_of_what_is_kept_stay_as_they_are(person):
    named = with_bone_names(person, "opensim")
    old, new = person.skeleton.limb_names.index("left hand"), named.skeleton.limb_names.index("hand_l")
    assert np.array_equal(person.motion.world_from_limb[:, old], named.motion.world_from_limb[:, new])
    ends = [joint.child for joint in named.skeleton.joints]
    places = named.motion.world_from_limb[..., :3, 3][:, ends]
    assert np.abs(named.motion.joint_positions - places).max() < 1e-6


def test_joints_keep_their_names(person):
    named = with_bone_names(person, "mixamo").skeleton
    assert {"left elbow", "right knee", "left hip"} <= set(named.joint_names) <= set(person.skeleton.joint_names)


@pytest.mark.parametrize("own", ["Unterarm", "right foot"])
def test_a_limb_that_the_user_renamed_keeps_its_bone_unless_the_name_is_another_segment(person, tmp_path, own):
    skeleton = person.skeleton
    marker = skeleton.markers_of(skeleton.limb_names.index("left forearm"))[0]
    renamed = with_stated_names(person, {person.trajectories.names[marker]: own})
    assert own in renamed.skeleton.limb_names
    skelgen.write(renamed, tmp_path / "a.bvh", bone_names="mixamo")
    assert ("mixamorig:LeftForeArm" in bones_of_bvh(tmp_path / "a.bvh", 60)) == (own == "Unterarm")


def test_what_a_profile_lacks_is_said(person, tmp_path):
    remarks = preview_export(person, find_format("bvh"), tmp_path / "a.bvh", {"bone_names": "opensim"}).remarks
    assert "OpenSim has no bone for head: left out." in remarks


def test_unreal_has_a_root_that_stays_still_below_the_pelvis(person, tmp_path):
    skelgen.write(person, tmp_path / "own.bvh")
    skelgen.write(person, tmp_path / "unreal.bvh", bone_names="unreal")
    own, unreal = (bones_of_bvh(tmp_path / f"{name}.bvh", 60) for name in ("own", "unreal"))
    assert np.allclose(unreal["root"], np.eye(4), atol=1e-6)
    for name, bone in (("left_forearm", "lowerarm_l"), ("pelvis", "pelvis"), ("right_foot", "foot_r")):
        assert np.allclose(own[name], unreal[bone], atol=1e-6)
    remarks = preview_export(person, find_format("gltf"), tmp_path / "a.glb", {"bone_names": "unreal"}).remarks
    assert any("'root' below all" in remark for remark in remarks)


def test_limbs_of_nobody_have_no_such_names(person, tmp_path):
    numbered = person.with_limb_names(())
    with pytest.raises(WriteError, match="no limb is known as one of a person"):
        skelgen.write(numbered, tmp_path / "a.bvh", bone_names="unity")


def test_glb_and_usd_know_the_names(person, tmp_path):
    for name in ("a.glb", "a.usda"):
        skelgen.write(person, tmp_path / name, bone_names="mixamo")
    assert b'"mixamorig:LeftForeArm"' in (tmp_path / "a.glb").read_bytes()
    assert "mixamorig_LeftForeArm" in (tmp_path / "a.usda").read_text()
