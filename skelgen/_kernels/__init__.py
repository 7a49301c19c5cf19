"""Kernels: every loop that numba compiles, one source each, one subject a module.

A kernel is written as plain Python over numbers and is compiled when it is first called; the machine code is kept on
disk for the next time. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled. Numbers that kernels share with
the rest of the package are defined here, as numba freezes them: what is kept on disk is good for exactly these files.

numba takes half a second to import, and is imported when the first kernel is called.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import threading
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.code_files import cache_class
from skelgen._kernels.compilers import part_compiler, plain_compiler, remembering_compiler
from skelgen.errors import KernelError, SkelgenError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_announce: ContextVar[Callable[[str], None] | None] = ContextVar("who is told what is compiled", default=None)
_making = threading.Lock()

_NO_ENTRY = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""What only kernels call needs no entry from Python or C."""

_NO_ARRAYS = {"_nrt": False}
"""Where no arrays are made, numba need not count references to them."""


def kernel(function: _Function) -> _Function:
    """Return a function that is compiled at its first call; it runs without Python's lock, so that threads run abreast.

    It works in arrays that it is given, and makes and returns none: each would take some .04 s to compile. What it
    calls must be a kernel or a part of one. Divisions by zero give infinities and NaN, as NumPy's do. A call raises
    `KernelError` if numba cannot be imported, cannot compile, or finds no folder to write to.
    """
    return cast(_Function, Kernel(function, _plain_kernel))


def array_kernel(function: _Function) -> _Function:
    """Return a function like a `kernel` that may make arrays.

    Compiling takes a second or two for each sort, slice that is written to, or array expression of NumPy's: loops over
    numbers take a tenth of that.
    """
    return cast(_Function, Kernel(function, _array_kernel))


def kernel_part(function: _Function) -> _Function:
    """Return a function that only kernels call, and that works in given arrays as they do.

    Numbers that are given to it should not be written out, nor be names of Python's whole numbers: it would be compiled
    anew for each of them. Names of NumPy's are not; see `fixed`.
    """
    return cast(_Function, KernelPart(function, _part))


def array_part(function: _Function) -> _Function:
    """Return a function that only kernels call, and that may make arrays; see `kernel_part`."""
    return cast(_Function, KernelPart(function, _part_that_makes_arrays))


class Kernel:
    """A function that numba compiles when it is needed.

    Parameters
    ----------
    function : callable
        What is compiled.
    compile_with : callable
        Gives what numba makes of it; called once.
    """

    def __init__(self, function: Callable[..., Any], compile_with: Callable[[Callable[..., Any]], Any]) -> None:
        self.function = function
        self._compile_with = compile_with
        self._compiled: Any = None
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__

    def __call__(self, *args: Any) -> Any:
        """Call the compiled function.

        Raises
        ------
        KernelError
            If it cannot be compiled.
        """
        try:
            return self.compiled(*args)
        except (SkelgenError, MemoryError, IndexError):  # a monitor may cancel; NUMBA_BOUNDSCHECK=1 finds bad indices
            raise
        except Exception as error:  # compiled code raises nothing else
            if self._compiled is self.function:
                raise
            what = f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"
            raise KernelError(
                f"numba cannot compile {self.__module__}.{self.__name__} ({what}); install the versions of numba and "
                "NumPy that skelgen asks for, and see that the disk is not full"
            ) from error

    @property
    def compiled(self) -> Any:
        """What numba made of the function; the function itself where ``NUMBA_DISABLE_JIT`` is set."""
        if self._compiled is None:
            with _making:
                if self._compiled is None:
                    self._compiled = self._compile_with(self.function)
        return self._compiled


class KernelPart(Kernel):
    """A function that only kernels call: what is compiled of it has no entry from Python."""

    def __call__(self, *args: Any) -> Any:
        """Call the function where nothing is compiled.

        Raises
        ------
        KernelError
            If it is compiled: Python would jump to nowhere.
        """
        if self.compiled is not self.function:
            raise KernelError(f"only kernels call {self.__module__}.{self.__name__}, which has no entry from Python")
        return self.function(*args)


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


def _part(function: Callable[..., Any]) -> Any:
    return _njit(part_compiler, **_NO_ENTRY, **_NO_ARRAYS)(function)


def _part_that_makes_arrays(function: Callable[..., Any]) -> Any:
    return _njit(part_compiler, **_NO_ENTRY)(function)


def _plain_kernel(function: Callable[..., Any]) -> Any:
    return _kept_on_disk(function, _njit(plain_compiler, no_cfunc_wrapper=True, **_NO_ARRAYS))


def _array_kernel(function: Callable[..., Any]) -> Any:
    compiled = _kept_on_disk(function, _njit(remembering_compiler, no_cfunc_wrapper=True))
    if compiled is not function:
        _begin_counting_references()
    return compiled


def _kept_on_disk(function: Callable[..., Any], compile_with: Callable[[Callable[..., Any]], Any]) -> Any:
    compiled = compile_with(function)
    if hasattr(compiled, "py_func"):  # else NUMBA_DISABLE_JIT is set
        try:
            compiled._cache = cache_class(sources_digest)(function)
        except RuntimeError as error:
            raise KernelError(
                f"compiled kernels can be kept neither in {Path(__file__).parent} nor in your cache folder; "
                "set NUMBA_CACHE_DIR to a folder that you can write to"
            ) from error
    return compiled


def _njit(compiler: Callable[[], Any], **options: bool) -> Any:
    try:
        import numba  # noqa: PLC0415 - half a second
    except Exception as error:  # it refuses versions of NumPy that it does not know, in several ways
        raise KernelError(
            f"numba, which compiles skelgen's kernels, cannot be imported ({error}); install the version asked for"
        ) from error
    _introduce()

    def begin(*task: Any) -> Any:
        return compiler()(*task)  # where all is on disk, no compiler is needed

    return cast(Any, numba.njit)(nogil=True, error_model="numpy", pipeline_class=begin, **options)


@cache
def _begin_counting_references() -> None:
    """Do what numba does before it compiles, and machine code from the disk needs as well, where it makes arrays."""
    from numba.core import registry, runtime  # noqa: PLC0415 - half a second

    cast(Any, runtime).rtsys.initialize(registry.cpu_target.target_context)  # which numba gives no types


@cache
def _introduce() -> None:
    """Tell numba what a kernel is that another one calls, and listen to what it compiles."""
    from numba.core import event, types  # noqa: PLC0415 - half a second
    from numba.extending import typeof_impl  # noqa: PLC0415 - half a second

    class Listener(event.Listener):
        depth = 0  # parts of a kernel are compiled while the kernel is
        collects = False

        def on_start(self, event: Any) -> None:
            self.depth += 1
            if self.depth > 1:
                return
            self.collects = gc.isenabled()
            gc.disable()  # numba makes many objects, and most of them stay
            announce = _announce.get()
            if announce is not None:
                announce(event.data["dispatcher"].py_func.__name__)

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0 and self.collects:
                gc.enable()

    cast(Any, event).register("numba:compile", Listener())  # which numba gives no types
    typeof_impl.register(Kernel)(lambda kernel, context: types.Dispatcher(kernel.compiled))


@cache
def sources_digest() -> str:
    """Return a digest of all sources of kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()
