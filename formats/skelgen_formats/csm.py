"""CSM: the marker file of Character Studio (the Biped of 3ds Max).

Layout, text; keywords begin with ``$``, in any case, and may stand in any order before ``$Points``::

    $Date 07/18/00            and $Time, $Filename, $Actor: optional, ignored
    $Comments                 free text up to the next keyword
    Motion capture
    $FirstFrame 1             number of the first frame
    $LastFrame 149            number of the last frame
    $SpineLinks 4             spine bones that the importing Biped gets; optional, says nothing of the markers
    $Rate 120.0               frames per second
    $Order                    marker names, separated by blanks, over one or more lines
    LFWT LBWT RBWT
    $Points                   one line per frame: its number, then x y z of every marker in that order
    1  115.438 -93.475 1083.692  DROPOUT  -155.031 81.281 1096.477

A dropout is the word ``DROPOUT`` in place of the three numbers; some programs write it three times, once per
number, and some write three zeros. All are read; one word is written, or zeros on request. The format states no
unit and no names with blanks: numbers are taken as mm, z up, and blanks in names are written as underscores. Written
numbers have as many digits as give the same float64 back.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.files import replacing
from skelgen.model import PointCloud, Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.progress import Monitor, with_progress
from skelgen_formats import writing
from skelgen_formats.lines import Lines, Sample, decoded_head, read_lines
from skelgen_formats.markers import scaled, take_from_markers, uncut, zeros_unseen
from skelgen_formats.options import AXES, FILLED, POINTS, RATE, UNIT, Format, Option, Options, Writable, per_mm
from skelgen_formats.text import count_in, first_in, parse_rows, rate_in, stated_in

_TITLE = "CSM"
_DROPOUT = "DROPOUT"
_SPINE_LINKS = 4  # what a new Biped has; the importer needs a number, and markers do not determine one
_MM = 1.0
_KNOWN_FIRST = ("$comments", "$firstframe", "$lastframe", "$spinelinks", "$rate", "$order", "$points")

_Sections = dict[str, tuple[int, list[str]]]  # keyword -> line number and its words


def read_csm(path: Path, sample: Sample | None = None) -> Trajectories | PointCloud:
    """Read a Character Studio marker file.

    Parameters
    ----------
    path : Path
        The file.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    Trajectories
        Positions in mm; or a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If a keyword is missing, a line has the wrong number of numbers, or frames are missing between others.
    """
    lines = read_lines(path, sample)
    sections, first = _sections(path, lines)
    _, names = stated_in(path, sections, "$order")
    notices: list[str] = []
    rows, numbers = _frames(path, lines, first, len(names), notices)
    begin = count_in(path, *first_in(path, sections, "$firstframe"), "$FirstFrame")
    end = count_in(path, *first_in(path, sections, "$lastframe"), "$LastFrame")
    if numbers and numbers[0] != begin:
        raise FormatError(path, first + 1, f"the first frame has number {numbers[0]}; $FirstFrame says {begin}")
    rows = uncut(lines, rows, end - begin + 1, notices)
    positions = zeros_unseen(rows.reshape(len(rows), len(names), 3))
    rate = rate_in(path, *first_in(path, sections, "$rate"), "$Rate")
    return take_from_markers(path, scaled(path, positions, _MM), names, rate, notices)


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write labelled markers as a Character Studio marker file."""
    markers = writing.markers_to_write(value, _TITLE, options.filled, monitor)
    take = writing.positions_of(markers)
    names = writing.check_writable_names(path, take.names, "", _clean)
    gap = _DROPOUT if options.dropout == "word" else "0 0 0"
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(_header_text(take, names, options.unit))
        frames = with_progress(take.positions * per_mm(options.unit), take.n_frames, monitor)
        for number, row in enumerate(frames, start=1):
            words = (gap if math.isnan(x) else f"{x!r} {y!r} {z!r}" for x, y, z in row.tolist())
            stream.write(f"{number}  " + "  ".join(words) + "\n")
    writing.write_table(markers, path)


def _clean(name: str) -> str:
    return "_".join(name.split()).lstrip("$")


