"""Postures of simulated people: any that joints allow, and hands that are held, so that arms close a loop."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from skelgen.geometry.rotations import unit_vectors
from skelgen.model.arrays import Floats
from skelgen.simulation import Structure
from skelgen.simulation.motion import random_angles, smooth_curves, world_from_limbs
from skelgen.simulation.people import Person

RATE = 100.0  # Hz
RANGES = {"upper arm": 1.6, "forearm": 1.2, "thigh": 0.8, "shank": 1.0}  # of offsets, in amplitudes
BENT = {"thigh": ((-10.0, 35.0), (-110.0, 20.0), (-25.0, 25.0)), "shank": ((0.0, 130.0),)}
LEG = ("thigh", "shank", "foot", "toes")
EXERTIONS, ALIKE = (0.03, 1.2), 0.6  # of usual amplitudes; of people
MIRROR = np.array([-1.0, 1.0, -1.0])
SIDES = {"left": 1.0, "right": -1.0}
SHAKEN, MOVED = 3.0, 60.0  # mm: how far held hands slip, and those in front of the chest move together
SLOW = (0.1, 0.8)  # Hz
LEAST_BENT, STRETCHED = 0.25, 0.985  # of an arm's length: how near the shoulder and how far a wrist is
OUT_AND_BACK, HANGING = (-0.5, 1.0, -0.3), (0.6, -0.3, -0.74)  # of the left elbow from the line, of fingers
HABITS, ASYMMETRY = (40.0, 0.4, 0.4), 0.4  # spread of wrists [mm], ways of elbows and turns of hands [rad]; of sides


@dataclass(frozen=True)
class Hold:
    """Where hands are held: on which segment, where of it the left one is [mm], and whether it stays in the room."""

    segment: str
    place: tuple[float, float, float]
    elbow: tuple[float, float, float] = OUT_AND_BACK
    stays: bool = False
    moves: bool = False


HOLDS = {
    "hips": Hold("pelvis", (20.0, 190.0, 60.0)),
    "clasped": Hold("chest", (330.0, 35.0, 60.0), moves=True),
    "bars": Hold("chest", (380.0, 180.0, -120.0), stays=True),
    "thighs": Hold("thigh", (90.0, 0.0, -250.0)),
    "shoulders": Hold("chest", (110.0, -110.0, 200.0), (0.6, 0.6, -1.0)),
    "behind the head": Hold("head", (-90.0, 60.0, 90.0)),
    "overhead": Hold("chest", (60.0, 350.0, 700.0)),
}


def about_posture(
    who: Person, n_frames: int, motion_range: tuple[float, float], rng: np.random.Generator, *, is_alike: bool
) -> tuple[list[Floats], Floats]:
    """Return the angles and the poses of somebody who moves at random about a posture that is drawn."""
    body = in_posture(who.body, rng, is_alike=is_alike)
    angles = random_angles(body, n_frames, RATE, rng, rng.uniform(*motion_range))
    return angles, world_from_limbs(body, angles, np.zeros((n_frames, 3)))


def at_exercise(who: Person, n_frames: int, rng: np.random.Generator) -> tuple[list[Floats], Floats]:
    """Return the angles and the poses of somebody whose hips and knees are bent by anything that they can be.

    Trunk, arms and each leg move by amounts of their own, from hardly at all to freely; legs and arms are alike on both
    sides, and move together, or not.
    """
    is_alike, is_together = rng.uniform(size=2) < ALIKE
    body = in_posture(who.body, rng, is_alike=is_alike, bent=BENT)
    angles, moved = random_angles(body, n_frames, RATE, rng), {}
    for number, limb in enumerate(body.limbs):
        side = limb.name.partition(" ")[0] if " " in limb.name else ""
        part = "leg" if limb.name.endswith(LEG) else "arm" if side else "trunk"
        other = body.limb_names.index(limb.name.replace("right", "left"))
        if is_alike and is_together and other != number:
            mirror = MIRROR if limb.kind == "ball" else 1.0
            angles[number] = np.deg2rad(limb.offsets) + mirror * (angles[other] - angles[other].mean(axis=0))
            continue
        size = moved.setdefault((part, side), np.exp(rng.uniform(*np.log(EXERTIONS))))
        angles[number] = np.deg2rad(limb.offsets) + size * (angles[number] - np.deg2rad(limb.offsets))
    return angles, world_from_limbs(body, angles, np.zeros((n_frames, 3)))


def in_posture(
    body: Structure,
    rng: np.random.Generator,
    *,
    is_alike: bool,
    bent: dict[str, tuple[tuple[float, float], ...]] | None = None,
) -> Structure:
    """Return a body whose joint angles lie about those of a posture that is drawn, the same on both sides if alike.

    What is bent anyhow lies between stated angles [deg] of the left side.
    """
    limbs, drawn = [], {}
    for limb in body.limbs:
        side, _, rest = limb.name.partition(" ")
        segment = rest or limb.name
        by = rng.uniform(-1, 1, len(limb.offsets))
        if is_alike:
            by = drawn.setdefault(segment, by) * (MIRROR if side == "right" and limb.kind == "ball" else 1.0)
        by = 0.0 * by if limb.kind == "free" else by
        offsets = limb.offsets + RANGES.get(segment, 0.5) * limb.amplitudes * by
        if bent and segment in bent:
            least, most = np.transpose(bent[segment])
            mirror = MIRROR if side == "right" and limb.kind == "ball" else np.ones(3)
            offsets = ((least + most) / 2 * mirror[: len(by)]) + (most - least) / 2 * by
        limbs.append(replace(limb, offsets=offsets))
    return replace(body, limbs=tuple(limbs))


@dataclass(frozen=True)
class Habit:
    """How somebody's hands differ: wrists [mm], ways of elbows and turns of hands [rad], left ones first."""

    wrists: Floats
    elbows: Floats
    turns: Floats

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Habit:
        """Somebody's, mostly alike on both sides."""
        wrists, elbows, turns = (
            spread * (rng.normal(size=3) + ASYMMETRY * rng.normal(size=(2, 3))) for spread in HABITS
        )
        return cls(wrists, elbows, turns)


