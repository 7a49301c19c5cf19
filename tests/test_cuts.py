"""Takes that nobody would record give a result or an error in a sentence: a sample of `tests/benchmarks/cuts.py`."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent / "benchmarks" / "cuts.py"
SAMPLE = {"cuts": 12, "short": 16, "bounds": 24, "accepted": 16}  # cases; more are tried by hand


@pytest.fixture(scope="module")
def cuts():
    """The script as a module."""
    spec = importlib.util.spec_from_file_location("cuts", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["cuts"] = module  # where dataclasses look for it
    spec.loader.exec_module(module)
    yield module
    del sys.modules["cuts"]


@pytest.mark.parametrize("kind", SAMPLE)
def test_odd_takes_give_a_result_or_an_error_in_a_sentence(cuts, kind):
    if kind == "cuts" and not cuts.recordings():
        pytest.skip("the real recordings are not here: ../shared/data is absent")
    outcomes = {seed: cuts.outcome(kind, seed) for seed in range(1000, 1000 + SAMPLE[kind])}
    assert not {seed: said for seed, said in outcomes.items() if said.startswith("escape")}
    assert sum(said == "result" for said in outcomes.values()) > len(outcomes) / 4
