"""Images to a skeleton on the simulated rig: ``python tests/benchmarks/capture_pipeline.py [seeds] [structure ...]``.

First the pairs of balls: how many fit by chance, and how many of those are left when the tracks have decided; with the
cameras as they are, and with one turned by 0.3 px, three times the noise that the settings say. Then what one command
makes of the images: points, markers, limbs, joints.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from shown import peak_gigabytes, show, show_machine

from skelgen.app.pipeline import run_stages
from skelgen.capture.bodies import resolved_points
from skelgen.capture.live import PointFinder
from skelgen.capture.markers import markers_of
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.evaluation import Evaluation, evaluate
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import PointCloud, Project
from skelgen.model.arrays import Floats
from skelgen.model.rig import CaptureSettings
from skelgen.simulation.truth import Truth

SEEN_THROUGH = ", nothing hidden"
STRUCTURES = ("arm", "rods", "tree:4", "human", "human" + SEEN_THROUGH)
N_FRAMES = 600
BENT = 0.3  # px
DEVIATIONS, LEAST = 5.0, 5.0  # of a point, and mm: a point farther from all balls is none
LEAST_SEEN = 0.02  # of all frames: balls that fewer show are not asked for


@dataclass(frozen=True, eq=False)
class Reading:
    """Markers of a recording; wrong points and all, on the way to them; processor time without rendering [s]."""

    cloud: PointCloud
    before: tuple[int, int]
    by_line: tuple[int, int]
    seconds: float


def bent(settings: CaptureSettings, pixels: float) -> CaptureSettings:
    """Settings of a rig whose right camera was turned upwards after its calibration."""
    right, turn = settings.rig.right, np.eye(4)
    turn[:3, :3] = matrix_from_vector(np.array([pixels / right.matrix[1, 1], 0.0, 0.0]))
    right = replace(right, camera_from_world=turn @ right.camera_from_world)
    return replace(settings, rig=replace(settings.rig, right=right))


def distances(points: Floats, balls: Floats) -> Floats:
    """Distance [mm] of each point from the nearest ball."""
    there = balls[~np.isnan(balls[:, 0])]
    return np.linalg.norm(points[:, np.newaxis] - there, axis=2).min(axis=1)


def wrong(points: Floats, std: Floats, balls: Floats) -> int:
    """Points that are no ball."""
    return int((distances(points, balls) > DEVIATIONS * std + LEAST).sum())


def read(source: SimulatedRig, settings: CaptureSettings) -> Reading:
    """Markers, and beside them what single pairs of images tell."""
    finder, counts = PointFinder(settings), np.zeros((2, 2), dtype=int)
    for index, pair in enumerate(source):
        _, _, points = finder.find(pair)
        std = np.sqrt(np.linalg.eigvalsh(points.covariance)[:, -1]) if len(points) else np.empty(0)
        kept = resolved_points(points, [])
        for row, chosen in enumerate((np.arange(len(points)), kept)):
            counts[row] += wrong(points.points[chosen], std[chosen], source.scene.points[index]), len(chosen)
    begin = time.process_time()
    for _ in source:
        pass
    rendered = time.process_time()
    cloud = markers_of(settings, source)
    seconds = time.process_time() - rendered - (rendered - begin)
    return Reading(cloud, tuple(counts[0]), tuple(counts[1]), seconds)


def wrong_in(cloud: PointCloud, source: SimulatedRig) -> int:
    """Points of a cloud that are no ball."""
    starts, std = cloud.frame_starts, cloud.attributes["std"]
    return sum(
        wrong(points, std[starts[frame] : starts[frame + 1]], source.scene.points[frame])
        for frame, points in enumerate(cloud)
    )


def share(part: int, whole: int) -> str:
    """A part in per cent."""
    return f"{100 * part / whole:.2f}"


def truth_of(cloud: PointCloud, source: SimulatedRig) -> Truth:
    """The scene's truth with the marker of each point."""
    markers, std, starts = [], cloud.attributes["std"], cloud.frame_starts
    for frame, points in enumerate(cloud):
        gaps = np.linalg.norm(points[:, np.newaxis] - source.scene.points[frame], axis=2)
        gaps = np.where(np.isnan(gaps), np.inf, gaps)
        is_ball = gaps.min(axis=1) <= DEVIATIONS * std[starts[frame] : starts[frame + 1]] + LEAST
        markers.append(np.where(is_ball, gaps.argmin(axis=1), -1))
    assert source.scene.truth is not None
    return replace(source.scene.truth, marker_of_point=np.concatenate(markers))


