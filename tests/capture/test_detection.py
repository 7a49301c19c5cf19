"""Balls in an image: where they are, how certain, which of them touch, and what is no ball."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen._kernels.bright_spots import FULL
from skelgen.capture.detection import (
    DetectionParameters,
    correct_eccentricity,
    dark_noise,
    detect_balls,
    find_thresholds,
    level_of,
)
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import render_view
from skelgen.capture.simulated_rig.view import RenderParameters
from skelgen.errors import InputError

WANTED = 0.02  # px: what the project asks of a centre in the conditions of the reference rig
TOUCHING = 0.15  # px: three standard deviations of a ball that is half behind another
DARK = np.zeros((480, 640), dtype=np.uint8)


def scene(n, seed, distances=(900.0, 1100.0), parameters=None):
    """One image of balls that do not touch, with their true centres."""
    rng, camera = np.random.default_rng(seed), reference_rig().left
    depth = rng.uniform(*distances, size=4 * n)
    slopes = rng.uniform([-0.33, -0.25], [0.33, 0.25], size=(4 * n, 2))
    chosen = [0]
    for ball in range(1, 4 * n):
        apart = np.linalg.norm(slopes[chosen] - slopes[ball], axis=1).min()
        if apart > 0.05 and len(chosen) < n:
            chosen.append(ball)
    points = np.column_stack([slopes, np.ones(4 * n)])[chosen] * depth[chosen, np.newaxis]
    image, truth = render_view(camera, points, parameters or RenderParameters(), seed)
    return image, truth


def errors(balls, truth):
    gaps = balls.centres[np.newaxis] - truth.centres[:, np.newaxis]
    nearest = np.linalg.norm(gaps, axis=2).argmin(axis=1)
    return gaps[np.arange(len(gaps)), nearest], nearest


def test_centres_at_the_conditions_of_the_reference_rig_are_as_certain_as_asked():
    found = [(detect_balls(image), truth) for image, truth in (scene(15, seed) for seed in range(4))]
    assert all(len(balls) == 15 for balls, _ in found)
    all_errors = np.concatenate([errors(balls, truth)[0] for balls, truth in found])
    assert np.sqrt((all_errors**2).mean()) < WANTED


def test_predicted_deviations_are_those_of_the_errors():
    ratios = []
    for seed in range(6):
        image, truth = scene(12, seed, (800.0, 2000.0), RenderParameters(noise=3.0))
        balls = correct_eccentricity(reference_rig().left, detect_balls(image))
        off, nearest = errors(balls, truth)
        ratios.append(off / balls.std[nearest, np.newaxis])
    spread = np.sqrt((np.concatenate(ratios) ** 2).mean())
    assert 0.7 < spread < 1.4


def test_near_balls_are_centred_with_their_camera():
    image, truth = scene(8, 1, (350.0, 500.0), RenderParameters(diameter=20.0))
    balls = detect_balls(image)
    before, after = errors(balls, truth)[0], errors(correct_eccentricity(reference_rig().left, balls), truth)[0]
    assert np.sqrt((before**2).mean()) > 2 * np.sqrt((after**2).mean())
    assert np.sqrt((after**2).mean()) < WANTED


def test_edges_give_better_centres_than_brightness_between_thresholds():
    several = {"edge": [], "brightness": []}
    for seed in range(4):
        image, truth = scene(15, seed, (900.0, 1500.0), RenderParameters(reflections=0))
        for way, found in several.items():
            balls = correct_eccentricity(reference_rig().left, detect_balls(image, DetectionParameters(centre=way)))
            found.append(errors(balls, truth)[0])
    by_edge, by_brightness = (np.sqrt((np.concatenate(found) ** 2).mean()) for found in several.values())
    assert by_edge < 0.85 * by_brightness


def test_thresholds_stand_off_both_quantiles():
    counts = np.zeros(256, dtype=np.int64)
    counts[[10, 30, 250]] = 97_000, 2_900, 100  # H(0.98) = 30, H(0.9999) = 250
    found = find_thresholds(counts, DetectionParameters())
    assert (found.low, found.high) == pytest.approx((0.2 * 250 + 0.8 * 30, 0.8 * 250 + 0.2 * 30))
    assert found.weights[int(found.low)] == 0 and found.weights[int(found.high) + 1] == FULL
    middle = (found.low + found.high) / 2
    assert found.weights[int(middle)] == pytest.approx(FULL / 2, abs=FULL / (found.high - found.low))


def test_quantiles_are_grey_levels():
    counts = np.bincount([3] * 5 + [7] * 4 + [9], minlength=256)
    assert [level_of(counts, part) for part in (0.1, 0.5, 0.9, 0.95)] == [3, 3, 7, 9]


def test_the_noise_of_the_dark_is_found_from_the_histogram():
    for background, n_bright in ((20.0, 20_000), (1.0, 0)):  # the latter is cut off at 0
        levels = np.random.default_rng(0).normal(background, 3.0, size=200_000).round().clip(0).astype(np.int64)
        counts = np.bincount(levels, minlength=256)
        counts[250] += n_bright
        assert dark_noise(counts) == pytest.approx(3.0, rel=0.15)


def test_one_small_ball_is_found_though_the_quantile_leaves_it_out():
    image, truth = scene(1, 2, (2000.0, 2100.0), RenderParameters(reflections=0))
    balls = detect_balls(image)
    assert len(balls) == 1
    assert np.abs(errors(balls, truth)[0]).max() < 0.1


def test_many_large_balls_are_found_though_the_quantile_lies_inside_them():
    image, _ = scene(40, 2, (380.0, 420.0), RenderParameters(diameter=20.0, brightness=1500.0))
    assert (image > 200).mean() > 0.03
    assert len(detect_balls(image)) == 40


@pytest.mark.parametrize("apart", [0.8, 1.0, 1.5, 1.9])
@pytest.mark.parametrize("distance", [800.0, 1300.0])
def test_touching_balls_are_separated(apart, distance):
    for turn in np.arange(6):
        x, y = 30.0 + apart * 7.0 * np.cos(turn), -50.0 + apart * 7.0 * np.sin(turn)
        points = np.array([[30.0, -50.0, distance], [x, y, distance + 40.0]])
        image, truth = render_view(reference_rig().left, points, RenderParameters(), int(turn))
        balls = detect_balls(image)
        assert len(balls) == 2
        assert balls.touching.all()
        assert np.linalg.norm(errors(balls, truth)[0], axis=1).max() < TOUCHING


def test_three_balls_in_a_triangle_are_separated():
    ring = 8.0 * np.array([[np.cos(turn), np.sin(turn), 0.0] for turn in 2 * np.pi * np.arange(3) / 3])
    points = np.add(ring, [0.0, 0.0, 900.0])
    image, truth = render_view(reference_rig().left, points, RenderParameters(reflections=0))
    balls = detect_balls(image)
    assert len(balls) == 3
    assert np.linalg.norm(errors(balls, truth)[0], axis=1).max() < TOUCHING


@pytest.mark.parametrize("bend", [0.0, 25.0, 50.0, 80.0])
@pytest.mark.parametrize("apart", [12.0, 14.0])
def test_three_balls_in_a_row_are_separated(bend, apart):
    """They leave gaps on both sides, which a small disc would fill."""
    angle = np.radians(bend)
    row = apart * np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]])
    image, truth = render_view(
        reference_rig().left, np.add(row, [20.0, -30.0, 1000.0]), RenderParameters(reflections=0)
    )
    balls = detect_balls(image)
    assert len(balls) == 3
    assert np.linalg.norm(errors(balls, truth)[0], axis=1).max() < TOUCHING


def test_separation_can_be_switched_off():
    points = np.array([[0.0, 0.0, 1000.0], [11.0, 0.0, 1000.0]])
    image, _ = render_view(reference_rig().left, points, RenderParameters(reflections=0))
    assert len(detect_balls(image, DetectionParameters(separate=False, max_elongation=5.0))) == 1


def test_a_ball_that_the_border_cuts_has_the_centre_of_its_whole_outline():
    camera = reference_rig().left
    points = np.array([[-391.0, 20.0, 1000.0], [0.0, 0.0, 1000.0]])  # two thirds of the first are in the image
    image, truth = render_view(camera, points, RenderParameters(reflections=0))
    assert 0.4 < truth.visible[0] < 0.9
    balls = detect_balls(image)
    assert len(balls) == 2
    assert np.linalg.norm(errors(balls, truth)[0], axis=1).max() < TOUCHING


def test_dull_metal_is_no_ball():
    image, _ = scene(10, 6, parameters=RenderParameters(reflections=30))
    assert len(detect_balls(image)) == 10


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.25, 0.1, 1e-3, -2e-3, 0.0)])
def test_centres_are_corrected_for_perspective_and_lens(distortion):
    camera = replace(reference_rig().left, distortion=np.array(distortion))
    points = np.array([[120.0, 80.0, 450.0], [-120.0, 70.0, 450.0], [20.0, -90.0, 450.0]])
    image, truth = render_view(
        camera, points, RenderParameters(diameter=24.0, reflections=0, noise=0.0, shot_noise=0.0)
    )
    balls = detect_balls(image)
    before, after = errors(balls, truth)[0], errors(correct_eccentricity(camera, balls), truth)[0]
    assert np.abs(before).max() > 1.5 * WANTED
    assert np.abs(after).max() < WANTED


def test_a_cable_of_light_changes_no_ball_beside_it():
    image, _ = scene(5, 6)
    beside = detect_balls(image)
    image = image.copy()
    for step in range(200):
        image[100 + step, 200 + step : 205 + step] = 255
    balls = detect_balls(image)
    assert len(balls) == 5
    assert balls.centres == pytest.approx(beside.centres, abs=0.02)  # px: it moves the thresholds


def test_balls_come_largest_first():
    image, _ = scene(12, 8, (700.0, 2000.0))
    area = detect_balls(image).area
    assert (np.diff(area) <= 0).all()


@pytest.mark.parametrize("level", [0, 5])
def test_a_black_image_has_no_balls_and_says_why(level):
    balls = detect_balls(np.full_like(DARK, level))
    assert len(balls) == 0
    assert "shows no balls" in balls.notice and "lens caps" in balls.notice


def test_noise_alone_has_no_balls():
    noise = np.clip(np.random.default_rng(0).normal(10, 3, size=DARK.shape), 0, 255).astype(np.uint8)
    assert "shows no balls" in detect_balls(noise).notice


def test_an_over_exposed_image_has_no_balls_and_says_why():
    balls = detect_balls(np.full_like(DARK, 252))
    assert len(balls) == 0
    assert "over-exposed" in balls.notice and "shutter" in balls.notice


def test_an_image_full_of_spots_has_no_balls_and_says_why():
    image = DARK.copy()
    image[::2, ::4] = 255
    balls = detect_balls(image, DetectionParameters(min_area=1))
    assert len(balls) == 0
    assert "more than 500 bright spots" in balls.notice


@pytest.mark.parametrize(
    "image, what",
    [
        (np.zeros((480, 640, 3), dtype=np.uint8), r"\(480, 640, 3\)"),
        (np.zeros((480, 640), dtype=np.uint16), "uint16"),
        (np.zeros((0, 640), dtype=np.uint8), "640 x 0"),
        ([[1, 2], [3, 4]], "list"),
    ],
)
def test_what_is_no_grey_image_is_refused(image, what):
    with pytest.raises(InputError, match=what):
        detect_balls(image)


def test_images_of_odd_sizes_and_strides_are_searched():
    image, truth = scene(10, 9)
    part = image[1:460:1, 3:601]
    assert not part.flags.c_contiguous
    inside = ((truth.centres > [20, 20]) & (truth.centres < [580, 440])).all(axis=1)
    found = detect_balls(part)
    gaps = np.linalg.norm(found.centres[np.newaxis] + [3, 1] - truth.centres[inside][:, np.newaxis], axis=2)
    assert gaps.min(axis=1).max() < 0.1


def test_a_single_row_is_an_image():
    assert len(detect_balls(np.arange(200, dtype=np.uint8)[np.newaxis])) == 0


def test_settings_of_the_first_version_that_name_a_method_of_labelling_are_read():
    assert DetectionParameters.from_mapping({"method": "opencv", "min_area": "9"}).min_area == 9
