"""On what figures were reached, how much memory a process held, and work in a process of its own."""

import contextlib
import multiprocessing
import os
import platform
import sys
from collections.abc import Callable
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

import skelgen
from skelgen.errors import SkelgenError

PACKAGES = ("numpy", "scipy", "scikit-learn")

_Answer = TypeVar("_Answer")
_UNIT = 1024 if sys.platform != "darwin" else 1  # getrusage counts in KiB, on macOS in bytes
_CPU_FACTS, _MEMORY_FACTS = Path("/proc/cpuinfo"), Path("/proc/self/status")  # of Linux


def machine_line() -> str:
    """Return processor, cores, system, and versions of what computes."""
    versions = ", ".join([f"skelgen {skelgen.__version__}", *(f"{name} {version(name)}" for name in PACKAGES)])
    system = f"{platform.system()} {platform.machine()}"
    return f"{_processor_name()}, {os.cpu_count()} cores, {system}, Python {platform.python_version()}, {versions}"


def _processor_name() -> str:
    """Return the processor's name as the system tells it."""
    with contextlib.suppress(OSError):
        for line in _lines(_CPU_FACTS):
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def peak_gigabytes() -> float:
    """Return the most memory that this process has held [GB]; NaN on systems that do not tell.

    Linux is asked for the process's own peak: what getrusage says there begins with the peak of the parent.
    """
    with contextlib.suppress(OSError):
        for line in _lines(_MEMORY_FACTS):
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e9
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return float("nan")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _UNIT / 1e9


def in_own_process(work: Callable[..., _Answer], *given: object) -> _Answer:
    """Return what a function of a module returns in a fresh process: a process never forgets its peak of memory.

    Parameters
    ----------
    work : callable
        A function of a module.
    *given
        Its arguments; those and what it returns must be picklable.

    Raises
    ------
    SkelgenError
        If the process ends without an answer.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, work, *given))
    process.start()
    sender.close()
    try:
        answer: _Answer = receiver.recv()
        return answer
    except EOFError:
        process.join()
        raise SkelgenError(
            f"the process that measures {work.__name__} ended with exit code {process.exitcode}; is memory short?"
        ) from None
    finally:
        process.join()


def _lines(facts: Path) -> list[str]:
    return facts.read_text(encoding="utf-8").splitlines()


def _send(sender: Connection, work: Callable[..., object], *given: object) -> None:
    sender.send(work(*given))
    sender.close()
