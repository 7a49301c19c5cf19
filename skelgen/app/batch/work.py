"""One take of a batch, from its file to its folder: what workers do, on this machine or on others."""

from __future__ import annotations

import contextlib
import errno
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from skelgen_formats.registry import find_format, write_file

import skelgen
from skelgen.app.batch.job import Job
from skelgen.app.batch.known import known_of
from skelgen.app.batch.records import (
    DONE,
    FAILED,
    RECORD,
    WAITING,
    Record,
    clear,
    clear_unfinished,
    files_of,
    finished_record,
    write_json,
)
from skelgen.app.batch.takes import Entry
from skelgen.app.configuration import Settings
from skelgen.app.export import REPORT
from skelgen.app.files import open_input
from skelgen.app.known_skeleton import apply_skeleton
from skelgen.app.monitors import CollectingMonitor
from skelgen.app.outputs import OUTPUTS, Output, write_outputs
from skelgen.app.pipeline import run_stages
from skelgen.errors import FormatError, SkelgenError, WriteError
from skelgen.files import sha256_of
from skelgen.model import PointCloud, Project
from skelgen.progress import SILENT

USUAL = (".skelgen", ".labels.c3d", ".limbs.csv", ".joints.csv", ".angles.csv")
"""Files of every take, by what follows the stem. The project holds all else: `skelgen convert`, `skelgen report`."""

PICTURE = ".svg"
_PICTURE_SIDE = 96.0  # px

_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO}
"""What no other take would fare better with: no space, no rights, a broken disk."""

_KIBI = 1024 if sys.platform != "darwin" else 1  # getrusage counts in KiB on Linux, in bytes on macOS


@dataclass(frozen=True)
class Outcome:
    """What became of one take.

    Attributes
    ----------
    record : dict
        Its record.
    kept : bool
        Whether it was finished before.
    obstacle : str
        Why no other take could be done either; empty if they can.
    peak : int, bytes
        Most memory that the worker has held.
    """

    record: Record
    kept: bool = False
    obstacle: str = ""
    peak: int = 0


def work_on(entry: Entry, job: Job) -> Outcome:
    """Do one take, unless it is finished; whatever is wrong with it becomes its record.

    Parameters
    ----------
    entry : Entry
        The take.
    job : Job
        What is done with it.
    """
    if job.version != skelgen.__version__:
        where = f"the worker on {socket.gethostname()} runs skelgen {skelgen.__version__}"
        obstacle = f"{where}, the batch {job.version}: install the same version on all machines"
        return Outcome(blank_record(entry, job), obstacle=obstacle)
    folder, started = Path(entry.folder), time.perf_counter()
    record = blank_record(entry, job)
    try:
        record["source"] = _source_facts(entry)
        finished = finished_record(folder, job.fingerprint, record["source"]["sha256"])
        if finished is not None:
            clear_unfinished(folder)
            return Outcome(finished, kept=True, peak=_peak())
        clear(folder)
        record |= _done(entry, job) | {"outcome": DONE}
    except SkelgenError as error:
        return _failed(record, folder, str(error), obstacle=str(error) if _is_of_disk(error) else "")
    except Exception as error:  # a bug must not cost the other takes
        return _failed(record, folder, f"internal error: {type(error).__name__}: {error} (a bug)")
    record["run"] |= {"seconds": time.perf_counter() - started, "peak_bytes": _peak()}
    try:
        write_json(record, folder / RECORD)
    except WriteError as error:
        return _failed(record, folder, str(error), obstacle=str(error))
    return Outcome(record, peak=_peak())


def blank_record(entry: Entry, job: Job) -> Record:
    """Return the record of a take that nothing is known of."""
    return {
        "name": entry.name,
        "outcome": WAITING,
        "error": "",
        "source": {"path": entry.source, "bytes": None, "sha256": None},
        "job": job.fingerprint,
        "skelgen": skelgen.__version__,
        "facts": {},
        "files": {},
        "run": {},
    }


