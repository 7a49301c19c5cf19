"""One take of a batch: what is done with it (`Job`), and the work from its file to its folder on any machine."""

import contextlib
import dataclasses
import errno
import hashlib
import json
import socket
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from skelgen_formats.registry import find_format, write_file

import skelgen
from skelgen.app.batch import records
from skelgen.app.batch.takes import Entry
from skelgen.app.configuration import Settings
from skelgen.app.constraints import RunOptions
from skelgen.app.export import REPORT
from skelgen.app.files import NamedFile, open_input
from skelgen.app.outputs import OUTPUTS, Output, write_outputs
from skelgen.app.pipeline import CollectingMonitor, run_stages
from skelgen.app.project_file.archive import find_result
from skelgen.app.stage_summary import has_doubts, stage_notices
from skelgen.app.subject import joined_subjects, run_with_subject
from skelgen.errors import InputError, SkelgenError, WriteError, out_of_memory
from skelgen.files import sha256_of
from skelgen.model import PointCloud, Project
from skelgen.model.project import STAGES
from skelgen.parameters import ParameterValue
from skelgen.progress import SILENT


@dataclass(frozen=True)
class SubjectFile:
    """The project file of a subject: a calibrated skeleton that is applied to all takes.

    Attributes
    ----------
    path : str
        Path of the project; on a cluster all machines see it there.
    sha256 : str
        Checksum of its content: all takes of one batch have the same skeleton.
    """

    path: str
    sha256: str


@dataclass(frozen=True)
class Job:
    """What is done with every take.

    Attributes
    ----------
    settings : mapping of str to mapping
        Parameters that somebody wants otherwise, by stage.
    options : RunOptions
        Known numbers and trees; each take is done in one process.
    seed : int or None
        Seed of every take; None for that of a project, or 0.
    until : str or None
        Last stage; None for the last of all.
    format_name : str or None
        Format in which all takes are read; None finds it for each.
    reader_options : mapping of str to value
        Options of the readers.
    formats : tuple of str
        Formats that are written beside the usual files.
    subjects : tuple of SubjectFile
        Calibrated skeletons by which all takes are labelled and posed, one for each body that they show; none find the
        skeleton of each take.
    version : str
        Version of skelgen that all workers must have: results of two would not be those of either.
    """

    settings: Mapping[str, Mapping[str, ParameterValue]] = field(default_factory=dict)
    options: RunOptions = field(default_factory=RunOptions)
    seed: int | None = None
    until: str | None = None
    format_name: str | None = None
    reader_options: Mapping[str, ParameterValue] = field(default_factory=dict)
    formats: tuple[str, ...] = ()
    subjects: tuple[SubjectFile, ...] = ()
    version: str = skelgen.__version__

    def as_mapping(self) -> dict[str, object]:
        """Return all of it as plain values, as the manifest names them."""
        data = dataclasses.asdict(self)
        options = {name: value for name, value in data.pop("options").items() if value != ()}
        subjects = data.pop("subjects")  # one stands by itself, as in batches of earlier versions
        return data | {"options": options, "skeleton": subjects if len(subjects) > 1 else next(iter(subjects), None)}

    @property
    def fingerprint(self) -> str:
        """Hash of the job, the same as in earlier versions, so that their batches can be continued."""
        data = self.as_mapping()
        text = json.dumps(data | {"wishes": data.pop("options")}, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()


def subject_files(paths: Sequence[Path | str]) -> tuple[SubjectFile, ...]:
    """Return the project files of subjects after checking that they hold skeletons.

    Parameters
    ----------
    paths : sequence of Path or str
        Project files, or folders of runs; one for each body that the takes show.

    Raises
    ------
    InputError
        If one holds no skeleton that could be applied.
    """
    if paths:
        joined_subjects(paths)
    files = [find_result(Path(path)).absolute() for path in paths]
    return tuple(SubjectFile(str(file), sha256_of(file)) for file in files)


@lru_cache(maxsize=1)
def subject_in(files: tuple[SubjectFile, ...]) -> Project:
    """Read the subject of a batch, or its subjects as one; a worker does so once.

    Raises
    ------
    InputError
        If a file holds no skeleton, or is not the one with which the batch began.
    """
    subject = joined_subjects([file.path for file in files])
    for file in files:
        if sha256_of(Path(file.path)) != file.sha256:
            raise InputError(f"{file.path}: is not the skeleton with which the batch began; begin it anew")
    return subject


SUFFIXES = (".skelgen", ".labels.c3d", ".limbs.csv", ".joints.csv", ".angles.csv")
"""Files of every take, by what follows the stem. The project holds all else: `skelgen convert`, `skelgen report`."""


_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO}
"""Errors that every other take would meet, too: no space, no rights, a broken disk."""

_KIBI = 1024 if sys.platform != "darwin" else 1  # getrusage counts in KiB on Linux, in bytes on macOS


