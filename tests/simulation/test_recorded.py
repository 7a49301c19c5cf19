"""Markers ride on recorded bones, and the truth is what the bones did."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.bones import bone_names
from skelgen_formats.registry import read_motion, write_file

import skelgen
from skelgen.errors import InputError, ParameterError
from skelgen.evaluation import evaluate
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.takes import BoneMotion
from skelgen.simulation import BoneParameters, recorded_body, simulate

N_FRAMES = 60
ROUNDED_MM = 1e-9  # some products of rotations of metres


def waves(*amplitudes_deg, phase=0.0) -> np.ndarray:
    """Rotation vectors [rad], shape (n_frames, 3), whose parts swing at different speeds."""
    times = np.arange(N_FRAMES)[:, np.newaxis] / 10
    return np.deg2rad(amplitudes_deg) * np.sin(times * np.array([1.0, 1.3, 0.7]) + phase)


def bones(*entries, rate=50.0) -> BoneMotion:
    """Bones of (name, parent, place, rotation vectors, tip)."""
    names, parents, places, turns, tips = zip(*entries, strict=True)
    return BoneMotion(
        names=names,
        parents=np.array(parents),
        rotations=np.stack([matrix_from_vector(np.broadcast_to(turn, (N_FRAMES, 3))) for turn in turns], axis=1),
        places=np.stack([np.broadcast_to(place, (N_FRAMES, 3)) for place in places], axis=1),
        tips=tuple(np.array(tip, dtype=float).reshape(-1, 3) for tip in tips),
        rate=rate,
        name="walk.bvh",
    )


STILL = np.zeros(3)
WALK = np.arange(N_FRAMES)[:, np.newaxis] * np.array([10.0, 2.0, 0.0]) + np.array([0.0, 0.0, 900.0])
ROOT = ("hips", -1, WALK, waves(10, 20, 30), [0.0, 0.0, 200.0])
LEG = ("leg", 0, [0.0, 90.0, 0.0], waves(30, 40, 20, phase=1), [0.0, 0.0, -400.0])


def test_joints_and_markers_ride_on_the_bones():
    motion = bones(ROOT, LEG)
    truth = simulate(recorded_body(motion)).truth
    poses = motion.world_from_bone
    np.testing.assert_allclose(truth.joint_positions[:, 0], poses[:, 1, :3, 3], rtol=0, atol=ROUNDED_MM)
    np.testing.assert_allclose(truth.world_from_limb, poses, rtol=0, atol=ROUNDED_MM)
    assert (truth.limb_names, truth.joint_kinds, truth.rate) == (("hips", "leg"), ("ball",), 50.0)
    assert truth.limb_of_marker.tolist() == [0, 0, 0, 1, 1, 1]


def test_bones_that_never_turn_are_one_limb_with_their_parent():
    fixed = ("shin guard", 1, [0.0, 0.0, -400.0], [0.0, 0.3, 0.0], [0.0, 50.0, 0.0])
    foot = ("foot", 2, [0.0, 50.0, 0.0], waves(20, 30, 10), [150.0, 0.0, 0.0])
    motion = bones(ROOT, LEG, fixed, foot)
    truth = simulate(recorded_body(motion)).truth
    assert truth.limb_names == ("hips", "leg", "foot")
    place = motion.world_from_bone[:, 3, :3, 3]
    np.testing.assert_allclose(truth.joint_positions[:, 1], place, rtol=0, atol=ROUNDED_MM)


def test_bone_without_length_hands_its_turn_on():
    twist = ("twist", 0, [0.0, 90.0, 0.0], waves(30, 0, 0), [])
    leg = ("leg", 1, STILL, waves(0, 30, 0), [0.0, 0.0, -400.0])
    truth = simulate(recorded_body(bones(ROOT, twist, leg))).truth
    assert (truth.limb_names, truth.joint_kinds) == (("hips", "leg"), ("universal",))


def test_room_in_which_the_hips_slide_is_no_limb():
    room = ("Reference", -1, STILL, STILL, [])
    hips = ("hips", 0, *ROOT[2:])
    leg = ("leg", 1, *LEG[2:])
    truth = simulate(recorded_body(bones(room, hips, leg))).truth
    assert truth.limb_names == ("hips", "leg")


def test_root_without_length_gives_way_to_a_child():
    motion = bones(
        ("root", -1, WALK, waves(10, 20, 30), []),
        ("spine", 0, STILL, waves(20, 0, 10), [0, 0, 500]),
        ("leg", 0, STILL, waves(0, 40, 0), [0, 0, -400]),
    )
    truth = simulate(recorded_body(motion)).truth
    assert (truth.limb_names, truth.parents.tolist()) == (("spine", "leg"), [-1, 0])
    np.testing.assert_allclose(truth.world_from_limb, motion.world_from_bone[:, 1:], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("turn", "kind"), [(waves(30, 0, 0), "hinge"), (waves(0, 25, 0, phase=2), "hinge"), (waves(30, 20, 10), "ball")]
)
def test_kinds_are_those_that_the_motion_shows(turn, kind):
    leg = (*LEG[:3], turn, LEG[4])
    truth = simulate(recorded_body(bones(ROOT, leg))).truth
    assert truth.joint_kinds == (kind,)
    if kind == "hinge":
        in_child = np.einsum("fji,fj->fi", truth.world_from_limb[:, 1, :3, :3], truth.joint_axes[:, 0])
        np.testing.assert_allclose(in_child, np.tile(in_child[0], (N_FRAMES, 1)), rtol=0, atol=1e-9)


def test_joints_that_slide_are_held_and_said():
    sliding = np.array([0.0, 90.0, 0.0]) + 5 * np.sin(np.arange(N_FRAMES))[:, np.newaxis]
    body = recorded_body(bones(ROOT, ("leg", 0, sliding, *LEG[3:])))
    assert "most: leg, by up to 8." in body.notices[0]


def test_short_ends_are_left_out_and_said():
    thumb = ("thumb", 1, [0.0, 0.0, -400.0], waves(30, 20, 10), [20.0, 0.0, 0.0])
    body = recorded_body(bones(ROOT, LEG, thumb))
    assert body.structure.limb_names == ("hips", "leg")
    assert "shorter than 30 mm: thumb" in body.notices[0]
    kept = recorded_body(bones(ROOT, LEG, thumb), BoneParameters(shortest_bone=0, markers_per_limb=4))
    assert (kept.structure.n_limbs, kept.structure.n_markers) == (3, 12)


def test_a_part_of_the_body_can_be_chosen():
    foot = ("foot", 1, [0.0, 0.0, -400.0], waves(20, 30, 10), [150.0, 0.0, 0.0])
    motion = bones(ROOT, LEG, foot)
    truth = simulate(recorded_body(motion, BoneParameters(motion_root="leg"))).truth
    assert truth.limb_names == ("leg", "foot")
    np.testing.assert_allclose(truth.world_from_limb, motion.world_from_bone[:, 1:], rtol=0, atol=ROUNDED_MM)


def test_rate_is_that_wished_frames_fall_on_the_old_ones_and_joints_stay_closed():
    knee = ("shank", 1, [0.0, 0.0, -400.0], waves(0, 50, 0), [0.0, 0.0, -390.0])
    motion = bones(ROOT, LEG, knee)
    slow = simulate(recorded_body(motion)).truth
    fast = simulate(recorded_body(motion, rate=200.0)).truth
    assert (fast.rate, fast.n_frames, fast.joint_kinds) == (200.0, 4 * N_FRAMES - 3, ("ball", "hinge"))
    np.testing.assert_allclose(fast.world_from_limb[::4], slow.world_from_limb, rtol=0, atol=ROUNDED_MM)
    in_parent = np.linalg.inv(fast.world_from_limb[:, 1]) @ fast.world_from_limb[:, 2]
    np.testing.assert_allclose(in_parent[:, :3, 3], np.tile([0, 0, -400.0], (len(in_parent), 1)), rtol=0, atol=1e-9)


def test_faults_are_as_with_other_structures():
    simulated = simulate(recorded_body(bones(ROOT, LEG)), labelled=False, ghosts=1.0, noise=0.5, dropouts=0.1, seed=3)
    again = simulate(recorded_body(bones(ROOT, LEG)), labelled=False, ghosts=1.0, noise=0.5, dropouts=0.1, seed=3)
    assert simulated.take.points.tobytes() == again.take.points.tobytes()
    assert (simulated.truth.marker_of_point < 0).any()


def test_axes_are_turned_as_wished():
    motion = bones(ROOT, LEG)
    turned = simulate(recorded_body(motion, BoneParameters(motion_axes="y-to-z"))).truth.joint_positions
    x, y, z = np.moveaxis(simulate(recorded_body(motion)).truth.joint_positions, -1, 0)
    np.testing.assert_allclose(turned, np.stack([x, -z, y], axis=-1), rtol=0, atol=ROUNDED_MM)


def test_what_cannot_be_simulated_is_refused():
    two = bones(ROOT, ("hand", -1, -WALK, waves(5, 5, 5), [0, 0, 100]), ("finger", 1, [0, 0, 100], *LEG[3:]))
    with pytest.raises(InputError, match=r"2 bodies move \(hips, hand\)"):
        recorded_body(two)
    with pytest.raises(InputError, match="no bone turns against another"):
        recorded_body(bones(ROOT))
    with pytest.raises(InputError, match="there is no bone 'tail'; there are hips, leg"):
        recorded_body(bones(ROOT, LEG), BoneParameters(motion_root="tail"))
    body = recorded_body(bones(ROOT, LEG))
    with pytest.raises(ParameterError, match="the motion has 60"):
        simulate(body, n_frames=61)
    with pytest.raises(ParameterError, match="walk belongs to random motion"):
        simulate(body, walk=2.0)
    with pytest.raises(ParameterError, match="rate is 10 Hz"):
        simulate(body, rate=10.0)


def test_simulated_human_comes_back_from_its_own_bvh(tmp_path):
    first = simulate("human", n_frames=200, seed=2)
    project = skelgen.reconstruct(first.take)
    (path,) = write_file(project, tmp_path / "human.bvh")
    second = simulate(recorded_body(read_motion(path)), noise=0.3)
    limbs = [bone_names(project.skeleton).index(name) for name in second.truth.limb_names]
    places = project.motion.world_from_limb[:, limbs][..., :3, 3]
    assert np.abs(second.truth.world_from_limb[..., :3, 3] - places).max() < 0.01
    assert sorted(second.truth.joint_kinds) == sorted(first.truth.joint_kinds)
    score = evaluate(skelgen.reconstruct(second.take), second.truth)
    assert score.limbs.adjusted_rand == 1.0
