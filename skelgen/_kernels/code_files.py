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
    implementation = type("Implementation", (_contents_class(),), {"_locator_classes": locators})
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


@cache
def _contents_class() -> Any:
    """Return what a file holds: machine code, and bitcode by which other kernels that are compiled link to it.

    numba would read the bitcode at once, and make the environments of all functions that are part of the kernel, with
    the modules that define them: only what prints or words an error within compiled code looks into these.
    """
    from llvmlite import binding  # type: ignore[import-untyped]  # noqa: PLC0415 - half a second with numba
    from numba.core import caching, codegen, compiler  # noqa: PLC0415 - half a second

    contents_base: Any = caching.CompileResultCacheImpl  # numba gives these no types
    library_base: Any = codegen.JITCodeLibrary
    result_of: Any = compiler.compile_result

    class KeptLibrary(library_base):  # type: ignore[misc]
        def __init__(self, codegen: Any, name: str, code: bytes, bitcode: bytes) -> None:
            super().__init__(codegen, name)
            self.enable_object_caching()
            self._set_compiled_object(code)
            self._finalize_final_module()
            self.bitcode = bitcode
            self.module_for_linking: Any = None

        def get_pointer_to_function(self, name: str) -> int:
            return int(self.codegen._engine.get_function_address(name))

        def _get_module_for_linking(self) -> Any:
            if self.module_for_linking is None:
                self.module_for_linking = binding.parse_bitcode(self.bitcode)
            return self.module_for_linking

    class Contents(contents_base):  # type: ignore[misc]
        def reduce(self, result: Any) -> Any:
            (name, _, codes), *others, _ = result._reduce()
            return (name, *codes), *others

        def rebuild(self, target_context: Any, payload: Any) -> Any:
            kept, description, environment, signature, is_object_mode, lifted, annotation, starters = payload
            for start in starters:
                start()
            library = KeptLibrary(target_context.codegen(), *kept)
            return result_of(
                typing_context=target_context.typing_context,
                target_context=target_context,
                entry_point=target_context.get_executable(library, description, environment),
                library=library,
                fndesc=description,
                environment=environment,
                signature=signature,
                objectmode=is_object_mode,
                lifted=lifted,
                type_annotation=annotation,
                reload_init=starters,
                referenced_envs=(),
            )

    return Contents


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_SHOWN]
