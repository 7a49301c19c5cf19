"""Tables of points in Parquet: wide ones, and tidy ones or tables of vectors, which are read as their texts are."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError, MissingPackageError
from skelgen.files import open_regular
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats
from skelgen_formats.clock_titles import Clock
from skelgen_formats.lines import Lines
from skelgen_formats.options import ANGLE_ORDER, POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.tidy import read_tidy
from skelgen_formats.tidy_heads import find_tidy_head
from skelgen_formats.time_stamps import Stamps, since_first
from skelgen_formats.title_lines import in_one_line
from skelgen_formats.vectors import read_vector_lines
from skelgen_formats.wide import chosen_columns, take_from_rows

_MOST_TIMES, _FREE_MEMORY = 100, 1 << 24  # what a file may hold, beside its size, in bytes


def read_parquet(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read a table of points or bodies.

    Parameters
    ----------
    path, options
        See `skelgen_formats.wide.read_table`, of which the errors are, too.

    Raises
    ------
    MissingPackageError
        If pyarrow is not installed.
    """
    try:
        from pyarrow import ArrowException, parquet  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise MissingPackageError(f"{path}: Parquet needs `pip install skelgen-mocap[tables]`") from error
    with open_regular(path) as stream:
        try:
            file = parquet.ParquetFile(stream)
            titles = list(file.schema_arrow.names)
            head = in_one_line([titles])
            wanted = chosen_columns(head, options) if head else []
            clocks = [head.clock.column, *(column for column, _ in head.clock.others)] if head and head.clock else []
            names = [titles[column] for column in [*wanted, *clocks]] or titles
            twice = [name for name in names if titles.count(name) > 1]
            if twice:
                raise FormatError(path, "", f"two columns are called {twice[0]}")
            size = 8 * file.metadata.num_rows * len(names)
            if size > _MOST_TIMES * path.stat().st_size + _FREE_MEMORY:
                raise FormatError(path, "", f"announces {size} bytes of numbers, far more than such a file holds")
            table: Any = file.read(names)
            if head is None:
                return _of_text(path, table, options)
            numbers = np.stack([_numbers(path, table.column(name)) for name in names], axis=1)
        except (ArrowException, OSError, ValueError) as error:
            raise FormatError(path, "", f"no Parquet file, or damaged: {' '.join(str(error).split())}") from error
    frames = np.arange(len(numbers))
    sampled = options.sample.of(frames) if options.sample else frames
    times = _stamps(numbers[:, len(wanted) :], head.clock) if head.clock else None
    return take_from_rows(path, numbers[sampled, : len(wanted)], head, times, options)


def _of_text(path: Path, table: Any, options: Options) -> Trajectories | PointCloud | Poses:
    """Return the take of a table with a row per point, or with a vector per cell."""
    lines = Lines(path, "\n".join(_rows(table)).encode(), "utf-8")
    if find_tidy_head(lines) is not None:
        return read_tidy(path, lines, options)
    try:
        return read_vector_lines(path, lines, options)
    except FormatError as error:
        raise FormatError(path, "", "no columns such as name_x, name_y, name_z; name them so") from error


def _rows(table: Any) -> Iterator[str]:
    """Yield the lines of a table, cells parted by tabs."""
    yield "\t".join(table.column_names)
    for row in zip(*(column.to_pylist() for column in table.columns), strict=True):
        yield "\t".join("" if cell is None else " ".join(str(cell).split()) for cell in row)


def _stamps(columns: Floats, clock: Clock) -> Stamps:
    """Return the times in a column, with what other columns add to it."""
    whole = since_first(columns[:, 0], clock.second)
    added = clock.added(columns[:, 0], [*columns.T[1:]])
    return Stamps(whole.since + (added - added[:1]), whole.are_seconds)


def _numbers(path: Path, column: Any) -> Floats:
    try:
        return np.asarray(column.to_numpy(), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FormatError(path, "", "a column of coordinates does not hold numbers") from error


FORMAT = Format(
    name="wide-parquet",
    title="Table of points, Parquet",
    suffixes=(".parquet",),
    holds="markers",
    sniff=lambda head, path: head.startswith(b"PAR1"),
    read=read_parquet,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT, ANGLE_ORDER),
    note="Columns as in wide-csv, tidy-csv or vector-csv. Needs the extra `tables`.",
)
