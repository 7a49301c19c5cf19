"""People whose hands are held: ``python tests/benchmarks/held_hands.py [30]``, at the hips, clasped, or on bars.

Arms and trunk, or both arms, form a closed loop then, in which one joint too many seems to be there: hands keep their
distance from the pelvis, or from each other, nearly as steadily as limbs do that are joined. Simulated people in all
marker sets squat, walk, reach or jump; hands are put where they are held, elbows follow (two bones of known length,
elbows out and back), with soft tissue as measured. Markers have no names; the sets are known.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from learn_sets import NOISE
from people import LEAST_TREE, LENGTHS, PLACED, RATE, Person, reconstruct, scores
from scipy.spatial.transform import Rotation
from shown import show, show_machine

from skelgen.geometry.rotations import unit_vectors
from skelgen.marker_sets import LABORATORY_SETS, MARKER_SETS
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.motion import smooth_curves
from skelgen.simulation.people import Person as WornPerson
from skelgen.simulation.people import natural_motion, person, realistic_soft_tissue

WAYS, MOVES = ("hips", "clasped", "bars"), ("squat", "squat", "walk", "reach", "jump")
SIDES = {"left": 1.0, "right": -1.0}
AT_HIPS, CLASPED, ON_BARS = (20.0, 190.0, 60.0), (330.0, 35.0, 60.0), (380.0, 180.0, -120.0)  # mm, of the left hand
SHAKEN, MOVED = 3.0, 60.0  # mm: how far held hands slip, and clasped ones move together
SLOW = (0.1, 0.8)  # Hz
STRETCHED = 0.985  # of an arm's length, at most
OUT_AND_BACK, HANGING = (-0.5, 1.0, -0.3), (0.6, -0.3, -0.74)  # of the left elbow from the line, of fingers


def main() -> None:
    """Print a row per person, and how many trees are as wanted."""
    show_machine()
    rows = []
    for told, who in people(int(sys.argv[1]) if len(sys.argv) > 1 else 30):
        rows.append((*told, *scores(who, reconstruct(who, "nothing"))[:5]))
        print(*rows[-1], sep="  ", flush=True)
    show("Hands held", ("set", "motion", "hands", "purity", "bodies", "limbs", "edges", "tree"), rows)
    trees = np.array([float(row[-1]) for row in rows])
    print(f"trees {trees.mean():.3f} in the mean; {(trees < LEAST_TREE).sum()} of {len(trees)} below {LEAST_TREE}")


def people(n_people: int) -> Iterator[tuple[tuple[str, str, str], Person]]:
    """Yield sets, motions and ways to hold the hands, and the people."""
    sets = (*MARKER_SETS, *LABORATORY_SETS)
    for number in range(n_people):
        rng = np.random.default_rng([991, number])
        marker_set, n_frames = sets[number % len(sets)], LENGTHS[number // 3 % 3]
        way = WAYS[(number + number // len(sets)) % 3]
        motion = "squat" if way == "bars" else MOVES[number % len(MOVES)]
        who = person(marker_set, 0.0, rng, placed=PLACED)
        angles, poses = natural_motion(who, motion, n_frames, RATE, rng)
        poses = with_held_hands(who, poses, way, rng)
        angles, poses = [angles[limb] for limb in who.limbs], poses[:, who.limbs]
        positions = carried_markers(who.worn, poses) + realistic_soft_tissue(who.worn, poses, angles, RATE, rng, who)
        positions += NOISE * rng.normal(size=positions.shape)
        limb, names = np.asarray(who.worn.limb_of_marker), list(who.worn.limb_names)
        take = Trajectories(positions, [f"M{marker:03}" for marker in range(len(limb))], RATE)
        allowed = limb[:, np.newaxis] == np.arange(len(names))
        yield (marker_set, motion, way), Person(take, names, np.array(who.worn.parents), allowed, None)


def with_held_hands(who: WornPerson, poses: Floats, way: str, rng: np.random.Generator) -> Floats:
    """Poses of all limbs, shape (n_frames, n_limbs, 4, 4) [mm], with both hands held."""
    poses, together = poses.copy(), MOVED * smooth_curves(rng, len(poses), RATE, 3, SLOW)
    for side, sign in SIDES.items():
        home, place = held_at(who, poses, way, np.array([1.0, sign, 1.0]))
        wrist = home[:, :3, 3] + home[:, :3, :3] @ place + SHAKEN * smooth_curves(rng, len(poses), RATE, 3, SLOW)
        wrist += together * (way == "clasped")
        pose_arm(who, poses, side, wrist, home[:, :3, :3])
    return poses


def held_at(who: WornPerson, poses: Floats, way: str, mirror: Floats) -> tuple[Floats, Floats]:
    """Pose of what the hands are held at, shape (n_frames, 4, 4), and where there [mm]."""
    names = who.body.limb_names
    if way == "hips":
        return poses[:, names.index("pelvis")], mirror * AT_HIPS
    chest = poses[:, names.index("chest")]
    if way == "clasped":
        return chest, mirror * CLASPED
    return np.repeat(chest[:1], len(chest), axis=0), mirror * ON_BARS


def pose_arm(who: WornPerson, poses: Floats, side: str, wrist: Floats, held: Floats) -> None:
    """Put the wrist of an arm where it is wanted, as far as it reaches, and turn the hand with what it holds."""
    names, mirror = list(who.body.limb_names), np.array([1.0, SIDES[side], 1.0])
    upper, fore, hand = (names.index(f"{side} {segment}") for segment in ("upper arm", "forearm", "hand"))
    to_elbow, to_wrist = (np.asarray(who.body.limbs[limb].joint) for limb in (fore, hand))
    a, b = np.linalg.norm(to_elbow), np.linalg.norm(to_wrist)
    chest, shoulder = poses[:, names.index("chest"), :3, :3], poses[:, upper, :3, 3]
    way, reach = unit_vectors(wrist - shoulder), np.linalg.norm(wrist - shoulder, axis=1)
    reach = np.minimum(reach, STRETCHED * (a + b))[:, np.newaxis]
    along = (a**2 - b**2 + reach**2) / (2 * reach)
    out = chest @ (mirror * OUT_AND_BACK)
    out = unit_vectors(out - (out * way).sum(axis=1, keepdims=True) * way)
    elbow = shoulder + along * way + np.sqrt(np.maximum(a**2 - along**2, 0.0)) * out
    poses[:, upper, :3, :3] = turned_to(chest, to_elbow, elbow - shoulder)
    poses[:, fore, :3, :3] = turned_to(poses[:, upper, :3, :3], to_wrist, shoulder + reach * way - elbow)
    poses[:, fore, :3, 3] = elbow
    hanging = turned_to(np.eye(3)[np.newaxis], np.array([0.0, 0.0, -1.0]), np.array([mirror * HANGING]))
    poses[:, hand, :3, :3] = held @ hanging
    poses[:, hand, :3, 3] = elbow + poses[:, fore, :3, :3] @ to_wrist


def turned_to(rotations: Floats, axis: Floats, wanted: Floats) -> Floats:
    """Rotations, shape (n, 3, 3), turned by as little as brings an axis of theirs to wanted directions, (n, 3)."""
    now, there = unit_vectors(rotations @ axis), unit_vectors(wanted)
    across = np.cross(now, there)
    sine = np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.arctan2(sine, (now * there).sum(axis=1, keepdims=True))
    turn = Rotation.from_rotvec(across / np.maximum(sine, np.finfo(np.float64).tiny) * angle)
    return np.asarray(turn.as_matrix() @ rotations)


if __name__ == "__main__":
    main()
