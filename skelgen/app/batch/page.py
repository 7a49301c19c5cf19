"""The page of a batch: one row and a small picture per take."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote

from skelgen.app.batch.records import DONE, FAILED, Record
from skelgen.app.pages import write_html
from skelgen.app.report.wording import counted, duration, millimetres

PAGE = "index.html"

_COUNTS = ("markers", "limbs", "joints")
_PICTURE = ".svg"
_REPORT = ".html"
_PROJECT = ".skelgen"


def write_page(manifest: Record, path: Path) -> Path:
    """Write the page of a batch; it holds no times, so the same takes give the same page.

    Parameters
    ----------
    manifest : dict
        From `manifest_of`.
    path : Path
        The HTML file, in the folder of the batch.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    return write_html(
        __name__.rpartition(".")[0],
        path,
        sentence=_sentence(manifest["counts"]),
        columns=_COUNTS,
        rows=[_row(record) for record in manifest["takes"]],
    )


def _sentence(counts: dict[str, int]) -> str:
    n_takes = sum(counts.values())
    parts = [f"{counts[outcome]} {outcome}" for outcome in counts if counts[outcome]]
    return f"{counted(n_takes, 'take')}: {', '.join(parts)}."


def _row(record: Record) -> dict[str, Any]:
    facts, name = record["facts"], record["name"]
    row = {"name": name, "outcome": record["outcome"], "error": record["error"]}
    row |= {"notices": facts.get("notices", []), "counts": [facts.get(key, "–") for key in _COUNTS]}
    row |= {kind: _link(record, suffix) for kind, suffix in _LINKS.items()}
    row["length"] = _length(facts) if record["outcome"] == DONE else "–"
    residual = facts.get("residual_mm")
    row["residual"] = "–" if residual is None else millimetres(residual)
    row["is_failed"] = record["outcome"] == FAILED
    return row


_LINKS = {"picture": _PICTURE, "report": _REPORT, "project": _PROJECT}


def _link(record: Record, suffix: str) -> str:
    """Address of a take's file, from the page; empty if there is none."""
    for file in record["files"]:
        if file.endswith(suffix):
            return quote(str(PurePosixPath(record["name"]) / file), errors="surrogateescape")
    return ""


def _length(facts: Record) -> str:
    frames = counted(facts["frames"], "frame")
    return f"{frames}, {duration(max(facts['frames'] - 1, 0) / facts['rate_hz'])}"
