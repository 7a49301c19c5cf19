"""A person in a room to a skeleton: ``python tests/benchmarks/room_pipeline.py [frames] [seeds] [cameras ...]``.

Balls of all images, hidden by the body and merged where they are near each other, become points, and the stages make
labels, limbs and a tree of them. Each figure is against the truth. Before that, images of eight cameras to joint
angles: what one moment takes; and to points, with balls that hide and touch each other in the images.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shown import show, show_machine
from unrendered import blobs_of

from skelgen.app.pipeline import run_stages
from skelgen.capture.detection import BallFinder
from skelgen.capture.room.live import RoomCapture
from skelgen.capture.room.recording import RoomRecording
from skelgen.capture.room.simulated import RoomScene, person_scene, room_arm, room_rig
from skelgen.capture.room.sources import SimulatedRoom
from skelgen.capture.room.tracks import RoomTracker
from skelgen.capture.simulated_rig.scene import joints_of, targets_of
from skelgen.evaluation import evaluate
from skelgen.model import PointCloud, Project
from skelgen.model.rig import RoomSettings
from skelgen.simulation import Truth

N_FRAMES, SEEDS, CAMERAS = 1000, 2, (4, 8)
DEVIATIONS, LEAST = 5.0, 5.0  # of a point, and mm: a point farther from all markers is none
LIVE_FRAMES = 30
SIZES = ((640, 480), (1280, 1024))  # px
IMAGE_FRAMES = 40


def truth_of(cloud: PointCloud, scene: RoomScene) -> Truth:
    """The scene's truth with the marker of each point."""
    assert scene.truth is not None
    markers, std, starts = [], cloud.attributes["std"], cloud.frame_starts
    for frame, points in enumerate(cloud):
        gaps = np.linalg.norm(points[:, np.newaxis] - scene.positions[frame], axis=2)
        is_marker = gaps.min(axis=1) <= DEVIATIONS * std[starts[frame] : starts[frame + 1]] + LEAST
        markers.append(np.where(is_marker, gaps.argmin(axis=1), -1))
    return replace(scene.truth, marker_of_point=np.concatenate(markers))


def row(n_cameras: int, n_frames: int, seed: int) -> tuple[str, ...]:
    """Figures of one take."""
    rig = room_rig(n_cameras)
    scene, rng = person_scene(rig, n_frames, seed=seed), np.random.default_rng(seed)
    recording = RoomRecording(rig)
    for frame in range(n_frames):
        recording.add(blobs_of(scene, frame, rig, rng)[0], frame / scene.rate)
    cloud = recording.cloud("room", scene.rate)
    truth = truth_of(cloud, scene)
    begin = time.process_time()
    scores = evaluate(run_stages(Project(cloud, seed)), truth)
    seconds = time.process_time() - begin
    assert scores.labels is not None
    assert scores.limbs is not None
    assert scores.topology is not None
    return (
        *(str(n_cameras), str(seed), f"{cloud.n_points / n_frames:.1f}", f"{scores.labels.idf1:.4f}"),
        *(f"{scores.labels.n_markers_found} of {scene.positions.shape[1]}",),
        *(f"{scores.limbs.n_limbs_found} of {scores.limbs.n_limbs_true}", "yes" if scores.topology.is_exact else "no"),
        f"{seconds:.0f}",
    )


def points(size: tuple[int, int], seed: int) -> tuple[str, ...]:
    """Markers of a person found in rendered images."""
    rig = room_rig(8, size)
    scene = person_scene(rig, IMAGE_FRAMES, seed=seed)
    finder, tracker, found = BallFinder(RoomSettings(rig), None), RoomTracker(rig), []
    for frame in SimulatedRoom(scene, rig, seed):
        found.append(tracker.see(finder.find(frame), frame.time))
    n_seen = n_found = n_wrong = n_points = 0
    off = []
    for frame, (places, tracks) in enumerate(found):
        kept = tracker.tracks.are_markers(tracks)
        std = np.sqrt(np.linalg.eigvalsh(places.covariance[kept])[:, -1])
        gaps = np.linalg.norm(places.points[kept][:, np.newaxis] - scene.positions[frame], axis=2)
        is_right = gaps.min(axis=1) <= DEVIATIONS * std + 1.0
        seen = np.flatnonzero((~scene.hidden[frame]).sum(axis=0) >= 2)
        n_seen, n_found = n_seen + len(seen), n_found + int(np.isin(seen, gaps.argmin(axis=1)[is_right]).sum())
        n_points, n_wrong = n_points + len(std), n_wrong + int((~is_right).sum())
        off.append(gaps.min(axis=1)[is_right])
    rms = np.sqrt((np.concatenate(off) ** 2).mean())
    shares = f"{100 * n_found / n_seen:.2f}", f"{100 * n_wrong / n_points:.3f}"
    return f"{size[0]} x {size[1]}", str(seed), f"{n_seen / IMAGE_FRAMES:.1f}", *shares, f"{rms:.3f}"


def live(size: tuple[int, int]) -> tuple[str, ...]:
    """Median time [ms] of one moment, with its images already there."""
    rig, arm = room_rig(8, size), room_arm()
    scene = person_scene(rig, LIVE_FRAMES, arm, walk=0.0)
    settings = RoomSettings(rig, targets_of(arm), joints_of(arm))
    frames = list(SimulatedRoom(scene, rig))
    with RoomCapture(settings) as capture:
        taken = [capture.see(frame) for frame in frames]
        begin = time.process_time()
        for frame in frames:
            capture.see(frame)
        spent = (time.process_time() - begin) / len(frames)
    latency = np.array([captured.latency for captured in taken[10:]])
    n_angles = np.mean([len(captured.angles) for captured in taken])
    times = (np.median(latency), np.quantile(latency, 0.99), spent)
    return f"{size[0]} x {size[1]}", f"{n_angles:.2f}", *(f"{1000 * seconds:.1f}" for seconds in times)


def main(n_frames: int, seeds: int, cameras: Sequence[int]) -> None:
    """Print both tables."""
    show_machine()
    columns: tuple[str, ...] = ("images", "joints found", "median", "99 % below", "processor time")
    show("Images of 8 cameras to joint angles [ms]", columns, [live(size) for size in SIZES])
    columns = ("images", "seed", "not hidden from two", "found [%]", "wrong [%]", "rms [mm]")
    show(f"Images of 8 cameras to points, {IMAGE_FRAMES} frames", columns, [points(size, 0) for size in SIZES])
    rows = [row(n_cameras, n_frames, seed) for n_cameras in cameras for seed in range(seeds)]
    columns = ("cameras", "seed", "points a frame", "IDF1", "markers", "limbs", "tree", "stages [s]")
    show(f"A person of 45 markers, {n_frames} frames", columns, rows)


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    main(*(numbers[:2] if len(numbers) > 1 else (N_FRAMES, SEEDS)), numbers[2:] or CAMERAS)
