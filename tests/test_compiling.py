"""Compiled loops and their plain twins."""

import sys

import pytest

from skelgen.compiling import compile_function, loops


@pytest.fixture
def modules():
    loops.cache_clear()
    yield "skelgen.stages.labels.compiled", "skelgen.stages.labels.plain"
    loops.cache_clear()


def test_compiled_functions_do_what_the_plain_ones_do():
    pytest.importorskip("numba", reason="numba is not installed")

    def plain(first, second):
        return first / second

    assert compile_function(plain)(1.0, 4.0) == plain(1.0, 4.0)
    assert compile_function(plain)(1.0, 0.0) == float("inf")  # as NumPy does, no error


def test_compiled_loops_come_first(modules):
    pytest.importorskip("numba", reason="numba is not installed")
    assert loops(*modules).__name__ == modules[0]


def test_plain_twin_takes_over_where_the_compiled_one_cannot_be_had(modules, monkeypatch):
    monkeypatch.setitem(sys.modules, modules[0], None)
    assert loops(*modules).__name__ == modules[1]
