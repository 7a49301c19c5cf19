"""The files of a run: every result that is there, in a format that other programs open, all at once or none.

Files may replace others: inputs never, files that the user did not name only where that is asked for.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from skelgen_formats import registry
from skelgen_formats.c3d.writer import write_points
from skelgen_formats.registry import write_file

from skelgen.app.project_file.archive import SUFFIX, save_project
from skelgen.errors import SkelgenError, WriteError
from skelgen.files import arriving_together, check_folder
from skelgen.model import Project, Trajectories
from skelgen.model.placed_joints import place_of
from skelgen.model.skeleton import joint_between
from skelgen.parameters import ParameterValue
from skelgen.progress import SILENT, Monitor


@dataclass(frozen=True)
class Output:
    """One file of a run.

    Attributes
    ----------
    suffix : str
        What follows the stem.
    needs : str
        Stage whose result it shows; empty where a take suffices.
    write : callable (project, path) -> object
        Writes it.
    """

    suffix: str
    needs: str
    write: Callable[[Project, Path], object]


def write_outputs(
    project: Project,
    folder: Path | str,
    stem: str,
    *,
    result_name: str = "",
    outputs: Sequence[Output] | None = None,
    monitor: Monitor = SILENT,
) -> list[Path]:
    """Write every file that the project's results allow.

    The files are completed in a temporary folder and then moved into place, so that an error or an interruption
    leaves what was there before.

    Parameters
    ----------
    project : Project
        With the results of some stages.
    folder : Path or str
        Where the files go; created if absent.
    stem : str
        Beginning of all names.
    result_name : str
        Name of the XML file with all results; ``<stem>.xml`` if empty.
    outputs : sequence of Output, optional
        Which files; `OUTPUTS` if left out.
    monitor : Monitor
        Receives progress, and a notice for each format that cannot hold this project.

    Returns
    -------
    list of Path
        The files, sorted by name.

    Raises
    ------
    WriteError
        If the folder cannot be written.
    """
    monitor.begin("writing")
    due = [output for output in outputs or OUTPUTS if not output.needs or project.has(output.needs)]
    with arriving_together(Path(folder)) as temporary:
        for index, output in enumerate(due):
            name = result_name if result_name and output.suffix == ".xml" else stem + output.suffix
            _write_if_possible(output, project, temporary / name, monitor)
            monitor.advance(index + 1, len(due))
        names = sorted(file.name for file in temporary.iterdir())
    return [Path(folder) / name for name in names]


def stem_of(path: Path | str) -> str:
    """Return the beginning of the output names for an input: its name without the suffix."""
    name = Path(path).name
    return name[: -len(SUFFIX)] if name.lower().endswith(SUFFIX) else Path(path).stem


def _write_raw_joints(project: Project, path: Path) -> None:
    """Write the joints before the fit; after it, their descriptions say which the motion does not determine."""
    topology, trajectories = project.topology, project.trajectories
    names = tuple(joint_between(*(project.limbs.names[limb] for limb in edge)) for edge in topology.edges.tolist())
    marks = [place_of(joint).remark for joint in project.skeleton.joints] if project.has("skeleton") else []
    raw = Trajectories(topology.raw_joint_positions, names, trajectories.rate, trajectories.name)
    write_points(raw, path, "mm", descriptions=marks)


def _write_report(project: Project, path: Path) -> None:
    from skelgen.app.report import write_report  # noqa: PLC0415 - plotting takes a second to load

    write_report(project, path)


OUTPUTS = (
    Output(SUFFIX, "", save_project),
    Output(".labels.c3d", "labels", lambda project, path: write_file(project.trajectories, path)),
    Output(".limbs.csv", "limbs", write_file),
    Output(".costs.txt", "limbs", write_file),
    Output(".raw-joints.c3d", "joints", _write_raw_joints),
    Output(".tree.txt", "joints", write_file),
    Output(".xml", "skeleton", write_file),
    Output(".xsf", "skeleton", write_file),
    Output(".joints.csv", "skeleton", write_file),
    Output(".angles.csv", "skeleton", write_file),
    Output(".json", "labels", write_file),
    Output(".html", "labels", _write_report),
)
"""All files of a run, in the order in which they are written."""


def _write_if_possible(output: Output, project: Project, path: Path, monitor: Monitor) -> None:
    try:
        output.write(project, path)
    except WriteError as error:
        if isinstance(error.__cause__, OSError):  # no rights, disk full: that is for the user to mend
            raise
        path.unlink(missing_ok=True)
        monitor.notice(f"{path.name} is not written: {str(error).removeprefix(f'{path}: ')}")


def check_outputs(
    outputs: Iterable[Path], inputs: Iterable[Path | None], named: Iterable[Path] = (), *, overwrite: bool = False
) -> None:
    """Check what a command will replace, before it begins.

    Parameters
    ----------
    outputs : iterable of Path
        All files that will be written.
    inputs : iterable of Path or None
        Files that are read.
    named : iterable of Path
        Outputs that the user named, or that are results of an earlier run.
    overwrite : bool
        Whether other files may be replaced, too.

    Raises
    ------
    WriteError
        If an output is an input, or replaces a file that is not to be replaced.
    """
    given, free = [path for path in inputs if path is not None and path.exists()], set(named)
    for output in outputs:
        if not output.exists():
            continue
        if any(output.samefile(path) for path in given):
            raise WriteError(f"{output} is what is read, and would be replaced; choose another name or folder")
        if not overwrite and output not in free:
            what = "is there already and was not named; remove it, choose another name, or say --overwrite"
            raise WriteError(f"{output} {what}")


def check_run(folder: Path, names: tuple[str, str], inputs: Iterable[Path | None], *, overwrite: bool = False) -> None:
    """Check what the outputs of a run will replace; a folder with a project of their name holds an earlier run.

    Parameters
    ----------
    folder : Path
        Where the files go.
    names : tuple of str
        Beginning of all names, and name of the XML file if that is another one.
    inputs, overwrite
        As of `check_outputs`.

    Raises
    ------
    WriteError
        As of `check_outputs`, or if a file is in the place of the folder.
    """
    check_folder(folder)
    stem, result_name = names
    project = folder / (stem + SUFFIX)
    written = [folder / (stem + output.suffix) for output in OUTPUTS]
    written += [folder / result_name] if result_name else []
    read = [path for path in inputs if path is not None and path.absolute() != project.absolute()]  # which grows
    check_outputs(written, read, written if project.is_file() else (), overwrite=overwrite)


def recording_of(project: Project) -> Path | None:
    """Return the recording that a project was made from, if it knows."""
    return None if project.source is None else Path(project.source.path)


def files_of(path: Path, format_name: str | None, options: Mapping[str, ParameterValue]) -> tuple[Path, ...]:
    """Return all files that writing will make; the file alone where no format writes it, which is an error later.

    Parameters
    ----------
    path : Path
        The file that the user names.
    format_name : str or None
        Name of the format; None takes that of the suffix.
    options : mapping of str to value
        Options of the writer; unknown ones are passed over here.
    """
    try:
        entry = registry.format_for_writing(path, format_name)
        known = {option.name for option in entry.options if option.writing}
        chosen = registry.options_of(entry, {name: value for name, value in options.items() if name in known})
    except SkelgenError:
        return (path,)
    return entry.files(path, chosen)
