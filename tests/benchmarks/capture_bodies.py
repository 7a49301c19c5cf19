"""Rigid bodies among unlabelled points: ``python tests/benchmarks/capture_bodies.py [number of frames]``.

Three targets of five balls are posed at random in front of the reference rig (Gaschler 2011, Table 4.1); each ball is
hidden with 20 % chance, and stray points fill up to 40. All points err with the covariance that 0.1 px in both images
give them. Bodies of which four balls or more are seen must be found; a pose counts if it is right within 2 mm.

Then targets far away, of which four or five balls are seen: depth errs by more than targets are distinct there. Wrong
is a pose that is off by more than 2 mm or 6 degrees, and by more than seven times what it states.

Then the same from rendered images of 640 x 480 pixels through the whole capture, in which balls touch, hide each other,
and are hidden by limbs: the reference arm, and three targets that pass before each other. There a body can be found
if at least half of four of its balls is seen in both images; a pose is wrong if the middle of the balls is off by more
than 2 mm, or the body turned by more than 2 degrees.
"""

from __future__ import annotations

import sys
import time
from typing import NamedTuple

import numpy as np
from shown import show, show_machine, verdict

from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.design import propose_targets
from skelgen.capture.live import MotionCapture
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.capture.simulated_rig.scene import Wandering, scene_of_bodies, wandering_poses
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget, StereoRig

N_TARGETS, N_BALLS, N_POINTS = 3, 5, 40
HIDDEN = 0.2
FEWEST = 4
SIZE = 60.0  # mm: half the width of a target
ROOM, MIDDLE = np.array([300.0, 220.0, 350.0]), np.array([-200.0, 0.0, 1200.0])  # mm: where both cameras look
WRONG = 2.0  # mm
WRONG_TURN = 2.0  # degrees
FRAMES, WARM_UP = 3000, 20
FAR = ((2000.0, 4), (3000.0, 4), (3000.0, 5), (4000.0, 5))  # mm, and balls that are seen
FAR_FRAMES, FAR_TURN, FAR_OFF = 500, 0.1, 50.0  # frames, rad, and squared deviations of a pose
RENDERED, STEP = 300, 3  # frames of a rendered scene, of which every third is captured
PASSING = ((1000.0, 120.0), (1000.0, 60.0), (1500.0, 60.0))  # mm: distance, and how far the targets stand apart
SEEN = 0.5  # of a ball in both images
SEEDS = (0, 1, 2)


class Frame(NamedTuple):
    """One frame with its truth: pose and number of seen balls of each target."""

    points: StereoPoints
    poses: list[Floats]
    seen: list[int]


def covariances(rig: StereoRig, points: Floats) -> Floats:
    """Of triangulated points [mm^2], shape (n, 3, 3): the inverse of what both images say of them."""
    information = np.zeros((len(points), 3, 3))
    for camera in (rig.left, rig.right):
        turn, shift = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
        seen = points @ turn.T + shift
        slopes = np.zeros((len(points), 2, 3))
        for axis in range(2):
            focal = camera.matrix[axis, axis] / seen[:, 2]
            slopes[:, axis, axis] = focal
            slopes[:, axis, 2] = -focal * seen[:, axis] / seen[:, 2]
        slopes = slopes @ turn
        information += slopes.swapaxes(1, 2) @ slopes / rig.noise**2
    return np.linalg.inv(information)


def make_frame(
    rig: StereoRig,
    targets: list[BodyTarget],
    rng: np.random.Generator,
    n_points: int,
    distance: float = MIDDLE[2],
    n_seen: int | None = None,
) -> Frame:
    """Targets posed at random, with hidden balls and strays."""
    poses, places, seen = [], [], []
    middle = np.array([*MIDDLE[:2], distance])
    for target in targets:
        pose = transform_from(matrix_from_vector(rng.normal(size=3) * 2), middle + rng.uniform(-0.7, 0.7, 3) * ROOM)
        shown = rng.uniform(size=len(target.points)) >= HIDDEN
        if n_seen is not None:
            shown = rng.permutation(len(target.points)) < n_seen
        poses.append(pose)
        places.append((target.points @ pose[:3, :3].T + pose[:3, 3])[shown])
        seen.append(int(shown.sum()))
    strays = n_points - sum(seen)
    places.append(middle + rng.uniform(-1, 1, (strays, 3)) * ROOM)
    points = rng.permutation(np.concatenate(places))
    covariance = covariances(rig, points)
    points = points + (np.linalg.cholesky(covariance) @ rng.normal(size=(len(points), 3, 1)))[..., 0]
    numbers = np.arange(n_points)
    found = StereoPoints(points, covariance, numbers, numbers, np.zeros(n_points), np.zeros(n_points, bool))
    return Frame(found, poses, seen)


