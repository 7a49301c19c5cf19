#!/usr/bin/env python3
"""Learn the table of skelgen/stages/names/likely_segments.py: ``python tests/benchmarks/learn_names.py``.

Simulated people of one height in all marker sets and motions, with soft tissue as measured, as many in any posture
(arms crossed, on the hips, overhead), and some who wear markers amid every limb and move at random. Their limbs are
those that are found in the take without names, and those that wear the markers, of which some are split, some joined to
their neighbour, and some markers go to a limb near by. First printed: limbs with the right segment for each marker set,
learned from all other sets.
"""

import argparse
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
from learn_sets import MOTION_RANGE, seen_markers
from postures import RATE, about_posture
from shapes import hidden

import skelgen
from skelgen.marker_sets import MARKER_SETS
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import spread_frames
from skelgen.simulation import simulate
from skelgen.simulation.people import MOTIONS, person
from skelgen.stages.names import likely_segments as likely
from skelgen.stages.names import name_limbs, recognised_set
from skelgen.stages.names.moving_tree import MovingTree

TABLE = Path(likely.__file__).with_name("tables") / "distances.toml"
HEIGHT = 1750.0  # mm
TAKES, FRAMES, FIRST = 250, 60, 1000
POSTURES = 31  # of the random numbers
VERSIONS = 3  # of the limbs of each take, the found ones included
SPLIT, JOINED, STRAY = 0.2, 0.1, 3  # of the limbs; markers at most
WIDER = np.array([1.2, 1.6])  # people move in more ways than the simulated ones
NARROWEST = np.array([0.04, 0.1]) ** 2
LEAST, RAREST = 10, -1.0  # examples; logarithm of how often
INWARD = {"hand": "forearm", "forearm": "upper arm", "foot": "shank", "head": "chest"}


