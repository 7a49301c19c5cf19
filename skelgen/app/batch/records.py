"""The record of a take, which makes it finished, and the manifest of a batch, which gathers all records."""

import contextlib
import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skelgen.errors import WriteError
from skelgen.files import UNFINISHED, replacing, sha256_of

Record = dict[str, Any]
"""A take's record as plain JSON values; what differs from run to run stands under ``run`` alone."""

RECORD = "take.json"
MANIFEST = "manifest.json"

DONE, FAILED, WAITING = "done", "failed", "waiting"

_FORMAT = "skelgen batch"
_VERSION = 1


def write_json(data: Mapping[str, Any], path: Path) -> None:
    """Write a JSON file, whole or not at all.

    Parameters
    ----------
    data : mapping
        Plain values.
    path : Path
        The file.
    """
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="ascii")


def read_json(path: Path) -> Record | None:
    """Return what a JSON file holds, or None if it is none of an object."""
    try:
        data = json.loads(path.read_text(encoding="ascii"))
    except (OSError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None


def files_of(paths: Iterable[Path]) -> dict[str, dict[str, object]]:
    """Return size and checksum of files by name."""
    return {path.name: {"bytes": path.stat().st_size, "sha256": sha256_of(path)} for path in sorted(paths)}


def finished_record(folder: Path, fingerprint: str, source_sha256: str) -> Record | None:
    """Return the record of a take if it is finished: same job, same recording, every file as it was written.

    Parameters
    ----------
    folder : Path
        Of the take.
    fingerprint : str
        Of the job.
    source_sha256 : str
        Checksum of the take's file.
    """
    record = read_json(folder / RECORD)
    try:
        if record is None or (record["outcome"], record["job"]) != (DONE, fingerprint):
            return None
        if record["source"]["sha256"] != source_sha256:
            return None
        return record if record["files"] == files_of(folder / name for name in record["files"]) else None
    except (KeyError, TypeError, OSError):
        return None


def clear(folder: Path) -> None:
    """Take away what an earlier run left in a take's folder: its record first, its files, what it did not finish.

    Files that no record names stay.

    Raises
    ------
    WriteError
        If it cannot be taken away.
    """
    record = read_json(folder / RECORD) or {}
    files = record.get("files")
    names = [name for name in files if Path(name).name == name] if isinstance(files, dict) else []
    try:
        for name in (RECORD, *names):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from error
    clear_unfinished(folder)


def clear_unfinished(folder: Path) -> None:
    """Take away what a killed run did not finish in a folder; as far as possible."""
    with contextlib.suppress(OSError):
        for path in folder.glob(f"{UNFINISHED}*"):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


def manifest_of(job: Mapping[str, Any], records: Iterable[Record]) -> Record:
    """Return the manifest of a batch.

    Parameters
    ----------
    job : mapping
        From `Job.as_mapping`.
    records : iterable of dict
        One per take.
    """
    takes = list(records)
    counts = {outcome: sum(one["outcome"] == outcome for one in takes) for outcome in (DONE, FAILED, WAITING)}
    return {"format": _FORMAT, "version": _VERSION, "job": dict(job), "counts": counts, "takes": takes}


def earlier_names(manifest: Path) -> dict[str, str]:
    """Return the names of takes by source that a manifest holds; none if it is none."""
    takes = (read_json(manifest) or {}).get("takes")
    try:
        return {take["source"]["path"]: take["name"] for take in takes or ()}
    except (KeyError, TypeError):
        return {}
