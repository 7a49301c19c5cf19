"""Projects that refer to their recording: what is written of it, and how it is found and checked again."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from skelgen_formats.registry import read_take

from skelgen.errors import FormatError, WriteError
from skelgen.files import sha256_of
from skelgen.model import Project, Take
from skelgen.model.project import Source


def source_of(path: Path, format_name: str, options: Mapping[str, Any]) -> Source:
    """Return what is known of a recording that is about to be read.

    Parameters
    ----------
    path : Path
        The file.
    format_name : str
        Its format.
    options : mapping of str to value
        Options of the reader.
    """
    facts = path.stat()
    return Source(str(path.absolute()), format_name, dict(options), facts.st_size, facts.st_mtime_ns)


def reference_to(project: Project) -> Source:
    """Return what a project file says of the recording that it refers to.

    Raises
    ------
    WriteError
        If the take was not read from a file, or that file has changed since.
    """
    source = project.source
    if source is None:
        raise WriteError(f"{project.name or 'the take'} was not read from a recording; the project must hold it")
    path = Path(source.path)
    try:
        facts = path.stat()
        if (facts.st_size, facts.st_mtime_ns) != (source.size, source.modified):
            raise WriteError(f"{path} has changed since it was read; let the project hold the recording")
        return replace(source, sha256=sha256_of(path))
    except OSError as error:
        what = f"{path} cannot be read any more ({error.strerror or error})"
        raise WriteError(f"{what}; let the project hold the recording") from error


def take_of(source: Source, project_file: Path) -> tuple[Take, Source]:
    """Read the recording that a project refers to, where it was or beside the project.

    Parameters
    ----------
    source : Source
        The recording, with its checksum.
    project_file : Path
        The project.

    Returns
    -------
    tuple of Take and Source
        The source with the place where it was found.

    Raises
    ------
    FormatError
        If it is in neither place, or is not the same file any more.
    """
    places = (Path(source.path), project_file.parent / Path(source.path).name)
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        looked = " nor at ".join(str(place) for place in dict.fromkeys(places))
        raise FormatError(project_file, "", f"the recording that it refers to is not at {looked}; put it back there")
    try:
        is_same = sha256_of(found) == source.sha256
    except OSError as error:
        raise FormatError(found, "", f"cannot be read: {error.strerror or error}") from error
    if not is_same:
        raise FormatError(found, "", f"is not the recording that {project_file} was made from: its content differs")
    facts = found.stat()
    there = replace(source, path=str(found.absolute()), size=facts.st_size, modified=facts.st_mtime_ns)
    return read_take(found, source.format, **source.options), there
