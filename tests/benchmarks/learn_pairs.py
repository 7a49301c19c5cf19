"""Learn the table of skelgen/stages/limbs/pair_evidence.py: ``python tests/benchmarks/learn_pairs.py``.

Pairs of markers of real people (``../shared/data/bodies`` beside the project) in whole, in cuts and in fragments; of
simulated people and animals with soft tissue as measured; and of simulated structures that move at random. `SHARES`
says how much each kind weighs together, its takes weigh alike. A logistic regression on features and their squares
gives the weights. Markers on a joint, which the reference puts on two limbs, count where they are on no common limb
only. First printed: area under the curve and mean loss [nats] for each person, learned from all but this one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import limbs as limb_benchmark
import numpy as np
from people import Person, load
from shown import show
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss, roc_auc_score

from skelgen.benchmark.people import simulated_animal, simulated_person
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation import SimulatedTake, simulate
from skelgen.stages.limbs.pair_evidence import FEATURES, pair_features

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "bodies"
EVERY = 3  # of the simulated takes of tests/benchmarks/limbs.py
N_PEOPLE, N_ANIMALS = 70, 12  # simulated
SHARES = {"person": 1.0, "simulated person": 0.5, "structure": 0.7}
NOISE = 2.0  # mm, of the noisy cut
KEPT = 0.8  # of the markers in the cut of markers
BURSTS, BURST = 6, 0.03  # of each marker in fragments, and their mean length as a part of the take
TORN = 0.15  # of the markers are two tracks that never meet
TORN_TAKES = 0.3  # of the simulated people are seen in fragments, too


class Subject(NamedTuple):
    """A take, the bodies that each marker may be on, shape (n_markers, n_bodies), and which bodies are joined."""

    kind: str
    name: str
    positions: Floats
    allowed: Bools
    joined: Bools


class Pairs(NamedTuple):
    """Pairs of one take: what they are like, and whether the answer is yes."""

    kind: str
    name: str
    features: Floats
    answers: Bools


def main() -> None:
    """Print how well each person is told by all others, then the table."""
    learn([pairs_of(subject) for subject in subjects()], len(FEATURES))


def learn(takes: Sequence[Pairs], n_features: int) -> None:
    """Print how well each person is told by all others, then the table."""
    rows = []
    for name in sorted({one.name for one in takes if one.kind == "person"}):
        weights = learned([one for one in takes if one.name != name])
        odds = [(one.answers, scores(one.features, weights)) for one in takes if one.name == name]
        areas = [roc_auc_score(*one) for one in odds]
        loss = np.mean([log_loss(answers, 1 / (1 + np.exp(-np.clip(one, -9, 9)))) for answers, one in odds])
        rows.append((name, f"{np.mean(areas):.4f}", f"{min(areas):.4f}", f"{loss:.3f}"))
    show("Learned from all others", ("take", "area, mean of cuts", "worst", "loss"), rows)
    bias, *weights = learned(takes)
    print(f"BIAS = {bias:.3f}")
    for name, part in (("WEIGHTS", weights[:n_features]), ("SQUARE_WEIGHTS", weights[n_features:])):
        print(f"{name} = ({', '.join(f'{value:.3f}' for value in part)})")


def subjects() -> Iterator[Subject]:
    """Real people, simulated people and animals, structures that move at random."""
    for path in sorted(FOLDER.glob("*.truth.npz")):
        name = path.name.split(".")[0]
        person = load(FOLDER, name)
        for positions, markers in cuts(np.asarray(person.take.positions), np.random.default_rng(0)):
            yield Subject("person", name, positions, person.allowed[markers], joined_bodies(person))
    rng = np.random.default_rng(1)
    for index in range(N_PEOPLE + N_ANIMALS):
        is_person = index < N_PEOPLE
        made = simulated_person(index) if is_person else simulated_animal(index - N_PEOPLE)
        subject = simulated("simulated person" if is_person else "structure", made[0])
        yield subject
        if rng.random() < TORN_TAKES:
            positions, markers = in_fragments(subject.positions, rng)
            yield subject._replace(positions=positions, allowed=subject.allowed[markers])
    labelled = [row for row in limb_benchmark.ROWS.values() if not row.unlabelled]
    for case in [case for row in labelled for case in row.cases][::EVERY]:
        made = simulate(limb_benchmark.structure(case), seed=case.seed, **case.options)
        yield simulated("structure", made)


def cuts(positions: Floats, rng: np.random.Generator) -> Iterator[tuple[Floats, Ints]]:
    """All, halves, a third, noisier, fewer markers, in fragments; with the marker of each column."""
    n_frames, every = len(positions), np.arange(positions.shape[1])
    some = np.sort(rng.permutation(every)[: int(KEPT * len(every))])
    first = positions[: n_frames // 2]
    noisy = positions + rng.normal(0, NOISE, positions.shape)
    for cut in (positions, first, positions[n_frames // 2 :], positions[n_frames // 3 : 2 * n_frames // 3], noisy):
        yield cut, every
    yield positions[:, some], some
    yield in_fragments(positions, rng)
    yield in_fragments(first, rng)


def in_fragments(positions: Floats, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Positions with bursts of every marker lost and some markers torn in two; the marker of each column."""
    n_frames, n_markers, _ = positions.shape
    pieces, owner = list(positions.transpose(1, 0, 2).copy()), list(range(n_markers))
    for marker in range(n_markers):
        for start in rng.integers(0, n_frames, BURSTS).tolist():
            pieces[marker][start : start + int(rng.exponential(BURST) * n_frames) + 1] = np.nan
        if rng.random() < TORN:
            torn, later = rng.integers(int(TORN * n_frames), int((1 - TORN) * n_frames)), pieces[marker].copy()
            later[:torn], pieces[marker][torn:] = np.nan, np.nan
            pieces.append(later)
            owner.append(marker)
    return np.stack(pieces, axis=1), np.array(owner)


