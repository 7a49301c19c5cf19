"""Tables as text: a header that names every column with its unit, and a line per row; files arrive whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from skelgen.files import replacing
from skelgen.model.arrays import Floats


def write_csv(path: Path, header: Sequence[str], rows: Iterable[str]) -> None:
    """Write a table.

    Parameters
    ----------
    path : Path
        The file, replaced as a whole.
    header : sequence of str
        Names of the columns, free of commas.
    rows : iterable of str
        Each with its line end.

    Raises
    ------
    WriteError
        If the file cannot be written.
    """
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(",".join(header) + "\n")
        stream.writelines(rows)


def write_motion(path: Path, header: Sequence[str], times: Floats, numbers: Floats) -> None:
    """Write a row per frame: number of the frame from 0, time [s], and numbers to the last digit.

    Parameters
    ----------
    path : Path
        The file.
    header : sequence of str, length n_columns
        Names of the numbers, with their units.
    times : ndarray, shape (n_frames,), s
        Time of each frame.
    numbers : ndarray, shape (n_frames, n_columns)
        The numbers.
    """
    row = "%d,%r" + ",%r" * numbers.shape[1] + "\n"
    frames = enumerate(zip(times.tolist(), numbers.tolist(), strict=True))
    write_csv(path, ["frame", "time_s", *header], (row % (frame, time, *values) for frame, (time, values) in frames))
