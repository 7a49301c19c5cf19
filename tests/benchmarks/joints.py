"""How often the type of a joint is right, and whether stated deviations hold: ``python tests/benchmarks/joints.py``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from shown import show, show_machine, verdict

from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import choose_joint_type, find_hierarchy, fit_joint, pose_covariance
from skelgen.model import Limbs, Poses
from skelgen.simulation import Truth, simulate
from skelgen.stages.joints import find_joints
from skelgen.stages.skeleton import fit_skeleton

STRUCTURES = ("human", "tree:8", "tree:12", "quadruped")
SEEDS = (10, 11, 12)
FAULTS = ((0.3, 0.0), (1.0, 0.0), (0.3, 1.5), (1.0, 3.0))  # noise and soft tissue [mm]
WANTED_RIGHT = 0.95

N_TAKES = 200
POINTS = np.array([[50.0, 0, 40], [-50, 20, -40], [0, -60, 10], [0, 40, -10]])  # mm, on each limb, centred
AT = np.array([[30.0, -20, 150], [-20, 10, -170]])  # mm: the joint in both limbs
AXES = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
WANTED_RMS = 5.0  # mm, of a free ball joint
COVERAGE = (0.90, 0.98)  # wanted of 95 % intervals

SENSORS = ((0.0, 0.0), (2.0, 0.01), (4.0, 0.02))  # errors of position [mm] and rotation [rad]


def main() -> None:
    """Print all tables."""
    show_machine()
    show_kinds()
    show_joints()
    show_little_motion()
    show_sensors()


def show_kinds() -> None:
    """Kinds in the whole pipeline, with labels and limbs given."""
    rows = []
    everything: Counter[tuple[str, str]] = Counter()
    for name in STRUCTURES:
        for noise, tissue in FAULTS:
            found = Counter(pair for seed in SEEDS for pair in kinds_of_take(name, seed, noise, tissue))
            everything.update(found)
            rows.append((name, f"{noise:g}", f"{tissue:g}", *right_of(found)))
    rows.append(("all", "", "", *right_of(everything)))
    columns = ("structure", "noise [mm]", "soft tissue [mm]", "right", "taken for another kind", "")
    show(f"Kinds of joints, labels and limbs given, 1000 frames, seeds {SEEDS}; wanted >= 95 %", columns, rows)


def kinds_of_take(name: str, seed: int, noise: float, tissue: float) -> Iterator[tuple[str, str]]:
    """True and found kind of every joint of the true tree."""
    case = simulate(name, seed=seed, n_frames=1000, noise=noise, soft_tissue=tissue)
    of_marker = case.truth.limb_of_marker
    limbs = Limbs(of_marker, np.zeros((len(of_marker), len(of_marker))))
    skeleton, _ = fit_skeleton(case.take, limbs, find_joints(case.take, limbs))
    found = {frozenset((joint.parent, joint.child)): joint.kind for joint in skeleton.joints}
    for edge, kind in true_kinds(case.truth).items():
        yield kind, found.get(edge, "no joint")


def true_kinds(truth: Truth) -> dict[frozenset[int], str]:
    """Kind of each joint by its two limbs."""
    return {frozenset(edge): kind for edge, kind in zip(truth.edges.tolist(), truth.joint_kinds, strict=True)}


def right_of(found: Counter[tuple[str, str]]) -> tuple[str, str, str]:
    """Cells: how many are right, which are not, and the verdict."""
    right = sum(count for (true, kind), count in found.items() if true == kind)
    wrong = ", ".join(f"{true} as {kind}: {count}" for (true, kind), count in found.items() if true != kind)
    return f"{right} of {found.total()}", wrong or "-", verdict(right >= WANTED_RIGHT * found.total())


def show_joints() -> None:
    """Joints between two limbs with 4 + 4 markers: error against stated deviation."""
    rows = []
    for kind in ("ball", "hinge", "universal"):
        for is_known in (True, False):
            squares, stated, inside = [], [], []
            for seed in range(N_TAKES):
                poses, covariances, across = tracked(kind, seed, degrees=10.0, noise=1.0)
                joint = fit_joint(kind, poses, 0, 1, covariances if is_known else None)
                error = across @ (np.concatenate([joint.in_parent, joint.in_child]) - AT.ravel())
                std = np.sqrt(np.diag(across @ joint.covariance @ across))
                squares.append(error[:3] @ error[:3])
                stated.append(std[:3] @ std[:3])
                inside.append(np.abs(error) < 1.96 * std)
            rms, covered = float(np.sqrt(np.mean(squares))), float(np.mean(inside))
            reached = rms <= WANTED_RMS and COVERAGE[0] <= covered <= COVERAGE[1]
            figures = (f"{rms:.2f}", f"{np.sqrt(np.mean(stated)):.2f}", f"{100 * covered:.1f} %", verdict(reached))
            rows.append((kind, "given" if is_known else "from the poses", *figures))
    columns = ("kind", "covariances", "RMS error [mm]", "stated [mm]", "in 95 % intervals", "")
    title = (
        f"20 degrees of motion, 1 mm noise, 4 + 4 markers, 200 frames, {N_TAKES} takes; wanted: RMS <= 5 mm, 90-98 %"
    )
    show(title, columns, rows)


def tracked(kind: str, seed: int, degrees: float, noise: float) -> tuple[Poses, np.ndarray, np.ndarray]:
    """Poses of two limbs that swing by +-`degrees` per axis, their covariances, and what of (parent, child) is told."""
    random = np.random.default_rng(seed)
    angles, across = np.deg2rad(degrees) * waves(random), np.eye(6)
    turn = matrix_from_vector(angles if kind == "ball" else angles[:, :1] * AXES[0])
    if kind == "universal":
        turn = turn @ matrix_from_vector(angles[:, 1:2] * AXES[1])
    if kind == "hinge":
        across[:3, :3] -= np.outer(AXES[0], AXES[0])
        across[3:, 3:] -= np.outer(AXES[0], AXES[0])
    upper, lower = np.tile(np.eye(4), (2, len(turn), 1, 1))
    upper[:, :3, :3], upper[:, :3, 3] = matrix_from_vector(waves(random)), 300 * waves(random)
    lower[:, :3, :3] = upper[:, :3, :3] @ turn
    lower[:, :3, 3] = upper[:, :3, :3] @ AT[0] + upper[:, :3, 3] - lower[:, :3, :3] @ AT[1]
    bodies = []
    for body in (upper, lower):
        seen = np.einsum("fij,nj->fni", body[:, :3, :3], POINTS) + body[:, None, :3, 3]
        seen = seen + noise * random.normal(size=seen.shape)
        bodies.append(fit_transform(POINTS, seen, np.ones(seen.shape[:2], dtype=bool)))
    poses = Poses(np.stack(bodies, axis=1), ("upper", "lower"), 30.0)
    return poses, np.stack([pose_covariance(POINTS, noise)] * 2), across


def waves(random: np.random.Generator) -> np.ndarray:
    """Three sines, 200 frames at 30 Hz."""
    times = np.arange(200)[:, None] / 30
    return np.sin(2 * np.pi * random.uniform(0.2, 1.0, 3) * times + random.uniform(0, 2 * np.pi, 3))


def show_little_motion() -> None:
    """What is said of joints that hardly move."""
    rows = []
    for degrees in (10.0, 5.0, 2.0, 1.0):
        for kind in ("ball", "universal", "hinge"):
            found: Counter[str] = Counter()
            for seed in range(20):
                poses, covariances, _ = tracked(kind, seed, degrees, noise=1.0)
                found[choose_joint_type(poses, 0, 1, covariances).kind] += 1
            rows.append((f"{degrees:g}", kind, ", ".join(f"{name} {count}" for name, count in found.most_common())))
    columns = ("swing [deg]", "true kind", "found, of 20 takes")
    show("Less and less motion, 1 mm noise, 4 + 4 markers, 200 frames", columns, rows)


def show_sensors() -> None:
    """Bodies with orientation: hierarchy, kinds and joint places without anything given."""
    rows = []
    for name in ("human", "tree:8", "quadruped"):
        for shift, turn in SENSORS:
            scores = [score_of_sensors(name, seed, shift, turn) for seed in SEEDS]
            trees, kinds, joints, errors, stated = (np.array(column) for column in zip(*scores, strict=True))
            cells = (f"{trees.sum()} of {len(SEEDS)}", f"{kinds.sum()} of {joints.sum()}")
            rows.append((name, f"{shift:g}", f"{turn:g}", *cells, f"{errors.mean():.2f}", f"{stated.mean():.2f}"))
    columns = ("structure", "error [mm]", "error [rad]", "tree", "kinds", "joint error [mm]", "stated [mm]")
    show(f"Sensors anywhere on the limbs, 1000 frames, nothing given, seeds {SEEDS}", columns, rows)


def score_of_sensors(name: str, seed: int, shift: float, turn: float) -> tuple[bool, int, int, float, float]:
    """Whether the tree is right, kinds that are right, of how many, mean error and deviation of joints but hinges."""
    random, truth = np.random.default_rng(seed), simulate(name, seed=seed, n_frames=1000).truth
    mount = np.tile(np.eye(4), (truth.n_limbs, 1, 1))
    mount[:, :3, :3] = matrix_from_vector(random.normal(size=(truth.n_limbs, 3)))
    mount[:, :3, 3] = random.normal(size=(truth.n_limbs, 3)) * 60
    world = truth.world_from_limb @ mount
    world[..., :3, :3] @= matrix_from_vector(turn * random.normal(size=(*world.shape[:2], 3)))
    world[..., :3, 3] += shift * random.normal(size=(*world.shape[:2], 3))
    found = find_hierarchy(Poses(world, truth.limb_names, truth.rate))
    kinds, right, errors, stated = true_kinds(truth), 0, [0.0], [0.0]
    for child, joint in found.joints.items():
        parent = int(found.parents[child])
        kind = kinds.get(frozenset((parent, child)))
        right += joint.kind == kind
        if kind in {"ball", "universal"}:
            column = truth.edges.tolist().index(
                [parent, child] if [parent, child] in truth.edges.tolist() else [child, parent]
            )
            true = np.linalg.inv(truth.world_from_limb[0, parent] @ mount[parent]) @ [
                *truth.joint_positions[0, column],
                1,
            ]
            errors.append(float(np.linalg.norm(joint.fit.in_parent - true[:3])))
            stated.append(float(np.linalg.norm(joint.fit.std[0])))
    tree = {frozenset((int(found.parents[child]), child)) for child in found.joints}
    return tree == set(kinds), right, len(kinds), float(np.mean(errors[1:])), float(np.mean(stated[1:]))


if __name__ == "__main__":
    main()
