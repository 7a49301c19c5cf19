"""What the benchmarks share: where they ran, and tables of what is wanted and what is reached."""

from __future__ import annotations

import multiprocessing
import os
import platform
import resource
import sys
from collections.abc import Callable, Iterable
from importlib.metadata import version
from typing import Any

from skelgen.evaluation import Table

KIBI = 1024 if sys.platform != "darwin" else 1  # getrusage counts in KiB on Linux, in bytes on macOS
PACKAGES = ("skelgen", "numpy", "scipy", "scikit-learn")


def show(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table and an empty line."""
    table = Table(title, tuple(columns), tuple(tuple(row) for row in rows))
    print(*table.lines(), "", sep="\n")


def show_machine() -> None:
    """Print on what the figures were reached."""
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {versions}\n")


def verdict(is_reached: bool) -> str:
    """Return what the last column says."""
    return "reached" if is_reached else "MISSED"


def peak_gigabytes() -> float:
    """Most memory that this process has held [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KIBI / 1e9


def in_own_process(work: Callable[..., Any], *given: Any) -> Any:
    """Return what a function of a module returns in a fresh process: a process never forgets its peak of memory."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(work, given, sender))
    process.start()
    sender.close()
    try:
        return receiver.recv()
    except EOFError:
        process.join()
        raise SystemExit(f"{work.__name__}{given} ended with exit code {process.exitcode}") from None
    finally:
        process.join()


def _send(work: Callable[..., Any], given: tuple[Any, ...], sender: Any) -> None:
    sender.send(work(*given))
    sender.close()
