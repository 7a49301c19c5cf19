"""Where the machine code of kernels is kept: one file for each kernel and the types that it was compiled for.

numba numbers these files, and keeps an index of what each holds. Two processes that compile at the same time may give
one number to two things, and a process that is killed between the two files leaves an index that points to what an
older version compiled: either is machine code for other arguments. Here the file's name says what it holds.
"""

from __future__ import annotations

import contextlib
import hashlib
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

_SHOWN = 16  # digits of a digest in a file's name


@cache
def cache_class(sources_digest: Callable[[], str]) -> Any:
    """Keep machine code in the folder that the user names, else in the package's, else in the user's cache folder.

    Parameters
    ----------
    sources_digest : callable
        Gives what tells versions of the kernels' sources apart: what is kept is good for exactly these.
    """
    import numba  # noqa: PLC0415 - half a second
    from numba.core import caching  # noqa: PLC0415 - half a second

    class AllSources:
        """What is kept is good as long as no file of kernels changes: they use each other's constants."""

        def get_source_stamp(self) -> str:
            return sources_digest()

    folders = (caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, caching.UserWideCacheLocator)
    locators = [type(folder.__name__, (AllSources, folder), {}) for folder in folders]
    implementation = type("Implementation", (caching.CompileResultCacheImpl,), {"_locator_classes": locators})
    files_base: Any = caching.IndexDataCacheFile  # numba gives these no types
    cache_base: Any = caching.FunctionCache

    class CodeFiles(files_base):  # type: ignore[misc]
        def __init__(self, folder: str, name: str, stamp: str) -> None:
            super().__init__(folder, name, stamp)
            self.name, self.version = name, _digest(f"{numba.__version__} {stamp}")

        def save(self, key: Any, data: Any) -> None:
            self._save_data(self.file_of(key), (str(key), data))
            for path in Path(self._cache_path).glob(f"{self.name}.*.nb[ci]"):
                if not path.name.startswith(f"{self.name}.{self.version}."):  # what an older version compiled
                    with contextlib.suppress(OSError):
                        path.unlink()

        def load(self, key: Any) -> Any:
            try:
                kept_for, data = self._load_data(self.file_of(key))
            except (OSError, EOFError, pickle.UnpicklingError):
                return None
            return data if kept_for == str(key) else None

        def flush(self) -> None:
            for path in Path(self._cache_path).glob(f"{self.name}.*.nb[ci]"):
                path.unlink(missing_ok=True)

        def file_of(self, key: Any) -> str:
            return f"{self.name}.{self.version}.{_digest(str(key))}.nbc"

    class Cache(cache_base):  # type: ignore[misc]
        _impl_class = implementation

        def __init__(self, function: Callable[..., Any]) -> None:
            super().__init__(function)
            stamp = self._impl.locator.get_source_stamp()
            self._cache_file = CodeFiles(self._cache_path, self._impl.filename_base, stamp)

        def load_overload(self, signature: Any, target_context: Any) -> Any:
            """Load machine code without all rules by which numba would compile, which it would read before."""
            with self._guard_against_spurious_io_errors():
                return self._load_overload(signature, target_context)

    return Cache


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_SHOWN]