def people(takes):
    """Yield seed, positions in some frames, names of markers, their limbs, and those found, of simulated people."""
    for seed in range(FIRST, FIRST + takes):
        options = {"motion": sorted(MOTIONS)[(seed + seed // len(MARKER_SETS)) % len(MOTIONS)], "height": HEIGHT}
        worn = MARKER_SETS[seed % len(MARKER_SETS)]
        made = simulate(
            "human", n_frames=500, seed=seed, noise=0.3, marker_set=worn, soft_tissue="realistic", **options
        )
        yield seed, *_limbs_of(made.take, made.truth)
    for seed in range(FIRST, FIRST + takes):
        yield seed, *_limbs_of(*_in_posture(MARKER_SETS[seed % len(MARKER_SETS)], seed))
    for seed in range(FIRST, FIRST + takes // 8):
        made = simulate("human", n_frames=300, seed=seed, noise=0.3)
        yield seed, *_limbs_of(made.take, made.truth)


def _in_posture(marker_set, seed):
    """Return a take of somebody who moves at random about a posture, and who wears the markers."""
    rng = np.random.default_rng([POSTURES, seed])
    who = person(marker_set, HEIGHT, rng)
    moves = about_posture(who, 300, MOTION_RANGE, rng, is_alike=seed % 2 == 1)
    return Trajectories(seen_markers(who, *moves, rng), list(who.worn.marker_names), RATE), who.worn


def _limbs_of(take, worn):
    """Return positions in some frames, names of markers, and the limb of each, true and found."""
    limbs = [worn.limb_names[limb] for limb in worn.limb_of_marker]
    project = skelgen.reconstruct(hidden(take), until="limbs")
    found = np.full(len(limbs), -1)
    found[[int(name[1:4]) for name in project.trajectories.names]] = project.limbs.limb_of_marker
    return take.positions[spread_frames(take.n_frames, FRAMES)], take.names, limbs, found


def drawn_limbs(positions, limbs, rng):
    """Return the limb of each marker, as clustering might find them."""
    whole = sorted(set(limbs))
    group = np.array([whole.index(limb) for limb in limbs])
    for index, limb in enumerate(whole):
        on_limb, chance = np.flatnonzero(group == index), rng.random()
        side, _, segment = limb.rpartition(" ")
        inward = f"{side} {INWARD.get(segment, '')}".strip()
        if chance < SPLIT and len(on_limb) > 1:
            rng.shuffle(on_limb)
            group[on_limb[: rng.integers(1, len(on_limb))]] = group.max() + 1
        elif chance > 1 - JOINED and inward in whole:
            group[on_limb] = whole.index(inward)
    for marker in rng.integers(len(group), size=rng.integers(STRAY)):
        apart = np.median(np.linalg.norm(positions - positions[:, [marker]], axis=2), axis=0)
        group[marker] = group[np.where(group == group[marker], np.inf, apart).argmin()]
    return np.unique(group, return_inverse=True)[1]


def label_of(name):
    """Return the label that a name of a limb says, or None."""
    plain = name.rstrip("0123456789 ")
    side, _, segment = plain.partition(" ") if plain.startswith(("left ", "right ")) else ("", "", plain)
    label = (segment, ("left", "right").index(side) if side else -1)
    return likely.LABELS.index(label) if label in likely.LABELS else None


def example(positions, names, group):
    """Return the markers of each limb, and its label by the names of its markers."""
    called = name_limbs(Limbs(group, np.zeros((len(group),) * 2)), names, recognised_set(names))
    labels = [label_of(name) for name in called]
    for side in (0, 1):
        upper, lower, stiff = (likely.LABELS.index((one, side)) for one in ("upper arm", "forearm", likely.STIFF_ARM))
        labels = labels if upper in labels else [stiff if label == lower else label for label in labels]
    return [positions[:, group == limb] for limb in range(group.max() + 1)], labels


def learned(examples):
    """Return the rows of the table."""
    pairs, sizes = defaultdict(list), defaultdict(list)
    for markers, labels in examples:
        features = likely.pair_features(np.stack([one.mean(axis=1) for one in markers], axis=1)) - np.log(HEIGHT)
        for limb, label in enumerate(labels):
            if label is not None and markers[limb].shape[1] > 1:
                sizes[likely.LABELS[label][0]].append(
                    np.log((likely.size_of(markers[limb]) + likely.SMALLEST) / HEIGHT)
                )
            for other in range(limb):
                if None not in (label, labels[other]):
                    pairs[likely.relation(label, labels[other])].append(features[limb, other])
    often = Counter(likely.LABELS[label][0] for _, labels in examples for label in labels if label is not None)
    every = np.concatenate([np.array(found) for found in pairs.values()])
    every_label = range(len(likely.LABELS))
    relations = sorted({likely.relation(one, other) for one in every_label for other in every_label})
    segments = sorted({segment for segment, _ in likely.LABELS})
    shares = {one: np.log(often[one] / _sides(one) / len(examples)) for one in segments}
    return {
        "pairs": {one: _row(np.array(pairs[one]) if len(pairs[one]) >= LEAST else every) for one in relations},
        "segments": {one: (*_size(sizes[one]), max(shares[one], RAREST)) for one in segments},
        "any": {"mean": every.mean(axis=0), "deviation": 1.3 * every.std(axis=0)},
    }


def _size(found):
    """Mean and deviation of the size."""
    return np.mean(found), 1.3 * np.std(found) + 0.1


def _sides(segment):
    return 1 if segment in likely.TRUNK else 2


def _row(found):
    """Means, variances and covariance of two features."""
    covariance = (np.cov(found.T) + np.diag(NARROWEST)) * np.outer(WIDER, WIDER)
    return *found.mean(axis=0), covariance[0, 0], covariance[1, 1], covariance[0, 1]


def right_segments(examples, rows):
    """Return how many limbs have the right segment and side, if sides may be exchanged, and how many there are."""
    tables, right, total = likely.tables_of(rows), 0, 0
    for markers, labels in examples:
        limbs = tuple(range(len(labels)))
        tree = MovingTree(limbs, {}, np.empty(0), dict(enumerate(markers)), 100.0)
        found = [likely.LABELS[label] for label in likely.likely_segments(tree, tables=tables).labels]
        other = [(segment, 1 - side if side >= 0 else -1) for segment, side in found]
        wanted = [None if label is None else likely.LABELS[label] for label in labels]
        right += max(sum(one == two for one, two in zip(guess, wanted, strict=True)) for guess in (found, other))
        total += len(labels)
    return right, total


def write(rows):
    """Write the table."""
    lines = [
        "# Written by tests/benchmarks/learn_names.py of simulated people. Of two limbs: the logarithm of the distance",
        "# of their middles in statures and of half its range (8 mm added), their means, variances, covariance. Of a",
        "# limb: mean and deviation of the logarithm of its size in statures (5 mm added), and how many there are.",
    ]
    for part, found in rows.items():
        lines += ["", f"[{part}]"]
        lines += [f'"{key}" = [{", ".join(f"{value:.4g}" for value in values)}]' for key, values in found.items()]
    TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--takes", type=int, default=TAKES)
    wanted = parser.parse_args()
    rng = np.random.default_rng(0)
    examples = [
        (seed % len(MARKER_SETS), example(positions, names, group))
        for seed, positions, names, limbs, found in people(wanted.takes)
        for group in (found, *(drawn_limbs(positions, limbs, rng) for _ in range(VERSIONS - 1)))
    ]
    for index, worn in enumerate(MARKER_SETS):
        rows = learned([one for number, one in examples if number != index])
        right, total = right_segments([one for number, one in examples if number == index][::VERSIONS], rows)
        print(f"{worn}: {right} of {total} limbs right without their tree", flush=True)
    write(learned([one for _, one in examples]))


if __name__ == "__main__":
    main()
