"""Any file that the program reads or writes: registered formats, stereo recordings, the project file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path

from skelgen_formats import registry
from skelgen_formats.capture_settings import write_settings
from skelgen_formats.lines import Sample
from skelgen_formats.options import Format, Option

from skelgen.app.bodies import body_files
from skelgen.app.corrections import with_identities
from skelgen.app.inputs import with_checked_arguments
from skelgen.app.limb_names import with_segment_names
from skelgen.app.outputs import check_outputs, files_of, recording_of
from skelgen.app.project_file import archive
from skelgen.errors import FormatError, InputError, WriteError
from skelgen.files import read_content, replacing
from skelgen.model import PointCloud, Poses, Project, Take, Trajectories
from skelgen.model.filled import Filled
from skelgen.model.rig import AnySettings, RoomSettings
from skelgen.parameters import ParameterValue
from skelgen.progress import SILENT, Monitor

PROJECT_FORMAT = "skelgen"
"""Name of the project file among the formats."""

_PROJECT_NOTE = "Take and results of all stages, exactly; every stage resumes from it."
_PROJECT_ROW = (PROJECT_FORMAT, "skelgen project", archive.SUFFIX, "everything", "yes", "yes", "", _PROJECT_NOTE)


@dataclass(frozen=True)
class NamedFile:
    """A file as the user names it.

    Attributes
    ----------
    path : Path
        Where it is.
    format : str or None
        Name of its format; None recognises it.
    options : mapping of str to value
        Options of the format's reader or writer.
    """

    path: Path
    format: str | None = None
    options: Mapping[str, ParameterValue] = field(default_factory=dict)


def open_input(
    file: NamedFile | Path | str,
    seed: int | None = None,
    identities: Path | None = None,
    *,
    monitor: Monitor = SILENT,
    sample: Sample | None = None,
) -> Project:
    """Open what every stage starts from: a take in any format, or a project file with its results.

    Parameters
    ----------
    file : NamedFile, Path or str
        The file; where no format is named, it is found by content first and suffix second. A folder stands for the
        project in it.
    seed : int, optional
        Seed of the project; by default that of the project file, or 0 for a take.
    identities : Path, optional
        File of identities stated by hand; by default those of the project file.
    monitor : Monitor
        Receives progress where reading takes long; may cancel.
    sample : Sample, optional
        Some frames of a large file only.

    Returns
    -------
    Project
        A bare one for a take.

    Raises
    ------
    FormatError
        If the file is not what its format demands.
    """
    file = file if isinstance(file, NamedFile) else NamedFile(Path(file))
    path, format, options = file.path, file.format, file.options
    if format == PROJECT_FORMAT or (format is None and archive.is_project_file(path)):
        if options:
            raise InputError(f"{path}: a project file is read without options, not with {', '.join(options)}")
        project = archive.open_project(archive.find_result(path))
        return with_identities(replace(project, seed=project.seed if seed is None else seed), identities)
    if is_stereo(path, format):
        taken = _read_stereo(path, **registry.checked_options(STEREO, options, reading=True), monitor=monitor)
        return with_identities(Project(taken, seed or 0), identities)
    take = registry.read_take(path, format, sample=sample, **options)
    source = archive.recorded_file_of(path, format or registry.recognise(path).name, options)
    return with_identities(Project(take, seed or 0, source=source), identities)


@with_checked_arguments
def write(
    value: Project | Take | Filled | AnySettings,
    path: Path | str,
    format: str | None = None,
    **options: ParameterValue,
) -> list[Path]:
    """Write a project, a take, filled markers or settings of a capture; the file appears whole or not at all.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses, Filled, CaptureSettings or RoomSettings
        What to write.
    path : Path or str
        The file; its format comes from `format` or the suffix. ``{body}`` in its name or in that of a folder writes
        each body of a project to a file of its own, as ``walk_{body}.bvh`` to ``walk_body1.bvh`` and
        ``walk_body2.bvh``.
    format : str, optional
        Format to write; ``skelgen formats`` lists them. ``skelgen`` is the project file.
    **options
        Options of the format's writer, e.g. ``unit``, ``axes``, ``rate``.

    Returns
    -------
    list of Path
        The files written: more than one for formats that come in pairs.

    Raises
    ------
    WriteError
        If no format belongs to the suffix, the format cannot hold the value, or the file cannot be written; if it is
        the recording of the project, or what the format puts beside a new file would replace another.

    Examples
    --------
    >>> import skelgen
    >>> skelgen.write(skelgen.simulate("rods", n_frames=100).take, "rods.trc", unit="cm")
    [PosixPath('rods.trc')]
    """
    recording = recording_of(value) if isinstance(value, Project) else None
    parts = body_files(with_segment_names(value, options.get("bone_names")), Path(path))
    for _, target in parts:
        files = files_of(target, format, options)
        check_outputs(files, (recording,), files if target.exists() else (target,))
    return [file for part, target in parts for file in write_any(part, target, format, **options)]


def write_any(
    value: Project | Take | Filled | AnySettings,
    path: Path | str,
    format: str | None = None,
    **options: ParameterValue,
) -> list[Path]:
    """Write as `write` does, over files that are there: callers have checked that they may.

    Parameters
    ----------
    value, path, format, **options
        As of `write`.
    """
    if isinstance(value, AnySettings):
        write_settings(value, Path(path))
        return [Path(path)]
    if isinstance(value, Filled):
        return registry.write_file(value, path, format, monitor=SILENT, **{"filled": True, **options})
    if not isinstance(value, Project | PointCloud | Trajectories | Poses):
        raise InputError(f"{value!r:.60} is no project, take, filled markers or settings; nothing else is written")
    if _is_project(path, format):
        if options:
            raise WriteError(f"{path}: a project file is written without options, not with {', '.join(options)}")
        return [archive.save_project(value if isinstance(value, Project) else Project(value), path)]
    return registry.write_file(value, path, format, monitor=SILENT, **options)


def _is_project(path: Path | str, format: str | None) -> bool:
    return format == PROJECT_FORMAT or (format is None and Path(path).suffix.lower() == archive.SUFFIX)


def convert_file(source: NamedFile, target: NamedFile, monitor: Monitor = SILENT) -> tuple[tuple[str, ...], list[Path]]:
    """Read one file and write another.

    Parameters
    ----------
    source : NamedFile
        What is read; its options are the reader's, also where the writer has one of the same name.
    target : NamedFile
        What is written; options that its format does not know are the reader's, and an error if that knows none either.
    monitor : Monitor
        Receives progress where reading takes long; may cancel.

    Returns
    -------
    notices : tuple of str
        What reader and writer did that the user should know.
    files : list of Path
        The files written.
    """
    written = set() if _is_project(target.path, target.format) else _writer_options(target)
    read = {name for name in _option_names(source.format or name_of_format(source.path)) if name not in written}
    for_reader = {name: value for name, value in target.options.items() if name in read} | dict(source.options)
    project = open_input(replace(source, options=for_reader), monitor=monitor)
    target = replace(target, options={name: value for name, value in target.options.items() if name not in read})
    value = project if project.has("labels") else project.take
    parts = body_files(with_segment_names(value, target.options.get("bone_names")), target.path)
    for _, path in parts:
        planned = files_of(path, target.format, target.options)
        check_outputs(planned, (recording_of(project),), planned)
    files = [file for part, path in parts for file in write_any(part, path, target.format, **target.options)]
    remarked = [(part, path) for part, path in parts if isinstance(part, Project)] or [(project, target.path)]
    read_now = () if _is_project(archive.find_result(source.path), source.format) else project.take.notices
    return (*read_now, *_remarks(remarked, target)), files


def _writer_options(target: NamedFile) -> set[str]:
    entry = registry.format_for_writing(target.path, target.format)
    return {option.name for option in entry.options if option.writing}


def _remarks(parts: Sequence[tuple[Project, Path]], target: NamedFile) -> tuple[str, ...]:
    """What becomes of projects in another format; a project file keeps all."""
    from skelgen.app.export import remarks_on_parts  # noqa: PLC0415 - loads the report

    if _is_project(target.path, target.format):
        return ()
    entry = registry.format_for_writing(target.path, target.format)
    return remarks_on_parts(parts, entry, registry.options_of(entry, target.options))


def name_of_format(path: Path) -> str:
    """Return the name of the format in which a file is read."""
    if archive.is_project_file(path):
        return PROJECT_FORMAT
    return STEREO.name if is_stereo(path) else registry.recognise(path).name


def readable_formats() -> tuple[Format, ...]:
    """Return all formats that takes are read from: those of files, and the stereo recording."""
    return (*(entry for entry in registry.known_formats() if entry.read is not None), STEREO)


def format_rows() -> list[dict[str, str]]:
    """Return one row per format, keys as in `skelgen_formats.registry.COLUMNS`; the project file comes last."""
    return [
        dict(zip(registry.COLUMNS, row, strict=True))
        for row in (*registry.formats_table(), registry.format_row(STEREO), _PROJECT_ROW)
    ]


def file_filter() -> str:
    """Return what a file dialog offers to open: everything that is read, then each format by itself."""
    readable = [(entry.title, entry.suffixes) for entry in readable_formats()]
    readable.append((_PROJECT_ROW[1], (archive.SUFFIX,)))
    everything = " ".join(dict.fromkeys(f"*{suffix}" for _, suffixes in readable for suffix in suffixes))
    single = [f"{title} ({' '.join(f'*{suffix}' for suffix in suffixes)})" for title, suffixes in readable]
    return ";;".join((f"Recordings and projects ({everything})", *single, "All files (*)"))


def _option_names(format_name: str) -> set[str]:
    if format_name == PROJECT_FORMAT:
        return set()
    entry = STEREO if format_name == STEREO.name else registry.find_format(format_name)
    return {option.name for option in entry.options if option.reading}


# The root of capture settings, behind what XML allows before it; nothing that has matched is tried anew.
_BEFORE_ROOT = rb"(?>\s+|<\?(?>.*?\?>)|<!--(?>.*?-->)|<!DOCTYPE[^>]*+>)*+"
_ROOT = re.compile(rb"(?:\xef\xbb\xbf)?" + _BEFORE_ROOT + rb"<capture[\s>/]", re.DOTALL)


def _read_stereo(path: Path | str, source: str = "", frames: int = 0, *, monitor: Monitor = SILENT) -> PointCloud:
    """Turn all images of a stereo recording into unlabelled points.

    Parameters
    ----------
    path : Path or str
        Settings of the capture.
    source : str
        Where images come from; empty takes what the settings say.
    frames : int
        Pairs of images at most; 0 takes all.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    PointCloud
        See `skelgen.capture.markers.markers_of`.

    Raises
    ------
    FormatError
        If the settings are not what they must be.
    SkelgenError
        If there is no source, it breaks off, or its images do not belong to the settings.
    """
    from skelgen.app.capture import source_of  # noqa: PLC0415 - numba takes a second
    from skelgen.app.room import read_capture_settings  # noqa: PLC0415
    from skelgen.capture.markers import markers_of  # noqa: PLC0415
    from skelgen.capture.room.recording import markers_of_room  # noqa: PLC0415

    path = Path(path)
    settings = read_capture_settings(path)
    images = source_of(settings, source)
    if isinstance(settings, RoomSettings):
        return markers_of_room(settings, images, n_frames=frames or None, name=path.name, monitor=monitor)
    return markers_of(settings, images, n_frames=frames or None, name=path.name, monitor=monitor)


def is_stereo(path: Path | str, format: str | None = None) -> bool:
    """Whether a file is read as a stereo recording.

    Parameters
    ----------
    path : Path or str
        A file; settings of a capture are known by their first bytes.
    format : str, optional
        Name of the format if the user gave one.
    """
    if format is not None:
        return format == STEREO.name
    try:
        return _sniff(read_content(Path(path), registry.SNIFF_BYTES), Path(path))
    except FormatError:
        return False  # who reads it next says why it cannot be read


def _sniff(head: bytes, path: Path) -> bool:
    return _ROOT.match(head) is not None


STEREO = Format(
    name="stereo",
    title="stereo recording",
    suffixes=(".xml",),
    holds="points",
    sniff=_sniff,
    read=lambda path, options: _read_stereo(path),
    options=(
        Option("source", "", "where images come from; empty takes what the settings say"),
        Option("frames", 0, "pairs of images at most; 0 takes all", low=0),
    ),
    note="Settings of a capture: the balls in its images become points.",
)
"""Read by the application and not by the formats, because it needs `skelgen.capture`."""


def write_html(package: str, path: Path, **values: object) -> Path:
    """Fill the template of a package and write the page.

    Parameters
    ----------
    package : str
        Name of the package that holds the template.
    path : Path
        The HTML file.
    **values
        What the template names.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    from jinja2 import Environment, StrictUndefined  # noqa: PLC0415 - takes time to load

    source = resources.files(package).joinpath("page.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    html = environment.from_string(source).render(values)
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8", errors="replace")
    return path
