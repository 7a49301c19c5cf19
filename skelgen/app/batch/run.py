"""A batch from its plan to its end: takes go to workers, their records into the manifest and onto the page."""

import contextlib
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import cast
from urllib.parse import quote

from skelgen.app.batch.records import (
    DONE,
    FAILED,
    MANIFEST,
    Manifest,
    Record,
    clear_unfinished,
    earlier_names,
    manifest_of,
    read_json,
    write_json,
)
from skelgen.app.batch.takes import Entry, find_entries
from skelgen.app.batch.work import Job, Outcome, blank_record, check_formats
from skelgen.app.batch.workers import in_processes
from skelgen.app.drawing.wording import duration, millimetres
from skelgen.app.files import write_html
from skelgen.app.project_file.archive import SUFFIX
from skelgen.errors import InputError, SkelgenError, WriteError
from skelgen.progress import SILENT, Monitor, counted

Pool = Callable[[Job, Sequence[Entry]], Generator[Outcome, None, None]]
"""Runs all takes of a batch, and yields the outcome of each."""


@dataclass(frozen=True)
class BatchResult:
    """What became of a batch.

    Attributes
    ----------
    records : tuple of Record
        One per take, in the order of the takes.
    n_kept : int
        How many were finished before.
    manifest, page : Path
        What gathers them.
    """

    records: tuple[Record, ...]
    n_kept: int
    manifest: Path
    page: Path

    @property
    def n_done(self) -> int:
        """How many takes are done."""
        return sum(record["outcome"] == DONE for record in self.records)

    @property
    def failed(self) -> tuple[Record, ...]:
        """Records of takes that could not be done."""
        return tuple(record for record in self.records if record["outcome"] == FAILED)


def run_batch(
    inputs: Iterable[Path | str],
    output: Path | str,
    job: Job | None = None,
    *,
    pool: Pool | None = None,
    resume: bool = False,
    monitor: Monitor = SILENT,
) -> BatchResult:
    """Run the stages on many takes, and write the results of each into a folder of its own.

    Parameters
    ----------
    inputs : iterable of Path or str
        Files, folders and patterns, see `find_entries`.
    output : Path or str
        Folder of the batch; each take gets a folder in it.
    job : Job, optional
        What is done with each take; defaults if left out.
    pool : callable (job, entries) -> iterator of Outcome, optional
        Runs the takes; one process on this machine if left out.
    resume : bool
        Whether `output` may hold a batch: takes that are finished in it are kept.
    monitor : Monitor
        Receives the number of takes that are done, and a notice for each that fails; may cancel.

    Returns
    -------
    BatchResult
        Also if takes failed.

    Raises
    ------
    InputError
        If there is no take, or a batch without `resume`.
    WriteError
        If nothing can be written any more; finished takes are kept.
    """
    job, output = job or Job(), Path(output)
    check_formats(job.formats)
    manifest = _manifest_in(output, resume=resume)
    entries = find_entries(inputs, output, earlier_names(manifest))
    gathered = _Gathered(entries, job, output)
    clear_unfinished(output)
    created = [place for place in (manifest, output / PAGE, output, *output.parents) if not place.exists()]
    gathered.write()
    try:
        with contextlib.closing((pool or in_processes)(job, entries)) as outcomes:
            obstacle = gathered.add_all(outcomes, monitor)
    except SkelgenError:
        if not gathered.has_begun:
            _remove(created)  # there is no batch to be continued
        raise
    finally:
        if manifest.exists():
            gathered.end()
    if obstacle:
        raise gathered.stopped(obstacle)
    return gathered.result()


def _manifest_in(output: Path, *, resume: bool) -> Path:
    manifest = output / MANIFEST
    if manifest.exists() and not resume:
        raise InputError(f"{output} holds a batch: continue it with --resume, or take another folder")
    return manifest


def _remove(paths: Iterable[Path]) -> None:
    """Take away files and folders, the innermost first; a folder in which somebody else put something stays."""
    for path in paths:
        with contextlib.suppress(OSError):
            path.rmdir() if path.is_dir() else path.unlink()


def read_manifest(path: Path | str) -> Manifest:
    """Return the manifest of a batch, given the file or its folder.

    Raises
    ------
    InputError
        If there is none.
    """
    path = Path(path)
    file = path / MANIFEST if path.is_dir() else path
    manifest = read_json(file)
    if manifest is None or "takes" not in manifest:
        raise InputError(f"{file}: there is no manifest of a batch")
    return cast("Manifest", manifest)


