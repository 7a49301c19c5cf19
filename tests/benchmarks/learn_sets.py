"""Learn skelgen/stages/limbs/tables/worn_*.npz, shapes of marker sets: ``python tests/benchmarks/learn_sets.py``.

Each set is worn by simulated people of all sizes, with soft tissue as measured, in all natural motions and in random
motions about any posture. Kept are means of the logarithms of distances and of how much they vary, standard deviations
between people, with what simulation does not vary: where exactly a marker is stuck; principal components, which are
what posture and proportions do, and what these leave. The same of all places that markers are stuck at, whatever the
set.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import skelgen.stages.limbs.worn_sets as module
from skelgen._kernels.distance_statistics import MOTION_WEIGHT
from skelgen.marker_sets import EVERY_PLACE, LABORATORY_SETS, MARKER_SETS
from skelgen.model.arrays import Floats
from skelgen.simulation import Structure
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.motion import random_angles, world_from_limbs
from skelgen.simulation.people import MOTIONS, Person, natural_motion, person, realistic_soft_tissue
from skelgen.stages.limbs.worn_shapes import Shape, shape_of

N_PEOPLE, N_WAYS = 300, 12  # in each set, and in all places at once; principal components that are kept
FIRST_SEED, N_FRAMES = 7000, 200
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
    """What is learned of all sets, and which of their markers are on half a body, where these are enough."""
    table = {}
    for marker_set in (*MARKER_SETS, *LABORATORY_SETS):
        table |= learned(marker_set, people_in(marker_set))
        segments = table[f"{marker_set}/segments"]
        names = np.array(person(marker_set, 0.0, np.random.default_rng(0)).worn.limb_names)[segments]
        for half, of_half in module.HALVES.items():
            taken = np.flatnonzero(np.isin(names, of_half))
            if module.LEAST_OF_HALF <= len(taken) < len(segments):
                table[f"{marker_set}/{half}"] = taken.astype(np.uint8)
        print(marker_set, len(segments), flush=True)
    return table


def places() -> dict[str, np.ndarray]:
    """What is learned of all places at once, the same on both sides."""
    people = people_in(EVERY_PLACE)
    other = {"L ": "R ", "R ": "L "}
    names = person(EVERY_PLACE, 0.0, np.random.default_rng(0)).worn.marker_names
    mirrored = np.array([names.index(other.get(name[:2], name[:2]) + name[2:]) for name in names])
    return learned(EVERY_PLACE, np.concatenate([people, people[:, :, mirrored][..., mirrored]]))


def people_in(marker_set: str) -> Floats:
    """Shapes of people in a set, shape (n_people, 2, n_markers, n_markers)."""
    return np.array([_person_in_any_posture(marker_set, number).tables for number in range(N_PEOPLE)], dtype=np.float32)


def learned(marker_set: str, people: Floats) -> dict[str, np.ndarray]:
    """Of pairs of markers mean and spread over people, the ways in which they vary together, and what these leave."""
    first, second = np.triu_indices(people.shape[2], 1)
    pairs = people[:, :, first, second].astype(np.float64)
    pairs[:, 0] -= np.median(pairs[:, 0], axis=1, keepdims=True)
    least = np.array([STUCK, MOVED])[:, np.newaxis]
    mean, weight = pairs.mean(axis=0), least / np.sqrt([[1.0], [MOTION_WEIGHT]])
    off = ((pairs - mean) / weight).reshape(len(pairs), -1)
    scores, sizes, ways = np.linalg.svd(off, full_matrices=False)
    rest = (off - (scores[:, :N_WAYS] * sizes[:N_WAYS]) @ ways[:N_WAYS]).reshape(pairs.shape) * weight
    ways = (sizes[:N_WAYS, np.newaxis] / np.sqrt(len(pairs)) * ways[:N_WAYS]).reshape(N_WAYS, *mean.shape) * weight
    spread, left = (np.sqrt(one.var(axis=0) + least**2) for one in (pairs, rest))
    arrays = zip(module.LEARNED, (mean, spread, ways, left), strict=True)
    someone = person(marker_set, 0.0, np.random.default_rng(0)).worn
    table = {f"{marker_set}/{name}": values.astype(np.float16) for name, values in arrays}
    table[f"{marker_set}/markers"] = np.array(someone.marker_names)
    table[f"{marker_set}/segments"] = someone.limb_of_marker.astype(np.uint8)
    return table


def _person_in_any_posture(marker_set: str, number: int) -> Shape:
    """Somebody in natural motion, or, every other one, in random motion about a posture: arms crossed, on the hips,
    overhead, in guard, deep squats; alike on both sides for half of these."""
    rng = np.random.default_rng([FIRST_SEED, number])
    who = person(marker_set, 0.0, rng, placed=PLACED)
    if number % 2 == 0:
        motion = MOTIONS[number // 2 % len(MOTIONS)]
        angles, poses = natural_motion(who, motion, N_FRAMES, RATE, rng)
    else:
        angles, poses = about_posture(who, N_FRAMES, MOTION_RANGE, rng, is_alike=number % 4 == 1)
    return shape_of(seen_markers(who, angles, poses, rng))


def about_posture(
    who: Person, n_frames: int, motion_range: tuple[float, float], rng: np.random.Generator, *, is_alike: bool
) -> tuple[list[Floats], Floats]:
    """Return the angles and the poses of somebody who moves at random about a posture that is drawn."""
    body = in_posture(who.body, rng, is_alike=is_alike)
    angles = random_angles(body, n_frames, RATE, rng, rng.uniform(*motion_range))
    return angles, world_from_limbs(body, angles, np.zeros((n_frames, 3)))


def seen_markers(who: Person, angles: list[Floats], poses: Floats, rng: np.random.Generator) -> Floats:
    """Return the markers [mm] of somebody in motion, with soft tissue and noise, shape (n_frames, n_markers, 3)."""
    angles, poses = [angles[limb] for limb in who.limbs], poses[:, who.limbs]
    positions = carried_markers(who.worn, poses) + realistic_soft_tissue(who.worn, poses, angles, RATE, rng, who)
    return np.asarray(positions + NOISE * rng.normal(size=positions.shape))


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
