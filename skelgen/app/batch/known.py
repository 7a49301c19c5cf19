"""The known skeleton of a batch: named when it begins, read once by each worker."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from skelgen.app.batch.job import KnownFile
from skelgen.app.known_skeleton import open_known
from skelgen.app.store import find_result
from skelgen.errors import InputError
from skelgen.files import sha256_of
from skelgen.model import Project


def known_file(path: Path | str) -> KnownFile:
    """Return the file of a known skeleton, checked.

    Parameters
    ----------
    path : Path or str
        A project file, or the folder of a run.

    Raises
    ------
    InputError
        If it holds no skeleton that could be applied.
    """
    open_known(path)
    file = find_result(Path(path)).absolute()
    return KnownFile(str(file), sha256_of(file))


@lru_cache(maxsize=1)
def known_of(file: KnownFile) -> Project:
    """Return the known skeleton of a batch; a worker reads it once.

    Raises
    ------
    InputError
        If it holds no skeleton, or is not the file with which the batch began.
    """
    known = open_known(file.path)
    if sha256_of(Path(file.path)) != file.sha256:
        raise InputError(f"{file.path}: is not the skeleton with which the batch began; begin it anew")
    return known
