"""Bones rest in the pose that the user wants, and on the pelvis where a rig wants it; the motion stays."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.bone_profiles import rooted_at
from skelgen_formats.registry import find_format
from skelgen_formats.rest_pose import with_rest_pose

import skelgen
from skelgen.app.export import preview_export
from skelgen.benchmark.judges import bones_of_bvh

TOLERANCE = 1e-6  # mm


@pytest.fixture(scope="module")
def person():
    take = skelgen.simulate("human", n_frames=60, seed=1).take
    return skelgen.reconstruct(take, root="head 1")


def joints_at_rest(project):
    """Where each joint is at rest, by its name, once by either limb."""
    skeleton, found = project.skeleton, {}
    for joint, name in zip(skeleton.joints, skeleton.joint_names, strict=True):
        parent, child = skeleton.reference_pose[[joint.parent, joint.child]]
        found[name] = parent[:3, :3] @ joint.position_in_parent + parent[:3, 3]
        assert np.allclose(found[name], child[:3, :3] @ joint.position_in_child + child[:3, 3], atol=TOLERANCE)
    return found


@pytest.mark.parametrize(("rest", "low"), [("t-pose", 0.0), ("a-pose", np.sqrt(0.5))])
def test_a_person_stands_and_holds_the_arms_aside(person, rest, low):
    found = joints_at_rest(with_rest_pose(person, rest))
    for side, outward in (("left", 1.0), ("right", -1.0)):
        arm = found[f"{side} wrist"] - found[f"{side} shoulder"]
        leg = found[f"{side} ankle"] - found[f"{side} hip"]
        assert np.allclose(arm / np.linalg.norm(arm), [outward * np.sqrt(1 - low**2), 0, -low], atol=0.03)
        assert np.allclose(leg / np.linalg.norm(leg), [0, 0, -1], atol=0.03)  # z is up, faces look along -y
    across = found["left hip"] - found["right hip"]
    assert across[0] > 0.99 * np.linalg.norm(across)


def test_the_lowest_marker_is_on_the_ground_below_the_root(person):
    standing = with_rest_pose(person, "t-pose").skeleton
    poses = standing.reference_pose[standing.limb_of_marker]
    heights = (poses[:, :3, :3] @ standing.marker_offsets[..., np.newaxis])[:, 2, 0] + poses[:, 2, 3]
    assert abs(heights.min()) < TOLERANCE
    assert np.allclose(standing.reference_pose[standing.roots[0], :2, 3], 0.0, atol=TOLERANCE)


@pytest.mark.parametrize("rest", ["t-pose", "a-pose", "first-frame"])
def test_the_motion_is_the_same_whatever_the_rest(person, rest, tmp_path):
    for name, options in (("own", {}), ("other", {"rest": rest})):
        skelgen.write(person, tmp_path / f"{name}.bvh", **options)
    own, other = (bones_of_bvh(tmp_path / f"{name}.bvh", 60) for name in ("own", "other"))
    for bone, poses in own.items():
        assert np.allclose(poses[:, :3, 3], other[bone][:, :3, 3], atol=1e-3)  # the reader is of single precision


def test_the_first_frame_is_at_rest(person):
    pose = with_rest_pose(person, "first-frame").skeleton.reference_pose
    first = person.motion.world_from_limb[0]
    root = int(person.skeleton.roots[0])
    assert np.allclose(pose[:, :3, :3], first[:, :3, :3])
    assert np.allclose(pose[:, :3, 3] - pose[root, :3, 3], first[:, :3, 3] - first[root, :3, 3], atol=1e-3)


def test_who_is_no_person_keeps_the_reference_with_a_note(tmp_path):
    rods = skelgen.reconstruct(skelgen.simulate("rods", n_frames=60).take)
    assert with_rest_pose(rods, "t-pose") is rods
    remarks = preview_export(rods, find_format("bvh"), tmp_path / "a.bvh", {"rest": "t-pose"}).remarks
    assert any("there is no t-pose" in remark for remark in remarks)


def test_a_skeleton_hung_on_another_limb_moves_as_before(person):
    pelvis = person.skeleton.limb_names.index("pelvis")
    hung = rooted_at(person, pelvis)
    assert hung.skeleton.roots.tolist() == [pelvis]
    assert np.allclose(hung.motion.rotations, person.motion.rotations)
    number_of = {name: number for number, name in enumerate(hung.skeleton.joint_names)}
    for number, name in enumerate(person.skeleton.joint_names):
        assert np.array_equal(hung.motion.joint_positions[:, number_of[name]], person.motion.joint_positions[:, number])
    joints_at_rest(hung)
    marker = 4
    limb = person.skeleton.limb_of_marker[marker]
    places = [
        project.motion.world_from_limb[:, limb] @ [*project.skeleton.marker_offsets[marker], 1.0]
        for project in (person, hung)
    ]
    assert np.allclose(*places)


def test_a_rig_hangs_on_its_hips(person, tmp_path):
    skelgen.write(person, tmp_path / "a.bvh", bone_names="mixamo", rest="t-pose")
    assert "ROOT mixamorig:Hips" in (tmp_path / "a.bvh").read_text()
    remarks = preview_export(person, find_format("bvh"), tmp_path / "a.bvh", {"bone_names": "mixamo"}).remarks
    assert "Mixamo has the pelvis as root: the bones hang on it." in remarks
    for name in ("a.glb", "a.usda"):
        skelgen.write(person, tmp_path / name, bone_names="mixamo", rest="t-pose")
