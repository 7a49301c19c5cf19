"""The simulated rig: images that follow from the cameras, and the truth that goes with them."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.detection import detect_balls
from skelgen.capture.optics import in_image, project
from skelgen.capture.reference_rig import reference_arm, reference_rig
from skelgen.capture.simulated_rig import SimulatedRig, render_pair, render_view, simulated_rig
from skelgen.capture.simulated_rig.scene import (
    hand_held_target,
    joints_of,
    scene_of_bodies,
    scene_of_structure,
    targets_of,
    wandering_poses,
)
from skelgen.capture.simulated_rig.view import (
    METAL_LEVEL,
    RenderParameters,
    background,
    brightness,
    corner_rays,
    look_at,
)
from skelgen.capture.sources import open_source
from skelgen.errors import InputError, ParameterError
from skelgen.model.rig import BodyTarget

CLEAN = RenderParameters(noise=0.0, shot_noise=0.0, reflections=0, background=0.0, brightness=200.0, limb_darkening=0.0)
BEFORE = np.array([[150.0, 20.0, 1000.0], [60.0, -90.0, 1100.0]])  # mm: in both images of the reference rig
ROUNDING = 0.02  # px: grey levels are rounded to whole ones


def light_centre(image):
    y, x = np.indices(image.shape)
    weights = image.astype(float)
    return np.array([(x * weights).sum(), (y * weights).sum()]) / weights.sum()


def test_the_light_of_a_small_ball_has_its_centre_where_the_camera_projects_it():
    rig = reference_rig()
    for point in BEFORE:
        pair, _ = render_pair(rig, point[np.newaxis], CLEAN)
        for camera, image in ((rig.left, pair.left), (rig.right, pair.right)):
            assert light_centre(image) == pytest.approx(project(camera, point), abs=ROUNDING)


def test_a_large_ball_lies_farther_out_by_its_perspective():
    camera, radius = replace(reference_rig().left, distortion=np.zeros(5)), 60.0
    image, truth = render_view(camera, np.array([[300.0, 0.0, 1000.0]]), replace(CLEAN, diameter=2 * radius))
    shift = (light_centre(image) - truth.centres[0])[0]
    from_middle = truth.centres[0, 0] - camera.matrix[0, 2]
    assert shift == pytest.approx(from_middle * radius**2 / (1000.0**2 - radius**2), abs=ROUNDING)


def test_the_light_of_a_ball_is_its_area_times_its_brightness():
    camera = reference_rig().left
    image, truth = render_view(camera, BEFORE[:1], CLEAN)
    level = brightness(BEFORE[:1], CLEAN)[0]
    assert image.sum(dtype=float) == pytest.approx(np.pi * truth.radii[0] ** 2 * level, rel=0.01)


@pytest.mark.parametrize("far, near", [(1000.0, 2000.0), (2000.0, 4000.0)])
def test_brightness_falls_with_distance_beyond_the_best_one(far, near):
    places = np.array([[0.0, 0.0, far], [0.0, 0.0, near]])
    one, other = brightness(places, RenderParameters())
    assert other < one


def test_balls_nearer_than_half_a_metre_are_darker_as_the_lamps_are_beside_the_lens():
    at_half, at_fifth = brightness(np.array([[0.0, 0.0, 500.0], [0.0, 0.0, 200.0]]), RenderParameters())
    assert at_fifth < at_half


def test_brightness_falls_towards_the_border():
    middle, border = brightness(np.array([[0.0, 0.0, 1000.0], [350.0, 0.0, 937.0]]), RenderParameters())
    assert border < 0.8 * middle


def test_a_ball_behind_another_is_seen_in_part():
    camera = reference_rig().left
    points = np.array([[0.0, 0.0, 1000.0], [7.0, 0.0, 1100.0]])
    _, truth = render_view(camera, points, CLEAN)
    assert truth.visible[0] == pytest.approx(1.0, abs=1e-3)
    assert 0.2 < truth.visible[1] < 0.8


def test_visible_parts_are_those_of_circles_that_overlap():
    camera = reference_rig().left
    points = np.array([[0.0, 0.0, 1000.0], [7.0, 0.0, 1000.001]])  # one radius aside: a lens of 0.391 of the area
    _, truth = render_view(camera, points, CLEAN)
    assert truth.visible[1] == pytest.approx(1 - 0.391, abs=5e-3)


def test_the_border_cuts_a_ball():
    camera = reference_rig().left
    ray = corner_rays(camera)[240, 16]  # the left border of the image
    _, truth = render_view(camera, 1000.0 * np.array([[*ray, 1.0]]), CLEAN)
    assert truth.visible[0] == pytest.approx(0.5, abs=0.02)


def test_hidden_absent_and_unseen_balls_leave_the_image_dark():
    points = np.array([[0.0, 0.0, 1000.0], [np.nan] * 3, [0.0, 0.0, -1000.0], [5000.0, 0.0, 1000.0]])
    hidden = np.zeros((2, 4), dtype=bool)
    hidden[:, 0] = True
    pair, truth = render_pair(reference_rig(), points, CLEAN, hidden=hidden)
    assert pair.left.max() == pair.right.max() == 0
    assert not truth.left.visible.any()


def test_noise_has_its_deviation_and_differs_from_frame_to_frame():
    parameters = RenderParameters(reflections=0, background=100.0, noise=2.0, shot_noise=0.05)
    nothing = np.empty((0, 3))
    first, _ = render_pair(reference_rig(), nothing, parameters, index=0)
    second, _ = render_pair(reference_rig(), nothing, parameters, index=1)
    wanted = np.sqrt(2.0**2 + 0.05 * 100.0 + 1 / 12)  # and the rounding to whole levels
    assert first.left.std() == pytest.approx(wanted, rel=0.01)
    images = [image.astype(float).ravel() for image in (first.left, first.right, second.left)]
    assert np.abs(np.corrcoef(images) - np.eye(3)).max() < 0.01


def test_the_same_seed_gives_the_same_images():
    one, other = (render_pair(reference_rig(), BEFORE, seed=5, index=7)[0] for _ in range(2))
    assert (one.left == other.left).all()
    assert (one.right == other.right).all()


def test_dull_metal_stands_still_in_the_world_and_stays_dull():
    parameters = RenderParameters(reflections=20)
    rig = reference_rig()
    left, right = background(rig.left, parameters, 1), background(rig.right, parameters, 1)
    for light in (left, right):
        assert parameters.background + 10 < light.max() < 3 * METAL_LEVEL
    assert not np.array_equal(left, right)


def test_samples_see_the_rays_of_the_lens():
    camera = reference_rig().left
    rays = corner_rays(camera)
    point = np.append(rays[100, 500], 1.0) * 1000.0
    seen, _ = look_at(camera, point[np.newaxis], CLEAN)
    assert len(seen.index) == 1
    assert project(camera, point) == pytest.approx([500 - 16 - 0.5, 100 - 16 - 0.5], abs=1e-6)


def test_balls_of_a_body_are_where_its_pose_puts_them():
    rig, body = reference_rig(), BodyTarget("star", np.array([[0.0, 0, 0], [40, 0, 0], [0, 55, 0], [0, 0, 70]]))
    poses = wandering_poses(rig, 20, 2, seed=2)
    scene = scene_of_bodies([body, BodyTarget("other", body.points * 1.3)], poses)
    assert scene.points.shape == (20, 8, 3)
    expected = body.points @ poses[7, 0, :3, :3].T + poses[7, 0, :3, 3]
    assert scene.points[7, :4] == pytest.approx(expected)
    assert scene.body_of_ball.tolist() == [0] * 4 + [1] * 4


def test_markers_of_a_simulated_structure_are_the_balls_of_its_scene():
    scene = scene_of_structure("human", reference_rig(), n_frames=30, seed=3)
    for body, target in enumerate(scene.bodies):
        own = scene.body_of_ball == body
        pose = scene.world_from_body[11, body]
        assert scene.points[11, own] == pytest.approx(target.points @ pose[:3, :3].T + pose[:3, 3], abs=1e-9)
    assert 0.05 < scene.hidden.mean() < 0.8  # limbs stand before others


def test_joints_of_a_structure_hold_in_every_frame():
    structure = reference_arm()
    scene = scene_of_structure(structure, reference_rig(), n_frames=40)
    names = [body.name for body in scene.bodies]
    for joint in joints_of(structure):
        parent, child = (scene.world_from_body[:, names.index(name)] for name in (joint.parent, joint.child))
        in_parent, in_child = parent @ joint.parent_from_joint, child @ joint.child_from_joint
        assert in_parent[:, :3, 3] == pytest.approx(in_child[:, :3, 3], abs=1e-9)
        if joint.kind == "hinge":
            assert in_parent[:, :3, 2] == pytest.approx(in_child[:, :3, 2], abs=1e-9)


def test_both_cameras_see_the_whole_test_rig():
    scene = scene_of_structure("arm", reference_rig(), n_frames=60)
    rig = reference_rig()
    for camera in (rig.left, rig.right):
        pixels = project(camera, scene.points)
        assert ((pixels > 0) & (pixels < [camera.width, camera.height])).all(axis=-1).mean() > 0.98


def test_a_source_delivers_every_pair_in_order():
    with simulated_rig("arm", n_frames=3, rate=50.0) as source:
        pairs = list(source)
    assert (source.size, source.rate, source.n_frames, source.n_dropped) == ((640, 480), 50.0, 3, 0)
    assert [pair.index for pair in pairs] == [0, 1, 2]
    assert [pair.time for pair in pairs] == pytest.approx([0.0, 0.02, 0.04])
    again, truth = source.render(2)
    assert (again.left == pairs[2].left).all()
    assert truth.points == pytest.approx(source.scene.points[2])
    assert not pairs[0].left.flags.writeable


def test_who_is_slow_loses_pairs_of_a_paced_source_and_is_told():
    with simulated_rig("arm", n_frames=30, rate=100.0, paced=True) as source:
        next(iter(source))  # whatever the first pair has to compile or to keep
        pairs = []
        for pair in source:
            time.sleep(0.025)
            pairs.append(pair)
    assert sum(pair.dropped for pair in pairs) == source.n_dropped > 0
    assert all(later.index - pair.index == 1 + later.dropped for pair, later in itertools.pairwise(pairs))


def test_a_structure_far_away_is_lit_and_marked_so_that_its_balls_are_found():
    source = simulated_rig("human", n_frames=20, seed=1)
    found, visible = 0, 0
    for index in range(0, 20, 5):
        pair, truth = source.render(index)
        found += len(detect_balls(pair.left))
        visible += int((truth.left.visible > 0.5).sum())
    assert found == pytest.approx(visible, rel=0.15)


def test_a_frame_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="frames 0 to 1"):
        simulated_rig("arm", n_frames=2).render(2)


def test_cameras_of_different_sizes_are_refused():
    rig = reference_rig()
    odd = replace(rig, right=replace(rig.right, width=320, height=240))
    with pytest.raises(InputError, match="640 x 480 pixels and the right one 320 x 240"):
        SimulatedRig(scene_of_structure("arm", rig, n_frames=1), odd)


def test_unknown_structures_and_options_are_refused():
    with pytest.raises(ParameterError, match="octopus"):
        simulated_rig("octopus")
    with pytest.raises(ParameterError, match="wobble"):
        simulated_rig("arm", wobble=1.0)


def test_what_walks_out_of_both_images_is_refused():
    with pytest.raises(InputError, match="fits into both images at no distance"):
        simulated_rig("human", n_frames=50, walk=50_000.0)


@pytest.mark.parametrize("name", ["torso", "upper arm", "lower arm"])
def test_a_target_in_the_hand_stays_in_both_images_and_is_that_of_the_arm(name):
    for seed in range(5):
        scene = hand_held_target(name, reference_rig(), n_frames=200, rate=20.0, seed=seed)
        for camera in (reference_rig().left, reference_rig().right):
            assert in_image(camera, project(camera, scene.points.reshape(-1, 3))).all()
        lengths = np.linalg.norm(scene.points[7][:, np.newaxis] - scene.points[7], axis=-1)
        (same,) = (target for target in targets_of(reference_arm()) if target.name == name)
        np.testing.assert_allclose(lengths, np.linalg.norm(same.points[:, np.newaxis] - same.points, axis=-1))


def test_a_target_that_the_arm_has_not_is_named():
    with pytest.raises(InputError, match="there is no target 'foot' to show; there are torso, upper arm, lower arm"):
        open_source("simulated:target?show=foot")