def _sections(path: Path, lines: Lines) -> tuple[_Sections, int]:
    """Return the keywords before the points, and the index of the first line of points."""
    sections: _Sections = {}
    words: list[str] = []
    for number, line in lines.numbered():
        if line.lstrip().startswith("$"):
            keyword, *rest = line.split()
            if keyword.lower() == "$points":
                return sections, number
            words = list(rest)
            sections[keyword.lower()] = (number, words)
        else:
            words.extend(line.split())
    raise FormatError(path, len(lines), "there is no $Points: this is no CSM file or it is cut off")


def _frames(path: Path, lines: Lines, first: int, n_markers: int, notices: list[str]) -> tuple[Floats, list[int]]:
    """Return positions, shape (n_frames, 3 n_markers), and the frame numbers; a line that is cut off is left out."""
    numbers: list[int] = []

    def checked() -> Iterator[tuple[int, str]]:
        for number, line in lines.rows(first):
            if number == len(lines) and len(line.split()) + 2 * line.upper().count(_DROPOUT) < 3 * n_markers + 1:
                notices.append(f"line {number}, the last, is cut off and left out")
                return
            numbers.append(count_in(path, number, line.split(None, 1)[0], "the frame number"))
            if len(numbers) > 1 and numbers[-1] != numbers[-2] + 1 and not lines.is_sampled:
                raise FormatError(path, number, f"frame {numbers[-1]} follows frame {numbers[-2]}; a line is missing")
            dropped = _DROPOUT in line.upper()
            yield number, _without_dropouts(path, line.split(), number, n_markers) if dropped else line

    rows = parse_rows(path, checked(), 3 * n_markers + 1, None, leading=1)
    if numbers and numbers[-1] - numbers[0] + 1 != lines.count(rows):
        raise FormatError(path, "", "frames are missing; where, only the whole file tells")
    return rows, numbers


def _without_dropouts(path: Path, words: list[str], line: int, n_markers: int) -> str:
    """Return a frame's line with every dropout as three NaN."""
    n_words = len(words) - 1
    dropped = sum(word.upper() == _DROPOUT for word in words)
    if n_words == 3 * n_markers:
        once = 1
    elif n_words + 2 * dropped == 3 * n_markers:
        once = 3
    else:
        found = f"{n_words + 1 - dropped} numbers and {dropped} dropouts"
        raise FormatError(path, line, f"{found} where {3 * n_markers + 1} numbers belong")
    return " ".join(" nan" * once if word.upper() == _DROPOUT else word for word in words)


def _header_text(take: Trajectories, names: Sequence[str], unit: str) -> str:
    frames = f"$FirstFrame 1\n$LastFrame {take.n_frames}\n$SpineLinks {_SPINE_LINKS}\n$Rate {take.rate!r}\n"
    comment = f"$Comments\nMarker positions in {unit}, written by skelgen\n"
    return f"{comment}\n{frames}\n$Order\n{' '.join(names)}\n\n$Points\n"


def _sniff(head: bytes, path: Path) -> bool:
    words = decoded_head(head).lower().split()
    return bool(words) and words[0].startswith("$") and any(keyword in words for keyword in _KNOWN_FIRST)


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    names = writing.trajectories_of(project, _TITLE).names
    blanks = [name for name in names if name != _clean(name)]
    without_unit = f"The file does not say its unit: lengths are in {options.unit}."
    if not blanks:
        return (without_unit,)
    return without_unit, f"Names are written without blanks, such as {blanks[0]!r} as {_clean(blanks[0])!r}."


DROPOUT = Option("dropout", "word", "How an unseen marker is written.", ("word", "zero"), reading=False)

FORMAT = Format(
    name="csm",
    title="Character Studio marker file",
    suffixes=(".csm",),
    holds="markers",
    sniff=_sniff,
    read=lambda path, options: read_csm(path, options.sample),
    write=_write,
    check=lambda value, options: writing.check_markers(value, _TITLE, options.filled),
    files=lambda path, options: writing.marker_files(path, options.filled),
    keeps=("markers", "names"),
    remarks=_remarks,
    options=(DROPOUT, POINTS, AXES, UNIT, RATE, FILLED),
    note="No unit in the file: mm; dropouts as the word DROPOUT or as zeros; blanks in names become underscores.",
)
