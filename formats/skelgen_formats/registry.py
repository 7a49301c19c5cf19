"""Every file format that skelgen knows, declared once.

Each format module declares one `Format`; the command line's help, the table of the docs and the file dialogs are
generated from `FORMATS`. A file is recognised by its content first and by its suffix second.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skelgen.errors import FormatError, WriteError
from skelgen.files import read_content
from skelgen.geometry.frame_rate import with_rate
from skelgen.geometry.keypoints import keypoint_evidence
from skelgen.geometry.up_axis import with_up_axis
from skelgen.model import Take, Trajectories
from skelgen.model.arrays import check_rate
from skelgen.model.takes import BoneMotion
from skelgen.progress import SILENT, Monitor
from skelgen_formats import (
    acclaim,
    arrays,
    bids,
    bvh,
    c3d,
    cal3d,
    classic_texts,
    classic_xml,
    csm,
    dtrack,
    emt,
    gltf,
    json_points,
    mfml,
    mjcf,
    motion_csv,
    motive,
    mvnx,
    named_rows,
    nexus,
    opensim,
    parquet_tables,
    poses_csv,
    qualisys,
    qualisys_mat,
    summary_json,
    tables,
    tdf,
    tidy,
    tracking_tools,
    trc,
    untitled,
    untitled_points,
    urdf,
    usd,
    vectors,
    wide,
    xml_points,
)
from skelgen_formats.bone_profiles import with_bone_names
from skelgen_formats.foreign import is_foreign as foreign
from skelgen_formats.foreign import no_file, table_hint
from skelgen_formats.lines import Sample
from skelgen_formats.options import ALL_POINTS, AUTO, KEYPOINTS, POINTS, Format, Options, OptionValue, Writable
from skelgen_formats.rest_pose import with_rest_pose
from skelgen_formats.writing import table_of, turn_wished

SNIFF_BYTES = 1 << 16
"""How much of a file's beginning the sniffers are shown: several lines of titles over hundreds of columns."""

_EARLIER_NAMES = {"seed-xml": "classic-xml"}  # of formats in skelgen 0.1, which scripts may still use


FORMATS: tuple[Format, ...] = (
    *(c3d.C3D, trc.FORMAT, csm.FORMAT, bids.FORMAT, qualisys.FORMAT, motive.FORMAT, nexus.FORMAT, mvnx.FORMAT),
    *(arrays.FORMAT, json_points.FORMAT),
    *(qualisys_mat.FORMAT, tdf.FORMAT, emt.FORMAT, dtrack.FORMAT, tracking_tools.FORMAT),
    *(motion_csv.JOINTS_CSV, motion_csv.ANGLES_CSV, tables.CSV, tables.PARQUET, c3d.C3D_JOINTS, poses_csv.FORMAT),
    *(classic_xml.FORMAT, cal3d.FORMAT, opensim.FORMAT, urdf.FORMAT, mjcf.FORMAT, bvh.FORMAT, acclaim.FORMAT),
    *(gltf.FORMAT, usd.FORMAT, summary_json.FORMAT, tidy.FORMAT, wide.CSV, parquet_tables.FORMAT, vectors.FORMAT),
    *(untitled.FORMAT, mfml.FORMAT, classic_texts.LIMBS, classic_texts.COSTS, classic_texts.TREE),
    *(untitled_points.FORMAT, named_rows.FORMAT, xml_points.FORMAT),
)
"""All formats, in the order in which they are sniffed: the most particular content first."""


def known_formats() -> tuple[Format, ...]:
    """Return all formats in the order in which they are sniffed."""
    return FORMATS


def find_format(name: str) -> Format:
    """Return the format called `name`, or raise `WriteError` that lists the names."""
    for entry in known_formats():
        if entry.name == _EARLIER_NAMES.get(name, name):
            return entry
    names = ", ".join(entry.name for entry in known_formats())
    raise WriteError(f"there is no format {name!r}; formats are {names}")


def recognise(path: Path) -> Format:
    """Return the readable format of a file, by content first and suffix second.

    Raises
    ------
    FormatError
        If the file cannot be opened, is empty, or nothing matches.
    """
    head = read_content(path, SNIFF_BYTES)
    if not head:
        raise FormatError(path, "", "the file is empty")
    if sentence := no_file(head):
        raise FormatError(path, "", f"this is {sentence}")
    readable = [entry for entry in known_formats() if entry.read is not None]
    for entry in readable:
        if entry.sniff(head, path):
            return entry
    alike = [entry for entry in readable if path.name.lower().endswith(entry.suffixes)]
    if len(alike) == 1:
        return alike[0]
    if sentence := foreign(head, path):
        raise FormatError(path, "", f"this is {sentence}")
    for entry in known_formats():
        if entry.read_motion is not None and path.name.lower().endswith(entry.suffixes):
            hint = f"`skelgen simulate --motion {path.name}` puts markers on them"
            raise FormatError(path, "", f"{entry.title} holds bones, not markers; {hint}")
    names = ", ".join(f"{entry.name} ({' '.join(entry.suffixes)})" for entry in alike or readable)
    hint = f"; {hint}" if (hint := table_hint(head)) else ""
    raise FormatError(path, "", f"neither content nor suffix belongs to a known format; known are {names}{hint}")


