"""The project file ``.skelgen``: one zip archive with the structure as JSON and every array as a ``.npy`` member.

Members are stored without compression: marker positions hardly shrink, the bytes depend on no compressor's version,
and a file that declares more than it holds is known at once. A project may refer to its recording instead of holding
it; the recording is found by its place and known by its checksum. ``docs/project-file.md`` describes the file.
"""

import io
import json
import platform
import re
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from skelgen_formats.registry import read_take

import skelgen
from skelgen.app.project_file.packing import check_chain, packed, unpacked
from skelgen.errors import FormatError, InputError, ParameterError, RecordingMovedError, WriteError
from skelgen.files import open_regular, read_content, replacing, sha256_of
from skelgen.model import JointAngles, Motion, Project, Skeleton, StageReport, Take
from skelgen.model.arrays import Floats
from skelgen.model.project import Source
from skelgen.parameters import ParameterValue

SUFFIX = ".skelgen"
VERSION = 2
"""Version of the file's layout that is written; older ones are read, newer ones refused."""

_STRUCTURE = "project.json"
_RUN = "run.json"  # times and versions: all that may differ between two runs of the same input and seed
_ARRAYS = "arrays/"
_FORMAT = "skelgen project"
_MAGIC = b"PK\x03\x04"
_NAME_LENGTH, _NAME_FROM = slice(26, 28), 30  # bytes of a zip that tell the name of its first member
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time a zip can hold: the same bytes at any time of day
_PIECE = 2**20  # bytes written at once
_FILE_RIGHTS = 0o644 << 16  # what unzip gives the members; fixed, because the default depends on the platform
_LARGEST = 1e60  # of any array: squares and products of such numbers are numbers
_NPY = b"\x93NUMPY\x01\x00"
_HEADER = re.compile(rb"\{'descr': '(<f8|<i8|\|b1)', 'fortran_order': False, 'shape': \(([0-9, ]{0,99})\), \} *\n")
_RESULTS = ("trajectories", "labelling", "limbs", "topology", "skeleton", "motion")
_BYTES_PER_VALUE, _FREE_MEMORY = 64, 1 << 26  # that parsed JSON takes; what a small file may take
# what zipfile raises on damaged archives: absurd offsets, encrypted or unsupported members, odd names
_DAMAGES = (zipfile.BadZipFile, ValueError, OSError, EOFError, KeyError, struct.error, RuntimeError, OverflowError)


def save_project(project: Project, path: Path | str, *, embed: bool = True) -> Path:
    """Write a project file, whole or not at all.

    Parameters
    ----------
    project : Project
        With or without results.
    path : Path or str
        Usually ends in ``.skelgen``.
    embed : bool
        Whether the file holds the recording; otherwise it refers to it, by path and content.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    WriteError
        If it cannot be written, or would refer to a recording that has changed.

    Examples
    --------
    >>> save_project(Project(skelgen.simulate("rods", n_frames=50).take), "rods.skelgen")
    PosixPath('rods.skelgen')
    """
    path = Path(path)
    arrays: dict[str, NDArray[Any]] = {}
    members = {_STRUCTURE: _structure(project, arrays, embed), _RUN: _run_facts(project)}
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            _store(archive, f"{_ARRAYS}{name}.npy", *_as_npy(arrays[name]))
        for name, data in sorted(members.items()):
            _store(archive, name, json.dumps(data, indent=1, allow_nan=False).encode("ascii"))
    return path


def open_project(path: Path | str, recording: Path | None = None) -> Project:
    """Read a project file.

    Parameters
    ----------
    path : Path or str
        The file.
    recording : Path, optional
        Where the recording that it refers to is now, if it was moved.

    Raises
    ------
    RecordingMovedError
        If it refers to a recording that is not found.
    FormatError
        If it cannot be opened, is damaged, incomplete, or written by a newer version; the error names the member.
    """
    path = Path(path)
    if not path.exists():
        raise FormatError(path, "", "there is no such file")
    try:
        with open_regular(path) as stream, zipfile.ZipFile(stream) as archive:
            return _Reader(path, archive, recording).project()
    except zipfile.BadZipFile as error:
        what = "a project file belongs here, as `skelgen run` writes it from a take; this is none, or cut off"
        raise FormatError(path, "", what) from error
    except _DAMAGES as error:
        raise FormatError(path, "", f"cannot be read: {error}") from error


def is_project_file(path: Path | str) -> bool:
    """Tell whether a path is meant to be a project: by its suffix, by its content, or as the folder of a run."""
    path = Path(path)
    if path.suffix.lower() == SUFFIX or path.is_dir():
        return True
    try:
        head = read_content(path, 1 << 10)
    except FormatError:
        return False
    first = head[_NAME_FROM : _NAME_FROM + int.from_bytes(head[_NAME_LENGTH], "little")]
    return head.startswith(_MAGIC) and first.startswith(tuple(map(str.encode, (_STRUCTURE, _RUN, _ARRAYS))))