def failed_record(entry: Entry, job: Job, error: str) -> Record:
    """Return the record of a take that could not be done; its folder stays as it is."""
    return blank_record(entry, job) | {"outcome": FAILED, "error": " ".join(error.split())}


def check_formats(names: Sequence[str]) -> None:
    """Raise `WriteError` if a name is not that of a format that can be written."""
    for name in names:
        if name != REPORT.name and find_format(name).write is None:
            raise WriteError(f"the format {name} can only be read")


def _failed(record: Record, folder: Path, error: str, obstacle: str = "") -> Outcome:
    failed = record | {"outcome": FAILED, "error": " ".join(error.split()), "facts": {}, "files": {}}
    with contextlib.suppress(WriteError):  # the manifest says it too
        write_json(failed, folder / RECORD)
    return Outcome(failed, obstacle=obstacle, peak=_peak())


def _source_facts(entry: Entry) -> Record:
    path = Path(entry.source)
    try:
        return {"path": entry.source, "bytes": path.stat().st_size, "sha256": sha256_of(path)}
    except OSError as error:
        raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error


def _done(entry: Entry, job: Job) -> Record:
    """Run the stages and write the files; facts, files, and times."""
    project = open_input(entry.source, job.format_name, job.seed, **job.reader_options)
    settings = Settings(job.settings)
    if job.skeleton is None:
        project = run_stages(project, until_stage=job.until, settings=settings, wishes=job.wishes)
    else:
        project = apply_skeleton(project, known_of(job.skeleton), settings=settings)
    seconds = {name: report.seconds for name, report in project.reports.items()}
    timeless = {name: replace(report, seconds=0.0) for name, report in project.reports.items()}
    project = replace(project, reports=timeless)  # the same take gives the same bytes, whenever and wherever
    said = CollectingMonitor(SILENT)
    files = write_outputs(project, entry.folder, entry.stem, outputs=_outputs(job), monitor=said)
    facts = _facts(project, said.notices)
    return {"facts": facts, "files": files_of(files), "run": {"stages": seconds, "host": socket.gethostname()}}


def _outputs(job: Job) -> list[Output]:
    usual = [output for output in OUTPUTS if output.suffix in USUAL]
    return [*usual, Output(PICTURE, "skeleton", _write_picture), *[_output_of(name) for name in job.formats]]


def _output_of(name: str) -> Output:
    if name == REPORT.name:
        return next(output for output in OUTPUTS if output.suffix in REPORT.suffixes)
    return Output(find_format(name).suffixes[0], "", lambda project, path: write_file(project, path, name))


def _write_picture(project: Project, path: Path) -> None:
    from skelgen.app.report.figure_pose import small_figure  # noqa: PLC0415 - the report's templates take time to load

    path.write_text(small_figure(project, _PICTURE_SIDE), encoding="utf-8", errors="replace")


def _facts(project: Project, notices: Sequence[str]) -> Record:
    """What the page of the batch shows of a take."""
    take = project.take
    spoken = [*take.notices, *[line for report in project.reports.values() for line in report.notices], *notices]
    facts: Record = {"frames": take.n_frames, "rate_hz": take.rate, "unlabelled": isinstance(take, PointCloud)}
    if project.has("labels"):
        facts["markers"] = project.trajectories.n_markers
    if project.has("limbs"):
        facts["limbs"] = project.limbs.n_limbs
    if project.has("joints"):
        facts["joints"] = project.topology.n_joints
    if project.has("skeleton"):
        residuals = project.motion.residuals
        known = residuals[~np.isnan(residuals)]
        facts["residual_mm"] = float(known.mean()) if len(known) else None
    return facts | {"notices": list(dict.fromkeys(spoken))}


def _is_of_disk(error: SkelgenError) -> bool:
    cause = error.__cause__
    return isinstance(error, WriteError) and isinstance(cause, OSError) and cause.errno in _DISK


def _peak() -> int:
    """Most memory that this process has held [bytes]; 0 where that is not told."""
    if sys.platform == "win32":
        return 0
    import resource  # noqa: PLC0415 - there is none on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _KIBI
