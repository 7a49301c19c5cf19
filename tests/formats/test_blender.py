"""Blender is the judge of what animation programs show: poses, bones along their limbs, speed, and what is up."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.bone_profiles import with_bone_names
from skelgen_formats.bones import bone_end
from skelgen_formats.registry import write_file

import skelgen

POSITION_MM = 0.05  # demanded; Blender reckons in single precision
ALONG_DEG = 0.1


@pytest.fixture(scope="module", params=["walk.glb", "walk.usdc", "walk.bvh"])
def export(request, standing_project, judged_apart, tmp_path_factory):
    """The name of an export, 20 frames, and what Blender makes of it then."""
    (path,) = write_file(standing_project, tmp_path_factory.mktemp("blender") / request.param)
    frames = np.arange(0, standing_project.motion.n_frames, 2)
    times = ",".join(repr(time) for time in standing_project.motion.times[frames].tolist())
    return request.param, frames, judged_apart("bpy", "blender_poses.py", path, times)


def test_blender_poses_every_limb_where_the_motion_has_it(export, standing_project):
    _, frames, found = export
    for frame, pose in zip(frames, found["poses"], strict=True):
        for limb in range(standing_project.skeleton.n_limbs):
            place = np.array(pose[f"limb{limb}"])[:3, 3] * 1000
            truth = standing_project.motion.world_from_limb[frame, limb, :3, 3]
            assert np.abs(place - truth).max() < POSITION_MM


def test_bones_lie_along_their_limbs_and_those_at_the_ends_have_their_length(export, standing_project):
    name, _, found = export
    if name.endswith(".bvh"):
        pytest.skip("Blender itself draws a BVH's bones from joint to joint")
    for limb in range(standing_project.skeleton.n_limbs):
        head, tail = np.array(found["rest"][f"limb{limb}"]) * 1000
        end = bone_end(standing_project.skeleton, limb)  # limbs have the axes of the world in the reference pose
        cosine = (tail - head) @ end / np.linalg.norm(tail - head) / np.linalg.norm(end)
        assert np.degrees(np.arccos(min(cosine, 1.0))) < ALONG_DEG
        if not (standing_project.skeleton.parents == limb).any():
            assert np.linalg.norm(tail - head - end) < POSITION_MM


def test_bones_stay_along_their_limbs_as_they_move(export, standing_project):
    name, frames, found = export
    if name.endswith(".bvh"):
        pytest.skip("Blender itself turns a BVH's bones")
    for frame, pose in zip(frames, found["poses"], strict=True):
        for limb in range(standing_project.skeleton.n_limbs):
            end = standing_project.motion.rotations[frame, limb] @ bone_end(standing_project.skeleton, limb)
            along = np.array(pose[f"limb{limb}"])[:3, 1]
            assert np.degrees(np.arccos(min(along @ end / np.linalg.norm(end), 1.0))) < ALONG_DEG


def test_take_plays_as_fast_and_as_long_as_it_was_recorded(export, standing_project):
    name, _, found = export
    duration = standing_project.motion.times[-1]
    first, last = found["keys"]
    assert (last - first) / found["rate"] == pytest.approx(duration, rel=1e-5)
    if name.endswith(".usdc"):  # the only one of the three that tells Blender which frames to play
        start, end = found["range"]
        assert (end - start) / found["rate"] == pytest.approx(duration, abs=1 / found["rate"])


HUMAN = {"pelvis": "hips", "chest": "spine", "head": "head"} | {
    f"{side} {limb}": f"{side}{bone}"
    for side in ("left", "right")
    for limb, bone in (
        *(("upper arm", "UpperArm"), ("forearm", "LowerArm"), ("hand", "Hand")),
        *(("thigh", "UpperLeg"), ("shank", "LowerLeg"), ("foot", "Foot")),
    )
}
"""What VRM calls the bones of a person."""


@pytest.fixture(scope="module")
def person():
    return skelgen.reconstruct(skelgen.simulate("human", n_frames=40, seed=1).take, root="head 1")


@pytest.mark.parametrize(
    ("profile", "suffix"),
    [("mixamo", "bvh"), ("mixamo", "glb"), ("unreal", "bvh"), ("unreal", "glb"), ("unity", "bvh"), ("smpl", "bvh")],
)
def test_the_mapper_of_a_retargeting_library_finds_every_bone(person, judged_apart, tmp_path, profile, suffix):
    (path,) = write_file(person, tmp_path / f"walk.{suffix}", bone_names=profile, rest="t-pose")
    found = judged_apart("io_scene_vrm", "blender_human_bones.py", path)["human"]
    skeleton = with_bone_names(person, profile).skeleton
    called = dict(zip(skeleton.limb_names, _limbs_of(person, skeleton), strict=True))
    assert {called[bone]: human for bone, human in found.items()} == HUMAN


def _limbs_of(project, skeleton):
    """What the project calls the limbs of a skeleton whose bones a profile names; both have the same markers."""
    own = project.skeleton
    on_limb = [skeleton.markers_of(limb).tolist() for limb in range(skeleton.n_limbs)]
    return [own.limb_names[own.limb_of_marker[markers[0]]] if markers else "root" for markers in on_limb]


def test_a_rig_for_mixamo_has_the_standard_names_and_moves_as_our_own(person, judged_apart, tmp_path):
    project = person
    (path,) = write_file(project, tmp_path / "walk.bvh", bone_names="mixamo", rest="t-pose")
    found = judged_apart("bpy", "blender_poses.py", path, ",".join(map(repr, project.motion.times.tolist())))
    sides = [
        f"{side}{bone}" for side in ("Left", "Right") for bone in ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")
    ]
    assert set(found["rest"]) == {f"mixamorig:{bone}" for bone in ("Hips", "Spine", "Head", *sides)}
    for name, bone in (("left hand", "LeftHand"), ("right foot", "RightFoot"), ("left thigh", "LeftUpLeg")):
        limb = project.skeleton.limb_names.index(name)
        places = np.array([pose[f"mixamorig:{bone}"] for pose in found["poses"]])[:, :3, 3] * 1000
        assert np.abs(places - project.motion.world_from_limb[:, limb, :3, 3]).max() < POSITION_MM
    shoulder, hand = (np.array(found["rest"][f"mixamorig:Left{bone}"][0]) for bone in ("Arm", "Hand"))
    assert np.allclose((hand - shoulder) / np.linalg.norm(hand - shoulder), [1, 0, 0], atol=0.03)
