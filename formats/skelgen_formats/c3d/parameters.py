"""The parameters of a C3D file: a chain of records behind the header, with groups, names, shapes and values.

The parameters begin with 4 bytes (two reserved, number of blocks, processor: 84 Intel, 85 DEC, 86 MIPS) and are a
chain of records: i8 length of the name, i8 id (below 0 a group, else a parameter of the group -id), the name, i16
bytes to the next record (0 ends the chain); a parameter goes on with i8 type (-1 text, 1 i8, 2 i16, 4 f32), u8 number
of dimensions, u8 per dimension, the values, u8 length of the description, the description.
"""

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError

_END_OF_CHAIN = 0
_TYPES = {-1: "S1", 1: "i1", 2: "i2", 4: "f4"}
_MOST_DIMENSIONS = 7

Values = NDArray[Any]
Parameters = Mapping[tuple[str, str], Values]


def parameters_of(path: Path, records: bytes, order: str, dec: bool) -> tuple[Parameters, list[str]]:
    """Return the parameters, and a sentence if their chain does not end as it should.

    The pointer of the last record is junk in some files, so that the chain goes on into nothing: it ends there, if the
    labels of the points were found.

    Parameters
    ----------
    path : Path
        The file, for errors.
    records : bytes
        The chain, without the four bytes before it.
    order : str
        ``<`` or ``>``.
    dec : bool
        Whether f32 are in DEC's layout.
    """
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Values]] = []
    notices = []
    try:
        _walk(path, records, order, dec, groups, found)
    except FormatError as error:
        if not any(name == "LABELS" and groups.get(group) == "POINT" for group, name, _ in found):
            raise
        notices.append(f"the parameters end with a broken record ({error.place}); what was read before it is taken")
    return {(groups.get(group, ""), name): value for group, name, value in found}, notices


def _walk(
    path: Path, records: bytes, order: str, dec: bool, groups: dict[int, str], found: list[tuple[int, str, Values]]
) -> None:
    position = 0
    while position + 2 <= len(records):
        name_length, identity = struct.unpack_from("bb", records, position)
        name_length = abs(name_length)  # negative marks a locked record
        pointer = position + 2 + name_length
        if name_length == 0 or identity == 0:
            break
        if pointer + 2 > len(records):
            raise FormatError(path, f"parameter byte {position}", "a record reaches beyond the parameters")
        name = records[position + 2 : pointer].decode("latin-1").strip().upper()
        (step,) = struct.unpack_from(f"{order}h", records, pointer)
        if identity < 0:
            groups[-identity] = name
        else:
            found.append((identity, name, _value(path, records, pointer + 2, order, dec)))
        if step == _END_OF_CHAIN:
            break
        if step < 0 or pointer + step > len(records):
            raise FormatError(path, f"parameter byte {pointer}", "a record points outside the parameters")
        position = pointer + step


def _value(path: Path, records: bytes, position: int, order: str, dec: bool) -> Values:
    place = f"parameter byte {position}"
    if position + 2 > len(records):
        raise FormatError(path, place, "a parameter reaches beyond the parameters")
    kind, n_dimensions = struct.unpack_from("bB", records, position)
    shape = tuple(records[position + 2 : position + 2 + n_dimensions])
    if kind not in _TYPES or len(shape) < n_dimensions or n_dimensions > _MOST_DIMENSIONS:
        raise FormatError(path, place, f"a parameter has type {kind} and {n_dimensions} dimensions; it is damaged")
    dtype = np.dtype(f"{order}{_TYPES[kind]}")
    count = math.prod(shape)
    start = position + 2 + n_dimensions
    end = start + count * dtype.itemsize
    if end > len(records):
        raise FormatError(path, place, f"a parameter of {count} values reaches beyond the parameters")
    raw = records[start:end]
    values: Values = dec_floats(raw) if dec and dtype.kind == "f" else np.frombuffer(raw, dtype)
    return values.reshape(shape, order="F")


def dec_floats(raw: bytes) -> NDArray[np.float32]:
    """Return numbers in DEC's 32-bit layout: 16-bit halves swapped, exponent biased by two more."""
    halves = np.frombuffer(raw, "<u2").reshape(-1, 2)[:, ::-1]
    with np.errstate(invalid="ignore"):  # a NaN that signals is a NaN
        return np.asarray(np.ascontiguousarray(halves).view("<f4").reshape(-1) / 4, dtype=np.float32)


def number_of(parameters: Parameters, key: tuple[str, str], default: float) -> float:
    """Return the first number of a parameter, or the default where there is none that is finite.

    Parameters
    ----------
    parameters : mapping of (group, parameter) to ndarray
        All of a file.
    key : tuple of two str
        Group and parameter.
    default : float
        If there is none.
    """
    values = parameters.get(key)
    if values is None or values.size == 0 or values.dtype.kind == "S":
        return default
    value = float(values.reshape(-1)[0])
    return value if math.isfinite(value) else default


def float_of(raw: bytes, order: str, dec: bool) -> float:
    """Return the f32 in four bytes.

    Parameters
    ----------
    raw : bytes
        The four.
    order : str
        ``<`` or ``>``.
    dec : bool
        Whether in DEC's layout.
    """
    return float(dec_floats(raw)[0]) if dec else float(struct.unpack(f"{order}f", raw)[0])


def strings_of(values: Values) -> list[str]:
    """Return the stripped texts of a parameter; none of one that holds numbers."""
    if values.dtype.kind != "S" or values.size == 0:
        return []
    rows = values.reshape(values.shape[0] if values.ndim else 1, -1, order="F")
    return [_text(rows[:, column].tobytes()) for column in range(rows.shape[1])]


def _text(raw: bytes) -> str:
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return text.replace("\0", " ").strip()
