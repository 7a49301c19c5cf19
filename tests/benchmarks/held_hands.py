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
from postures import with_held_hands
from shown import show, show_machine

from skelgen.marker_sets import LABORATORY_SETS, MARKER_SETS
from skelgen.model import Trajectories
from skelgen.simulation.markers import carried_markers
from skelgen.simulation.people import natural_motion, person, realistic_soft_tissue

WAYS, MOVES = ("hips", "clasped", "bars"), ("squat", "squat", "walk", "reach", "jump")


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


if __name__ == "__main__":
    main()
