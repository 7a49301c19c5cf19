"""Who does the takes of a batch: processes on this machine, or the workers of an existing dask cluster.

A process does one take after the other; if it crashes, the others go on. On a cluster, files lie on storage that all
machines share.
"""

from __future__ import annotations

import contextlib
import logging
import math
import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import skelgen
from skelgen.errors import InputError, ParameterError
from skelgen.interrupts import deaf_children, end_with_parent, uninterrupted
from skelgen.model.arrays import check_whole

if TYPE_CHECKING:
    from distributed import Client, Future

    from skelgen.app.batch.takes import Entry
    from skelgen.app.batch.work import Job, Outcome


TRIES = 2
"""A take whose worker dies is given to another one once: somebody may have killed it by mistake."""

_FAILED = 1
"""Exit code of a process that ends by an exception."""

_RECYCLED_ABOVE = 500_000_000
"""bytes; a worker that has held more is replaced, since Python seldom gives memory back. A usual take needs half."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "NUMBA_NUM_THREADS")


def in_processes(
    job: Job, entries: Sequence[Entry], n_workers: int = 1, timeout: float | None = None
) -> Generator[Outcome, None, None]:
    """Do all takes in processes of their own, and yield what became of each as it is known.

    Parameters
    ----------
    job : Job
        What is done with them.
    entries : sequence of Entry
        The takes.
    n_workers : int
        How many processes.
    timeout : float, s, optional
        Time after which a take is given up and its process ended; as long as it takes if left out.

    Raises
    ------
    ParameterError
        If the time is not one, or there is no process.
    InputError
        If a process fails before it begins with a take.
    """
    limit, n_workers = _limit(timeout), check_whole(n_workers, 1, "n_workers")
    waiting = deque(entries)
    tries: dict[str, int] = {}
    workers: list[_Worker] = []
    try:
        while waiting or workers:
            while waiting and len(workers) < n_workers:
                workers.append(_Worker(job, limit))
                workers[-1].begin(waiting.popleft())
            for worker in [one for one in workers if one.entry is None]:
                if waiting:
                    worker.begin(waiting.popleft())
                else:
                    workers.remove(worker)
                    worker.stop()
            for worker in _reporting(workers):
                entry, outcome = worker.finish()
                if outcome is None or worker.is_late or outcome.peak > _RECYCLED_ABOVE:
                    workers.remove(worker)
                    worker.stop()
                elif waiting:
                    worker.begin(waiting.popleft())  # at once: it shall not wait until this outcome is written down
                if outcome is None and not worker.is_late:
                    tries[entry.name] = tries.get(entry.name, 0) + 1
                    if tries[entry.name] < TRIES:
                        waiting.appendleft(entry)
                        continue
                yield outcome or _given_up(entry, job, worker.end_in_words())
    finally:
        for worker in workers:
            worker.kill()


def _limit(timeout: float | None) -> float:
    if timeout is None:
        return math.inf
    if not 0 < timeout < threading.TIMEOUT_MAX:
        raise ParameterError(f"--timeout {timeout:g} is no number of seconds above 0")
    return timeout


class _Worker:
    """A process that is given takes.

    Parameters
    ----------
    job : Job
        What is done with them.
    timeout : float, s
        How long each may take.
    """

    def __init__(self, job: Job, timeout: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs,), daemon=True, name="skelgen-batch")
        with _one_thread(), uninterrupted(), deaf_children():
            self.process.start()
        theirs.close()
        self._send(job)
        self.entry: Entry | None = None
        self.is_late, self.has_begun = False, False
        self.deadline = math.inf  # until its take begins
        self._timeout, self._outcome = timeout, cast("Outcome | None", None)

    def begin(self, entry: Entry) -> None:
        """Give it a take."""
        self.entry = entry
        self._send(entry)

    def _send(self, given: Job | Entry) -> None:
        with contextlib.suppress(OSError):  # it died: `finish` will tell
            self.connection.send(given)

    def has_finished(self) -> bool:
        """Receive a message, and return whether its take is finished; the only other message is that it has begun."""
        try:
            self._outcome = self.connection.recv()
        except (EOFError, OSError):
            self.process.join()
            return True
        self.has_begun = True
        self.deadline = math.inf if self._outcome else time.monotonic() + self._timeout
        return self._outcome is not None

    def finish(self) -> tuple[Entry, Outcome | None]:
        """Return the take and what became of it; None if the process died.

        Raises
        ------
        InputError
            If it failed before it began with any take: it loads the script that started it, which fails or starts
            processes itself.
        """
        if self.process.exitcode == _FAILED and not self.has_begun:
            raise InputError(
                "a worker process failed before its first take, with the error on stderr: it loads the script that "
                'asks for the batch, which must do so below `if __name__ == "__main__":`'
            )
        entry, self.entry = self.entry, None
        outcome, self._outcome = self._outcome, None
        assert entry is not None
        return entry, outcome

    def end_in_words(self) -> str:
        """Say why it could not finish its take."""
        if self.is_late:
            return f"it was not done after {self._timeout:g} s (--timeout)"
        code = self.process.exitcode
        died = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
        return f"its worker process ended {died}, {TRIES} times; there may be too little memory: use fewer --jobs"

    def stop(self) -> None:
        """Let it end."""
        self.connection.close()
        self.process.join()

    def kill(self) -> None:
        """End it at once."""
        self.process.kill()
        self.stop()


def _reporting(workers: list[_Worker]) -> list[_Worker]:
    """Wait for workers, and return those whose takes are over; one that is late is ended."""
    busy = {worker.connection: worker for worker in workers if worker.entry is not None}
    soonest = min((worker.deadline for worker in busy.values()), default=math.inf)
    answered = wait(list(busy), None if soonest == math.inf else max(soonest - time.monotonic(), 0.0)) if busy else []
    for connection, worker in busy.items():
        if connection not in answered and worker.deadline < time.monotonic():
            worker.is_late = True
            worker.process.kill()  # the end of its connection will tell
    return [busy[one] for one in answered if busy[one].has_finished()]  # type: ignore[index]


def _given_up(entry: Entry, job: Job, why: str) -> Outcome:
    from skelgen.app.batch.work import Outcome, failed_record  # noqa: PLC0415 - numpy loads in the workers alone

    return Outcome(failed_record(entry, job, why))


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that start now use one thread for linear algebra: the cores are shared by processes."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(connection: Connection[Any, Any]) -> None:
    """What a worker process does until nobody gives it takes any more."""
    end_with_parent()  # so that nothing is written behind a new batch's back
    with contextlib.suppress(EOFError, OSError):
        job = connection.recv()  # here and not among the arguments: it loads packages for seconds
        from skelgen.app.batch.work import work_on  # noqa: PLC0415 - numpy must see the number of threads first

        do = partial(work_on, job=job)
        while True:
            entry = connection.recv()
            connection.send(None)  # from now on its time counts
            connection.send(do(entry))


def on_cluster(
    job: Job, entries: Sequence[Entry], address: str, shared: Path, timeout: float = 10.0
) -> Generator[Outcome, None, None]:
    """Do all takes on a cluster, and yield what became of each as it is known.

    A take whose worker is lost is done by another one; if the first had finished it, the other finds its record.

    Parameters
    ----------
    job : Job
        What is done with them.
    entries : sequence of Entry
        The takes; their paths must mean the same on all machines.
    address : str
        Of the scheduler, e.g. ``tcp://host:8786``.
    shared : Path
        A file that every worker must see.
    timeout : float, s
        Time after which a scheduler that does not answer counts as missing.

    Raises
    ------
    InputError
        If there is no scheduler or worker, a worker has another version, or does not see the files.
    """
    from skelgen.app.batch.work import work_on  # noqa: PLC0415 - worker processes load it later

    with _connected(address, timeout) as client:
        _check_workers(client, address, shared)
        from distributed import as_completed  # noqa: PLC0415 - an extra

        futures = client.map(work_on, entries, job=job, pure=False)
        entry_of = dict(zip((future.key for future in futures), entries, strict=True))
        try:
            for future in as_completed(futures, loop=client.loop):
                yield _outcome(future, entry_of[future.key], job, address)
                future.release()
        finally:
            with contextlib.suppress(Exception):  # the scheduler may be gone
                client.cancel(futures, force=True)


@contextlib.contextmanager
def _connected(address: str, timeout: float) -> Iterator[Client]:
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
        from distributed.comm import resolve_address  # noqa: PLC0415
    except ImportError as error:
        raise InputError(f"a scheduler needs dask ({error}): pip install 'skelgen-mocap[batch]'") from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in a sentence
    client = Client.__new__(Client)
    client.status = "closed"  # one that never connects shall not wait for that at its end
    try:
        resolve_address(address)
        client.__init__(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
        client.status = "closed"
        what = f"there is no dask scheduler at {address} ({' '.join(str(error).split())})"
        raise InputError(
            f"{what}; start one with `dask scheduler --host 127.0.0.1`, and workers with `dask worker`"
        ) from error
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            client.close(timeout=1)


def _check_workers(client: Client, address: str, shared: Path) -> None:
    def asked(path: str) -> tuple[str, bool]:  # travels as code: a worker may lack this package
        import importlib  # noqa: PLC0415
        import pathlib  # noqa: PLC0415

        return importlib.import_module("skelgen").__version__, pathlib.Path(path).exists()

    found: dict[str, BaseException | tuple[str, bool]] = client.run(asked, str(shared), on_error="return")
    if not found:
        raise InputError(f"the scheduler at {address} has no workers; start some with `dask worker {address}`")
    for worker, answer in found.items():
        if isinstance(answer, BaseException):
            raise InputError(f"the worker {worker} cannot load skelgen ({answer}): install {skelgen.__version__} there")
        version, sees = answer
        if version != skelgen.__version__:
            what = f"the worker {worker} runs skelgen {version}, this is {skelgen.__version__}"
            raise InputError(f"{what}: install the same version on all machines")
        if not sees:
            what = f"the worker {worker} does not see {shared}"
            raise InputError(f"{what}: inputs and results must lie on storage that all machines share, at one path")


def _outcome(future: Future, entry: Entry, job: Job, address: str) -> Outcome:
    """What became of a take, or why that is not known."""
    from skelgen.app.batch.work import Outcome, blank_record, failed_record  # noqa: PLC0415 - as above

    if future.status == "finished":
        return cast(Outcome, future.result())
    if future.status == "error":
        error = future.exception()
        return Outcome(failed_record(entry, job, f"the cluster gave it up: {type(error).__name__}: {error}"))
    return Outcome(blank_record(entry, job), obstacle=f"the connection to the scheduler at {address} is lost")
