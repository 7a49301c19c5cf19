"""Evidence that two tracklets are one marker: the formula, written with SciPy's distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammaln, logsumexp
from scipy.stats import t

from skelgen._kernels.tracklet_evidence import (
    PRIOR_SAMPLES,
    RIGID_PRIOR,
    WITNESSES,
    DistanceTables,
    UsualDeviations,
    evidence_of_one,
    witness_weights,
)

USUAL = UsualDeviations(1.5, 30.0, 100.0)
ROUNDING = 1e-9  # nats; sums of logarithms of this size


def tables_of(rng, n):
    """Distances of n tracklets, some with one sample, some rigid."""
    count = np.floor(rng.uniform(1, 12, (n, n)))
    tau = np.where(rng.uniform(size=(n, n)) < 0.5, 1.0, 25.0)
    scatter = tau**2 * np.maximum(count - 1, 0)
    mean = rng.uniform(50, 500, (n, n))
    count, scatter, mean = (np.triu(one, 1) + np.triu(one, 1).T for one in (count, scatter, mean))
    return DistanceTables(count, mean, scatter, witness_weights(count, scatter, USUAL))


def weights_of(freedom, scatter):
    """Log probability of each kind of pair together with its scatter, from an inverse-gamma prior of its variance."""
    after, found = PRIOR_SAMPLES + freedom, []
    for tau, prior in ((USUAL.rigid, RIGID_PRIOR), (USUAL.loose, 1 - RIGID_PRIOR)):
        square = PRIOR_SAMPLES * tau**2
        ratio = gammaln(after / 2) - gammaln(PRIOR_SAMPLES / 2)
        found.append(np.log(prior) + ratio + PRIOR_SAMPLES / 2 * np.log(square) - after / 2 * np.log(square + scatter))
    return found


def evidence_by_scipy(one, other, witness, tables):
    """One distance: log of Student's mixture of one marker over that of two."""
    first, second = tables.samples[one, witness], tables.samples[other, witness]
    scatter = tables.scatter[one, witness] + tables.scatter[other, witness]
    freedom = PRIOR_SAMPLES + first + second - 2
    missed = tables.mean[other, witness] - tables.mean[one, witness]
    same, differ = [], []
    for tau, weight in zip((USUAL.rigid, USUAL.loose), weights_of(first + second - 2, scatter), strict=True):
        narrow = (PRIOR_SAMPLES * tau**2 + scatter) / freedom * (1 / first + 1 / second)
        same.append(weight + t.logpdf(missed, freedom, scale=np.sqrt(narrow)))
        differ.append(weight + t.logpdf(missed, freedom, scale=np.sqrt(narrow + USUAL.spacing**2)))
    return logsumexp(same) - logsumexp(differ)


@pytest.mark.parametrize("seed", range(3))
def test_evidence_is_the_sum_of_the_mixtures_ratios_over_the_best_witnesses(seed):
    tables = tables_of(np.random.default_rng(seed), 12)
    found, number = evidence_of_one(0, np.array([1, 5]), tables, USUAL, counts_loose=True, is_slow=False)
    for place, other in enumerate((1, 5)):
        rank = tables.witness[0] * tables.witness[other]
        best = np.argsort(-rank, kind="stable")[:WITNESSES]
        wanted = sum(evidence_by_scipy(0, other, witness, tables) for witness in best if rank[witness] > 0)
        assert number[place] == (rank[best] > 0).sum()
        assert found[place] == pytest.approx(wanted, abs=ROUNDING)


def test_a_rigid_distance_of_many_samples_is_the_best_witness():
    weights = witness_weights(np.array([0.0, 1.0, 8.0, 8.0]), np.array([0.0, 0.0, 7.0, 7.0 * 30**2]), USUAL)
    assert weights[0] == 0.0
    assert weights.argmax() == 2
    assert weights[3] < 0.01


def test_distances_that_are_not_rigid_do_not_count_as_rigid_ones():
    tables = tables_of(np.random.default_rng(0), 8)._replace(scatter=np.full((8, 8), 30.0**2 * 10))
    _, number = evidence_of_one(0, np.array([1]), tables, USUAL, counts_loose=False, is_slow=False)
    assert number[0] < 0.1
