"""Takes that nobody would record give a result or an error in a sentence: a sample of `tests/benchmarks/cuts.py`."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

SAMPLE = {"cuts": 8, "short": 12, "bounds": 20, "accepted": 20}  # cases; more are tried by hand


@pytest.fixture(scope="module")
def cuts():
    """The script as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parent / "benchmarks"))
        yield importlib.import_module("cuts")


@pytest.mark.parametrize("kind", SAMPLE)
def test_odd_takes_give_a_result_or_an_error_in_a_sentence(cuts, kind):
    if kind == "cuts" and not cuts.recordings():
        pytest.skip("the real recordings are not here: ../shared/data is absent")
    outcomes = {seed: cuts.outcome(kind, seed) for seed in range(1000, 1000 + SAMPLE[kind])}
    assert not {seed: said for seed, said in outcomes.items() if said.startswith("escape")}
    assert sum(said == "result" for said in outcomes.values()) > len(outcomes) / 4


def test_points_that_fit_exactly_overflow_nothing_beside_one_that_does_not(cuts):
    assert cuts.outcome("short", 150_770) == "result"  # most frames show so little that limbs fit it exactly
