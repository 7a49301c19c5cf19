"""Pairs of balls that exclude each other, and what decides: ``python tests/benchmarks/capture_ambiguous.py [seeds]``.

Balls of simulated structures are projected with 0.1 px of noise; pairs that fit and share a ball with another one are
counted against the truth. They are decided by time alone, with the rigid distances that are learned on the way, and
with the targets of the settings; with the cameras as they are, and with one turned by 0.3 px after its calibration.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from capture_pipeline import bent
from shown import show, show_machine
from unrendered import projected_balls

from skelgen.capture.ball_tracks import BallTracks
from skelgen.capture.markers.candidates import CandidateStore
from skelgen.capture.markers.correspondences import accept_best_first, evidence_over_time, find_markers, track_pairs
from skelgen.capture.optics import match_and_triangulate
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig.scene import scene_of_structure
from skelgen.model.arrays import Bools
from skelgen.model.rig import CaptureSettings

NOISE = 0.1  # px
WAYS = ("time alone", "learned distances", "and targets")


def decided(structure: str, seed: int, rate: float, turned: float) -> tuple[int, list[int], float]:
    """Ambiguous pairs of ten seconds, how many each way judges wrongly, and processor time of the last [s]."""
    rig, n_frames = reference_rig(), int(10 * rate)
    scene = scene_of_structure(structure, rig, seed=seed, n_frames=n_frames, rate=rate)
    settings = bent(CaptureSettings(rig, scene.bodies, scene.joints), turned)
    store, followers = CandidateStore(), (BallTracks(rig.left.size), BallTracks(rig.right.size))
    is_right, share_a_ball, rng = [], [], np.random.default_rng(seed)
    for frame in range(n_frames):
        (left, of_left), (right, of_right) = projected_balls(scene, frame, rig, NOISE, rng)
        points = match_and_triangulate(left, right, settings.rig)
        centres = (left.centres, right.centres)
        store.add(points, *[one.follow(seen, frame / rate) for one, seen in zip(followers, centres, strict=True)])
        is_right.append(of_left[points.left] == of_right[points.right])
        share_a_ball.append(points.ambiguous)
    truth, shared = np.concatenate(is_right), np.concatenate(share_a_ball)

    def wrong(kept: Bools) -> int:
        return int((kept != truth)[shared].sum())

    candidates = store.all()
    pairs = track_pairs(candidates, *((one.first, one.last) for one in followers))
    by_time = accept_best_first(pairs, evidence_over_time(candidates, pairs, rig.noise))[pairs.of_candidate]
    learned = find_markers(candidates, pairs, rig.noise, 1 / rate)
    begin = time.process_time()
    known = find_markers(candidates, pairs, rig.noise, 1 / rate, settings.bodies)
    return int(shared.sum()), [wrong(kept) for kept in (by_time, learned, known)], time.process_time() - begin


def main(seeds: int) -> None:
    """Print the table."""
    show_machine()
    rows = []
    for structure in ("arm", "rods", "tree:4", "human"):
        for rate in (60.0, 10.0):
            for turned in (0.0, 0.3):
                found = [decided(structure, seed, rate, turned) for seed in range(seeds)]
                n_shared = sum(one[0] for one in found)
                shares = [f"{100 * sum(one[1][way] for one in found) / n_shared:.2f}" for way in range(len(WAYS))]
                per_frame = 1000 * np.mean([one[2] for one in found]) / (10 * rate)
                rows.append((structure, f"{rate:g}", f"{turned:g}", str(n_shared), *shares, f"{per_frame:.1f}"))
    columns = (
        "structure",
        "rate [Hz]",
        "turned [px]",
        "ambiguous",
        *[f"{way}, wrong [%]" for way in WAYS],
        "ms a frame",
    )
    show(f"Pairs of balls that share a ball with another pair, {seeds} seeds of ten seconds", columns, rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
