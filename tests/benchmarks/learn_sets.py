"""Learn skelgen/stages/limbs/tables/worn_*.npz, shapes of marker sets: ``python tests/benchmarks/learn_sets.py``.

Each set is worn by simulated people of all sizes, with soft tissue as measured, in all natural motions. Kept are means
of the logarithms of distances and of how much they vary, and standard deviations between people, with what simulation
does not vary: where exactly a marker is stuck. The same of all places that markers are stuck at, whatever the set.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import skelgen.stages.limbs.worn_sets as module
from skelgen.model.arrays import Floats
from skelgen.simulation import Structure, simulate
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.motion import random_angles, world_from_limbs
from skelgen.simulation.people import (
    EVERY_PLACE,
    LABORATORY_SETS,
    MARKER_SETS,
    MOTIONS,
    natural_motion,
    person,
    realistic_soft_tissue,
)

N_PEOPLE, FIRST_SEED, N_FRAMES = 15, 7000, 200  # of each set
N_PEOPLE_OF_PLACES = 40
PLACED = 15.0  # mm, one standard deviation of a coordinate between examiners (Della Croce et al. 2005)
POSTURES = {"upper arm": 1.6, "forearm": 1.2, "thigh": 0.8, "shank": 1.0}  # ranges of offsets, in amplitudes
MOTION_RANGE, MIRROR = (0.2, 1.2), np.array([-1.0, 1.0, -1.0])
RATE, NOISE = 100.0, 0.3  # Hz, mm
STUCK, MOVED = 0.12, 0.5  # least standard deviations of both logarithms


def main() -> None:
    """Write both tables."""
    tables = Path(module.__file__).with_name("tables")
    np.savez_compressed(tables / "worn_sets.npz", **sets())
    np.savez_compressed(tables / "worn_places.npz", **places())


def sets() -> dict[str, np.ndarray]:
    """Shapes of all sets."""
    table = {}
    for marker_set in (*MARKER_SETS, *LABORATORY_SETS):
        shapes: list[tuple[Floats, Floats]] = []
        for number in range(N_PEOPLE):
            case = simulate(
                "human", seed=FIRST_SEED + number, motion=MOTIONS[number % len(MOTIONS)], marker_set=marker_set,
                n_frames=N_FRAMES, soft_tissue="realistic", noise=0.3,
            )  # fmt: skip
            shape = module.shape_of(np.asarray(case.take.positions))
            shapes.append((shape.distances, shape.motions))
        found = np.array(shapes)
        least = np.array([STUCK, MOVED])[:, np.newaxis, np.newaxis]
        table[f"{marker_set}/mean"] = found.mean(axis=0).astype(np.float16)
        table[f"{marker_set}/spread"] = np.sqrt(found.var(axis=0) + least**2).astype(np.float16)
        table[f"{marker_set}/markers"] = np.array(case.take.names)
        table[f"{marker_set}/segments"] = case.truth.limb_of_marker.astype(np.uint8)
        print(marker_set, len(case.truth.limb_of_marker), flush=True)
    return table


def places() -> dict[str, np.ndarray]:
    """The shape of all places at once, the same on both sides."""
    shapes = [_person_in_any_posture(number) for number in range(N_PEOPLE_OF_PLACES)]
    someone = person(EVERY_PLACE, 0.0, np.random.default_rng(0)).worn
    other = {"L ": "R ", "R ": "L "}
    names = someone.marker_names
    mirrored = np.array([names.index(other.get(name[:2], name[:2]) + name[2:]) for name in names])
    found = np.array([(one.distances, one.motions) for one in shapes])
    found = np.concatenate([found, found[:, :, mirrored][..., mirrored]])
    least = np.array([STUCK, MOVED])[:, np.newaxis, np.newaxis]
    return {
        "mean": found.mean(axis=0).astype(np.float16),
        "spread": np.sqrt(found.var(axis=0) + least**2).astype(np.float16),
        "markers": np.array(names),
        "segments": someone.limb_of_marker.astype(np.uint8),
    }


def _person_in_any_posture(number: int) -> module.Shape:
    """Somebody in natural motion, or, every other one, in random motion about a posture: arms crossed, on the hips,
    overhead, in guard, deep squats; alike on both sides for half of these."""
    rng = np.random.default_rng([FIRST_SEED, number])
    who = person(EVERY_PLACE, 0.0, rng, placed=PLACED)
    if number % 2 == 0:
        motion = MOTIONS[number // 2 % len(MOTIONS)]
        angles, poses = natural_motion(who, motion, N_FRAMES, RATE, rng)
    else:
        body = in_posture(who.body, rng, is_alike=number % 4 == 1)
        angles = random_angles(body, N_FRAMES, RATE, rng, rng.uniform(*MOTION_RANGE))
        poses = world_from_limbs(body, angles, np.zeros((N_FRAMES, 3)))
    angles, poses = [angles[limb] for limb in who.limbs], poses[:, who.limbs]
    positions = carried_markers(who.worn, poses)
    positions += realistic_soft_tissue(who.worn, poses, angles, RATE, rng, who)
    return module.shape_of(positions + NOISE * rng.normal(size=positions.shape))


def in_posture(body: Structure, rng: np.random.Generator, *, is_alike: bool) -> Structure:
    """Return a body whose joint angles lie about those of a posture that is drawn, the same on both sides if alike."""
    limbs, drawn = [], {}
    for limb in body.limbs:
        side, _, rest = limb.name.partition(" ")
        segment = rest or limb.name
        by = rng.uniform(-1, 1, len(limb.offsets))
        if is_alike:
            by = drawn.setdefault(segment, by) * (MIRROR if side == "right" and limb.kind == "ball" else 1.0)
        by = 0.0 * by if limb.kind == "free" else by
        limbs.append(replace(limb, offsets=limb.offsets + POSTURES.get(segment, 0.5) * limb.amplitudes * by))
    return replace(body, limbs=tuple(limbs))


if __name__ == "__main__":
    main()
