"""MATLAB MAT: trajectories as Qualisys Track Manager exports them, or arrays of points as scripts save them.

One variable of any name holds a struct: ``Frames``, ``FrameRate`` [Hz] and ``Trajectories``, in that ``Labeled`` and
``Unidentified``, each with ``Count``, ``Labels`` (a cell array of texts) and ``Data``, shape (markers, 4, frames): x,
y, z [mm] and the residual; NaN is unseen. Newer exports have ``Type`` beside it. All else (force, analogue data,
bodies) is left out. A file without such a struct may hold arrays, also in structs and cells, of which
`skelgen_formats.named_arrays` finds the positions: markers of a struct with a field or an element for each (biomechZoo
has a struct for each), those of the MoCap Toolbox, of Visual3D and Theia, or an array with names beside it.

The file is of MATLAB's level 5: a header of 128 bytes, then elements of a type, a number of bytes, and these, padded to
eight; see the MathWorks' *MAT-File Format*. Only what is wanted is read, so that damage elsewhere does not matter.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.files import read_content
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.progress import counted
from skelgen_formats.bodies import blank_unseen, row_by_row, take_from_bodies
from skelgen_formats.flags import flag_of_key
from skelgen_formats.markers import check_frames, scaled, take_from_markers, zeros_unseen
from skelgen_formats.named_arrays import take_from_arrays
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options
from skelgen_formats.turn_titles import AXES

_MAGIC = b"MATLAB 5.0 MAT-file"
_HEADER_BYTES, _ENDIAN_AT = 128, 126
_COMPRESSED, _MATRIX = 15, 14
_CELL, _STRUCT, _CHARACTERS, _NUMBERS = 1, 2, 4, range(6, 16)  # classes of arrays
_NUMPY_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8", "i8", "u8", "S1", "u2")
_TYPES = dict(zip((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17), _NUMPY_TYPES, strict=True))
_MOST_TIMES, _FREE_BYTES, _DEEPEST = 100, 1 << 20, 16  # what may be packed in a file, in its size; structs in structs
_FEWEST_POINTS = 4  # of structs with the same names, which are trials
_NO_POINTS = (
    "a MATLAB file, but not of Qualisys: no struct with Trajectories, and no array (frames, points, 3) or struct with"
    " (frames, 3) of each point; save one of these, or export C3D or TRC"
)
_MM = 1.0  # Track Manager exports mm
_KEYS_OF_BODIES = {"RigidBodies", "Skeletons"}
_SEGMENT_KEYS = {"SegmentLabels": 0, "PositionData": 3, "RotationData": 4}  # how many numbers a segment has in each
_BODY_KEYS = {"Name": 0, "Positions": 3, "Rotations": 9}

_Value = NDArray[np.generic] | str | Mapping[str, "_Value"] | Sequence["_Value"] | None


class _DamageError(ValueError):
    """The bytes are not those of a MATLAB file."""


def read_qualisys_mat(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the trajectories of a file of MATLAB.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `recorded_rate` and `recorded_unit` count where the file is none of Track Manager.

    Returns
    -------
    Trajectories
        Positions in mm; a `PointCloud` if no trajectory has a label; `Poses` of bodies alone.

    Raises
    ------
    FormatError
        If the file is damaged, or holds no points.
    """
    content = read_content(path)
    if not content.startswith(_MAGIC):
        what = "a MATLAB file of version 7.3 or older than 5; type in MATLAB"
        again = f"load('{path.name}'), and save('{path.stem}_7.mat', '-v7')"
        raise FormatError(path, "", f"{what} {again}, or export TSV or C3D from Track Manager")
    order = ">" if content[_ENDIAN_AT:_HEADER_BYTES] == b"MI" else "<"
    try:
        every = [*_variables(path, content[_HEADER_BYTES:], order)]
        variables = [_value(data, order) for data in every]
        names = [_name(data, order) for data in every]
    except (_DamageError, struct.error, zlib.error, ValueError, UnicodeDecodeError) as error:
        raise FormatError(path, "", f"no MATLAB file, or a damaged one: {str(error)[:100]}") from error
    found = [one for one in variables if isinstance(one, Mapping) and isinstance(one.get("Trajectories"), Mapping)]
    if not found:
        if of_bodies := [one for one in variables if isinstance(one, Mapping) and one.keys() & _KEYS_OF_BODIES]:
            return _bodies(path, of_bodies[0])
        return _take_of_scripts(path, dict(zip(names, variables, strict=True)), options)
    rate, frames = (_number(found[0].get(name)) for name in ("FrameRate", "Frames"))
    if rate is None or not 0 < rate < np.inf:
        raise FormatError(path, "FrameRate", "the frame rate is missing or not above 0")
    positions, labels = _trajectories(path, found[0]["Trajectories"])
    others = sorted(key for key in _KEYS_OF_BODIES & found[0].keys() if _labels(found[0][key]))
    notices = [f"{key} are left out: {', '.join(_labels(found[0][key])[:8])}; export them alone" for key in others]
    if frames is not None and 0 <= frames < 1e9:
        check_frames(path, "Frames", int(frames), len(positions), notices)
    return take_from_markers(path, scaled(path, zeros_unseen(positions), _MM), labels, rate, notices)