class _Gathered:
    """Records of a batch as they come in."""

    def __init__(self, entries: Sequence[Entry], job: Job, output: Path) -> None:
        self._entries, self._job, self._output = entries, job, output
        self._records = {entry.name: blank_record(entry, job) for entry in entries}
        self._kept = 0
        self.has_begun = False

    def add_all(self, outcomes: Iterable[Outcome], monitor: Monitor) -> str:
        """Add outcomes as they come, report them, and return why the batch must stop; empty if it need not."""
        monitor.begin("takes")
        monitor.advance(0, len(self._entries))
        for outcome in outcomes:
            self.has_begun = True
            obstacle = self._add(outcome, monitor)
            if obstacle:
                return obstacle
        return ""

    def _add(self, outcome: Outcome, monitor: Monitor) -> str:
        record = outcome.record
        self._records[record["name"]] = record
        self._kept += outcome.kept
        if outcome.obstacle:
            return outcome.obstacle
        if record["outcome"] == FAILED:
            monitor.notice(f"{record['name']}: {record['error']}")
        n_over = sum(one["outcome"] in {DONE, FAILED} for one in self._records.values())
        monitor.advance(n_over, len(self._records))
        return ""

    def write(self) -> None:
        """Write manifest and page."""
        manifest = manifest_of(self._job.as_mapping(), self._records.values())
        write_json(manifest, self._output / MANIFEST)
        write_page(manifest, self._output / PAGE)

    def end(self) -> None:
        """Remove what stopped workers left, and write manifest and page; on a full disk the earlier ones stay."""
        for entry in self._entries:
            if self._records[entry.name]["outcome"] != DONE:
                clear_unfinished(Path(entry.folder))
        with contextlib.suppress(WriteError):
            self.write()

    def stopped(self, obstacle: str) -> WriteError:
        """Return the error that ends a batch which cannot go on."""
        n_done = sum(record["outcome"] == DONE for record in self._records.values())
        kept = f"{n_done} of {len(self._entries)} takes are finished and kept; continue with --resume"
        return WriteError(f"{obstacle.rstrip('.')}: the batch is stopped; {kept}")

    def result(self) -> BatchResult:
        """Return what became of it."""
        records = tuple(self._records.values())
        return BatchResult(records, self._kept, self._output / MANIFEST, self._output / PAGE)


PAGE = "index.html"

_COUNTS = ("markers", "limbs", "joints")
_LINKS = {"picture": ".svg", "report": ".html", "project": ".skelgen"}


def write_page(manifest: Manifest, path: Path) -> Path:
    """Write the page of a batch; it holds no times, so the same takes give the same page.

    Parameters
    ----------
    manifest : Manifest
        From `manifest_of`.
    path : Path
        The HTML file, in the folder of the batch.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    counts = manifest["counts"]
    parts = [f"{count} {outcome}" for outcome, count in counts.items() if count]
    sentence = f"{counted(sum(counts.values()), 'take')}: {', '.join(parts)}."
    rows = [_row(record) for record in manifest["takes"]]
    return write_html(__name__.rpartition(".")[0], path, sentence=sentence, columns=_COUNTS, rows=rows)


@dataclass(frozen=True)
class ResultRow:
    """What became of a take of a batch, for people.

    Attributes
    ----------
    source : str
        The recording.
    outcome, error, length, residual : str
        In words; the error is empty if there was none.
    notices : tuple of str
        What the steps noticed.
    project : Path or None
        The project file; None if there is none.
    """

    source: str
    outcome: str
    error: str
    length: str
    residual: str
    notices: tuple[str, ...]
    project: Path | None


def result_rows(result: BatchResult) -> tuple[ResultRow, ...]:
    """Return what became of each take of a batch, in the order of the takes."""
    rows = []
    for record in result.records:
        row = _row(record)
        file = next((name for name in record["files"] if name.endswith(SUFFIX)), None)
        project = None if file is None else result.page.parent / str(record["name"]) / file
        notices = tuple(map(str, record["facts"].get("notices", [])))
        outcome, error, length, residual = (str(row[key]) for key in ("outcome", "error", "length", "residual"))
        source = str(record["source"]["path"])
        rows.append(ResultRow(source, outcome, error, length, residual, notices, project))
    return tuple(rows)


def _row(record: Record) -> dict[str, object]:
    facts, name = record["facts"], record["name"]
    doubtful = f", doubtful: {', '.join(facts['doubtful'])}" if facts.get("doubtful") else ""
    row: dict[str, object] = {"name": name, "outcome": record["outcome"] + doubtful, "error": record["error"]}
    row |= {"notices": facts.get("notices", []), "counts": [facts.get(key, "–") for key in _COUNTS]}
    for kind, suffix in _LINKS.items():
        file = next((file for file in record["files"] if file.endswith(suffix)), None)
        row[kind] = quote(str(PurePosixPath(name) / file), errors="surrogateescape") if file else ""
    row["length"] = "–"
    if record["outcome"] == DONE:
        seconds = max(facts["frames"] - 1, 0) / facts["rate_hz"]
        row["length"] = f"{counted(facts['frames'], 'frame')}, {duration(seconds)}"
    residual = facts.get("residual_mm")
    row["residual"] = "–" if residual is None else millimetres(residual)
    row["is_failed"] = record["outcome"] == FAILED
    return row