def errors_of(cloud: PointCloud, source: SimulatedRig) -> Floats:
    """Distances [mm] of points from the balls that they are."""
    found = np.concatenate([distances(points, source.scene.points[frame]) for frame, points in enumerate(cloud)])
    return found[found <= DEVIATIONS * cloud.attributes["std"] + LEAST]


def joints_of(scores: Evaluation) -> tuple[str, str]:
    """Mean error of the joints [mm], and its bound."""
    found = [score.mean for score in scores.joints if score.mean is not None]
    bounds = [score.bound for score in scores.joints if score.bound is not None]
    return (f"{np.mean(found):.2f}" if found else "", f"{np.mean(bounds):.2f}" if bounds else "")


def result(structure: str, seed: int, source: SimulatedRig, reading: Reading) -> tuple[str, ...]:
    """A row of what the stages make of the markers."""
    begin, cloud = time.process_time(), reading.cloud
    truth = truth_of(cloud, source)
    project = run_stages(Project(cloud, seed))
    seconds = time.process_time() - begin
    scores = evaluate(project, truth)
    assert scores.labels is not None and scores.limbs is not None and scores.topology is not None
    seen = np.bincount(truth.marker_of_point[truth.marker_of_point >= 0], minlength=truth.n_markers)
    to_find = int((seen >= LEAST_SEEN * cloud.n_frames).sum())
    off = errors_of(cloud, source)
    return (
        *(structure, str(seed), f"{np.sqrt((off**2).mean()):.2f}", f"{np.quantile(off, 0.99):.2f}"),
        *(f"{scores.labels.n_markers_found} of {to_find}", f"{scores.labels.idf1:.4f}"),
        *(f"{scores.limbs.n_limbs_found} of {scores.limbs.n_limbs_true}", "yes" if scores.topology.is_exact else "no"),
        *joints_of(scores),
        *(f"{1000 * reading.seconds / cloud.n_frames:.1f}", f"{seconds:.1f}"),
    )


def main(seeds: int, structures: Sequence[str]) -> None:
    """Print both tables."""
    show_machine()
    pairs, results = [], []
    for structure in structures:
        for seed in range(seeds):
            name, hides = structure.removesuffix(SEEN_THROUGH), not structure.endswith(SEEN_THROUGH)
            source = simulated_rig(name, n_frames=N_FRAMES, seed=seed, hide=hides)
            for pixels in (0.0, BENT):
                reading = read(source, bent(source.settings, pixels) if pixels else source.settings)
                after = wrong_in(reading.cloud, source), reading.cloud.n_points
                figures = (share(*reading.before), share(*reading.by_line), share(*after))
                pairs.append((structure, str(seed), f"{pixels:g}", f"{reading.before[1] / N_FRAMES:.1f}", *figures))
                if not pixels:
                    results.append(result(structure, seed, source, reading))
    wrong_by = ("all pairs", "nearest to the line", "by tracks")
    columns = ("structure", "seed", "turned [px]", "pairs a frame", *[f"{way}, wrong [%]" for way in wrong_by])
    show(f"Pairs of balls that fit, {N_FRAMES} frames", columns, pairs)
    columns = ("structure", "seed", "points, rms [mm]", "99 % below", "markers", "IDF1", "limbs", "tree")
    columns += ("joints [mm]", "bound", "ms a pair of images", "stages [s]")
    show("From images to a skeleton, processor time", columns, results)
    print(f"peak of all of it: {peak_gigabytes():.2f} GB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3, sys.argv[2:] or STRUCTURES)