def _take_of_scripts(
    path: Path, variables: Mapping[str, _Value], options: Options
) -> Trajectories | PointCloud | Poses:
    """Return the take that arrays hold, of several structs with the same names those of the first."""
    held = [*_flat(variables)]
    count = Counter(name for name, _, _ in held)
    alike = Counter(owner for name, owner, one in held if count[name] > 1 and one.ndim == 2 and 3 in one.shape)
    others = [owner for owner, n_points in alike.items() if n_points >= _FEWEST_POINTS][1:]  # further trials
    chosen = [(name, owner, one) for name, owner, one in held if owner not in others]
    count = Counter(name for name, _, _ in chosen)
    of_points = {"", *(owner for _, owner, one in chosen if one.ndim >= len(AXES))}
    arrays = {}
    for name, owner, one in chosen:
        is_of_other = flag_of_key(name) is not None and owner not in of_points  # such as of a gaze
        arrays[f"{owner}.{name}" if is_of_other else _called(name, owner, count)] = one
    take = take_from_arrays(path, arrays, options, _NO_POINTS)
    left_out = f"structs with the same names are left out, but the first: {', '.join(others)[:100]}"
    return replace(take, notices=(left_out, *take.notices)) if others else take


def _called(name: str, owner: str, count: Mapping[str, int]) -> str:
    """Return what an array is called: as its struct, where others have its name, too."""
    if not owner or count[name] < 2:
        return name
    return f"{owner}_{name}" if name.lower() in {*AXES} else owner


def _bodies(path: Path, held: Mapping[str, _Value]) -> Poses:
    """Return the segments of skeletons, or else the rigid bodies, of an export without trajectories."""
    some = held.get("Skeletons")
    skeletons = [one for one in (some if isinstance(some, list) else [some]) if isinstance(one, Mapping)]
    if any(str(one.get("Reference", "")).upper() == "LOCAL" for one in skeletons):
        what = "segments are in coordinates of their parents; export the skeleton with the reference Global"
        raise FormatError(path, "Skeletons", what)
    rigid, rate = held.get("RigidBodies"), _number(held.get("FrameRate"))
    if rate is None or not 0 < rate < np.inf:
        raise FormatError(path, "FrameRate", "the frame rate is missing or not above 0")
    names: list[str] = []
    blocks: list[NDArray[np.float64]] = []
    for one in skeletons:
        labels, places, turns = _checked(path, one, _SEGMENT_KEYS, (2, 1, 0))
        numbers = blank_unseen(np.concatenate([places, turns[..., [3, 0, 1, 2]]], axis=2))
        names, blocks = [*names, *labels], [*blocks, numbers]
    if not skeletons:
        names, places, turns = _checked(path, rigid if isinstance(rigid, Mapping) else {}, _BODY_KEYS, (2, 0, 1))
        blocks = [row_by_row(places, turns)]
    if len({len(one) for one in blocks}) > 1:
        raise FormatError(path, "Skeletons", "skeletons of different numbers of frames; export each alone")
    return take_from_bodies(path, np.concatenate(blocks, axis=1), _MM, names, rate)


