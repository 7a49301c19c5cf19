"""NumPy arrays of points (.npy, .npz): shape (n_frames, n_points, 3), in an archive with their names if there are any.

An archive holds the positions as its only array of that shape, or under one of some names; beside them may stand the
names of the points, the frame rate (or times) and the unit; `skelgen_formats.named_arrays` tells which is which, and
other orders of the axes. What is not there is assumed as of a wide table. Pickled objects are never loaded.
"""

import struct
import sys
import tokenize
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.files import TRUTH_SUFFIX, open_regular
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen_formats.named_arrays import take_from_arrays
from skelgen_formats.options import POINTS, RECORDED_RATE, RECORDED_UNIT, Format, Options

_SURPLUS = 4096  # bytes that archives and headers may take beside the numbers
_MOST_TIMES = 100  # what a compressed archive may hold, in its own size
_PICKLED = "holds pickled objects, which are never loaded; save the array of numbers alone"
_BROKEN = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, NotImplementedError),  # a damaged archive
    *(ValueError, TypeError, SyntaxError, tokenize.TokenError, OverflowError, MemoryError, KeyError),  # or array in it
)


def read_arrays(path: Path, options: Options) -> Trajectories | PointCloud | Poses:
    """Read the points of an array file.

    Parameters
    ----------
    path : Path
        The file.
    options : Options
        `recorded_rate`, `recorded_unit` and `sample` count.

    Raises
    ------
    FormatError
        If it holds no array of that shape, or is damaged.
    """
    return take_from_arrays(path, _arrays(path), options)


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return all arrays of numbers and texts; what would have to be unpickled is left out."""
    try:
        with open_regular(path) as stream, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of headers as Python 2 wrote them
            size = path.stat().st_size
            if stream.read(2) == b"PK":
                stream.seek(0)
                with zipfile.ZipFile(stream) as archive:
                    if sum(member.file_size for member in archive.infolist()) > _MOST_TIMES * size + _SURPLUS:
                        raise FormatError(path, "", "announces far more numbers than such a file holds")
                stream.seek(0)
                with np.load(stream, allow_pickle=False) as members:
                    plain = {name: _sound(members[name]) for name in members.files if _is_plain(members, name)}
                    if members.files and not plain:
                        raise FormatError(path, "", _PICKLED)
                    return plain
            stream.seek(0)
            one = _one(path, stream, size)
            return {name: one[name] for name in one.dtype.names} if one.dtype.names else {"": one}
    except _BROKEN as error:
        what = f"no file of NumPy arrays, or damaged: {' '.join(str(error).split())[:100]}"
        raise FormatError(path, "", what) from error


def _sound(array: NDArray[Any]) -> NDArray[Any]:
    """The same array; raises ValueError if it holds texts with numbers that stand for no character."""
    if array.dtype.kind == "U" and array.dtype.itemsize and array.size:
        codes = np.frombuffer(array.tobytes(), f"{array.dtype.byteorder.replace('|', '=')}u4")
        if codes.max() > sys.maxunicode:
            raise ValueError("a text that is none")
    return array


def _is_plain(members: Any, name: str) -> bool:
    """Whether a member is an array without objects: its header says so."""
    with members.zip.open(f"{name}.npy" if f"{name}.npy" in members.zip.namelist() else name) as stream:
        return _header(stream)[1].hasobject is False


def _header(stream: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    return shape, dtype


def _one(path: Path, stream: Any, size: int) -> NDArray[Any]:
    shape, dtype = _header(stream)
    if dtype.hasobject:
        raise FormatError(path, "", _PICKLED)
    if int(np.prod(shape, dtype=object)) * dtype.itemsize > size:
        raise FormatError(path, "", f"announces an array of the shape {shape}, which the file does not hold")
    stream.seek(0)
    array: NDArray[Any] = np.load(stream, allow_pickle=False)
    return array


def _is_array(head: bytes, path: Path) -> bool:
    name = path.name.lower()
    is_archive = head.startswith(b"PK\x03\x04") and name.endswith(".npz") and not name.endswith(TRUTH_SUFFIX)
    return head.startswith(b"\x93NUMPY") or is_archive


FORMAT = Format(
    name="numpy",
    title="NumPy array of points",
    suffixes=(".npy", ".npz"),
    holds="markers",
    sniff=_is_array,
    read=read_arrays,
    options=(POINTS, RECORDED_RATE, RECORDED_UNIT),
    note="Shape (frames, points, 3) or another order; in .npz also names, rate or times, unit, flags; else by option.",
)
