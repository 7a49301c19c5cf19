"""Bodies that bend everywhere have no rigid limbs, and that is said."""

from __future__ import annotations

import numpy as np

from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.limbs import find_limbs

SENTENCE = "there may be no rigid limbs"


def arm_without_joints(n_markers=14, n_frames=500):
    """Markers around an arm of 500 mm whose curvature is two waves that travel along it, in two planes."""
    times, along = np.arange(n_frames)[:, np.newaxis] / 100, np.linspace(0, 1, 200)
    heading, rising = (
        np.cumsum(2.5 * np.sin(2 * np.pi * (rate * times - waves * along)), axis=1) / 200
        for rate, waves in ((0.31, 0.6), (0.23, 0.4))
    )
    turned = np.cos(heading), np.sin(heading), np.cos(rising), np.sin(rising)
    middle = np.cumsum(np.stack([turned[0] * turned[2], turned[1] * turned[2], turned[3]], axis=2), axis=1) * 2.5
    up = np.stack([-turned[0] * turned[3], -turned[1] * turned[3], turned[2]], axis=2)
    beside = np.stack([turned[1], -turned[0], 0 * turned[0]], axis=2)
    places, angles = np.arange(7, 200, 200 // n_markers)[:n_markers], 2.4 * np.arange(n_markers)[:, np.newaxis]
    points = middle[:, places] + 20 * (np.cos(angles) * up[:, places] + np.sin(angles) * beside[:, places])
    points += np.random.default_rng(0).normal(0, 0.4, points.shape)
    return Trajectories(points, tuple(f"M{number}" for number in range(n_markers)), 100.0)


def test_an_arm_that_bends_everywhere_has_no_limbs_for_sure(notices):
    limbs = find_limbs(arm_without_joints(), monitor=notices)
    assert SENTENCE in " ".join(notices.sentences)
    assert np.nanmax(limbs.probability) < 0.95


def test_rigid_limbs_stand_out(notices):
    find_limbs(simulate("classic-human", n_frames=500, noise=0.5).take, monitor=notices)
    assert SENTENCE not in " ".join(notices.sentences)
