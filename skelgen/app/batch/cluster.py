"""Takes on the workers of an existing dask cluster; files lie on storage that all machines share."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import skelgen
from skelgen.app.batch.job import Job
from skelgen.app.batch.takes import Entry
from skelgen.app.batch.work import Outcome, blank_record, failed_record, work_on
from skelgen.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECTING = 10.0
"""s after which a scheduler that does not answer is not there."""


def on_cluster(job: Job, entries: Sequence[Entry], address: str, shared: Path) -> Generator[Outcome, None, None]:
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

    Raises
    ------
    InputError
        If there is no scheduler or worker, a worker has another version, or does not see the files.
    """
    with _connected(address) as client:
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
def _connected(address: str) -> Iterator[Client]:
    try:
        from distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(f"a scheduler needs dask ({error}): pip install 'skelgen[batch]'") from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in a sentence
    try:
        client = Client(address, timeout=CONNECTING, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
        what = f"there is no dask scheduler at {address} ({' '.join(str(error).split())})"
        raise InputError(f"{what}; start one with `dask scheduler`, and workers with `dask worker`") from error
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

    found: dict[str, Any] = client.run(asked, str(shared), on_error="return")
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
    if future.status == "finished":
        return cast(Outcome, future.result())
    if future.status == "error":
        error = future.exception()
        return Outcome(failed_record(entry, job, f"the cluster gave it up: {type(error).__name__}: {error}"))
    return Outcome(blank_record(entry, job), obstacle=f"the connection to the scheduler at {address} is lost")
