"""Learn skelgen/stages/limbs/tables/worn_*.npz, shapes of marker sets: ``python tests/benchmarks/learn_sets.py``.

Each set is worn by simulated people of all sizes, with soft tissue as measured, in all natural motions, in random
motions about any posture, in natural motions with hands that are held: at the hips, clasped, on bars, on thighs or
shoulders, behind the head or overhead; and with hips and knees bent by anything, where trunk, arms and each leg move by
amounts of their own, as of those who sit, row, lunge or kick. Kept are means of the logarithms of distances and of how
much they vary, and standard deviations, of those whose hands are free, with what simulation does not vary: where
exactly a marker is stuck; principal components of how all differ from these means, which are what posture and
proportions do; and what these leave. The same of all places that markers are stuck at, whatever the set, with postures
from which searches begin.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from postures import HOLDS, RATE, Habit, about_posture, at_exercise, with_held_hands
from sklearn.cluster import KMeans

import skelgen.stages.limbs.worn_sets as module
from skelgen._kernels.distance_statistics import MOTION_WEIGHT
from skelgen.marker_sets import EVERY_PLACE, LABORATORY_SETS, MARKER_SETS
from skelgen.model.arrays import Floats
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.people import MOTIONS, Person, natural_motion, person, realistic_soft_tissue
from skelgen.stages.limbs.worn_shapes import Shape, shape_of


class Sample(NamedTuple):
    """How many people have free hands, hold them, and sit, row or lunge; and how many principal components are kept."""

    n_free: int
    n_hold: int
    n_exercise: int
    n_ways: int


OF_SETS = Sample(300, 140, 320, 32)  # in each set
OF_PLACES = Sample(500, 240, 1000, 48)  # in no set: they fit many things but for how people move
N_BEGINNINGS = 24  # postures from which searches begin, each the middle of people who are alike
FIRST_SEED, N_FRAMES = 7000, 200
PLACED = 15.0  # mm, one standard deviation of a coordinate between examiners (Della Croce et al. 2005)
MOTION_RANGE = (0.2, 1.2)
NOISE = 0.3  # mm
STUCK, MOVED = 0.12, 0.5  # least standard deviations of both logarithms


def main() -> None:
    """Write both tables."""
    tables = Path(module.__file__).with_name("tables")
    names = sorted((*MARKER_SETS, *LABORATORY_SETS))
    sets = [learned(one, *people_in(one, OF_SETS), OF_SETS.n_ways) for one in names]
    np.savez(tables / "worn_sets.npz", **table_of(sets))
    np.savez(tables / "worn_places.npz", **table_of([places()]))


def table_of(sets: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """What is learned of all sets, one after the other: a file of few arrays, not packed, is read at once."""
    return {key: np.concatenate([one[key] for one in sets], axis=2 * (key == "usual")) for key in sets[0]}


def halves_of(marker_set: str, segments: np.ndarray) -> np.ndarray:
    """Which half of a body each marker is on, the number of one of `HALVES` from 1 on; 0 where these are too few."""
    names = np.array(person(marker_set, 0.0, np.random.default_rng(0)).worn.limb_names)[segments]
    halves = np.zeros(len(segments), dtype=np.uint8)
    for number, of_half in enumerate(module.HALVES.values(), start=1):
        taken = np.isin(names, of_half)
        if module.LEAST_OF_HALF <= taken.sum() < len(segments):
            halves[taken] = number
    return halves


def places() -> dict[str, np.ndarray]:
    """What is learned of all places at once, the same on both sides."""
    other = {"L ": "R ", "R ": "L "}
    names = person(EVERY_PLACE, 0.0, np.random.default_rng(0)).worn.marker_names
    mirrored = np.array([names.index(other.get(name[:2], name[:2]) + name[2:]) for name in names])
    people = people_in(EVERY_PLACE, OF_PLACES)
    both = (np.concatenate([some, some[:, :, mirrored][..., mirrored]]) for some in people)
    table = learned(EVERY_PLACE, *both, OF_PLACES.n_ways, N_BEGINNINGS)
    return table | {"halves": np.zeros(len(names), dtype=np.uint8)}


def people_in(marker_set: str, sample: Sample) -> tuple[Floats, Floats]:
    """Shapes of people in a set, (n, 2, n_markers, n_markers): of those with free hands, and of those who hold them."""
    numbers = range(sample.n_free + sample.n_hold + sample.n_exercise)
    people = np.array([_person(marker_set, number, sample).tables for number in numbers], dtype=np.float32)
    return people[: sample.n_free], people[sample.n_free :]


def learned(marker_set: str, free: Floats, held: Floats, n_ways: int, n_beginnings: int = 0) -> dict[str, np.ndarray]:
    """Of pairs of markers mean and spread over people whose hands are free, the ways in which all people differ from
    that mean together, and what these leave; and so many postures in the middle of people who are alike."""
    first, second = np.triu_indices(free.shape[2], 1)
    pairs = np.concatenate([free, held])[:, :, first, second].astype(np.float64)
    pairs[:, 0] -= np.median(pairs[:, 0], axis=1, keepdims=True)
    least = np.array([STUCK, MOVED])[:, np.newaxis]
    mean, weight = pairs[: len(free)].mean(axis=0), least / np.sqrt([[1.0], [MOTION_WEIGHT]])
    off = ((pairs - mean) / weight).reshape(len(pairs), -1)
    scores, sizes, ways = np.linalg.svd(off, full_matrices=False)
    rest = (off - (scores[:, :n_ways] * sizes[:n_ways]) @ ways[:n_ways]).reshape(pairs.shape) * weight
    ways = (sizes[:n_ways, np.newaxis] / np.sqrt(len(pairs)) * ways[:n_ways]).reshape(n_ways, *mean.shape) * weight
    varying = pairs[: len(free)].var(axis=0), (rest**2).mean(axis=0)
    spread, left = (np.sqrt(variance + least**2) for variance in varying)
    someone, beginnings = person(marker_set, 0.0, np.random.default_rng(0)).worn, np.zeros((0, n_ways))
    if n_beginnings:
        usual = KMeans(n_beginnings, n_init=3, random_state=0).fit(np.sqrt(len(pairs)) * scores[:, :n_ways])
        beginnings = usual.cluster_centers_
    segments = someone.limb_of_marker.astype(np.uint8)
    print(marker_set, len(segments), flush=True)
    return {
        "names": np.array([marker_set]),
        "n_markers": np.array([len(segments)], dtype=np.uint8),
        "markers": np.array(someone.marker_names),
        "segments": segments,
        "halves": halves_of(marker_set, segments),
        "usual": np.stack([mean, spread, left]).astype(np.float16),
        "ways": ways.transpose(2, 1, 0).astype(np.float16),
        "beginnings": beginnings.astype(np.float16),
    }


def _person(marker_set: str, number: int, sample: Sample) -> Shape:
    """The shape of somebody in a set."""
    rng = np.random.default_rng([FIRST_SEED, number])
    who = person(marker_set, 0.0, rng, placed=PLACED)
    return shape_of(seen_markers(who, *_moving(number, sample), rng))


@cache
def _moving(number: int, sample: Sample) -> tuple[list[Floats], Floats]:
    """How somebody moves, whatever is worn: at exercise; or in natural motion, with hands that are held, or free; or,
    of those every other one, in random motion about a posture: arms crossed, overhead, in guard, deep squats; alike on
    both sides for half of these."""
    who = person(EVERY_PLACE, 0.0, np.random.default_rng([FIRST_SEED, number]))
    rng = np.random.default_rng([FIRST_SEED, number, 1])
    if number >= sample.n_free + sample.n_hold:
        return at_exercise(who, N_FRAMES, rng)
    if number >= sample.n_free:
        motion, way = MOTIONS[number // len(HOLDS) % len(MOTIONS)], list(HOLDS)[number % len(HOLDS)]
        angles, poses = natural_motion(who, motion, N_FRAMES, RATE, rng)
        return angles, with_held_hands(who, poses, way, rng, Habit.drawn(rng))
    if number % 2 == 0:
        return natural_motion(who, MOTIONS[number // 2 % len(MOTIONS)], N_FRAMES, RATE, rng)
    return about_posture(who, N_FRAMES, MOTION_RANGE, rng, is_alike=number % 4 == 1)


def seen_markers(who: Person, angles: list[Floats], poses: Floats, rng: np.random.Generator) -> Floats:
    """Return the markers [mm] of somebody in motion, with soft tissue and noise, shape (n_frames, n_markers, 3)."""
    angles, poses = [angles[limb] for limb in who.limbs], poses[:, who.limbs]
    positions = carried_markers(who.worn, poses) + realistic_soft_tissue(who.worn, poses, angles, RATE, rng, who)
    return np.asarray(positions + NOISE * rng.normal(size=positions.shape))


if __name__ == "__main__":
    main()