def _labels(held: _Value) -> list[str]:
    """Return the names of rigid bodies, or of the segments of skeletons."""
    every = [one for one in (held if isinstance(held, list) else [held]) if isinstance(one, Mapping)]
    labels = [one.get("Name", one.get("SegmentLabels")) for one in every]
    return [str(name) for some in labels for name in (some if isinstance(some, list) else [some]) if name]


def _checked(
    path: Path, held: Mapping[str, _Value], keys: Mapping[str, int], axes: tuple[int, int, int]
) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    """Return names, and two arrays, shape (n_frames, n_bodies, n), that stand under the keys with their axes so."""
    labels, *arrays = (held.get(key) for key in keys)
    names = [labels] if isinstance(labels, str) else labels if isinstance(labels, list) else []
    ordered = [
        one.astype(np.float64).transpose(axes) for one in arrays if isinstance(one, np.ndarray) and one.ndim == 3
    ]
    shapes = [one.shape[1:] for one in ordered]
    if not names or shapes != [(len(names), n) for n in [*keys.values()][1:]] or len(ordered[0]) != len(ordered[1]):
        what = "bodies without names, positions and rotations for each; export the 3D data from Track Manager"
        raise FormatError(path, "", f"no trajectories, and {what}")
    return [str(name) for name in names], ordered[0], ordered[1]