@dataclass(frozen=True)
class Outcome:
    """What became of one take.

    Attributes
    ----------
    record : Record
        Its record.
    kept : bool
        Whether it was finished before.
    obstacle : str
        Why no other take could be done either; empty if they can.
    peak : int, bytes
        Most memory that the worker has held.
    """

    record: records.Record
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
        finished = records.finished_record(folder, record)
        if finished is not None:
            records.clear_unfinished(folder)
            return Outcome(finished, kept=True, peak=_peak())
        records.clear(folder)
        record["facts"], record["files"], record["run"] = _done(entry, job)
        record["outcome"] = records.DONE
    except SkelgenError as error:
        obstacle = str(error) if _is_of_disk(error) else ""
        return _failed(record, folder, out_of_memory(error) or str(error), obstacle)
    except Exception as error:  # a bug must not cost the other takes
        why = out_of_memory(error) or f"internal error: {type(error).__name__}: {error} (a bug)"
        return _failed(record, folder, why)
    record["run"] |= {"seconds": time.perf_counter() - started, "peak_bytes": _peak()}
    try:
        records.write_json(record, folder / records.RECORD)
    except WriteError as error:
        return _failed(record, folder, str(error), obstacle=str(error))
    return Outcome(record, peak=_peak())


def blank_record(entry: Entry, job: Job) -> records.Record:
    """Return the record of a take that is not begun.

    Parameters
    ----------
    entry : Entry
        The take.
    job : Job
        What is done with it.
    """
    return {
        "name": entry.name,
        "outcome": records.WAITING,
        "error": "",
        "source": {"path": entry.source, "bytes": None, "sha256": None},
        "job": job.fingerprint,
        "skelgen": skelgen.__version__,
        "facts": {},
        "files": {},
        "run": {},
    }


def failed_record(entry: Entry, job: Job, error: str) -> records.Record:
    """Return the record of a take that could not be done; its folder stays as it is.

    Parameters
    ----------
    entry : Entry
        The take.
    job : Job
        What was to be done with it.
    error : str
        Why it could not be done.
    """
    return blank_record(entry, job) | {"outcome": records.FAILED, "error": " ".join(error.split())}


def check_formats(names: Sequence[str]) -> None:
    """Raise `WriteError` if no format of that name can be written."""
    for name in names:
        if name != REPORT.name and find_format(name).write is None:
            raise WriteError(f"the format {name} can only be read")


def _failed(record: records.Record, folder: Path, error: str, obstacle: str = "") -> Outcome:
    failed = record | {"outcome": records.FAILED, "error": " ".join(error.split()), "facts": {}, "files": {}}
    with contextlib.suppress(WriteError):  # the manifest says it too
        records.write_json(failed, folder / records.RECORD)
    return Outcome(failed, obstacle=obstacle, peak=_peak())


def _source_facts(entry: Entry) -> records.FileFacts:
    path = Path(entry.source)
    checksum = sha256_of(path)
    return {"path": entry.source, "bytes": path.stat().st_size, "sha256": checksum}


def _done(entry: Entry, job: Job) -> tuple[records.Facts, dict[str, records.FileFacts], records.Run]:
    """Run the stages and write the files; facts, files, and times."""
    project = open_input(NamedFile(Path(entry.source), job.format_name, job.reader_options), job.seed)
    settings = Settings(job.settings)
    if job.subjects:
        project = run_with_subject(project, subject_in(job.subjects), settings=settings)
    else:
        project = run_stages(project, until_stage=job.until, settings=settings, options=job.options)
    seconds = {name: report.seconds for name, report in project.reports.items()}
    timeless = {name: replace(report, seconds=0.0) for name, report in project.reports.items()}
    project = replace(project, reports=timeless)  # the same take gives the same bytes, whenever and wherever
    collecting = CollectingMonitor(SILENT)
    outputs = [output for output in OUTPUTS if output.suffix in SUFFIXES]
    outputs += [Output(".svg", "skeleton", _write_picture), *map(_output_of, job.formats)]
    files = write_outputs(project, entry.folder, entry.stem, outputs=outputs, monitor=collecting)
    facts = _facts(project, collecting.notices)
    return facts, records.files_of(files), {"stages": seconds, "host": socket.gethostname()}


def _output_of(name: str) -> Output:
    if name == REPORT.name:
        return next(output for output in OUTPUTS if output.suffix in REPORT.suffixes)
    return Output(find_format(name).suffixes[0], "", lambda project, path: write_file(project, path, name))


def _write_picture(project: Project, path: Path) -> None:
    from skelgen.app.report.skeleton import small_figure  # noqa: PLC0415 - the report's templates take time to load

    path.write_text(small_figure(project, 96.0), encoding="utf-8", errors="replace")


def _facts(project: Project, notices: Sequence[str]) -> records.Facts:
    """What the page of the batch shows of a take."""
    take = project.take
    every = [*take.notices, *[line for stage in project.reports for line in stage_notices(project, stage)], *notices]
    facts: records.Facts = {"frames": take.n_frames, "rate_hz": take.rate, "unlabelled": isinstance(take, PointCloud)}
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
    doubtful = [stage for stage in STAGES if has_doubts(project, stage)]
    return facts | {"doubtful": doubtful, "notices": list(dict.fromkeys(every))}


def _is_of_disk(error: SkelgenError) -> bool:
    cause = error.__cause__
    return isinstance(error, WriteError) and isinstance(cause, OSError) and cause.errno in _DISK


def _peak() -> int:
    """Most memory that this process has held [bytes]; 0 where the system does not say."""
    if sys.platform == "win32":
        return 0
    import resource  # noqa: PLC0415 - there is none on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _KIBI
