"""Khronos' validator must find no fault, and whoever poses the file by its specification must find our skeleton."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skelgen_formats.bones import bone_end, limb_from_bone
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.benchmark.judges import GltfPoses
from skelgen.errors import WriteError
from skelgen.geometry.up_axis import AS_RECORDED

pygltflib = pytest.importorskip("pygltflib", reason="pip install pygltflib, which reads what is judged")

POSITION_MM = 0.01  # demanded; single precision has steps of 0.0001 mm at 2 m
VALIDATOR = "npm install gltf-validator in the project's folder"
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def validated():
    """What the validator says of a file: its report."""
    if not shutil.which("node"):
        pytest.skip(f"no node: apt-get install nodejs npm, then {VALIDATOR}")

    def report(path: Path) -> dict:
        modules = os.pathsep.join(filter(None, [os.environ.get("NODE_PATH"), str(ROOT / "node_modules")]))
        command = ["node", Path(__file__).with_name("gltf_validate.js"), path]
        run = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "NODE_PATH": modules}
        )
        if "Cannot find module 'gltf-validator'" in run.stderr:
            pytest.skip(f"no validator: {VALIDATOR}")
        assert run.returncode == 0, run.stderr
        return json.loads(run.stdout)

    return report


CASES = ["one root in the middle", "two roots, deep", "a single frame", "a single limb", "no markers"]


def written(project, path):
    """The files of a project as it stands, whatever is up."""
    return write_file(project, path, axes=AS_RECORDED)


def without_markers(project):
    bare = np.full_like(project.skeleton.limb_of_marker, -1)
    return replace(project, _skeleton=replace(project.skeleton, limb_of_marker=bare))


def limbs_of(reader, project):
    """Poses of the limbs' nodes, shape (n_keys, n_limbs, 4, 4)."""
    return reader.world_from_node()[:, reader.gltf.skins[0].joints[: project.skeleton.n_limbs]]


@pytest.fixture(scope="module", params=CASES)
def project(request, make_project):
    return {
        "one root in the middle": make_project,
        "two roots, deep": lambda: make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=40, rate=59.94),
        "a single frame": lambda: make_project(n_frames=1),
        "a single limb": lambda: make_project(parents=(-1,)),
        "no markers": lambda: without_markers(make_project()),
    }[request.param]()


def test_validator_finds_neither_error_nor_warning(validated, project, tmp_path):
    issues = validated(*written(project, tmp_path / "walk.glb"))["issues"]
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]
    assert {message["code"] for message in issues["messages"]} <= {"UNUSED_OBJECT"}  # a skin that no markers need


def test_validator_reads_what_was_written(validated, make_project, tmp_path):
    info = validated(*written(make_project(n_frames=30), tmp_path / "walk.glb"))["info"]
    assert info["animationCount"] == 1
    assert info["hasSkins"]
    assert info["totalVertexCount"] == 9


def test_nodes_are_where_the_limbs_are_at_every_frame(project, tmp_path):
    posed = limbs_of(GltfPoses(*written(project, tmp_path / "walk.glb")), project)
    assert np.abs(posed[..., :3, 3] * 1000 - project.motion.world_from_limb[..., :3, 3]).max() < POSITION_MM
    turned = project.motion.rotations @ limb_from_bone(project.skeleton)
    assert np.abs(posed[..., :3, :3] - turned).max() < 1e-6  # single precision, some bones deep


def test_y_axes_point_along_the_limbs_and_those_that_carry_none_have_an_end(project, tmp_path):
    reader = GltfPoses(*written(project, tmp_path / "walk.glb"))
    names = [node.name for node in reader.gltf.nodes]
    posed = reader.world_from_node()
    for limb in range(project.skeleton.n_limbs):
        end = project.motion.rotations[:, limb] @ bone_end(project.skeleton, limb)
        along = posed[:, names.index(f"limb{limb}"), :3, 1]
        assert np.abs(along - end / np.linalg.norm(end, axis=1, keepdims=True)).max() < 1e-6
        assert (f"limb{limb}_end" in names) == (not (project.skeleton.parents == limb).any())
        if f"limb{limb}_end" in names:
            place = posed[:, names.index(f"limb{limb}_end"), :3, 3] * 1000
            truth = project.motion.world_from_limb[:, limb, :3, 3] + end
            assert np.abs(place - truth).max() < POSITION_MM


def test_points_are_where_the_skeleton_has_the_markers(make_project, tmp_path):
    project = make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=40)
    points = GltfPoses(*written(project, tmp_path / "walk.glb")).points()
    assert np.abs(points * 1000 - project.motion.marker_positions[:, :-1]).max() < POSITION_MM


