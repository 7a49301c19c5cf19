"""Learn the table of skelgen/stages/limbs/pair_evidence.py: ``python tests/benchmarks/learn_pairs.py``.

Pairs of markers of real people (``../shared/data/bodies`` beside the project) in whole and in cuts, and of simulated
people, animals and machines; every take weighs alike, simulated takes together as much as people. A logistic regression
on features and their squares gives the weights. Markers on a joint, which the reference puts on two limbs, count where
they are on no common limb only. First printed: the area under the curve for each person, learned from the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import limbs as limb_benchmark
import numpy as np
from shown import show
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score

import skelgen
from skelgen.model.arrays import Bools, Floats
from skelgen.simulation import simulate
from skelgen.stages.limbs.pair_evidence import FEATURES, pair_features

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "bodies"
EVERY = 3  # of the simulated takes of tests/benchmarks/limbs.py
NOISE = 2.0  # mm, of the noisy cut
KEPT = 0.8  # of the markers in the cut of markers


class Pairs(NamedTuple):
    """Pairs of one take: what they are like, and whether they share a limb."""

    take: str
    features: Floats
    same: Bools


def main() -> None:
    """Print how well each person is told by the others, then the table."""
    people, simulated = list(people_pairs()), list(simulated_pairs())
    rows = []
    for name in sorted({pairs.take for pairs in people}):
        weights = learned([pairs for pairs in people if pairs.take != name], simulated)
        areas = [roc_auc_score(pairs.same, scores(pairs.features, weights)) for pairs in people if pairs.take == name]
        rows.append((name, f"{np.mean(areas):.4f}", f"{min(areas):.4f}"))
    show("Area under the curve, learned from the others", ("take", "mean of cuts", "worst"), rows)
    bias, *weights = learned(people, simulated)
    print(f"BIAS = {bias:.3f}")
    for name, part in (("WEIGHTS", weights[: len(FEATURES)]), ("SQUARE_WEIGHTS", weights[len(FEATURES) :])):
        print(f"{name} = ({', '.join(f'{value:.3f}' for value in part)})")


def people_pairs() -> Iterator[Pairs]:
    """Real people: all, halves, a third, slower, noisier, fewer markers."""
    for path in sorted(FOLDER.glob("*.truth.npz")):
        name = path.name.split(".")[0]
        truth = np.load(path)
        take = skelgen.read(next(one for one in FOLDER.glob(f"{name}.*") if one != path))
        index = {label.split(":")[-1].strip().lower(): marker for marker, label in enumerate(take.names)}
        kept = [index[str(label).split(":")[-1].strip().lower()] for label in truth["labels"]]
        positions, allowed = np.asarray(take.positions)[:, kept], truth["allowed"]
        rng, n_frames = np.random.default_rng(0), take.n_frames
        some = np.sort(rng.permutation(len(kept))[: int(KEPT * len(kept))])
        cuts = [positions, positions[: n_frames // 2], positions[n_frames // 2 :]]
        cuts += [positions[n_frames // 3 : 2 * n_frames // 3], positions[::5]]
        cuts += [positions + rng.normal(0, NOISE, positions.shape)]
        for cut in cuts:
            yield pairs_of(name, cut, allowed)
        yield pairs_of(name, positions[:, some], allowed[some])


def simulated_pairs() -> Iterator[Pairs]:
    """Takes of the benchmark of limbs."""
    labelled = [row for row in limb_benchmark.ROWS.values() if not row.unlabelled]
    for case in [case for row in labelled for case in row.cases][::EVERY]:
        made = simulate(limb_benchmark.structure(case), seed=case.seed, **case.options)
        limb = made.truth.limb_of_marker
        yield pairs_of(case.structure, np.asarray(made.take.positions), limb[:, np.newaxis] == np.unique(limb))


def pairs_of(take: str, positions: Floats, allowed: Bools) -> Pairs:
    """All pairs of a take whose answer is known; `allowed` says on which limbs each marker may be."""
    first, second = np.triu_indices(len(allowed), 1)
    same = (allowed[first] & allowed[second]).any(axis=1)
    sure = allowed.sum(axis=1) == 1
    known = ~same | (sure[first] & sure[second])
    features = pair_features(positions)[first, second]
    known &= ~np.isnan(features).any(axis=1)
    return Pairs(take, features[known], same[known])


def learned(people: list[Pairs], simulated: list[Pairs]) -> Floats:
    """Bias, weights of the features, weights of their squares."""
    takes = people + simulated
    weight = [1 / len(people)] * len(people) + [1 / len(simulated)] * len(simulated)
    each = np.concatenate(
        [np.full(len(one.same), part / len(one.same)) for one, part in zip(takes, weight, strict=True)]
    )
    table = np.concatenate([with_squares(one.features) for one in takes])
    middle, size = table.mean(axis=0), table.std(axis=0)
    fit = LogisticRegression(max_iter=1000)
    fit.fit((table - middle) / size, np.concatenate([one.same for one in takes]), sample_weight=each * len(each) / 2)
    slopes = fit.coef_[0] / size
    return np.array([fit.intercept_[0] - slopes @ middle, *slopes])


def with_squares(features: Floats) -> Floats:
    """Features and their squares."""
    return np.concatenate([features, features**2], axis=-1)


def scores(features: Floats, weights: Floats) -> Floats:
    """Log odds."""
    return np.asarray(weights[0] + with_squares(features) @ weights[1:])


if __name__ == "__main__":
    main()
