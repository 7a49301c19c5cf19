"""Compiled loops for labelled takes and their NumPy twins agree: with gaps, wrong labels, and in exact takes."""

from __future__ import annotations

import dataclasses
from importlib import import_module

import numpy as np
import pytest

from skelgen.stages.labels.confidence.distance_statistics import usual_distances
from skelgen.stages.repair.exchange_evidence import neighbours_of

ROUNDING = 1e-9  # mm and nats: sums of a few thousand products of millimetres, in another order
SQUARES = 1e-6  # mm^2: the same of squares of distances that change by up to a metre
SINGLE = 1e-5  # evidence is kept in single precision, up to 20 nats


@pytest.fixture(params=[{}, {"dropouts": 0.3}, {"noise": 0.0}], ids=["complete", "gaps", "exact"])
def take(request, simulated):
    """A human of whose labels two are exchanged for three frames."""
    take = simulated("human", n_frames=120, **{"noise": 0.5, "soft_tissue": 1.0, **request.param}).take
    positions = take.positions.copy()
    positions[50:53, [4, 5]] = positions[50:53, [5, 4]]
    return dataclasses.replace(take, positions=positions)


def twins(plain):
    pytest.importorskip("numba", reason="numba is not installed")
    folder, _, name = plain.rpartition(".")
    return import_module(f"{folder}.compiled_{name}"), import_module(plain)


def assert_same(compiled, plain, tolerance=ROUNDING):
    for one, other in zip(compiled, plain, strict=True):
        assert one.shape == other.shape
        np.testing.assert_allclose(one.astype(float), other.astype(float), rtol=0, atol=tolerance)


def arguments(name, take):
    """What a function of `steps` is called with."""
    positions, markers = take.positions, np.arange(take.n_markers)
    near = neighbours_of(positions)
    steps, lengths = np.diff(positions, axis=0), np.linalg.norm(np.diff(positions[:, :6], axis=1), axis=2)
    known = np.nan_to_num(positions[:, 0])
    return {
        "jumps": (positions.reshape(len(positions), -1),),
        "changes": (lengths, 20, 4),
        "lengths": (positions, 3, near[3, 1:]),
        "relative_steps": (steps, 3, near[3, 1:]),
        "expected_places": (positions, markers[::2], near, 10.0),
        "strayed": (positions, positions[:, ::-1].copy(), 2.0),
        "fitted_steps": (positions, 3, near[3, 1:], lengths, np.linspace(0.5, 2.0, 5), known, 0.1),
    }[name]


@pytest.mark.parametrize(
    "name", ["jumps", "changes", "lengths", "relative_steps", "expected_places", "strayed", "fitted_steps"]
)
def test_steps_of_both_twins_agree(take, name):
    results = [getattr(twin, name)(*arguments(name, take)) for twin in twins("skelgen.stages.repair.steps")]
    assert_same(*[result if isinstance(result, tuple) else (result,) for result in results])


def test_series_shorter_than_a_line_have_no_jumps_in_either_twin():
    series = np.arange(12.0).reshape(4, 3)
    for twin in twins("skelgen.stages.repair.steps"):
        assert np.isnan(twin.jumps(series)).all()
        assert np.isnan(twin.changes(series, 3)).all()


def test_evidence_of_both_twins_agrees(take):
    usual = usual_distances(take)
    given = (take.positions, usual.distance, usual.spread, usual.mates, usual.rivals, usual.reach)
    assert_same(*[twin.evidence_of(*given) for twin in twins("skelgen.stages.labels.weighing")], SINGLE)


@pytest.mark.parametrize("is_stated", [False, True])
def test_probabilities_of_both_twins_agree(take, is_stated):
    rng = np.random.default_rng(0)
    evidence = rng.normal(scale=8.0, size=take.seen.shape).astype(np.float32)
    breaks = rng.random(take.seen.shape) < 0.05
    stated = rng.random(take.seen.shape) < 0.01 if is_stated else np.zeros((0, 0), dtype=bool)
    given = (evidence, 3.0, take.seen, stated, breaks, 0.9, 0.1)
    assert_same(*[(twin.probabilities(*given),) for twin in twins("skelgen.stages.labels.weighing")])


def test_sums_of_distances_of_both_twins_agree(take):
    results = []
    for twin in twins("skelgen.stages.limbs.pair_sums"):
        shift = np.full((take.n_markers, take.n_markers), np.nan)
        first = twin.pair_sums(take.positions[:70], shift)
        results.append((*first, *twin.pair_sums(take.positions[70:], shift), np.nan_to_num(shift)))
    assert_same(*results, SQUARES)
    assert (results[0][1][0] < results[0][0][0]).any()  # some distances are far, and left out


def test_a_pair_that_is_never_seen_together_has_no_sums_in_either_twin(simulated):
    positions = simulated("human", n_frames=20).take.positions.copy()
    positions[:10, 0], positions[10:, 1] = np.nan, np.nan
    for twin in twins("skelgen.stages.limbs.pair_sums"):
        shift = np.full((positions.shape[1], positions.shape[1]), np.nan)
        assert not twin.pair_sums(positions, shift)[0][:, 0, 1].any()
        assert np.isnan(shift[0, 1])
