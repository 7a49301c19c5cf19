"""Exports: every format that a project can be written in, what it keeps of this project, and the writing itself."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from skelgen_formats import registry
from skelgen_formats.bone_profiles import remarks_on_bone_names
from skelgen_formats.options import AUTO, FILLED, Format, Options, Writable
from skelgen_formats.rest_pose import remarks_on_rest
from skelgen_formats.writing import PARTS, choices_in, parts_in, trajectories_of

from skelgen.app.bodies import BODY, body_files
from skelgen.app.limb_names import with_segment_names
from skelgen.app.outputs import check_outputs, recording_of
from skelgen.errors import SkelgenError, WriteError
from skelgen.files import arriving_together
from skelgen.geometry.frame_rate import n_frames_at
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import PointCloud, Poses, Project
from skelgen.model.filled import Filled
from skelgen.progress import SILENT, Monitor, counted, listed


def _write_report(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    from skelgen.app.report import write_report  # noqa: PLC0415 - its templates take time to load

    value = value.measured if isinstance(value, Filled) else value
    write_report(value if isinstance(value, Project) else Project(value), path, monitor)


REPORT = Format(
    name="report",
    title="Report, HTML",
    suffixes=(".html",),
    holds="report",
    write=_write_report,
    keeps=tuple(part.name for part in PARTS),
    note="One page with figures and tables of everything that was found, for reading and printing.",
    marks_open="dashed rings, and words in the table of joints",
)
"""What can be written beside the registered formats."""


@dataclass(frozen=True)
class Preview:
    """What an export will do.

    Attributes
    ----------
    files : tuple of Path
        What will be written; files that are there are replaced.
    contents : str
        What of the project will be in them, with its counts, e.g. ``45 markers in 2000 frames (20 s)``; of several
        bodies in files of their own for each file.
    remarks : tuple of str
        Sentences on what the format cannot hold, and on what becomes of the rest.
    obstacle : str
        Why it cannot be done; empty if it can.
    """

    files: tuple[Path, ...] = ()
    contents: str = ""
    remarks: tuple[str, ...] = ()
    obstacle: str = ""


def export_formats() -> tuple[Format, ...]:
    """Return every format that can be written, and the report."""
    return (*(entry for entry in registry.known_formats() if entry.write is not None), REPORT)


def obstacle_to(project: Project, entry: Format, options: Mapping[str, object]) -> str:
    """Return one sentence on why a project cannot be written in a format; empty if it can.

    Parameters
    ----------
    project, entry, options
        As for `export_project`.
    """
    try:
        entry.check(project, registry.options_of(entry, options))
    except SkelgenError as error:
        return str(error)
    return ""


def export_path(folder: Path, name: str, entry: Format) -> Path:
    """Return the path of an export, from which the format makes the names of its files.

    Parameters
    ----------
    folder : Path
        Where the files go.
    name : str
        Beginning of their names.
    entry : Format
        One of `export_formats`.

    Raises
    ------
    WriteError
        If the name cannot be that of a file.
    """
    if not name.strip() or any(character in name for character in "/\\\0"):
        raise WriteError(f"{name!r} cannot be the name of a file: it is empty or holds a slash")
    return folder / (name + entry.suffixes[0])


def preview_export(project: Project, entry: Format, path: Path, options: Mapping[str, object]) -> Preview:
    """Tell what `export_project` will do, without doing it.

    Parameters
    ----------
    project : Project
        What will be written.
    entry : Format
        In which format, one of `export_formats`.
    path : Path
        From `export_path`.
    options : mapping of str to value
        Options of the format's writer.
    """
    try:
        chosen = registry.options_of(entry, options)
        parts = body_files(with_segment_names(project, chosen.bone_names), path)
        for part, _ in parts:
            entry.check(part, chosen)
        written = [file for _, target in parts for file in entry.files(target, chosen)]
        check_outputs(written, (recording_of(project),), written)
    except SkelgenError as error:
        return Preview(obstacle=str(error))
    contents = [_contents(part, entry, chosen.rate) for part, _ in parts]
    if len(parts) > 1:
        contents = [f"{name.name}: {one}" for (_, name), one in zip(parts, contents, strict=True)]
    return Preview(tuple(written), "; ".join(contents), remarks_on_parts(parts, entry, chosen))


def turn_upright(entry: Format, up: str) -> str:
    """Return the choice of axes that turns the upward axis of a recording to that of a format.

    Parameters
    ----------
    entry : Format
        One of `export_formats` that says which axis is up.
    up : str
        What is up in the recording: ``x``, ``y`` or ``z``.
    """
    if up == entry.up:
        return AS_RECORDED
    return f"{up}-to-{entry.up}" if f"{up}-to-{entry.up}" in TURNS else AUTO


def remarks_on(project: Project, entry: Format, path: Path, options: Options) -> tuple[str, ...]:
    """Return sentences on what a format cannot hold of a project, and on what becomes of the rest.

    Parameters
    ----------
    project, entry, path, options
        As for `export_project`.
    """
    marking = (registry.marking_sentence(entry, path) + ".",) if options.filled else ()
    lost = [part.title for part in parts_in(project) if part.name not in entry.keeps]
    losses = (f"{entry.title} cannot hold {listed(lost)}.",) if lost else ()
    choices = choices_in(project) if "joints" in entry.keeps or entry.marks_open else ()
    if choices and not entry.marks_open:
        what = "has no place to say that of its joints: write a summary (summary-json) beside it, which does"
        choices = (*choices, f"{entry.title} {what}.")
    called = remarks_on_bone_names(with_segment_names(project, options.bone_names), options.bone_names)
    resting = remarks_on_rest(project, options.rest)
    return (
        *losses,
        *entry.remarks(project, options),
        *_remark_on_bodies(project, entry, path),
        *called,
        *resting,
        *choices,
        *marking,
    )


def _remark_on_bodies(project: Project, entry: Format, path: Path) -> tuple[str, ...]:
    """How to write each body by itself, where several share a file of skeletons."""
    n_bodies = len(project.bodies) if entry.holds == "skeleton" and project.has("joints") else 1
    stem, dot, suffix = path.name.partition(".")
    apart = f"the name {stem}_{BODY}{dot}{suffix} writes each to a file of its own"
    return (f"{n_bodies} bodies share this file; {apart}.",) if n_bodies > 1 else ()


def remarks_on_parts(parts: Sequence[tuple[Project, Path]], entry: Format, options: Options) -> tuple[str, ...]:
    """Return the sentences of `remarks_on` on files that are written together.

    Parameters
    ----------
    parts : sequence of (Project, Path)
        What is written to which file; see `skelgen.app.bodies.body_files`.
    entry, options
        As for `export_project`.

    Returns
    -------
    tuple of str
        A sentence that holds for all files is there once; others begin with the name of their file.
    """
    remarks = [remarks_on(part, entry, target, options) for part, target in parts]
    are_alike = len({target.name for _, target in parts}) < len(parts)
    files = [f"{target.parent.name}/{target.name}" if are_alike else target.name for _, target in parts]
    every = [(file, one) for file, some in zip(files, remarks, strict=True) for one in some]
    sentences = (one if all(one in some for some in remarks) else f"{file}: {one}" for file, one in every)
    return tuple(dict.fromkeys(sentences))


def export_project(
    project: Project, entry: Format, path: Path, options: Mapping[str, object], monitor: Monitor = SILENT
) -> list[Path]:
    """Write a project; all files of the format arrive together, or none.

    Parameters
    ----------
    project : Project
        What is written.
    entry : Format
        In which format, one of `export_formats`.
    path : Path
        From `export_path`.
    options : mapping of str to value
        Options of the format's writer.
    monitor : Monitor
        Receives progress; may cancel, which leaves what was there before.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    WriteError
        If the format cannot hold the project, or its files cannot be written.
    """
    chosen = registry.options_of(entry, options)
    parts = body_files(with_segment_names(project, chosen.bone_names), path)
    planned = [file for _, target in parts for file in entry.files(target, chosen)]
    check_outputs(planned, (recording_of(project),), planned)
    with ExitStack() as arriving:
        folders = dict.fromkeys(target.parent for _, target in parts)
        temporary = {folder: arriving.enter_context(arriving_together(folder)) for folder in folders}
        return [
            target.parent / file.name
            for part, target in parts
            for file in registry.write_as(entry, part, temporary[target.parent] / target.name, chosen, monitor)
        ]


def _contents(project: Project, entry: Format, rate: float) -> str:
    kept = [part for part in parts_in(project) if part.name in entry.keeps]
    names = {part.name for part in kept}
    take = project.take
    counts = []
    if "points" in names and isinstance(take, PointCloud):
        counts.append(counted(take.n_points, "point"))
    elif names & {"markers", "names"}:
        counts.append(counted(trajectories_of(project, entry.title).n_markers, "marker"))
    if "bodies" in names and isinstance(take, Poses):
        counts.append(counted(take.n_bodies, "body", "bodies"))
    if names & {"limbs", "motion"}:
        counts.append(counted(project.limbs.n_limbs, "limb"))
    if names & {"joints", "angles", "kinds"}:
        counts.append(counted(project.skeleton.n_joints, "joint"))
    n_frames = n_frames_at(take.n_frames, take.rate, rate)
    frames = f" in {counted(n_frames, 'frame')} at {rate or take.rate:g} Hz"
    return listed(counts) + (frames if any(part.in_every_frame for part in kept) else "")


def write_filled(filled: Filled, path: Path) -> tuple[list[Path], str]:
    """Write complete markers in the format of the suffix, and a table with a row per filled position.

    Parameters
    ----------
    filled : Filled
        From `skelgen.fill`.
    path : Path
        File for markers, e.g. ``walk.c3d``.

    Returns
    -------
    tuple of list of Path and str
        The files, and a sentence on how they mark filled positions.

    Raises
    ------
    WriteError
        If a file cannot be written, or no format for markers has the suffix.
    """
    entry = registry.format_for_writing(path)
    if FILLED not in entry.options:
        raise WriteError(f"{path}: {entry.name} holds the {entry.holds} and no markers; write c3d, trc or csm")
    return registry.write_file(filled, path, filled=True), registry.marking_sentence(entry, path)
