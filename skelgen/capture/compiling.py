"""Functions compiled by numba, kept on disk for the next time.

Importing this module imports numba; decorating raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compile_function(function: _Function) -> _Function:
    """Return the function compiled; it runs without Python's lock, so that threads run side by side.

    Compiling takes a second or two for each sort, set or array expression of NumPy's: loops over numbers take none.
    """
    return cast(_Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
