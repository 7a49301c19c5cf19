"""Candidates of recordings whose truth is known, without rendering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.ball_tracks import BallTracks
from skelgen.capture.markers.candidates import CandidateStore
from skelgen.capture.markers.correspondences import track_pairs
from skelgen.capture.optics import match_and_triangulate
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig.scene import scene_of_structure
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.rig import CaptureSettings
from tests.benchmarks.unrendered import projected_balls


class Projected:
    """Balls of a structure, 0.1 px off, seen by a rig that was turned by `turned` px after its calibration."""

    def __init__(self, structure, seed, n_frames, rate, turned=0.0):
        rig = reference_rig()
        self.scene = scene_of_structure(structure, rig, seed=seed, n_frames=n_frames, rate=rate)
        turn = np.eye(4)
        turn[:3, :3] = matrix_from_vector(np.array([turned / rig.right.matrix[1, 1], 0.0, 0.0]))
        right = replace(rig.right, camera_from_world=turn @ rig.right.camera_from_world)
        self.settings = CaptureSettings(replace(rig, right=right), self.scene.bodies, self.scene.joints)
        self.step, rng = 1 / rate, np.random.default_rng(seed)
        store, followers, is_right, share_a_ball = (
            CandidateStore(),
            (BallTracks((640, 480)), BallTracks((640, 480))),
            [],
            [],
        )
        for frame in range(n_frames):
            (left, of_left), (right_balls, of_right) = projected_balls(self.scene, frame, rig, 0.1, rng)
            points = match_and_triangulate(left, right_balls, self.settings.rig)
            tracks = [
                follower.follow(balls.centres, frame / rate)
                for follower, balls in zip(followers, (left, right_balls), strict=True)
            ]
            store.add(points, *tracks)
            is_right.append(of_left[points.left] == of_right[points.right])
            share_a_ball.append(points.ambiguous)
        self.candidates = store.all()
        self.pairs = track_pairs(self.candidates, *((follower.first, follower.last) for follower in followers))
        self.is_right, self.is_shared = np.concatenate(is_right), np.concatenate(share_a_ball)

    def wrong_part(self, kept):
        """Part of the ambiguous candidates that are judged wrongly."""
        return float((kept != self.is_right)[self.is_shared].mean())


@pytest.fixture(scope="session")
def projected():
    return Projected
