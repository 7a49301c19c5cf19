"""BIDS motion: ``..._motion.tsv``, a table whose titles are in ``..._channels.tsv``, its rate in ``..._motion.json``.

Each row of the table of channels is a column: ``tracked_point``, ``component`` (x, y, z, quat_w, ...), ``type`` (POS,
ORNT, LATENCY, ...) and ``units``; the JSON holds ``SamplingFrequency`` [Hz]. With titles made of these the table is
read as `skelgen_formats.wide` does. See https://bids-specification.readthedocs.io, "Motion".
"""

import csv
import json
from collections.abc import Mapping
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.options import (
    ANGLE_ORDER,
    BODIES,
    MM_PER_UNIT,
    POINTS,
    RECORDED_RATE,
    RECORDED_UNIT,
    Format,
    Options,
)
from skelgen_formats.text import is_number
from skelgen_formats.wide import read_table

_SUFFIX, _CHANNELS, _DESCRIPTION = "_motion.tsv", "_channels.tsv", "_motion.json"
_RATES = ("SamplingFrequency", "SamplingFrequencyEffective")


def read_bids(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points or bodies of a recording.

    Parameters
    ----------
    path : Path
        The table of motion.
    options : Options
        As of a wide table.

    Raises
    ------
    FormatError
        If the table of channels is missing, or has another number of rows than the table of motion has columns.
    """
    rows = [line for _, line in read_lines(path).numbered()]
    if not _beside(path, _CHANNELS).is_file():
        raise FormatError(path, "", f"{_beside(path, _CHANNELS).name}, which names its columns, is not beside it")
    channels = [*csv.DictReader((line for _, line in read_lines(_beside(path, _CHANNELS)).numbered()), delimiter="\t")]
    cells = rows[0].split("\t")
    if len(channels) != len(cells):
        what = f"{len(cells)} columns, and {len(channels)} channels in {_beside(path, _CHANNELS).name}"
        raise FormatError(path, 1, what)
    has_titles = not any(is_number(cell.strip()) for cell in cells)
    head = f"frequency: {_rate(path)}\n" + "\t".join(map(_title, channels))
    text = "\n".join([head, *rows[has_titles:], ""])
    return read_table(path, Lines(path, text.encode(), "utf-8", options.sample), options)


def _beside(path: Path, suffix: str) -> Path:
    return path.with_name(path.name[: -len(_SUFFIX)] + suffix)


def _rate(path: Path) -> str:
    """Return the frame rate that is described, or an empty text."""
    try:
        described = json.loads("\n".join(line for _, line in read_lines(_beside(path, _DESCRIPTION)).numbered()))
        return str(next(described[key] for key in _RATES if key in described))
    except (FormatError, ValueError, TypeError, StopIteration, RecursionError):
        return ""


def _title(channel: Mapping[str, str | None]) -> str:
    """Return the title of a channel, as scripts write it."""
    what, point, part, unit, name = (
        (channel.get(key) or "").strip() for key in ("type", "tracked_point", "component", "units", "name")
    )
    axis, of_unit = part.lower()[-1:], f" [{unit}]" if unit in (*MM_PER_UNIT, "deg", "rad") else ""
    if what.upper() == "POS":
        return f"{point}_{axis}{of_unit}"
    if what.upper() == "ORNT":
        return f"{point}_q{axis}" if "quat" in part.lower() else f"{point}_euler_{axis}{of_unit}"
    return "time" if what.upper() == "LATENCY" else f"channel {name}".rstrip("xyzXYZ")


def _is_bids(head: bytes, path: Path) -> bool:
    first = decoded_head(head).lstrip().split("\t", 1)[0]
    return path.name.endswith(_SUFFIX) and (_beside(path, _CHANNELS).is_file() or is_number(first.strip()))


FORMAT = Format(
    name="bids-motion",
    title="BIDS motion",
    suffixes=(_SUFFIX,),
    holds="markers",
    sniff=_is_bids,
    read=read_bids,
    options=(POINTS, BODIES, RECORDED_RATE, RECORDED_UNIT, ANGLE_ORDER),
    note="Points, or bodies, of motion.tsv with channels.tsv and motion.json beside it, which hold titles and rate.",
)
