"""People who sit, row, lunge or use one side: ``python tests/benchmarks/exercises.py [n_people] [--apart] [name ...]``.

What people do who do not walk: legs that hardly move, move in one plane together, or one alone. Simulated people of all
sizes wear markers in no set: two to four at random places on each segment, on some of them one, with soft tissue as
measured; every third wears a set that is left out of the tables. They move for 3 to 8 s. With --apart other exercises,
on which nothing was tuned.

Beside markers on the right limb, edges and tree stand the markers and the edges that are stated with 95 % and more and
are wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from doubt import AT, Known, judged
from learn_sets import seen_markers
from postures import RATE
from shown import show, show_machine

from skelgen.marker_sets import EVERY_PLACE, LABORATORY_SETS, MARKER_SETS
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.motion import smooth_curves, world_from_limbs
from skelgen.simulation.people import Person, person
from skelgen.stages.limbs import worn_sets

PLACED = 12.0  # mm: how far markers miss usual places
FRAMES = (300, 500, 800)
ALONE = 0.2  # of the segments carry one marker
N_TOES = 2  # the last segments
SWAY, TILT = 1.5, 6.0  # degrees: what nobody keeps still, and one standard deviation of postures between people
SIZES = 0.15  # the same of the logarithm of amplitudes
SLOW = (0.1, 0.8)  # Hz
SIDES = {"left": 1.0, "right": -1.0}

# Joint: segment, column of its angles, sign, and whether the sign changes with the side
ANGLES = {
    "hip flexion": ("thigh", 1, -1.0, False),
    "hip abduction": ("thigh", 0, 1.0, True),
    "hip rotation": ("thigh", 2, 1.0, True),
    "knee": ("shank", 0, 1.0, False),
    "ankle": ("foot", 0, 1.0, False),
    "shoulder flexion": ("upper arm", 1, -1.0, False),
    "shoulder abduction": ("upper arm", 0, 1.0, True),
    "elbow": ("forearm", 0, 1.0, False),
    "pronation": ("forearm", 1, 1.0, False),
    "wrist": ("hand", 0, 1.0, False),
    "trunk flexion": ("chest", 1, 1.0, False),
    "trunk bend": ("chest", 0, 1.0, False),
    "trunk rotation": ("chest", 2, 1.0, False),
    "head rotation": ("head", 2, 1.0, False),
    "head flexion": ("head", 1, 1.0, False),
}


@dataclass(frozen=True)
class Exercise:
    """Mean and amplitude [deg] of joint angles, and how both sides go together.

    Amplitudes are those of a wave of `seconds`, or of wandering where that is 0. The right side lags by a part of it,
    and has `right` of the left's motion; `rest` replaces the posture of the right side where it differs.
    """

    angles: dict[str, tuple[float, float]]
    seconds: float = 0.0
    lag: float = 0.0
    arms_lag: float = 0.0
    right: float = 1.0
    rest: dict[str, float] = field(default_factory=dict)


ARMS_DOWN = {"shoulder flexion": (5, 3), "shoulder abduction": (10, 3), "elbow": (15, 4)}
REACHING = {"shoulder flexion": (55, 45), "shoulder abduction": (15, 20), "elbow": (55, 40), "pronation": (20, 30),
            "wrist": (0, 20), "trunk flexion": (5, 12), "trunk rotation": (0, 15),
            "head rotation": (0, 20)}  # fmt: skip
LEG_STANDS = {"hip flexion": 5.0, "knee": 8.0, "ankle": 3.0, "hip abduction": 3.0}
EXERCISES = {
    "sit": Exercise({"hip flexion": (85, 1.5), "knee": (88, 2), "ankle": (-3, 2), "hip abduction": (10, 1.5)}
                    | REACHING),
    "stand": Exercise({"hip flexion": (3, 2), "knee": (4, 2), "ankle": (2, 2)} | ARMS_DOWN),
    "cycle": Exercise(
        {"hip flexion": (55, 22), "knee": (72, 37), "ankle": (5, 12), "trunk flexion": (35, 2),
         "shoulder flexion": (75, 2), "elbow": (20, 3)}, 0.9, 0.5,
    ),
    "lunge": Exercise(
        {"hip flexion": (45, 40), "knee": (50, 45), "ankle": (-10, 8), "trunk flexion": (5, 6)} | ARMS_DOWN,
        2.8, 0.0, 0.0, 0.45, {"hip flexion": -10.0, "knee": 40.0, "ankle": -15.0},
    ),
    "kick": Exercise(
        {"hip flexion": (30, 40), "knee": (40, 35), "ankle": (10, 10), "hip abduction": (8, 8),
         "trunk rotation": (0, 6), "shoulder abduction": (25, 10), "elbow": (30, 10)}, 1.6, 0.0, 0.0, 0.05, LEG_STANDS,
    ),
    "lie": Exercise({"hip flexion": (20, 12), "knee": (35, 15), "ankle": (25, 8), "shoulder abduction": (20, 12),
                     "elbow": (20, 15), "trunk flexion": (0, 3), "head rotation": (0, 25)}),
    "one leg": Exercise(
        {"hip flexion": (20, 22), "knee": (50, 35), "ankle": (5, 15), "hip abduction": (8, 10)} | ARMS_DOWN,
        0.0, 0.0, 0.0, 0.08, LEG_STANDS,
    ),
    "one side": Exercise(
        REACHING | {"hip flexion": (20, 20), "knee": (30, 28), "ankle": (0, 15), "hip abduction": (8, 10)},
        0.0, 0.0, 0.0, 0.05, LEG_STANDS | {"shoulder flexion": 5.0, "elbow": 15.0},
    ),
}  # fmt: skip
APART = {
    "row": Exercise(
        {"hip flexion": (75, 30), "knee": (60, 50), "ankle": (0, 15), "trunk flexion": (10, 15),
         "shoulder flexion": (40, 35), "elbow": (50, 40)}, 2.2,
    ),
    "climb": Exercise(
        {"hip flexion": (50, 30), "hip abduction": (25, 8), "hip rotation": (15, 10), "knee": (65, 35),
         "ankle": (5, 12), "shoulder flexion": (120, 35), "shoulder abduction": (25, 10), "elbow": (60, 35)},
        3.0, 0.5, 0.5,
    ),
    "kneel": Exercise({"hip flexion": (15, 4), "knee": (100, 4), "ankle": (35, 3)} | REACHING),
    "work at a table": Exercise(
        {"hip flexion": (80, 1), "knee": (70, 6), "ankle": (5, 5), "hip abduction": (5, 2), "trunk flexion": (12, 3),
         "shoulder flexion": (35, 12), "elbow": (85, 18), "pronation": (55, 15), "wrist": (-10, 12),
         "head flexion": (15, 10), "head rotation": (0, 15)},
    ),
    "sit to stand": Exercise({"hip flexion": (45, 42), "knee": (48, 44), "ankle": (-8, 8), "trunk flexion": (15, 15)}
                             | ARMS_DOWN, 3.2),
    "one arm": Exercise(REACHING | {"hip flexion": (4, 2), "knee": (5, 2)}, 0.0, 0.0, 0.0, 0.06,
                        {"shoulder flexion": 5.0, "elbow": 15.0}),
    "side kick": Exercise(
        {"hip flexion": (40, 25), "hip abduction": (35, 28), "hip rotation": (-10, 15), "knee": (60, 45),
         "shoulder flexion": (45, 10), "elbow": (100, 12)}, 2.0, 0.0, 0.0, 0.06, LEG_STANDS,
    ),
    "stretch": Exercise({"hip flexion": (70, 25), "knee": (10, 6), "ankle": (0, 6), "trunk flexion": (25, 20),
                         "shoulder flexion": (110, 25), "elbow": (20, 12)}, 4.0),
}  # fmt: skip


def main() -> None:
    """Print a row per exercise, and the mean of all."""
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    every, seed = (APART, 556) if "--apart" in sys.argv else (EXERCISES, 555)
    n_people = next((int(word) for word in words if word.isdigit()), 10)
    asked = [word for word in words if not word.isdigit()] or list(every)
    show_machine()
    rows, figures = [], []
    for number, name in enumerate(every):
        if name not in asked:
            continue
        found = np.array([figures_of(known) for known in people(every[name], n_people, (seed, number), name)])
        figures.append(found)
        rows.append((name, *_cells(found)))
        print(*rows[-1], sep="  ", flush=True)
    rows.append(("all", *_cells(np.concatenate(figures))))
    show("Exercises", ("", "on right limb", "edges", "tree", "below .85", "sure and wrong", "of", "edges", "of"), rows)


def _cells(found: Floats) -> tuple[str, ...]:
    means, sums = found.mean(axis=0), found.sum(axis=0).astype(int)
    return (*(f"{value:.3f}" for value in means[:3]), f"{(found[:, 2] < 0.85).sum()} of {len(found)}",
            *map(str, sums[3:]))  # fmt: skip


def figures_of(known: Known) -> tuple[float, ...]:
    """Parts of markers and edges that are right, of the tree that is found; sure markers and edges, wrong and all."""
    told = judged(known)
    sure, sure_edges = told.of_markers >= AT, told.of_edges >= AT
    return (
        float(told.marker_is_right.mean()), float(told.edge_is_right.mean()), told.tree,
        (sure & ~told.marker_is_right).sum(), sure.sum(), (sure_edges & ~told.edge_is_right).sum(), sure_edges.sum(),
    )  # fmt: skip


def people(exercise: Exercise, n_people: int, seed: tuple[int, int], name: str) -> Iterator[Known]:
    """Yield people who do an exercise."""
    sets, known_sets = (*MARKER_SETS, *LABORATORY_SETS), worn_sets.worn_sets
    every = known_sets()
    for number in range(n_people):
        rng = np.random.default_rng([*seed, number])
        marker_set = sets[(7 * seed[1] + number) % len(sets)] if number % 3 == 0 else EVERY_PLACE
        who = person(marker_set, 0.0, rng, placed=PLACED)
        angles, poses = performed(who, exercise, FRAMES[number // 3 % 3], rng)
        positions, segment = seen_markers(who, angles, poses, rng), np.asarray(who.worn.limb_of_marker)
        kept = _worn(segment, rng) if marker_set == EVERY_PLACE else np.arange(len(segment))
        names = [f"M{marker:03}" for marker in range(len(kept))]
        allowed = segment[kept, np.newaxis] == np.arange(who.worn.n_limbs)
        worn_sets.worn_sets = lambda known=tuple(one for one in every if one.name != marker_set): known
        yield Known(name, Trajectories(positions[:, kept], names, RATE), allowed, np.array(who.worn.parents))
        worn_sets.worn_sets = known_sets


def _worn(segment: Ints, rng: np.random.Generator) -> Ints:
    """Places that are worn: some of each segment but the toes, which hardly move."""
    kept = []
    for one in np.unique(segment)[:-N_TOES]:
        places = np.flatnonzero(segment == one)
        n_worn = 1 if rng.uniform() < ALONE else int(rng.integers(2, 5))
        kept += rng.permutation(places)[:n_worn].tolist()
    return np.sort(np.array(kept))


def performed(who: Person, exercise: Exercise, n_frames: int, rng: np.random.Generator) -> tuple[list[Floats], Floats]:
    """Return the angles of all limbs of somebody who does an exercise, and their poses."""
    body = who.body
    sway = [smooth_curves(rng, n_frames, RATE, np.size(limb.amplitudes), SLOW) for limb in body.limbs]
    angles = [np.deg2rad(SWAY) * own for own in sway]
    seconds = exercise.seconds * np.exp(SIZES * rng.normal())
    phase = rng.uniform() + np.arange(n_frames) / RATE / seconds if seconds else np.zeros(n_frames)
    for joint, (usual, amplitude) in exercise.angles.items():
        segment, column, sign, is_mirrored = ANGLES[joint]
        mean, size = usual + TILT * rng.normal(), np.exp(SIZES * rng.normal())
        sided = f"left {segment}" in body.limb_names
        lag = exercise.arms_lag if "arm" in segment or segment == "hand" else exercise.lag
        for side, s in SIDES.items() if sided else (("", 1.0),):
            own = exercise.rest.get(joint, mean) + 2.0 * rng.normal() if side == "right" else mean
            part = amplitude * size * (exercise.right if side == "right" else 1.0)
            wave = (np.sin(2 * np.pi * (phase - lag * (side == "right"))) if seconds
                    else smooth_curves(rng, n_frames, RATE, 1, SLOW)[:, 0])  # fmt: skip
            limb = body.limb_names.index(f"{side} {segment}" if sided else segment)
            angles[limb][:, column] += np.deg2rad(sign * (s if is_mirrored else 1.0) * (own + part * wave))
    root = 15.0 * smooth_curves(rng, n_frames, RATE, 3, SLOW)
    return angles, world_from_limbs(body, angles, root)


if __name__ == "__main__":
    main()