def read_take(
    path: Path | str, format_name: str | None = None, *, sample: Sample | None = None, **options: OptionValue
) -> Take:
    """Read a take from a file of any registered format.

    Parameters
    ----------
    path : Path or str
        The file.
    format_name : str, optional
        Skip the recognition and read as this format.
    sample : Sample, optional
        Some frames of a large file only, if its reader can do that; what they do not tell is read whole.
    **options
        Options of the format's reader by name; unknown ones are errors.

    Raises
    ------
    FormatError
        If the file is not what its format demands.
    """
    path = Path(path)
    entry = find_format(format_name) if format_name else recognise(path)
    if entry.read is None:
        raise FormatError(path, "", f"the format {entry.name} can only be written")
    chosen = options_of(entry, options, reading=True)
    take = _sampled(entry.read, path, replace(chosen, sample=sample)) or entry.read(path, chosen)
    return with_kind(take, chosen.points) if POINTS in entry.options else take


def _sampled(read: Callable[[Path, Options], Take], path: Path, options: Options) -> Take | None:
    """Return a take of some frames of a large file; None if it is not large, or only the whole file tells enough."""
    if options.sample is None or path.stat().st_size <= options.sample.above:
        return None
    try:
        return read(path, options)
    except FormatError:
        options.sample.n_left_out, options.sample.rate = 0, None
        return None


def with_kind(take: Take, points: str) -> Take:
    """Return a take whose points are told to be markers or keypoints, or to be markers without exception.

    Parameters
    ----------
    take : PointCloud, Trajectories or Poses
        As it was read.
    points : str
        One of `POINTS.choices`.
    """
    if not isinstance(take, Trajectories) or points not in (AUTO, KEYPOINTS, ALL_POINTS):
        return take
    if points == ALL_POINTS:
        return replace(take, are_all_wanted=True)
    why = "as was stated" if points == KEYPOINTS else keypoint_evidence(take.names, take.positions)
    notice = f"the points are keypoints, which sit on joints: {why}; bones between them become the skeleton"
    notice += " (`--points markers` takes them as markers on limbs)"
    return replace(take, are_keypoints=True, notices=(*take.notices, notice)) if why else take


def write_file(
    value: Writable,
    path: Path | str,
    format_name: str | None = None,
    *,
    monitor: Monitor = SILENT,
    **options: OptionValue,
) -> list[Path]:
    """Write a project, a take or filled markers in the format named or of the suffix, and return the files written.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What to write.
    path : Path or str
        The file.
    format_name : str, optional
        Name of the format; that of the suffix if left out.
    monitor : Monitor
        Shows progress; may cancel, which leaves what was there before.
    **options
        Options of the format's writer by name; unknown ones are errors.

    Raises
    ------
    WriteError
        If no writer belongs to the suffix, or the format cannot hold the value.
    ParameterError
        If the value of an option is not allowed.
    """
    path = Path(path)
    entry = format_for_writing(path, format_name)
    return write_as(entry, value, path, options_of(entry, options), monitor)


def write_as(entry: Format, value: Writable, path: Path, options: Options, monitor: Monitor = SILENT) -> list[Path]:
    """Write in a format that is found already.

    Parameters
    ----------
    entry : Format
        The format.
    value : Project, PointCloud, Trajectories, Poses or Filled
        What to write.
    path : Path
        The file.
    options : Options
        From `options_of`.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the format is only read, or cannot hold the value.
    """
    if entry.write is None:
        raise WriteError(f"the format {entry.name} can only be read")
    monitor.begin(f"writing {path.name}")
    value = with_bone_names(with_rest_pose(value, options.rest), options.bone_names)
    options = replace(options, axes=turn_wished(value, options, entry.up))
    entry.write(with_up_axis(with_rate(value, options.rate), options.axes), path, options, monitor)
    return list(entry.files(path, options))