def find_result(path: Path | str) -> Path:
    """Return a project file, or the only one in a folder.

    Raises
    ------
    FormatError
        If the folder holds none or several.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    found = sorted(path.glob(f"*{SUFFIX}"))
    if len(found) != 1:
        names = ", ".join(file.name for file in found) or "none"
        raise FormatError(path, "", f"the folder must hold one {SUFFIX} file; it holds {names}: name the file")
    return found[0]


class _Reader:
    """Members of one archive, with every error naming its member."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, recording: Path | None) -> None:
        self._path, self._recording = path, recording
        self._archive = archive
        declared = sum(max(info.file_size, info.compress_size) for info in archive.infolist())
        self._size = path.stat().st_size
        if declared > self._size:
            raise FormatError(path, "", f"the members declare {declared} bytes, the file holds only {self._size}")

    def project(self) -> Project:
        structure = self._json(_STRUCTURE)
        if structure.get("format") != _FORMAT:
            raise FormatError(self._path, _STRUCTURE, "not a skelgen project")
        version = structure.get("version")
        if not isinstance(version, int) or version > VERSION:
            what = f"version {version!r}; this skelgen reads versions up to {VERSION}: update skelgen"
            raise FormatError(self._path, _STRUCTURE, what)
        try:
            return self._assembled(structure, self._json(_RUN))
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError, InputError, ParameterError) as error:
            raise FormatError(self._path, _STRUCTURE, f"damaged: {error}") from error

    def _assembled(self, structure: Mapping[str, Any], run: Mapping[str, Any]) -> Project:
        structure = {"labelling": None, **structure}  # which the first files did not have
        take, source = self._take(structure, run)
        results = {name: unpacked(structure[name], self._array) for name in _RESULTS if structure[name] is not None}
        if structure["labelled"]:
            results["trajectories"] = take
        seconds = run["seconds"]
        reports = {
            name: StageReport(
                unpacked(facts["parameters"], self._array),
                float(seconds[name]),
                unpacked(facts["notices"], self._array),
            )
            for name, facts in structure["reports"].items()
        }
        chain = {f"_{name}": value for name, value in results.items()}
        identities = unpacked(structure.get("identities"), self._array)  # older files have none
        corrections = tuple(unpacked(structure.get("corrections", []), self._array))
        view = dict(structure.get("view", {}))
        project = Project(take, structure["seed"], reports, identities, corrections, view, source, **chain)
        check_chain(project)
        if project.has("skeleton"):
            compute = partial(_joint_angles, project.skeleton, project.trajectories.positions)
            project = replace(project, _motion=replace(project.motion, compute_angles=compute))
        return project

    def _take(self, structure: Mapping[str, Any], run: Mapping[str, Any]) -> tuple[Take, Source | None]:
        """The take that the file holds, or the recording that it refers to."""
        source = unpacked(structure.get("source") or run.get("source"), self._array)
        if not isinstance(source, Source | None):
            raise InputError("the source of the take is none")
        if structure["take"] is None and source is not None:
            return take_of(source, self._path, self._recording)
        return unpacked(structure["take"], self._array), source

    def _json(self, member: str) -> dict[str, object]:
        content = self._bytes(member)
        n_values = sum(content.count(mark) for mark in (b",", b"[", b"{"))
        if n_values * _BYTES_PER_VALUE > 3 * self._size + _FREE_MEMORY:
            raise FormatError(self._path, member, f"holds {n_values} values, far more than belong to such a file")
        try:
            data = json.loads(content, parse_constant=_refuse_constant)
        except (ValueError, RecursionError) as error:
            raise FormatError(self._path, member, f"not valid JSON: {error}") from error
        if not isinstance(data, dict):
            raise FormatError(self._path, member, "must hold a JSON object")
        return data

    def _array(self, name: str) -> NDArray[Any]:
        member = f"{_ARRAYS}{name}.npy"
        try:
            return _from_npy(self._bytes(member))
        except (ValueError, OverflowError) as error:
            raise FormatError(self._path, member, f"not a valid array: {error}") from error

    def _bytes(self, member: str) -> bytes:
        try:
            info = self._archive.getinfo(member)
        except KeyError as error:
            raise FormatError(self._path, member, "this part of the project file is missing") from error
        if info.compress_type != zipfile.ZIP_STORED:
            raise FormatError(self._path, member, "is compressed; project files store their members as they are")
        try:
            return self._archive.read(info)
        except _DAMAGES as error:
            raise FormatError(self._path, member, f"damaged or cut off: {error}") from error


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _joint_angles(skeleton: Skeleton, positions: Floats, motion: Motion) -> tuple[JointAngles, ...]:
    """Compute joint angles, which a project file does not hold."""
    from skelgen.kinematics.inverse.motion import MotionAngles  # noqa: PLC0415 - scipy is slow to load

    return MotionAngles(skeleton, positions)(motion)


