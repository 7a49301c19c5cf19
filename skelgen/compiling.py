"""Functions compiled by numba, kept on disk for the next time, and their plain twins.

Loops over single numbers that would be slow in Python stand in modules named ``compiled...``. Each has a twin that does
the same by whole arrays: easier to read, the measure for tests, and used where numba cannot keep what it compiles.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

_Function = TypeVar("_Function", bound=Callable[..., Any])
_told: ContextVar[Callable[[], None] | None] = ContextVar("told that loops are compiled", default=None)


def compile_function(function: _Function) -> _Function:
    """Return the function compiled; it runs without Python's lock, so that threads run side by side.

    Compiling takes a second or two for each sort, set or array expression of NumPy's: loops over numbers take none.
    What it calls must be compiled as well. numba looks at the caller's file alone to see whether what it kept is still
    good; so what is older than any file of compiled loops or of their twins is forgotten here.

    Raises
    ------
    RuntimeError
        If numba finds no folder to write its cache to.
    """
    return _compiled(function)


def compile_part(function: _Function) -> _Function:
    """Return a function compiled that only compiled functions call: this takes half the time.

    Numbers that are given to it should not be written out, nor be names of Python's whole numbers: it would be compiled
    anew for each of them. Names of NumPy's are not; see `fixed`.
    """
    return _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def fixed(*numbers: int) -> tuple[int, ...]:
    """Return places in tables, named once and for all, that are given to compiled functions; see `compile_part`."""
    return tuple(cast(int, np.intp(number)) for number in numbers)


@cache
def loops(compiled: str, plain: str) -> ModuleType:
    """Return a module of compiled loops, or its plain twin where numba cannot keep what it compiles.

    The twins agree to rounding only: which of them is used must not depend on what ran before.

    Parameters
    ----------
    compiled, plain : str
        Full names of two modules with the same functions. They are imported when they are first asked for.
    """
    try:
        return import_module(compiled)
    except (ImportError, RuntimeError):
        return import_module(plain)


def in_order(*arrays: NDArray[Any]) -> list[NDArray[Any]]:
    """Return arrays as compiled functions want them: one number after the other in memory, and not read-only.

    numba compiles a function anew for each kind of array that it is called with.
    """
    return [
        array if array.flags.c_contiguous and array.flags.writeable else np.array(array, order="C") for array in arrays
    ]


@contextlib.contextmanager
def telling_of_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call `tell` once if something is compiled within: the first time on a machine that takes half a minute in all."""
    token = _told.set(tell)
    try:
        yield
    finally:
        _told.reset(token)


def _compiled(function: _Function, **options: bool) -> _Function:
    import numba  # noqa: PLC0415 - a quarter of a second

    from skelgen._kernels import _introduce  # noqa: PLC0415 - until the last loops have moved there

    _listen()
    _introduce()
    njit = cast(Any, numba.njit)  # whose stubs lack some of these words
    compiled = njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    _forget_stale(Path(compiled.stats.cache_path), Path(function.__code__.co_filename).stem)
    return cast(_Function, compiled)


@cache
def _forget_stale(folder: Path, module: str) -> None:
    """Delete the indices of what was compiled before any file of compiled loops was changed."""
    changed = _newest_change()
    for index in folder.glob(f"{module}.*.nbi"):
        with contextlib.suppress(OSError):  # another process was faster, or the folder is for reading only
            if index.stat().st_mtime < changed:
                index.unlink()


@cache
def _newest_change() -> float:
    loops_and_twins = (path for start in ("compiled", "plain") for path in Path(__file__).parent.rglob(f"{start}*.py"))
    changes = (path.stat().st_mtime for path in loops_and_twins)  # some twins are compiled themselves
    return max((change for change in changes if change <= time.time()), default=0.0)  # clocks differ


@cache
def _listen() -> None:
    from numba.core import event  # noqa: PLC0415 - a quarter of a second

    class Listener(event.Listener):
        def on_start(self, event: object) -> None:
            tell = _told.get()
            if tell is not None:
                _told.set(None)
                tell()

        def on_end(self, event: object) -> None:
            pass

    cast(Any, event).register("numba:compile", Listener())  # which numba gives no types