def format_for_writing(path: Path, format_name: str | None = None) -> Format:
    """Return the format that a file is written in: that of the name, or that of the suffix.

    Parameters
    ----------
    path : Path
        The file; `.poses.csv` says more than `.csv`.
    format_name : str, optional
        Name of the format.

    Raises
    ------
    WriteError
        If there is none.
    """
    if format_name:
        return find_format(format_name)
    name = path.name.lower()
    writable = [entry for entry in known_formats() if entry.write is not None]
    pairs = [(len(suffix), entry) for entry in writable for suffix in entry.suffixes if name.endswith(suffix)]
    if pairs:
        return max(pairs, key=lambda pair: pair[0])[1]  # .poses.csv says more than .csv
    suffixes = " ".join(suffix for entry in writable for suffix in entry.suffixes)
    page = "; `skelgen report` writes a page of the results" if name.endswith((".html", ".htm")) else ""
    raise WriteError(f"{path}: no format is written with this suffix; there are {suffixes}{page}")


def options_of(entry: Format, given: Mapping[str, object], *, reading: bool = False) -> Options:
    """Return the options of a writer, or of a reader: what the user gave, and the format's defaults for the rest.

    Parameters
    ----------
    entry : Format
        The format.
    given : mapping of str to value
        Values, or their texts, by the names of options.
    reading : bool
        Whether these are the options of the reader.

    Raises
    ------
    WriteError
        If the format has no such option.
    ParameterError
        If a value is not allowed.
    """
    defaults = {option.name: option.default for option in entry.options}
    return Options(**(defaults | checked_options(entry, given, reading=reading)))


def checked_options(entry: Format, given: Mapping[str, object], *, reading: bool = False) -> dict[str, Any]:
    """Return what the user gave in the declared types; errors as `options_of`.

    Parameters
    ----------
    entry : Format
        The format.
    given : mapping of str to value
        Options that the user gave.
    reading : bool
        Whether for reading or for writing.
    """
    declared = {option.name: option for option in entry.options if (option.reading if reading else option.writing)}
    for name in given:
        if name not in declared:
            raise WriteError(f"the format {entry.name} has no option {name!r}; it has {', '.join(declared) or 'none'}")
    where = f"the format {entry.name}"
    return {name: declared[name].declaration.check(value, where) for name, value in given.items()}


def read_motion(
    path: Path | str, skeleton: Path | str | None = None, unit: str = AUTO, rate: float | None = None
) -> BoneMotion:
    """Read a motion of bones; the suffix tells the format.

    Parameters
    ----------
    path : Path or str
        The file.
    skeleton : Path or str, optional
        File of the bones, for formats that keep them apart; by default looked for in the same folder.
    unit : str
        Unit of lengths where the file states none: mm, cm, m, in, a number of mm, or auto.
    rate : float, Hz, optional
        Frame rate, where the file states none or a wrong one.

    Raises
    ------
    FormatError
        If the file is not a motion, or damaged; with the line.
    ParameterError
        If an option does not belong to the format.
    """
    path = Path(path)
    motions = [entry for entry in known_formats() if entry.read_motion is not None]
    for entry in motions:
        if entry.read_motion is not None and path.name.lower().endswith(entry.suffixes):
            motion = entry.read_motion(path, Path(skeleton) if skeleton else None, unit)
            return motion if rate is None else replace(motion, rate=check_rate(rate, path.name))
    known = ", ".join(f"{entry.title} ({' '.join(entry.suffixes)})" for entry in motions)
    raise FormatError(path, "", f"no motion of bones is known by this suffix; there are {known}")


def marking_sentence(entry: Format, path: Path) -> str:
    """Say how filled positions differ from measured ones in a file, for the user who exports it.

    Parameters
    ----------
    entry : Format
        A format that offers `FILLED`.
    path : Path
        The file of markers.
    """
    table = table_of(path).name
    if entry.filled_mark:
        return f"{path.name}: {entry.filled_mark}; {table} says from what they are filled and how surely"
    return f"{path.name}: {entry.title} cannot mark filled positions; {table} beside it says which they are"


COLUMNS = ("name", "title", "suffixes", "holds", "read", "write", "options", "note")
"""Titles of the table's columns."""


def formats_table() -> list[tuple[str, ...]]:
    """Return one row of texts per format, in the order of `COLUMNS`."""
    return [format_row(entry) for entry in known_formats()]


def format_row(entry: Format) -> tuple[str, ...]:
    """Return the texts of one format, in the order of `COLUMNS`."""
    return (
        entry.name,
        entry.title,
        " ".join(entry.suffixes),
        entry.holds,
        "yes" if entry.read else "as motion" if entry.read_motion else "",
        "yes" if entry.write else "",
        ", ".join(option.name for option in entry.options),
        entry.note,
    )
