"""Learn the weights of skelgen/stages/limbs/bodies.py: ``python tests/benchmarks/learn_bodies.py``.

Takes of learn_pairs.py, every `EVERY`th of the simulated ones, alone and in pairs beside each other at `APART`. Cuts of
one body are wrong, the cut between two bodies is right. Printed: the weights, and how many takes of each kind those of
the program tell rightly, as they are and while all in them go through the room together, which nothing is learned from;
its `BIASES` are lower by `CAREFUL`, as a body torn apart is worse than two that are joined. Which pairs are drawn moves
the numbers by some tenths: those of the program are of earlier draws.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from learn_pairs import Subject, subjects
from scipy.spatial.transform import Rotation
from shown import show
from sklearn.linear_model import LogisticRegression

from skelgen.geometry.statistics import LEAST_COMMON
from skelgen.model.arrays import Bools, Floats, evenly_spread
from skelgen.stages.limbs import bodies

EVERY = 4
APART = (500.0, 700.0, 1000.0, 1500.0, 3000.0)  # mm
PAIRS = 3  # for each take
WAY, TURN = 2000.0, 3.0  # mm, rad
FEATURES = ([0, 1], [2])  # of both ways to tell
CAREFUL = (2.0, 1.0)
WRONG_SHARE = 4.0  # takes of one body are so many times more frequent than those of two


class Case(NamedTuple):
    """A take of one body or two: what its cuts are like, and which is between bodies."""

    kind: str
    cuts: bodies.Cuts
    is_between: Bools


def main() -> None:
    """Print the weights, and how many takes they tell rightly."""
    taken = list(chosen())
    rng = np.random.default_rng(0)
    cases = [made for one in taken for made in both_ways(one.kind, one.positions, one.positions.shape[1], rng)]
    for index, one in enumerate(taken):
        for _ in range(PAIRS):
            other = taken[int(rng.integers(len(taken)))] if one.kind != "structure" else taken[index - 1]
            both, n_first = together(one.positions, other.positions, rng.choice(APART), rng)
            cases += both_ways(f"two: {one.kind}", both, n_first, rng)
    cases = [one for one in cases if len(one.is_between)]
    learned_from = [one for one in cases if not one.kind.endswith("going")]
    weights = np.concatenate([weights_of(one) for one in learned_from])
    features = np.concatenate([one.cuts.features for one in learned_from])
    answers = np.concatenate([one.is_between for one in learned_from])
    for columns, careful in zip(FEATURES, CAREFUL, strict=True):
        fit = LogisticRegression(C=100.0, max_iter=10_000, tol=1e-8)
        fit.fit(features[:, columns], answers, sample_weight=weights * len(weights) / weights.sum())
        print(f"bias {fit.intercept_[0] - careful:.3f}, weights {', '.join(f'{value:.3f}' for value in fit.coef_[0])}")
    rows = []
    for kind in sorted({one.kind for one in cases}):
        of_kind = [one for one in cases if one.kind == kind]
        odds = [one.cuts.odds for one in of_kind]
        right = [
            bool(one.is_between[value.argmax()]) if value.max() > 0 else not one.kind.startswith("two")
            for one, value in zip(of_kind, odds, strict=True)
        ]
        best = sorted(float(value.max()) for value in odds)
        rows.append((kind, f"{sum(right)} of {len(right)}", f"{best[0]:.1f}", f"{best[-1]:.1f}"))
    show("Takes told rightly", ("take", "right", "least log odds", "most"), rows)


def chosen() -> Iterator[Subject]:
    """Some of the takes of learn_pairs.py; people with z up."""
    for index, one in enumerate(subjects()):
        if one.kind == "person" or index % EVERY == 0:
            positions = one.positions
            if one.name in {"landing", "treadmill", "walk"}:
                positions = positions[..., [2, 0, 1]]
            yield one._replace(positions=positions[evenly_spread(np.arange(len(positions)), 4 * bodies.LOOKED_AT)])


def together(one: Floats, other: Floats, apart: float, rng: np.random.Generator) -> tuple[Floats, int]:
    """Two bodies beside each other, as far apart in the median as is wished [mm]; the markers of the first."""
    n_frames = min(len(one), len(other))
    angle = rng.uniform(0, 2 * np.pi)
    shift = np.nanmedian(one.reshape(-1, 3), axis=0) - np.nanmedian(other.reshape(-1, 3), axis=0)
    moved = other[-n_frames:] + shift + apart * np.array([np.cos(angle), np.sin(angle), 0.0])
    return np.concatenate([one[:n_frames], moved], axis=1), one.shape[1]


def both_ways(kind: str, positions: Floats, n_first: int, rng: np.random.Generator) -> list[Case]:
    """A take as it is, and while all in it go through the room together, turning."""
    n_frames, angle = len(positions), rng.uniform(0, 2 * np.pi)
    way = WAY * np.sin(np.linspace(0, 2 * np.pi, n_frames))[:, np.newaxis] * [np.cos(angle), np.sin(angle), 0.0]
    turn = Rotation.from_rotvec(np.linspace(0, TURN, n_frames)[:, np.newaxis] * [0.0, 0.0, 1.0]).as_matrix()
    middle = np.nanmean(positions.reshape(-1, 3), axis=0)
    moved = np.einsum("fij,fmj->fmi", turn, positions - middle) + way[:, np.newaxis]
    return [case(kind, positions, n_first), case(f"{kind}, going", moved, n_first)]


def case(kind: str, positions: Floats, n_first: int) -> Case:
    """The cuts of a take."""
    is_seen = (~np.isnan(positions[:, :, 0])).sum(axis=0) >= LEAST_COMMON
    found = bodies.cuts(bodies.marker_distances(positions[:, is_seen]))
    second = np.flatnonzero(is_seen) >= n_first
    between = (found.is_second == second).all(axis=1) | (found.is_second != second).all(axis=1)
    return Case(kind, found, between & (n_first < positions.shape[1]))


def weights_of(one: Case) -> Floats:
    """How much each cut counts: all of a take together as much as its cut between bodies."""
    n_between = int(one.is_between.sum())
    wrong = WRONG_SHARE / max(len(one.is_between) - n_between, 1)
    return np.where(one.is_between, 1.0, wrong)


if __name__ == "__main__":
    main()
