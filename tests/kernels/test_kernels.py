"""How kernels are compiled and kept: by all their sources, where one may write, with words for what fails."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import skelgen
from skelgen._kernels import Kernel, announce_compiling, contiguous, fixed, kernel, kernel_part
from skelgen.errors import KernelError

IS_COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"
needs_compiler = pytest.mark.skipif(not IS_COMPILED, reason="NUMBA_DISABLE_JIT is set")

CONSTANTS = "SIZE = {}\n"
SUBJECT = """
from skelgen._kernels import kernel
from skelgen._kernels.constants import SIZE

@kernel
def scaled(value):
    return value * SIZE
"""
MAKES_ARRAYS = """
import numpy as np
from skelgen._kernels import array_kernel

@array_kernel
def scaled(value):
    return np.full(2, value)
"""
TWO_KERNELS = """
from skelgen._kernels import kernel

@kernel
def scaled(value):
    return value * 2.0

@kernel
def scaled_twice(value):
    return scaled(scaled(value))
"""
RUN = """
from skelgen._kernels import announce_compiling
from skelgen._kernels.subject import scaled
compiled = []
with announce_compiling(compiled.append):
    print(scaled(3.0), *compiled)
"""


@pytest.fixture
def package(tmp_path):
    """A package skelgen with nothing but one kernel, which uses a constant of another module."""
    source, copy = Path(skelgen.__file__).parent, tmp_path / "skelgen"
    (copy / "_kernels").mkdir(parents=True)
    (copy / "__init__.py").touch()
    shutil.copy(source / "errors.py", copy)
    for name in ("__init__.py", "code_files.py", "compilers.py", "lowering.py"):
        shutil.copy(source / "_kernels" / name, copy / "_kernels")
    (copy / "_kernels" / "constants.py").write_text(CONSTANTS.format(2.0))
    (copy / "_kernels" / "subject.py").write_text(SUBJECT)
    return copy


def run(package, code=RUN, **variables):
    """What Python prints that finds this package first; its user cache folder is beside the package."""
    kept = {name: value for name, value in os.environ.items() if name not in {"NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT"}}
    kept |= {"PYTHONPATH": str(package.parent), "XDG_CACHE_HOME": str(package.parent / "cache")} | variables
    done = subprocess.run(
        [sys.executable, "-c", code], env=kept, cwd=package.parent, capture_output=True, text=True, check=False
    )
    return (done.stdout + done.stderr).strip()


@needs_compiler
def test_kernels_are_compiled_once_and_again_when_a_constant_elsewhere_changes(package):
    assert run(package) == "6.0 scaled"
    assert run(package) == "6.0"
    (package / "_kernels" / "constants.py").write_text(CONSTANTS.format(5.0))
    assert run(package) == "15.0 scaled"


@needs_compiler
def test_machine_code_of_other_sources_is_not_used_whatever_a_killed_process_left(package):
    folder = package / "_kernels" / "__pycache__"
    assert run(package) == "6.0 scaled"
    (older,) = folder.glob("*.nbc")
    content = older.read_bytes()
    (package / "_kernels" / "constants.py").write_text(CONSTANTS.format(5.0))
    assert run(package) == "15.0 scaled"
    (newer,) = folder.glob("*.nbc")  # what no source can use any more is taken away
    assert newer.name != older.name
    older.write_bytes(content)
    newer.unlink()
    assert run(package) == "15.0 scaled"


@needs_compiler
def test_machine_code_for_other_arguments_is_not_used_under_a_wrong_name(package):
    of_numbers, of_whole = RUN, RUN.replace("3.0", "3")
    assert (run(package, of_numbers), run(package, of_whole)) == ("6.0 scaled", "6.0 scaled")
    one, other = (package / "_kernels" / "__pycache__").glob("*.nbc")
    one.write_bytes(other.read_bytes())
    assert sorted([run(package, of_numbers), run(package, of_whole)]) == ["6.0", "6.0 scaled"]


@needs_compiler
def test_damaged_machine_code_is_compiled_anew(package):
    assert run(package) == "6.0 scaled"
    (kept,) = (package / "_kernels" / "__pycache__").glob("*.nbc")
    kept.write_bytes(kept.read_bytes()[:100])
    assert run(package) == "6.0 scaled"


@needs_compiler
@pytest.mark.parametrize(("subject", "result"), [(SUBJECT, "6.0"), (MAKES_ARRAYS, "[3. 3.]")])
def test_machine_code_is_used_without_reading_the_compilers_rules(package, subject, result):
    (package / "_kernels" / "subject.py").write_text(subject)
    code = RUN + "import sys\nprint(*{'numba.np.arrayobj', 'skelgen._kernels.lowering'} & set(sys.modules))\n"
    first, second = run(package, code), run(package, code)
    assert first.startswith(f"{result} scaled\n")
    assert "arrayobj" in first
    assert second == result


@needs_compiler
def test_machine_code_that_makes_arrays_is_used_where_nothing_is_compiled(package):
    (package / "_kernels" / "subject.py").write_text(MAKES_ARRAYS)
    assert run(package) == "[3. 3.] scaled"
    assert run(package) == "[3. 3.]"


@needs_compiler
def test_a_kernel_that_is_compiled_calls_one_whose_machine_code_was_kept(package):
    (package / "_kernels" / "subject.py").write_text(TWO_KERNELS)
    assert run(package) == "6.0 scaled"
    both = RUN.replace("import scaled", "import scaled, scaled_twice").replace("print(", "print(scaled_twice(3.0), ")
    assert run(package, both) == "12.0 6.0 scaled_twice"
    assert run(package, both) == "12.0 6.0"


@needs_compiler
def test_machine_code_goes_to_the_users_cache_where_the_package_cannot_be_written_to(package):
    (package / "_kernels" / "__pycache__").write_text("a file where the folder would be")
    assert run(package) == "6.0 scaled"
    assert run(package) == "6.0"
    assert list((package.parent / "cache").rglob("*.nbc"))


@needs_compiler
def test_machine_code_goes_where_the_user_wants_it(package, tmp_path):
    assert run(package, NUMBA_CACHE_DIR=str(tmp_path / "wanted")) == "6.0 scaled"
    assert list((tmp_path / "wanted").rglob("*.nbc"))


@needs_compiler
def test_no_folder_to_write_to_is_an_error_in_words(package):
    (package / "_kernels" / "__pycache__").touch()
    (package.parent / "cache").touch()
    assert "KernelError: compiled kernels can be kept neither in" in run(package)


def test_without_the_compiler_kernels_run_as_plain_python(package):
    assert run(package, NUMBA_DISABLE_JIT="1") == "6.0"
    assert not list(package.parent.rglob("*.nbc"))


def test_a_broken_numba_is_an_error_in_words(package):
    (package.parent / "numba.py").write_text("raise ImportError('Numba needs NumPy 1.0')")
    assert "KernelError: numba, which compiles skelgen's kernels, cannot be imported (Numba needs" in run(package)


@kernel
def _has_no_such_method(value):
    return value.no_such_method()


@needs_compiler
def test_a_kernel_that_cannot_be_compiled_is_an_error_in_words():
    with pytest.raises(KernelError, match=r"numba cannot compile .*_has_no_such_method \(TypingError"):
        _has_no_such_method(1.0)


FIRST, SECOND = fixed(0, 2)


@kernel_part
def _taken(values, place):
    return values[place]


@kernel
def _difference(values):
    return _taken(values, FIRST) - _taken(values, SECOND)


def test_kernels_call_their_parts():
    assert _difference(np.array([5.0, 0.0, 3.0])) == 2.0


@needs_compiler
def test_a_part_that_python_calls_is_an_error_in_words():
    with pytest.raises(KernelError, match=r"only kernels call .*_taken, which has no entry from Python"):
        _taken(np.array([5.0, 0.0, 3.0]), FIRST)


@needs_compiler
def test_parts_are_compiled_once_whatever_fixed_numbers_they_are_given():
    _difference.compiled.compile((_float_array(),))
    assert isinstance(_taken, Kernel)
    assert len(_taken.compiled.signatures) <= 1  # none if the kernel came from disk


def _float_array():
    import numba

    return numba.float64[::1]


@kernel
def _quotient(first, second):
    return first / second


@needs_compiler
def test_division_by_zero_is_infinite():
    assert _quotient(1.0, 0.0) == np.inf


@needs_compiler
def test_what_is_compiled_is_announced_once():
    from numba import njit

    half, told = njit(lambda number: number / 2), []  # of which nothing is kept on disk
    _quotient(1.0, 2.0)  # from now on compiling is heard
    with announce_compiling(told.append):
        half(1.0)
        half(1.0)
    assert told == ["<lambda>"]


def test_contiguous_arrays_are_not_copied_and_others_are():
    whole = np.zeros((4, 4))
    frozen = np.zeros(3)
    frozen.flags.writeable = False
    same, column, copy = contiguous(whole, whole[:, 1], frozen)
    assert same is whole
    assert column.flags.c_contiguous
    assert copy.flags.writeable


@kernel
def _walk(numbers, rows, out):
    """Fill `out` with what loops, indices and branches give."""
    last, place = -1, 0
    for row in range(rows.shape[0]):
        for column in range(row, rows.shape[1]):
            last, place = column, place + 1
            out[row] += rows[row, -1 - column] * numbers[-place]
    for back in range(2, -1, -1):
        out[3 + back] = numbers[back - 3]
        if back == 1:
            continue
        out[-1] += back
    for _ in range(5, 2):
        last = 100
    swapped, other = numbers[0], numbers[1]
    for _ in range(3):
        swapped, other = other, swapped + 1.0
    pair = (swapped, other)
    out[6], out[7], out[8] = pair[0], pair[1], last


def test_loops_and_indices_mean_what_they_mean_in_python():
    numbers, rows = np.arange(1.0, 7.0), np.arange(9.0).reshape(3, 3) ** 2
    compiled, plain = np.zeros((2, 10))
    _walk(numbers, rows, compiled)
    _walk.function(numbers, rows, plain)
    assert compiled.tolist() == plain.tolist()
    assert plain[:3].tolist() == [29.0, 66.0, 36.0]
