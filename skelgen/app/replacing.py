"""What may be replaced: inputs never, files that the user did not name only where that is asked for."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skelgen_formats import registry

from skelgen.app.outputs import OUTPUTS
from skelgen.app.project_file.archive import SUFFIX
from skelgen.errors import SkelgenError, WriteError
from skelgen.model import Project


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
            raise WriteError(f"{output} is read by this command and would be replaced; choose another name or folder")
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
    """
    stem, result_name = names
    project = folder / (stem + SUFFIX)
    written = [folder / (stem + output.suffix) for output in OUTPUTS]
    written += [folder / result_name] if result_name else []
    read = [path for path in inputs if path is not None and path.absolute() != project.absolute()]  # which grows
    check_outputs(written, read, written if project.is_file() else (), overwrite=overwrite)


def recording_of(project: Project) -> Path | None:
    """Return the recording that a project was made from, if it knows."""
    return None if project.source is None else Path(project.source.path)


def files_of(path: Path, format_name: str | None, options: Mapping[str, Any]) -> tuple[Path, ...]:
    """Return all files that writing will make; the file alone where no format writes it, which is an error later.

    Parameters
    ----------
    path : Path
        The file that the user names.
    format_name : str or None
        Name of the format; None takes that of the suffix.
    options : mapping of str to value
        For the writer; what it does not know is left to it.
    """
    try:
        entry = registry.format_for_writing(path, format_name)
        known = {option.name for option in entry.options if option.writing}
        chosen = registry.options_of(entry, {name: value for name, value in options.items() if name in known})
    except SkelgenError:
        return (path,)
    return entry.files(path, chosen)