def simulated(kind: str, made: SimulatedTake) -> Subject:
    """Bodies that carry no marker are passed over."""
    limb, parents = made.truth.limb_of_marker, made.truth.parents
    carried = np.unique(limb).tolist()
    joined = np.zeros((len(carried), len(carried)), dtype=np.bool_)
    for number, body in enumerate(carried):
        parent = int(parents[body])
        while parent >= 0 and parent not in carried:
            parent = int(parents[parent])
        if parent >= 0:
            joined[number, carried.index(parent)] = True
    return Subject(kind, kind, np.asarray(made.take.positions), limb[:, np.newaxis] == carried, joined | joined.T)


def joined_bodies(person: Person) -> Bools:
    """Whether each two bodies of a real person are joined."""
    joined = np.zeros((len(person.parents), len(person.parents)), dtype=np.bool_)
    children = np.flatnonzero(person.parents >= 0)
    joined[children, person.parents[children]] = True
    return joined | joined.T


def pairs_of(subject: Subject) -> Pairs:
    """All pairs of a take whose answer is known."""
    allowed = subject.allowed
    first, second = np.triu_indices(len(allowed), 1)
    same = (allowed[first] & allowed[second]).any(axis=1)
    sure = allowed.sum(axis=1) == 1
    known = ~same | (sure[first] & sure[second])
    features = pair_features(subject.positions)[first, second]
    known &= ~np.isnan(features).any(axis=1)
    return Pairs(subject.kind, subject.name, features[known], same[known])


def learned(takes: Sequence[Pairs]) -> Floats:
    """Bias, weights of the features, weights of their squares."""
    n_takes = Counter(one.kind for one in takes)
    each = np.concatenate(
        [np.full(len(one.answers), SHARES[one.kind] / n_takes[one.kind] / len(one.answers)) for one in takes]
    )
    table = np.concatenate([with_squares(one.features) for one in takes])
    middle, size = table.mean(axis=0), table.std(axis=0)
    fit = LogisticRegression(max_iter=1500)
    answers = np.concatenate([one.answers for one in takes])
    fit.fit((table - middle) / size, answers, sample_weight=each * len(each) / each.sum())
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
