"""Markers of which one camera loses sight stay where they are, and are left out where no_pair knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.markers import markers_of
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig

LOST = slice(40, 70)


def hidden_from(source, side, balls, frames=LOST):
    """The same recording, of which one camera does not see some balls for a while."""
    hidden = source.scene.hidden.copy()
    hidden[frames, side, balls] = True
    return SimulatedRig(replace(source.scene, hidden=hidden), source.rig, source.parameters, seed=1)


def of_one_camera(cloud, scene):
    """Frames of points of one camera, and their distances from the nearest ball [mm]."""
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    chosen = np.flatnonzero(cloud.attributes["n_blobs"] == 1)
    gaps = np.linalg.norm(cloud.points[chosen, np.newaxis] - scene.points[frames[chosen]], axis=2)
    return frames[chosen], gaps.min(axis=1)


@pytest.fixture(scope="module")
def arm():
    return simulated_rig("arm", n_frames=110, seed=1, hide=False)


@pytest.mark.parametrize("side", [0, 1])
def test_a_ball_that_one_camera_loses_is_placed_by_what_is_rigid_with_it(arm, side):
    cloud = markers_of(arm.settings, hidden_from(arm, side, 0))
    frames, off = of_one_camera(cloud, arm.scene)
    there = (frames >= LOST.start) & (frames < LOST.stop)
    assert there.sum() >= 0.9 * (LOST.stop - LOST.start)
    assert np.median(off) < 0.2 and off.max() < 2.0  # mm: as points of two cameras, whose depth errs by 0.1 mm
    assert any("seen by one camera only" in note for note in cloud.notices)


def test_deviations_say_how_far_depths_are_off(arm):
    cloud = markers_of(arm.settings, hidden_from(arm, 1, [0, 5]))
    _, off = of_one_camera(cloud, arm.scene)
    std = cloud.attributes["std"][cloud.attributes["n_blobs"] == 1]
    assert (off < 3 * std).mean() > 0.95


def test_without_rigid_mates_no_depth_is_made_up(arm):
    points = np.full_like(arm.scene.points, np.nan)
    points[:, 0] = arm.scene.points[:, 0]
    alone = SimulatedRig(replace(arm.scene, points=points), arm.rig, arm.parameters, seed=1)
    cloud = markers_of(arm.settings, hidden_from(alone, 1, 0))
    assert (cloud.attributes["n_blobs"] == 2).all()


def test_a_ball_that_both_cameras_lose_is_nowhere(arm):
    source = hidden_from(hidden_from(arm, 0, 0), 1, 0)
    cloud = markers_of(arm.settings, source)
    ball = source.scene.points[LOST, 0]
    gaps = [np.linalg.norm(cloud.frame(frame) - place, axis=1).min() for frame, place in enumerate(ball, LOST.start)]
    assert min(gaps) > 5.0