def _structure(project: Project, arrays: dict[str, NDArray[Any]], embed: bool) -> dict[str, object]:
    results = {name: getattr(project, f"_{name}") for name in _RESULTS}
    labelled = results["trajectories"] is project.take
    if labelled:
        results["trajectories"] = None  # the take itself: kept once
    reports = {
        name: {"parameters": packed(report.parameters, "", arrays), "notices": list(report.notices)}
        for name, report in project.reports.items()
    }
    structure = {"format": _FORMAT, "version": VERSION, "seed": project.seed, "labelled": labelled, "reports": reports}
    structure["take"] = packed(project.take, "take", arrays) if embed else None
    structure["source"] = None if embed else packed(_reference_to(project), "source", arrays)
    structure["identities"] = packed(project.identities, "identities", arrays)
    structure["corrections"] = packed(project.corrections, "corrections", arrays)
    structure["view"] = dict(project.view)
    return structure | {name: packed(value, name, arrays) for name, value in results.items()}


def _run_facts(project: Project) -> dict[str, object]:
    versions = {"skelgen": skelgen.__version__, "python": platform.python_version(), "numpy": np.__version__}
    seconds = {name: report.seconds for name, report in project.reports.items()}
    return {"versions": versions, "seconds": seconds, "source": packed(project.source, "", {})}


def _as_npy(array: NDArray[Any]) -> tuple[bytes, memoryview]:
    """Header and body of a .npy file; the body is not copied."""
    little = np.ascontiguousarray(array, {"f": "<f8", "i": "<i8", "b": "|b1"}[array.dtype.kind])
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, npy.header_data_from_array_1_0(little))
    return stream.getvalue(), little.reshape(-1).view(np.uint8).data


def _from_npy(content: bytes) -> NDArray[Any]:
    start = 10 + int.from_bytes(content[8:10], "little")
    header = _HEADER.fullmatch(content[10:start])
    if not content.startswith(_NPY) or header is None:
        raise ValueError("its header is not that of an array of whole numbers, double precision or truth values")
    shape = [int(length) for length in header[2].replace(b" ", b"").split(b",") if length]
    array = np.frombuffer(content, header[1].decode(), offset=start).reshape(shape)
    numbers = array.reshape(-1) if array.dtype.kind == "f" else np.zeros(0)
    if len(numbers) and max(np.fmax.reduce(numbers), -np.fmin.reduce(numbers)) > _LARGEST:
        raise ValueError(f"it holds numbers beyond {_LARGEST:g}, which nothing measured is")
    return array


def _store(archive: zipfile.ZipFile, name: str, *parts: bytes | memoryview) -> None:
    """Write a member piece by piece: other threads, such as that of a window, go on in between."""
    info = zipfile.ZipInfo(name, _EPOCH)
    info.create_system = 3  # Unix, on every platform
    info.external_attr = _FILE_RIGHTS
    info.file_size = sum(map(len, parts))  # tells whether offsets need 64 bits
    with archive.open(info, "w") as member:
        for part in parts:
            for start in range(0, len(part), _PIECE):
                member.write(part[start : start + _PIECE])


def recorded_file_of(path: Path, format_name: str, options: Mapping[str, ParameterValue]) -> Source:
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


def _reference_to(project: Project) -> Source:
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


def take_of(source: Source, project_file: Path, recording: Path | None = None) -> tuple[Take, Source]:
    """Read the recording that a project refers to, where it was or beside the project.

    Parameters
    ----------
    source : Source
        The recording, with its checksum.
    project_file : Path
        The project.
    recording : Path, optional
        Where it is now, if it is in neither place.

    Returns
    -------
    tuple of Take and Source
        The source with the place where it was found.

    Raises
    ------
    FormatError
        If it is in neither place, or is not the same file any more.
    """
    usual = [Path(source.path), project_file.parent / Path(source.path).name]
    places = usual if recording is None else [recording]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        looked = " nor at ".join(str(place) for place in dict.fromkeys(places))
        what = f"the recording that it refers to is not at {looked}; put it back there"
        raise RecordingMovedError(project_file, "", what)
    if sha256_of(found) != source.sha256:
        raise FormatError(found, "", f"is not the recording that {project_file} was made from: its content differs")
    facts = found.stat()
    there = replace(source, path=str(found.absolute()), size=facts.st_size, modified=facts.st_mtime_ns)
    return read_take(found, source.format, sample=None, **source.options), there
