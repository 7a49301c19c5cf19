"""Compiled loops and their plain twins."""

import os
import sys

import numpy as np
import pytest

from skelgen.compiling import _forget_stale, compile_function, compile_part, fixed, loops, telling_of_compiling


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


def test_parts_are_compiled_once_whatever_fixed_numbers_they_are_given():
    pytest.importorskip("numba", reason="numba is not installed")
    first, second = fixed(0, 2)

    @compile_part
    def taken(values, place):
        return values[place]

    @compile_function
    def both(values):
        return taken(values, first) - taken(values, second)

    assert both(np.array([5.0, 0.0, 3.0])) == 2.0
    assert len(taken.signatures) == 1


def test_compiling_is_told_once_and_only_when_something_is_compiled():
    numba = pytest.importorskip("numba", reason="numba is not installed")
    told = []
    compile_function(lambda number: number)  # from now on compiling is heard
    half = numba.njit(lambda number: number / 2)  # of which nothing is kept on disk

    with telling_of_compiling(lambda: told.append("first")):
        half(1.0)
        half(1)
    with telling_of_compiling(lambda: told.append("again")):
        half(3.0)
    assert told == ["first"]


def test_what_was_compiled_before_a_change_is_forgotten(tmp_path):
    old, new, other = (tmp_path / name for name in ("loops.a-1.nbi", "loops.b-2.nbi", "others.a-1.nbi"))
    for path in (old, new, other):
        path.touch()
    for path in (old, other):
        os.utime(path, (1.0, 1.0))
    _forget_stale(tmp_path, "loops")
    assert sorted(tmp_path.iterdir()) == [new, other]
