"""bvhio is the judge: where it poses the bones at every frame, the skeleton's joints must be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.app.stage_summary import stage_sentences
from skelgen.benchmark.judges import bones_of_bvh
from skelgen.errors import WriteError
from skelgen.model import Motion

bvhio = pytest.importorskip("bvhio", reason="pip install bvhio, the judge of BVH files")

POSITION_MM = 0.01  # demanded; bvhio poses in single precision, with steps of 0.0002 mm at 2 m
ROTATION = 1e-5  # of a matrix' elements: single precision, some bones deep


CASES = ["one root in the middle", "deep", "a single frame", "a single limb"]


@pytest.fixture(scope="module", params=CASES)
def project(request, make_project):
    return {
        "one root in the middle": make_project,
        "deep": lambda: make_project(parents=(1, 2, 3, -1, 3, 4, 0), n_frames=40, rate=59.94),
        "a single frame": lambda: make_project(n_frames=1),
        "a single limb": lambda: make_project(parents=(-1,)),
    }[request.param]()


def deviation(path, motion, per_mm=1.0) -> float:
    """Largest distance [mm] between bvhio's bones and the limbs' origins."""
    bones = bones_of_bvh(path, motion.n_frames)
    apart = [
        np.abs(bones[f"limb{limb}"][:, :3, 3] / per_mm - motion.world_from_limb[:, limb, :3, 3]).max()
        for limb in range(motion.world_from_limb.shape[1])
    ]
    return max(apart)


def test_bones_are_where_the_limbs_are_at_every_frame(project, tmp_path):
    assert deviation(*write_file(project, tmp_path / "walk.bvh"), project.motion) < POSITION_MM


def test_bones_turn_as_the_limbs_do(project, tmp_path):
    bones = bones_of_bvh(*write_file(project, tmp_path / "walk.bvh"), project.motion.n_frames)
    for limb in range(project.skeleton.n_limbs):
        turns = bones[f"limb{limb}"][:, :3, :3]
        # Importers give bones rest poses of their own: the turn since the first frame is what all agree on.
        since = turns @ turns[:1].swapaxes(-1, -2)
        truth = project.motion.rotations[:, limb] @ project.motion.rotations[:1, limb].swapaxes(-1, -2)
        assert np.abs(since - truth).max() < ROTATION


@pytest.mark.parametrize(("unit", "per_mm"), [("cm", 0.1), ("m", 0.001)])
def test_lengths_are_in_the_unit_wished(small_project, tmp_path, unit, per_mm):
    (path,) = write_file(small_project, tmp_path / "walk.bvh", unit=unit)
    assert deviation(path, small_project.motion, per_mm) < POSITION_MM


def test_turned_axes_leave_the_rest_pose_without_turns(small_project, tmp_path):
    from skelgen.geometry.up_axis import with_up_axis

    turned = with_up_axis(small_project, "z-to-y")
    (path,) = write_file(small_project, tmp_path / "walk.bvh", axes="z-to-y")
    assert deviation(path, turned.motion) < POSITION_MM
    offset = next(child.Offset for child in bvhio.readAsBvh(str(path)).Root.Children if child.Name == "limb0")
    x, y, z = small_project.skeleton.joints[0].position_in_parent
    np.testing.assert_allclose([offset.x, offset.y, offset.z], [x, z, -y], rtol=0, atol=1e-4)


def test_rate_is_that_wished_and_frames_fall_on_the_old_ones(small_project, tmp_path):
    (path,) = write_file(small_project, tmp_path / "walk.bvh", rate=50.0)
    content = bvhio.readAsBvh(str(path))
    assert (content.FrameCount, content.FrameTime) == (6, 0.02)
    bones, truth = bones_of_bvh(path, 6), small_project.motion.world_from_limb[::2, 1, :3, 3]
    assert np.abs(bones["limb1"][:, :3, 3] - truth).max() < POSITION_MM


def test_several_roots_hang_on_one_that_stays_still(make_project, tmp_path):
    project = make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=20)
    (path,) = write_file(project, tmp_path / "walk.bvh")
    assert deviation(path, project.motion) < POSITION_MM
    root = bvhio.readAsBvh(str(path)).Root
    assert root.Name == "world"
    assert [child.Name for child in root.Children] == ["limb1", "limb3"]
    assert not any(np.array(key.Position.to_tuple()).any() for key in root.Keyframes)


def test_added_or_replaced_offsets_are_the_same_for_bones_that_have_places(make_project, tmp_path):
    (path,) = write_file(make_project(parents=(-1, 0, -1)), tmp_path / "walk.bvh")
    for joint, *_ in bvhio.readAsBvh(str(path)).Root.layout():
        assert len(joint.Channels) == 3 or tuple(joint.Offset) == (0.0, 0.0, 0.0)


def test_bones_that_carry_no_other_end_as_far_as_their_markers_reach(small_project, tmp_path):
    root = bvhio.readAsBvh(str(*write_file(small_project, tmp_path / "walk.bvh"))).Root
    skeleton = small_project.skeleton
    for child in root.Children:
        tip = np.array(tuple(child.EndSite))
        markers = skeleton.marker_offsets[skeleton.markers_of(int(child.Name.removeprefix("limb")))]
        along = markers @ tip / np.linalg.norm(tip)
        assert np.linalg.norm(tip) == pytest.approx(along.max(), abs=1e-4)


def test_limb_without_markers_still_has_an_end(small_project, tmp_path):
    skeleton = small_project.skeleton
    bare = np.where(skeleton.limb_of_marker == 0, -1, skeleton.limb_of_marker)
    project = replace(small_project, _skeleton=replace(skeleton, limb_of_marker=bare))
    text = write_file(project, tmp_path / "walk.bvh")[0].read_text()
    assert "OFFSET 0.000000 0.000000 1.000000" in text


def test_what_is_not_told_is_said(small_project, make_project):
    entry = find_format("bvh")
    unit, interpolated = entry.remarks(small_project, Options(unit="cm"))
    assert "lengths are in cm" in unit
    assert interpolated == "BVH cannot say that in 1 of 12 frames some limb is not seen but interpolated."
    ring = replace(small_project.skeleton, loops=(small_project.skeleton.joints[0],))
    assert "1 joint closing loops" in entry.remarks(replace(small_project, _skeleton=ring), Options())[1]
    assert "2 bodies hang on one root" in entry.remarks(make_project(parents=(-1, 0, -1)), Options())[1]


def test_limbs_that_no_frame_shows_to_turn_are_named_and_not_counted_as_interpolated(small_project):
    seen = small_project.motion.limb_seen.copy()
    seen[:, 0], seen[:, 1:] = False, True
    project = replace(small_project, _motion=replace(small_project.motion, limb_seen=seen))
    told = f"No frame tells all turns of {small_project.skeleton.limb_names[0]}: too few markers."
    for name in ("bvh", "gltf", "usd", "poses-csv"):
        remarks = " ".join(find_format(name).remarks(project, Options()))
        assert told in remarks
        assert "interpolated" not in remarks
        assert "frames some limb" not in remarks
    assert "0.0 % of the limbs' poses are interpolated." in stage_sentences(project, "skeleton")


def test_take_and_project_without_frames_are_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.bvh")
    motion = small_project.motion
    fields = ("world_from_limb", "joint_positions", "marker_positions", "residuals", "limb_seen")
    empty = Motion(**{**vars(motion), **{name: getattr(motion, name)[:0] for name in fields}})
    with pytest.raises(WriteError, match="one limb and one frame"):
        write_file(replace(small_project, _motion=empty), tmp_path / "walk.bvh")
    assert list(tmp_path.iterdir()) == []
