"""The record of a take, which makes it finished, and the manifest of a batch, which gathers all records."""

import contextlib
import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath
from typing import Any, NotRequired, TypedDict

from skelgen.errors import FormatError, InputError, WriteError
from skelgen.files import UNFINISHED, replacing, sha256_of


class FileFacts(TypedDict):
    """Size and checksum of a file; of a recording its path, too. None where it could not be read."""

    path: NotRequired[str]
    bytes: int | None
    sha256: str | None


class Facts(TypedDict, total=False):
    """What the page of a batch shows of a take: counts, rate, mean residual, doubtful steps and notices."""

    frames: int
    rate_hz: float
    unlabelled: bool
    markers: int
    limbs: int
    joints: int
    residual_mm: float | None
    doubtful: list[str]
    notices: list[str]


class Run(TypedDict, total=False):
    """What differs from run to run: times, the machine, and the most memory that was held."""

    stages: dict[str, float]
    host: str
    seconds: float
    peak_bytes: int


class Record(TypedDict):
    """A take's record, as JSON keeps it.

    Attributes
    ----------
    name, outcome, error : str
        Of the take; `DONE`, `FAILED` or `WAITING`; why it failed, or empty.
    source : FileFacts
        The recording.
    job, skelgen : str
        Fingerprint of what was done, and the version of the program.
    facts : Facts
        What was found.
    files : dict of str to FileFacts
        What was written, by name.
    run : Run
        What differs from run to run.
    """

    name: str
    outcome: str
    error: str
    source: FileFacts
    job: str
    skelgen: str
    facts: Facts
    files: dict[str, FileFacts]
    run: Run


class Manifest(TypedDict):
    """All records of a batch, its job, and the number of takes with each outcome."""

    format: str
    version: int
    job: dict[str, object]
    counts: dict[str, int]
    takes: list[Record]


RECORD = "take.json"
MANIFEST = "manifest.json"

DONE, FAILED, WAITING = "done", "failed", "waiting"

_FORMAT = "skelgen batch"
_VERSION = 1
_MANY = 1e12  # more than any take has of anything


def write_json(data: Record | Manifest, path: Path) -> None:
    """Write a JSON file, whole or not at all.

    Parameters
    ----------
    data : Record or Manifest
        Plain values.
    path : Path
        The file.
    """
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="ascii")


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the object that a JSON file holds, unchecked; None if the file cannot be read or holds no object."""
    try:
        data = json.loads(path.read_text(encoding="ascii"))
    except (OSError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None


def files_of(paths: Iterable[Path]) -> dict[str, FileFacts]:
    """Return size and checksum of files by name."""
    return {path.name: {"bytes": path.stat().st_size, "sha256": sha256_of(path)} for path in sorted(paths)}


def finished_record(folder: Path, blank: Record) -> Record | None:
    """Return the record of a take if it is finished: same job, same recording, every file as it was written.

    Facts, files and times come from the file, all else from `blank`. A record that was altered counts as that of an
    unfinished take.

    Parameters
    ----------
    folder : Path
        Of the take.
    blank : Record
        Record of the take before it is done, with the checksum of its source.
    """
    record = read_json(folder / RECORD) or {}
    try:
        wanted = DONE, blank["job"], blank["source"]["sha256"]
        if (record["outcome"], record["job"], record["source"]["sha256"]) != wanted:
            return None
        paths = [folder / name for name in record["files"]]
        if not (paths and _are_facts(record["facts"]) and all(path.is_file() for path in paths)):
            return None
        if record["files"] != (files := files_of(paths)):
            return None
        known: Record = {**blank, "outcome": DONE, "files": files, "facts": record["facts"], "run": record["run"]}
        return known
    except (KeyError, TypeError, ValueError, AttributeError, OSError, FormatError):
        return None


def _are_facts(facts: Mapping[str, Any]) -> bool:
    """Whether facts have the types and ranges that the page needs."""
    counts = [facts["frames"], *(facts.get(name, 0) for name in ("markers", "limbs", "joints"))]
    residual = 0.0 if facts.get("residual_mm") is None else facts["residual_mm"]
    return (
        all(type(count) is int and 0 <= count < _MANY for count in counts)
        and all(isinstance(number, int | float) and 0 <= number < _MANY for number in (facts["rate_hz"], residual))
        and facts["rate_hz"] > 1 / _MANY
        and all(isinstance(words, str) for words in (*facts.get("doubtful", ()), *facts["notices"]))
    )


def clear(folder: Path) -> None:
    """Delete the record of an earlier run in a take's folder, then its files and what it did not finish.

    Files that no record names stay.

    Raises
    ------
    WriteError
        If it cannot be taken away.
    """
    record = read_json(folder / RECORD) or {}
    files = record.get("files")
    names = [name for name in files if PurePath(name).name == name] if isinstance(files, dict) else []
    try:
        (folder / RECORD).unlink(missing_ok=True)
        for path in [folder / name for name in names]:
            if path.is_file():
                path.unlink()
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


def manifest_of(job: Mapping[str, object], records: Iterable[Record]) -> Manifest:
    """Return the manifest of a batch.

    Parameters
    ----------
    job : mapping
        From `Job.as_mapping`.
    records : iterable of Record
        One per take.
    """
    takes = list(records)
    counts = {outcome: sum(one["outcome"] == outcome for one in takes) for outcome in (DONE, FAILED, WAITING)}
    return {"format": _FORMAT, "version": _VERSION, "job": dict(job), "counts": counts, "takes": takes}


def earlier_names(manifest: Path) -> dict[str, str]:
    """Return the folder names of takes by source that a manifest holds; an empty mapping if it is no manifest.

    Raises
    ------
    InputError
        If a name leads out of the folder of the batch.
    """
    takes = (read_json(manifest) or {}).get("takes")
    try:
        names = {take["source"]["path"]: take["name"] for take in takes or ()}
    except (KeyError, TypeError):
        return {}
    for name in names.values():
        if not (isinstance(name, str) and _stays_below(name)):
            what = f"a take is called {name!r}, which is no place in this folder; somebody altered the manifest"
            raise InputError(f"{manifest}: {what}: take another folder")
    return names


def _stays_below(name: str) -> bool:
    path = PurePath(name)
    return (
        not path.anchor and path.name != "" and ".." not in path.parts and path.as_posix() == name and "\0" not in name
    )
