"""A recording of two cameras as unlabelled points: right ones, at the right times, and refused with a reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.markers import markers_of, misfit_in_space
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.values import FrameSet
from skelgen.errors import Cancelled, InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.progress import SilentMonitor

BALL = 7.0  # mm: radius of the balls; what is farther from all centres is none


class Pairs:
    """A source of pairs that are given."""

    name, cameras = "pairs", ("left", "right")

    def __init__(self, pairs, n_frames=0, rate=60.0):
        self._pairs, self.rate = pairs, rate
        self.n_frames = len(pairs) if n_frames == 0 else n_frames

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def __iter__(self):
        return iter(self._pairs)


@pytest.fixture(scope="module")
def arm():
    return simulated_rig("arm", n_frames=60, seed=1)


@pytest.fixture(scope="module")
def pairs(arm):
    return list(arm)


def off(cloud, scene, frames):
    """Distance of each point from the nearest ball."""
    return np.concatenate(
        [
            np.linalg.norm(points[:, np.newaxis] - scene.points[frame], axis=2).min(axis=1)
            for frame, points in zip(frames, cloud, strict=True)
        ]
    )


def test_points_are_the_balls_that_both_cameras_see(arm):
    cloud = markers_of(arm.settings, arm)
    distances = off(cloud, arm.scene, range(60))
    assert (distances > BALL).mean() < 0.002
    assert np.median(distances) < 0.05
    truths = [arm.render(frame)[1] for frame in range(0, 60, 10)]
    seen = sum(int(((truth.left.visible > 0.5) & (truth.right.visible > 0.5)).sum()) for truth in truths)
    assert sum(len(cloud.frame(frame)) for frame in range(0, 60, 10)) >= 0.97 * seen
    assert cloud.times == pytest.approx(np.arange(60) / 60)
    assert "fit only by chance and are left out" in cloud.notices[0]


def test_a_camera_that_was_touched_after_the_calibration_does_hardly_any_harm(arm, pairs):
    right, turn = arm.rig.right, np.eye(4)
    turn[:3, :3] = matrix_from_vector(np.array([0.3 / right.matrix[1, 1], 0.0, 0.0]))  # 0.3 px
    rig = replace(arm.rig, right=replace(right, camera_from_world=turn @ right.camera_from_world))
    cloud = markers_of(replace(arm.settings, rig=rig), Pairs(pairs))
    assert (off(cloud, arm.scene, range(60)) > BALL).mean() < 0.005


def test_points_are_less_certain_the_farther_and_the_worse_their_balls_fit(arm, pairs):
    cloud = markers_of(arm.settings, Pairs(pairs))
    depth, std = cloud.points[:, 2], cloud.attributes["std"]
    assert std[depth > np.quantile(depth, 0.9)].mean() > 1.1 * std[depth < np.quantile(depth, 0.1)].mean()
    distances, misfit = off(cloud, arm.scene, range(60)), cloud.attributes["reprojection_error"]
    assert distances[misfit > np.quantile(misfit, 0.98)].mean() > 3 * distances.mean()


def test_misfits_are_as_large_in_space_as_far_away_they_are(arm):
    camera = arm.rig.left
    focal = camera.matrix[0, 0]
    found = misfit_in_space(np.array([[0, 0, 1000.0], [50, 80, 2000.0]]), np.array([0.1, 0.1]), camera)
    assert found == pytest.approx([100 / focal, 200 / focal])


def test_lost_pairs_leave_their_time_empty(arm, pairs):
    kept = [*pairs[:20], replace(pairs[30], dropped=10), *pairs[31:]]
    cloud = markers_of(arm.settings, Pairs(kept))
    assert cloud.n_frames == 50
    assert np.diff(cloud.times)[19] == pytest.approx(11 / 60)
    assert "10 pairs of images were lost (16.7 %); their time stays empty" in cloud.notices


def test_a_frame_without_balls_is_an_empty_frame_and_told(arm, pairs):
    dark = np.full((480, 640), 8, np.uint8)
    cloud = markers_of(arm.settings, Pairs([*pairs[:10], FrameSet((dark, dark), pairs[10].time, 10), *pairs[11:20]]))
    assert cloud.points_per_frame[10] == 0 and (np.delete(cloud.points_per_frame, 10) > 0).all()
    assert any(note.startswith("left image of 1 of 20 pairs, first of number 10: ") for note in cloud.notices)


def test_images_of_unknown_rate_are_told(arm, pairs):
    cloud = markers_of(arm.settings, Pairs(pairs[:5], rate=None))
    assert any("?rate=60" in note for note in cloud.notices)


def black(pairs):
    dark = np.zeros((480, 640), np.uint8)
    return [FrameSet((dark, dark), pair.time, pair.index) for pair in pairs]


def swapped(pairs):
    return [FrameSet((pair.right, pair.left), pair.time, pair.index) for pair in pairs]


def mirrored(pairs):
    return [replace(pair, images=(pair.left, pair.right[::-1])) for pair in pairs]


def smaller(pairs):
    return [replace(pair, images=(pair.left, pair.right[:, :600])) for pair in pairs]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (black, r"take: no ball is seen in both images of any pair; left image of 60 of 60 pairs, .*lens caps"),
        (swapped, "take: .* the cameras are swapped"),
        (mirrored, "take: .* the settings are of another rig"),
        (smaller, "the right camera sends 600 x 480 pixels, and its calibration is for 640 x 480"),
        (lambda pairs: [], "take: there is no pair of images"),
    ],
)
def test_recordings_of_which_nothing_can_come_are_refused_with_the_reason(arm, pairs, change, sentence):
    with pytest.raises(InputError, match=sentence):
        markers_of(arm.settings, Pairs(change(pairs), n_frames=60), name="take")


def test_a_source_without_end_needs_a_number_of_frames(arm, pairs):
    endless = Pairs(pairs, n_frames=None)
    with pytest.raises(InputError, match=r"without end; .* --frames"):
        markers_of(arm.settings, endless)
    assert markers_of(arm.settings, endless, n_frames=7).n_frames == 7


def test_reading_is_told_and_can_be_cancelled(arm):
    class Impatient(SilentMonitor):
        done = -1

        def advance(self, done, total):
            self.done = done, total
            if done:
                raise Cancelled("enough")

    monitor = Impatient()
    with pytest.raises(Cancelled):
        markers_of(arm.settings, arm, monitor=monitor)
    assert monitor.done == (50, 60)