def _flat(held: Mapping[str, _Value], owner: str = "") -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Yield arrays of numbers and texts, also those in structs and cells, with their names and that of their struct.

    A struct of several elements has that of the first text in each. Rows of one are flat.
    """
    for name, value in held.items():
        if isinstance(value, Mapping):
            yield from _flat(value, name)
        elif isinstance(value, np.ndarray):
            is_row = value.ndim == 2 and 1 in value.shape and value.size > 1
            yield name, owner, value.ravel() if is_row else value
        elif isinstance(value, str):
            yield name, owner, np.array(value)
        elif isinstance(value, list) and all(isinstance(text, str) for text in value):
            yield name, owner, np.array(value, dtype=np.str_)
        elif isinstance(value, list) and len(value) == 1:
            yield from _flat({name: value[0]}, owner)
        elif isinstance(value, list) and len({np.shape(one) for one in value if isinstance(one, np.ndarray)}) == 1:
            yield name, owner, np.stack([one for one in value if isinstance(one, np.ndarray)], axis=1)
        elif isinstance(value, list):
            for one in (one for one in value if isinstance(one, Mapping)):
                yield from _flat(one, next((text for text in one.values() if isinstance(text, str)), name))


def _trajectories(path: Path, held: _Value) -> tuple[NDArray[np.float64], list[str]]:
    """Return positions in mm, shape (n_frames, n_markers, 3), and names: of labelled ones, then of all others."""
    blocks, names = [], []
    for kind in ("Labeled", "Unidentified"):
        one = held.get(kind) if isinstance(held, Mapping) else None
        data = one.get("Data") if isinstance(one, Mapping) else None
        if not isinstance(one, Mapping) or not isinstance(data, np.ndarray) or data.size == 0:
            continue
        data = data[:, :, np.newaxis] if data.ndim == 2 else data  # MATLAB drops a last dimension of one
        if data.ndim != 3 or data.shape[1] not in (3, 4):
            raise FormatError(path, f"{kind}.Data", f"has the shape {data.shape}; (markers, 4, frames) belongs there")
        labels = one.get("Labels")
        labels = [labels] if isinstance(labels, str) else labels if isinstance(labels, list) else []
        texts = [label if isinstance(label, str) else "" for label in labels]
        if kind == "Labeled" and len(texts) != len(data):
            raise FormatError(path, "Labeled.Labels", f"{counted(len(texts), 'name')} for {len(data)} trajectories")
        names += texts if kind == "Labeled" else [f"unlabelled {n + 1}" for n in range(len(data))]
        blocks.append(data[:, :3].astype(np.float64).transpose(2, 0, 1))
    if not blocks or len({len(block) for block in blocks}) > 1:
        raise FormatError(path, "Trajectories", "holds no trajectories; export the 3D data from Track Manager")
    return np.concatenate(blocks, axis=1), names


def _variables(path: Path, content: bytes, order: str) -> Iterator[bytes]:
    """Yield the arrays of a file, unpacked."""
    left = _MOST_TIMES * len(content) + _FREE_BYTES
    for kind, data in _elements(content, order):
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(data, left)
            left -= len(unpacked)
            if unpacker.unconsumed_tail or left <= 0:
                raise FormatError(path, "", "announces far more numbers than such a file holds")
            yield from (inner for inner_kind, inner in _elements(unpacked, order) if inner_kind == _MATRIX)
        elif kind == _MATRIX:
            yield data


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        if kind >> 16:  # up to four bytes stand in the place of their number
            kind, size, at = kind & 0xFFFF, kind >> 16, at - 4
        if at + 8 + size > len(content):
            raise _DamageError("an element is longer than the file")
        yield kind, content[at + 8 : at + 8 + size]
        at += 8 + size
        at += -at % 8 if kind != _COMPRESSED else 0


def _name(content: bytes, order: str) -> str:
    """Return the name of an array, which stands behind its flags and dimensions."""
    parts = [data for _, (_, data) in zip(range(3), _elements(content, order), strict=False)]
    return parts[2].decode("latin-1") if len(parts) > 2 else ""


def _value(content: bytes, order: str, depth: int = 0) -> _Value:
    """Return an array: numbers, a text, the fields of a struct, or the list of a cell array; None if it is another."""
    parts = _elements(content, order)
    flags, dims, _ = (next(parts, (0, b""))[1] for _ in range(3))
    if depth > _DEEPEST or len(flags) < 4 or len(dims) < 8 or len(dims) % 4:
        raise _DamageError("an array has no dimensions")
    kind = struct.unpack_from(f"{order}I", flags)[0] & 0xFF
    shape = struct.unpack(f"{order}{len(dims) // 4}i", dims)
    if kind == _STRUCT:
        length = struct.unpack(f"{order}i", next(parts, (0, b""))[1])[0]
        titles = next(parts, (0, b""))[1]
        if length <= 0 or length > len(titles) + 1:
            raise _DamageError("a struct has no names")
        names = [titles[at : at + length].split(b"\0")[0].decode("latin-1") for at in range(0, len(titles), length)]
        values = [_value(data, order, depth + 1) for _, data in parts]
        starts = range(0, max(len(values), 1), max(len(names), 1))
        elements = [dict(zip(names, values[at:], strict=False)) for at in starts]
        return elements if len(elements) > 1 else elements[0]
    if kind == _CELL:
        return [_value(data, order, depth + 1) for _, data in parts]
    if kind not in _NUMBERS and kind != _CHARACTERS:
        return None
    stored, data = next(parts, (9, b""))
    if stored not in _TYPES or len(data) % np.dtype(_TYPES[stored]).itemsize:
        raise _DamageError("numbers of an unknown type")
    if kind == _CHARACTERS:
        wide = np.dtype(_TYPES[stored]).itemsize == 2
        text = data.decode(("utf-16-be" if order == ">" else "utf-16-le") if wide else "utf-8", "replace")
        rows = shape[0] if len(shape) == 2 and shape[0] * shape[1] == len(text) else 1
        texts = [text[row::rows].strip(" \0") for row in range(rows)]  # a matrix of characters has a text in each row
        return [*texts] if rows > 1 else text.strip(" \0")
    return np.frombuffer(data, f"{order}{_TYPES[stored]}").reshape(shape, order="F")


def _number(value: _Value) -> float | None:
    return float(value.ravel()[0]) if isinstance(value, np.ndarray) and value.size == 1 else None


FORMAT = Format(
    name="qualisys-mat",
    title="MATLAB MAT",
    suffixes=(".mat",),
    holds="markers",
    sniff=lambda head, path: head.startswith(_MAGIC),
    read=read_qualisys_mat,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Export of Qualisys Track Manager, in mm, without its bodies and signals; else arrays of points, as of numpy.",
)
