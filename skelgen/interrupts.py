"""Interrupts: what is not finished yet is known by name, so that it can be taken away however a program ends."""

import contextlib
import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""Signals by which somebody ends a program: Ctrl-C, `kill` or a shutdown, a terminal that is closed."""

_LOOK_SECONDS = 0.2  # between two looks after a parent

_unfinished: dict[Path, None] = {}
_arriving = threading.RLock()  # held while finished files take their places


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Yield a path at which something temporary may be made; what is there at the end of the block is taken away."""
    _unfinished[path] = None
    try:
        yield path
    finally:
        _remove(path)
        _unfinished.pop(path, None)


def remove_unfinished() -> None:
    """Take away everything that is unfinished, before the process ends without leaving its blocks."""
    for path in list(_unfinished):
        _remove(path)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Let whatever ends the program wait for the end of the block: a parent that is gone, and signals.

    Signals wait in the main thread alone, the only one to hear them.
    """
    with _arriving, _signals_waiting():
        yield


@contextlib.contextmanager
def _signals_waiting() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {number: handler for number in ENDING if callable(handler := signal.getsignal(number))}
    try:
        for number in handlers:
            signal.signal(number, lambda arrival, frame: arrived.append(arrival))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in arrived:
            signal.raise_signal(number)


@contextlib.contextmanager
def deaf_children() -> Iterator[None]:
    """Let processes that start now never hear Ctrl-C, which is for the parent: it ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker  # noqa: PLC0415 - the command line shall answer signals as soon as it can

    resource_tracker.ensure_running()  # until 3.13 Python lets signals through as it starts this one
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@cache
def end_with_parent() -> None:
    """Let this process, if another one has it work, ignore Ctrl-C, and end at once when that one is gone."""
    import multiprocessing  # noqa: PLC0415 - the command line shall answer signals as soon as it can

    parent = multiprocessing.parent_process()
    if parent is not None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it could not be blocked
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: Any) -> None:
    if parent.sentinel is not None:
        parent.join()
    while os.getppid() == parent.pid:  # joblib's processes have no sentinel
        time.sleep(_LOOK_SECONDS)
    _arriving.acquire()  # for ever: no half of what is being taken away may still arrive
    remove_unfinished()
    os._exit(1)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