def measure(n_targets: int, n_points: int, n_frames: int) -> tuple[int, int, int, Floats]:
    """Poses found, poses that can be found, wrong ones, and milliseconds of every frame, over `SEEDS`."""
    rig, found, possible, wrong = reference_rig(), 0, 0, 0
    times: list[float] = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        wished = [BodyTarget(f"body{i}", rng.uniform(-SIZE, SIZE, (N_BALLS, 3))) for i in range(n_targets)]
        finder = BodyFinder(targets := propose_targets(wished, seed=seed))
        for number in range(n_frames // len(SEEDS)):
            frame = make_frame(rig, targets, rng, n_points)
            start = time.process_time()
            bodies = {body.name: body for body in finder.find(frame.points)}
            if number >= WARM_UP:
                times.append(1e3 * (time.process_time() - start))
            for target, pose, seen in zip(targets, frame.poses, frame.seen, strict=True):
                body = bodies.get(target.name)
                error = np.inf if body is None else np.linalg.norm(body.world_from_body[:3, 3] - pose[:3, 3])
                possible += seen >= FEWEST
                found += bool(seen >= FEWEST and error <= WRONG)
                wrong += bool(body is not None and error > WRONG)
    return found, possible, wrong, np.array(times)


def rows(n_frames: int) -> list[tuple[str, ...]]:
    """The target of the issue, and what lies beyond."""
    table = []
    for n_targets, n_points in ((N_TARGETS, N_POINTS), (1, 50), (3, 100)):
        found, possible, wrong, times = measure(n_targets, n_points, n_frames)
        share, median = found / possible, float(np.median(times))
        table.append(
            (
                f"{n_targets} x {N_BALLS} balls, {n_points} points",
                f"{100 * share:.2f} % of {possible}",
                str(wrong),
                f"{median:.2f} ms",
                f"{np.percentile(times, 99):.2f} ms",
                verdict(share >= 0.995 and wrong == 0 and (median <= 1.0 or n_points > N_POINTS)),
            )
        )
    return table


def far_row(distance: float, n_seen: int) -> tuple[str, ...]:
    """Found and wrong poses of targets far away, some of whose balls are hidden."""
    rig, found, wrong, n = reference_rig(), 0, 0, 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        wished = [BodyTarget(f"body{i}", rng.uniform(-SIZE, SIZE, (N_BALLS, 3))) for i in range(N_TARGETS)]
        finder = BodyFinder(targets := propose_targets(wished, seed=seed))
        for _ in range(FAR_FRAMES // len(SEEDS)):
            frame = make_frame(rig, targets, rng, N_POINTS, distance, n_seen)
            bodies = {body.name: body for body in finder.find(frame.points)}
            n += len(targets)
            for target, pose in zip(targets, frame.poses, strict=True):
                if target.name in bodies:
                    is_wrong = far_off(bodies[target.name], pose)
                    wrong, found = wrong + is_wrong, found + (not is_wrong)
    return f"{n_seen} of {N_BALLS} balls, {distance / 1000:g} m", f"{100 * found / n:.1f} % of {n}", str(wrong)


def far_off(body: FoundBody, pose: Floats) -> bool:
    """Whether a pose is off by more than it may be and by more than it states."""
    turn = vector_from_matrix(body.world_from_body[:3, :3] @ pose[:3, :3].T)
    step = np.concatenate([turn, body.world_from_body[:3, 3] - pose[:3, 3]])
    is_beyond = step @ np.linalg.solve(body.covariance, step) > FAR_OFF
    return bool(is_beyond and (np.linalg.norm(step[3:]) > WRONG or np.linalg.norm(turn) > FAR_TURN))


def scenes() -> list[tuple[str, SimulatedRig]]:
    """What is rendered."""
    rig, rng = reference_rig(), np.random.default_rng(0)
    listed = [(f"the reference arm, seed {seed}", simulated_rig("arm", n_frames=RENDERED, seed=seed)) for seed in SEEDS]
    wished = [BodyTarget(f"body{i}", rng.uniform(-50, 50, (N_BALLS, 3))) for i in range(N_TARGETS)]
    targets = propose_targets(wished)
    for distance, apart in PASSING:
        poses = wandering_poses(rig, RENDERED, N_TARGETS, Wandering(distance, apart), seed=1)
        name = f"3 targets {apart:.0f} mm apart, {distance / 1000:g} m away"
        listed.append((name, SimulatedRig(scene_of_bodies(targets, poses), rig)))
    return listed


def rendered_row(name: str, source: SimulatedRig) -> tuple[str, ...]:
    """Poses from images: found, possible, wrong, and how far off they are."""
    found, possible, wrong, off = 0, 0, 0, []
    with MotionCapture(source.settings, threads=False) as capture:
        for index in range(0, source.scene.n_frames, STEP):
            pair, truth = source.render(index)
            bodies = capture.see(pair).bodies
            visible = np.minimum(truth.left.visible, truth.right.visible)
            for number, target in enumerate(source.settings.bodies):
                can_be = (visible[source.scene.body_of_ball == number] >= SEEN).sum() >= FEWEST
                possible += can_be
                if target.name in bodies:
                    pose, true = bodies[target.name].world_from_body, source.scene.world_from_body[index, number]
                    middle = np.append(target.points.mean(axis=0), 1.0)
                    off.append(np.linalg.norm((pose - true) @ middle))
                    turn = np.degrees(np.linalg.norm(vector_from_matrix(pose[:3, :3] @ true[:3, :3].T)))
                    wrong += bool(off[-1] > WRONG or turn > WRONG_TURN)
                    found += can_be
    share = f"{100 * found / possible:.1f} % of {possible}"
    median, most = np.median(off), max(off)
    return name, share, f"{wrong} of {len(off)}", f"{median:.3f} mm", f"{most:.2f} mm", verdict(wrong == 0)


if __name__ == "__main__":
    show_machine()
    n_frames = int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES
    columns = ("case", "found (wanted 99.5 %)", "wrong (wanted 0)", "median (wanted 1 ms)", "99 %", "verdict")
    show("rigid bodies, 20 % of the balls hidden", columns, rows(n_frames))
    columns = ("seen", "found", "wrong")
    show(f"far away, among {N_POINTS} points", columns, [far_row(*one) for one in FAR])
    columns = ("scene", "found of those seen", "wrong (wanted 0)", "median error", "largest", "verdict")
    show("rendered images, balls that touch and hide each other", columns, [rendered_row(*scene) for scene in scenes()])
