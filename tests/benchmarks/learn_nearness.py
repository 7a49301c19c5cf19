"""Learn the table of skelgen/stages/joints/nearness.py: ``python tests/benchmarks/learn_nearness.py``.

Pairs of limbs of the takes of learn_pairs.py, once with the true limbs and once with those that skelgen finds: joined
are bodies that the truth joins, and two parts of one body. First printed: area under the curve and mean loss [nats] for
each person, learned from all but this one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from learn_pairs import Pairs, Subject, learn, subjects

from skelgen.model import Trajectories
from skelgen.model.arrays import Ints, spread_frames
from skelgen.stages.joints.nearness import LOOKED_AT, WEIGHTS, neighbour_features
from skelgen.stages.limbs import find_limbs

RATE = 100.0  # Hz; of no consequence


def main() -> None:
    """Print how well neighbours of each person are told by all others, then the table."""
    learn([pairs for subject in subjects() for pairs in pairs_of(subject)], len(WEIGHTS))


def pairs_of(subject: Subject) -> Iterator[Pairs]:
    """All pairs of limbs that are seen together, for the limbs that are found and for the true ones."""
    shown = subject.positions[spread_frames(len(subject.positions), LOOKED_AT)]
    names = tuple(map(str, range(shown.shape[1])))
    limbs = [np.unique(subject.allowed.argmax(axis=1), return_inverse=True)[1]]
    if subject.kind != "structure":
        limbs.append(find_limbs(Trajectories(shown, names, RATE)).limb_of_marker)
    for limb in limbs:
        yield pairs_of_limbs(subject._replace(positions=shown), limb)


def pairs_of_limbs(subject: Subject, limb_of_marker: Ints) -> Pairs:
    """All pairs of limbs that are seen together: what they are like, and whether they are joined."""
    markers = [np.flatnonzero(limb_of_marker == limb) for limb in range(limb_of_marker.max() + 1)]
    features = neighbour_features([subject.positions[:, one] for one in markers])
    shares = np.stack([subject.allowed[one].sum(axis=0) for one in markers])
    bodies = (shares == shares.max(axis=1, keepdims=True)).astype(np.intp)
    joined = bodies @ (subject.joined | np.eye(len(subject.joined), dtype=np.bool_)) @ bodies.T > 0
    first, second = np.triu_indices(len(markers), 1)
    known = ~np.isnan(features[first, second]).any(axis=1)
    return Pairs(subject.kind, subject.name, features[first, second][known], joined[first, second][known])


if __name__ == "__main__":
    main()
