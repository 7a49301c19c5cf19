"""People who stay near each other all the time: ``python tests/benchmarks/near_people.py [30]``.

Two or three simulated people of `people.unknown_people`, each in a set of their own, move on the spot with their
middles 0.3 to 0.9 m apart, one partly inside the other as dancers are. Markers have no names. They should be as many
bodies as people, each with markers of one person alone; beside them each single person, who should stay one.
"""

from __future__ import annotations

import sys
from itertools import islice

import numpy as np
from people import Person, unknown_people
from shown import show, show_machine

import skelgen
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats

APART = (300.0, 900.0)  # mm


def main() -> None:
    """Print a row per group, and how many are told apart rightly."""
    show_machine()
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    rng, rows, right = np.random.default_rng(5), [], {True: [0, 0], False: [0, 0]}
    everybody = (who for _, _, who in unknown_people(10 * wanted))
    for number in range(wanted):
        people = list(islice(everybody, 1 if number % 3 == 0 else 2 + number % 2))
        apart = rng.uniform(*APART)
        positions, owner = beside_each_other(people, apart, rng)
        take = Trajectories(positions, [f"M{marker:03}" for marker in range(len(owner))], people[0].take.rate)
        project = skelgen.reconstruct(take, until="limbs")
        limbs, owner = project.limbs, owner[[int(name[1:4]) for name in project.trajectories.names]]
        body = np.append(limbs.body_of_limb, -1)[limbs.limb_of_marker]
        n_bodies = int(limbs.body_of_limb.max()) + 1
        mixed = sum(len(np.unique(owner[body == one])) > 1 for one in range(n_bodies))
        is_right = n_bodies == len(people) and mixed == 0
        right[len(people) > 1][0] += is_right
        right[len(people) > 1][1] += 1
        counts = map(str, (len(people), round(apart), len(owner), n_bodies, mixed))
        rows.append((*counts, "" if is_right else "wrong"))
        print(*rows[-1], sep="  ", flush=True)
    show("People near each other", ("people", "apart [mm]", "markers", "bodies", "of several", ""), rows)
    for are_several, (n_right, n_all) in right.items():
        print(f"{'several people' if are_several else 'single people'}: {n_right} of {n_all} told rightly")


def beside_each_other(people: list[Person], apart: float, rng: np.random.Generator) -> tuple[Floats, np.ndarray]:
    """Positions of all, whose middles are on a circle around the first, and the person of each marker."""
    n_frames = min(who.take.n_frames for who in people)
    parts, angle = [], rng.uniform(0, 2 * np.pi)
    for number, who in enumerate(people):
        own = who.take.positions[:n_frames]
        around = angle + np.pi / 3 * number
        away = apart * np.array([np.cos(around), np.sin(around)]) * (number > 0)
        middle = np.nanmean(own, axis=1)[:, np.newaxis] * [1.0, 1.0, 0.0]
        parts.append(own - middle + np.append(away, 0.0))
    return np.concatenate(parts, axis=1), np.repeat(np.arange(len(people)), [part.shape[1] for part in parts])


if __name__ == "__main__":
    main()