USUAL_HABIT = Habit(*np.zeros((3, 2, 3)))


def with_held_hands(
    who: Person, poses: Floats, way: str, rng: np.random.Generator, habit: Habit = USUAL_HABIT
) -> Floats:
    """Poses of all limbs, shape (n_frames, n_limbs, 4, 4) [mm], with both hands held."""
    hold, poses = HOLDS[way], poses.copy()
    together = MOVED * smooth_curves(rng, len(poses), RATE, 3, SLOW)
    for number, (side, sign) in enumerate(SIDES.items()):
        mirror = np.array([1.0, sign, 1.0])
        home = poses[:, _limb_named(who, hold.segment, side)]
        home = np.repeat(home[:1], len(home), axis=0) if hold.stays else home
        place = mirror * (np.array(hold.place) + habit.wrists[number])
        wrist = home[:, :3, 3] + home[:, :3, :3] @ place + SHAKEN * smooth_curves(rng, len(poses), RATE, 3, SLOW)
        wrist += together * hold.moves
        turned = home[:, :3, :3] @ Rotation.from_rotvec(mirror[[1, 0, 1]] * habit.turns[number]).as_matrix()
        _pose_arm(who, poses, side, wrist, mirror * (np.array(hold.elbow) + habit.elbows[number]), turned)
    return poses


def _limb_named(who: Person, segment: str, side: str) -> int:
    names = who.body.limb_names
    return names.index(segment) if segment in names else names.index(f"{side} {segment}")


def _pose_arm(who: Person, poses: Floats, side: str, wrist: Floats, elbow_way: Floats, held: Floats) -> None:
    """Put the wrist of an arm where it is wanted, as far as it reaches, and turn the hand with what it holds."""
    upper, fore, hand = (_limb_named(who, segment, side) for segment in ("upper arm", "forearm", "hand"))
    to_elbow, to_wrist = (np.asarray(who.body.limbs[limb].joint) for limb in (fore, hand))
    a, b = np.linalg.norm(to_elbow), np.linalg.norm(to_wrist)
    chest, shoulder = poses[:, _limb_named(who, "chest", side), :3, :3], poses[:, upper, :3, 3]
    way, reach = unit_vectors(wrist - shoulder), np.linalg.norm(wrist - shoulder, axis=1)
    reach = np.clip(reach, LEAST_BENT * (a + b), STRETCHED * (a + b))[:, np.newaxis]
    along = (a**2 - b**2 + reach**2) / (2 * reach)
    out = chest @ elbow_way
    out = unit_vectors(out - (out * way).sum(axis=1, keepdims=True) * way)
    elbow = shoulder + along * way + np.sqrt(np.maximum(a**2 - along**2, 0.0)) * out
    poses[:, upper, :3, :3] = turned_to(chest, to_elbow, elbow - shoulder)
    poses[:, fore, :3, :3] = turned_to(poses[:, upper, :3, :3], to_wrist, shoulder + reach * way - elbow)
    poses[:, fore, :3, 3] = elbow
    mirrored = np.array([1.0, SIDES[side], 1.0]) * HANGING
    hanging = turned_to(np.eye(3)[np.newaxis], np.array([0.0, 0.0, -1.0]), np.array([mirrored]))
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
