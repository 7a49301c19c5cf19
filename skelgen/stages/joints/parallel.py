"""Pairs of limbs are independent: use the cores, with one BLAS thread each."""

from __future__ import annotations

import numpy as np

from skelgen.progress import Monitor
from skelgen.stages.joints.pairs import JointGuess, Segment, guess_joint
from skelgen.stages.joints.parameters import JointParameters

WORTH_PROCESSES = 200
"""Descents cost some 5 ms each, starting workers about a second: below so many pairs that lack poses, one does."""


def map_pairs(
    pairs: list[tuple[Segment, Segment]],
    typical: float,
    parameters: JointParameters,
    seed: int,
    n_jobs: int,
    monitor: Monitor,
) -> list[JointGuess]:
    """Guess the joint of every pair, in the order given; the result does not depend on `n_jobs`."""
    if n_jobs == 1 or _n_descents(pairs, parameters) < WORTH_PROCESSES:
        found = []
        for index, (first, second) in enumerate(pairs):
            found.append(guess_joint(first, second, typical, parameters.alpha, parameters, seed))
            monitor.advance(index + 1, len(pairs))
        return found
    from joblib import Parallel, delayed  # noqa: PLC0415 - only wanted with several processes

    workers = Parallel(n_jobs=n_jobs, return_as="generator")
    results = workers(delayed(_guess_alone)(first, second, typical, parameters, seed) for first, second in pairs)
    found = []
    for guess in results:
        found.append(guess)
        monitor.advance(len(found), len(pairs))
    return found


def _n_descents(pairs: list[tuple[Segment, Segment]], parameters: JointParameters) -> int:
    if parameters.solver == "conjugate-gradient":
        return len(pairs)
    return int(np.sum([not (first.shape.has_pose or second.shape.has_pose) for first, second in pairs]))


def _guess_alone(first: Segment, second: Segment, typical: float, parameters: JointParameters, seed: int) -> JointGuess:
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - only wanted in workers

    with threadpool_limits(limits=1):
        return guess_joint(first, second, typical, parameters.alpha, parameters, seed)