def test_keys_are_at_the_frames(make_project, tmp_path):
    project = make_project(n_frames=40, rate=59.94)
    reader = GltfPoses(*written(project, tmp_path / "walk.glb"))
    np.testing.assert_allclose(reader.times, project.motion.times, rtol=1e-7, atol=0)  # single precision


def test_rotations_take_the_short_way_between_keys(make_project, tmp_path):
    reader = GltfPoses(*written(make_project(n_frames=60), tmp_path / "walk.glb"))
    for channel in reader.animation.channels:
        if channel.target.path == "rotation":
            quaternions = reader.values(reader.animation.samplers[channel.sampler].output)
            assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) >= 0).all()


@pytest.mark.parametrize(("unit", "per_mm"), [("mm", 1.0), ("cm", 0.1)])
def test_lengths_are_in_the_unit_wished(small_project, tmp_path, unit, per_mm):
    reader = GltfPoses(*write_file(small_project, tmp_path / "walk.glb", unit=unit))
    posed = limbs_of(reader, small_project)[..., :3, 3] / per_mm
    assert np.abs(posed - small_project.motion.world_from_limb[..., :3, 3]).max() < POSITION_MM


def test_turned_axes_and_another_rate_are_obeyed(small_project, validated, tmp_path):
    (path,) = write_file(small_project, tmp_path / "walk.glb", axes="z-to-y", rate=50.0)
    reader = GltfPoses(path)
    posed = limbs_of(reader, small_project)[..., :3, 3] * 1000
    x, y, z = np.moveaxis(small_project.motion.world_from_limb[::2, :, :3, 3], -1, 0)
    assert np.abs(posed - np.stack([x, z, -y], axis=-1)).max() < POSITION_MM
    assert validated(path)["issues"]["numErrors"] == 0


def test_names_kinds_and_deviations_stand_beside(small_project, tmp_path):
    gltf = GltfPoses(*written(small_project, tmp_path / "walk.glb")).gltf
    names = small_project.trajectories.names
    assert gltf.meshes[0].extras["marker_names"] == list(names[:-1])
    bones = {node.name: node for node in gltf.nodes}
    turns = limb_from_bone(small_project.skeleton)
    for joint in small_project.skeleton.joints:
        facts, above = bones[f"limb{joint.child}"].extras, turns[joint.parent]
        assert facts["kind"] == joint.kind
        assert (facts["limb"], facts["joint"]) == (f"limb{joint.child}", f"limb{joint.parent}-limb{joint.child}")
        spread = np.diag(above.T @ np.diag(joint.std**2) @ above)
        np.testing.assert_allclose(facts["std_mm"], np.sqrt(spread), rtol=1e-12)
        assert ("axis_in_parent" in facts) == (joint.axis is not None)
        if joint.axis is not None:
            np.testing.assert_allclose(above @ facts["axis_in_parent"], joint.axis, rtol=0, atol=1e-12)


def test_number_beyond_single_precision_is_refused_and_leaves_nothing(small_project, tmp_path):
    poses = small_project.motion.world_from_limb.copy()
    poses[3, 1, 0, 3] = 1e39
    motion = replace(small_project.motion, world_from_limb=poses)
    with pytest.raises(WriteError, match="single precision"):
        written(replace(small_project, _motion=motion), tmp_path / "walk.glb")
    assert list(tmp_path.iterdir()) == []


def test_what_is_up_is_turned_to_y_by_what_is_found(standing_project, tmp_path):
    reader = GltfPoses(*write_file(standing_project, tmp_path / "walk.glb"))
    x, y, z = np.moveaxis(standing_project.motion.world_from_limb[..., :3, 3], -1, 0)
    found = limbs_of(reader, standing_project)[..., :3, 3] * 1000
    assert np.abs(found - np.stack([x, z, -y], axis=-1)).max() < POSITION_MM
    as_it_is = GltfPoses(*write_file(standing_project, tmp_path / "as.glb", axes="as-recorded"))
    assert np.abs(limbs_of(as_it_is, standing_project)[..., :3, 3] * 1000 - np.stack([x, y, z], -1)).max() < POSITION_MM


def test_what_is_not_told_is_said(make_project, standing_project):
    remarks = find_format("gltf").remarks
    still = make_project(n_frames=1)
    assert any("does not tell" in sentence for sentence in remarks(still, Options(unit="m", axes="auto")))
    said = " ".join(remarks(standing_project, Options(unit="m", axes="auto")))
    assert "to be up" not in said
    assert "demands metres" not in said
    said = " ".join(remarks(standing_project, Options(unit="mm")))
    assert "in the recording it is z: choose axes z-to-y" in said
    assert "take the mm in the file for metres" in said


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        written(small_project.trajectories, tmp_path / "walk.glb")
