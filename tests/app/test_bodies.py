"""A take of several bodies: a project and a file for each."""

import json

import numpy as np
import pytest

import skelgen
from skelgen.errors import WriteError


@pytest.fixture(scope="module")
def two():
    """Two sets of rods in one take; their tables."""
    return skelgen.reconstruct(skelgen.simulate("rods", n_frames=200, subjects=2, seed=1, noise=0.2).take)


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
        skelgen.write(skelgen.model.Project(skelgen.simulate("rods", n_frames=10).take), tmp_path / "{body}.bvh")


def test_summary_lists_bodies(two, tmp_path):
    file = skelgen.write(two, tmp_path / "take.json")[0]
    bodies = json.loads(file.read_text())["bodies"]
    assert [(body["name"], len(body["limbs"]), len(body["markers"])) for body in bodies] == [
        ("body1", 3, 9),
        ("body2", 3, 9),
    ]
    assert bodies[0]["probability"] > 0.9
