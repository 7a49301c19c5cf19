"""Kernels: every loop that numba compiles, one source each, one subject a module.

A kernel is written as plain Python over numbers and is compiled when it is first called; the machine code is kept on
disk for the next time. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled. Numbers that kernels share with
the rest of the package are defined here, as numba freezes them: what is kept on disk is good for exactly these files.

Modules of kernels import numba, which takes half a second: whoever may do without imports them in a function.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import KernelError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_announce: ContextVar[Callable[[str], None] | None] = ContextVar("who is told what is compiled", default=None)


def kernel(function: _Function) -> _Function:
    """Return a function that is compiled at its first call; it runs without Python's lock, so that threads run abreast.

    What it calls must be a kernel or a part of one. Divisions by zero give infinities and NaN, as NumPy's do.
    Compiling takes a second or two for each sort, set or array expression of NumPy's: loops over numbers take none.

    Raises
    ------
    KernelError
        If numba cannot be imported or finds no folder to write to; at the first call, if it cannot compile.
    """
    compiled = _compiled(function)
    if hasattr(compiled, "py_func"):  # else NUMBA_DISABLE_JIT is set
        _keep_on_disk(compiled)
        _explain_failure(compiled)
    return cast(_Function, compiled)


def kernel_part(function: _Function) -> _Function:
    """Return a function that only kernels call: it is compiled into each of them, and cannot be called from Python.

    Numbers that are given to it should not be written out, nor be names of Python's whole numbers: it would be compiled
    anew for each of them. Names of NumPy's are not; see `fixed`.
    """
    return cast(_Function, _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True))


def fixed(*numbers: int) -> tuple[int, ...]:
    """Return places in tables, named once and for all, that are given to kernels' parts; see `kernel_part`."""
    return tuple(cast(int, np.intp(number)) for number in numbers)


def contiguous(*arrays: NDArray[Any]) -> list[NDArray[Any]]:
    """Return arrays as kernels want them: one number after the other in memory, and not read-only.

    numba compiles a kernel anew for each kind of array that it is called with.
    """
    return [
        array if array.flags.c_contiguous and array.flags.writeable else np.array(array, order="C") for array in arrays
    ]


@contextlib.contextmanager
def announce_compiling(announce: Callable[[str], None]) -> Iterator[None]:
    """Call `announce` with the name of each kernel that is compiled within: this happens in the first run only."""
    token = _announce.set(announce)
    try:
        yield
    finally:
        _announce.reset(token)


def _compiled(function: Callable[..., Any], **options: bool) -> Any:
    try:
        import numba  # noqa: PLC0415 - half a second
    except Exception as error:  # it refuses versions of NumPy that it does not know, in several ways
        raise KernelError(
            f"numba, which compiles the kernels, cannot be imported ({error}); install the version that skelgen asks for"
        ) from error
    _listen()
    return cast(Any, numba.njit)(nogil=True, error_model="numpy", **options)(function)


def _keep_on_disk(compiled: Any) -> None:
    """Keep machine code in the folder that the user names, else in the package's, else in the user's cache folder."""
    from numba.core import caching  # noqa: PLC0415 - half a second

    class AllSources:
        """What is kept is good as long as no file of kernels changes: they use each other's constants."""

        def get_source_stamp(self) -> str:
            return _sources_digest()

    def of_all_sources(folder: type) -> Any:
        return type(folder.__name__, (AllSources, folder), {})

    folders = (caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, caching.UserWideCacheLocator)

    class Implementation(caching.CompileResultCacheImpl):
        _locator_classes: ClassVar = [of_all_sources(folder) for folder in folders]

    class Cache(caching.FunctionCache):
        _impl_class = Implementation

    try:
        compiled._cache = cast(Any, Cache)(compiled.py_func)
    except RuntimeError as error:
        raise KernelError(
            f"compiled kernels can be kept neither in {Path(__file__).parent} nor in your cache folder; "
            "set NUMBA_CACHE_DIR to a folder that you can write to"
        ) from error


@cache
def _sources_digest() -> str:
    """Return a digest of all sources of kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def _explain_failure(compiled: Any) -> None:
    """Say in words that a kernel cannot be compiled, or that what was compiled cannot be kept."""
    compile_for_args = compiled._compile_for_args

    def compile_or_explain(*args: object, **kwargs: object) -> object:
        try:
            return compile_for_args(*args, **kwargs)
        except Exception as error:
            name = f"{compiled.py_func.__module__}.{compiled.py_func.__name__}"
            first_line = str(error).strip().partition("\n")[0]
            raise KernelError(
                f"numba cannot compile {name} ({type(error).__name__}: {first_line}); install the versions of numba "
                "and NumPy that skelgen asks for, and see that the disk is not full"
            ) from error

    compiled._compile_for_args = compile_or_explain


@cache
def _listen() -> None:
    from numba.core import event  # noqa: PLC0415 - half a second

    class Listener(event.Listener):
        depth = 0  # kernels' parts are compiled while the kernel is

        def on_start(self, event: Any) -> None:
            announce = _announce.get()
            if announce is not None and self.depth == 0:
                announce(event.data["dispatcher"].py_func.__name__)
            self.depth += 1

        def on_end(self, event: Any) -> None:
            self.depth -= 1

    cast(Any, event).register("numba:compile", Listener())  # which numba gives no types
