"""What a C3D file says of itself, checked against the file's size before anything is allocated.

Layout: blocks of 512 bytes. The first is the header, in words of 16 bits:

======  ==========================================================================================
byte    header
======  ==========================================================================================
0       number of the block at which the parameters begin, usually 2
1       80, the mark of a C3D file
2       number of points
4       analogue values per frame, over all channels and their samples
6       number of the first frame
8       number of the last frame
12      f32 scale: below 0, data are f32; else data are i16 and count in units of the scale
16      number of the block at which the data begin
18      analogue samples per frame and channel
20      f32 frame rate
======  ==========================================================================================

The parameters begin with 4 bytes (two reserved, number of blocks, processor: 84 Intel, 85 DEC, 86 MIPS) and are a
chain of records: i8 length of the name, i8 id (below 0 a group, else a parameter of the group -id), the name, i16
bytes to the next record (0 ends the chain); a parameter goes on with i8 type (-1 text, 1 i8, 2 i16, 4 f32), u8 number
of dimensions, u8 per dimension, the values, u8 length of the description, the description.

The data hold, frame by frame, x, y, z and residual of each point and then the analogue samples, all f32 or all i16.

Frames beyond 65535 do not fit the header's words. Vicon and this writer state them in TRIAL:ACTUAL_START_FIELD and
ACTUAL_END_FIELD (two u16, low word first), c3d.org in POINT:LONG_FRAMES; without either the data are counted.
"""

import math
import os
import struct
from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.files import open_regular

BLOCK = 512
MAGIC = 0x50
MOST_HEADER_FRAMES = 65535
WORDS_PER_POINT = 4
_PROCESSORS = {84: "<", 85: "<", 86: ">"}  # DEC words are little-endian; only its f32 differ
_DEC = 85
_END_OF_CHAIN = 0
_TYPES = {-1: "S1", 1: "i1", 2: "i2", 4: "f4"}
_MOST_DIMENSIONS = 7
_BIGGEST_RATE = 1e6  # Hz; no camera is faster
_BIGGEST_SCALE = 1e6  # units per count of an i16

Values = NDArray[Any]
Parameters = Mapping[tuple[str, str], Values]


@dataclass(frozen=True, eq=False)
class C3dLayout:
    """What header and parameters say, found consistent with each other and with the file's size.

    Attributes
    ----------
    n_points, n_frames, n_analog : int
        Points, frames, analogue samples per frame.
    rate : float, Hz
        Frame rate.
    scale : float
        File's unit per count for i16 data; below 0 for f32 data.
    data_start : int
        Byte at which the data begin.
    order : str
        ``<`` or ``>``.
    dec : bool
        Whether f32 are in DEC's layout.
    parameters : mapping of (group, parameter) to ndarray
        Upper-case names; text as arrays of bytes, first index fastest as in the file.
    counted : bool
        Whether the number of frames was counted from the file's size, for lack of a statement.
    notices : tuple of str
        What the file states wrongly, and what was taken instead.
    """

    n_points: int
    n_frames: int
    n_analog: int
    rate: float
    scale: float
    data_start: int
    order: str
    dec: bool
    parameters: Parameters
    counted: bool
    notices: tuple[str, ...] = ()

    @property
    def frame_words(self) -> int:
        """Values per frame."""
        return WORDS_PER_POINT * self.n_points + self.n_analog

    @property
    def word_bytes(self) -> int:
        """Bytes of a value: 4 for f32, 2 for i16."""
        return 4 if self.scale < 0 else 2

    def texts(self, group: str, name: str) -> list[str]:
        """Return a text parameter as stripped strings; the numbered continuations (``LABELS2``) follow.

        Parameters
        ----------
        group, name : str
            Of the parameter.
        """
        found: list[str] = []
        number = 1
        while (group, name if number == 1 else f"{name}{number}") in self.parameters:
            found += _strings(self.parameters[group, name if number == 1 else f"{name}{number}"])
            number += 1
        return found


def read_layout(path: Path) -> C3dLayout:
    """Read and check header and parameters.

    Raises
    ------
    FormatError
        If the file is no C3D file, or its header or parameters contradict each other or the file's size.
    """
    try:
        with open_regular(path) as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(0)
            head = stream.read(BLOCK)
            order, dec, records = _parameter_section(path, head, stream, size)
    except OSError as error:
        raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error
    parameters, junk = _parameters(path, records, order, dec)
    layout = _layout(path, head, order, dec, parameters, size)
    return replace(layout, notices=(*junk, *layout.notices))


def dec_floats(raw: bytes) -> NDArray[np.float32]:
    """Return numbers in DEC's 32-bit layout: 16-bit halves swapped, exponent biased by two more."""
    halves = np.frombuffer(raw, "<u2").reshape(-1, 2)[:, ::-1]
    with np.errstate(invalid="ignore"):  # a NaN that signals is a NaN
        return np.asarray(np.ascontiguousarray(halves).view("<f4").reshape(-1) / 4, dtype=np.float32)


def _parameter_section(path: Path, head: bytes, stream: Any, size: int) -> tuple[str, bool, bytes]:
    if len(head) == 0:
        raise FormatError(path, "", "the file is empty")
    if len(head) < BLOCK or head[1] != MAGIC:
        raise FormatError(path, "byte 1", "a C3D file has 80 there and a header of 512 bytes; this is another file")
    start = (head[0] - 1) * BLOCK
    if head[0] == 0 or start + BLOCK > size:
        raise FormatError(path, "byte 0", f"the header puts the parameters in block {head[0]}, outside the file")
    stream.seek(start)
    begin = stream.read(4)
    n_blocks, processor = begin[2], begin[3]
    if processor not in _PROCESSORS:
        raise FormatError(path, f"byte {start + 3}", f"processor type {processor}; 84, 85 and 86 are known")
    order = _PROCESSORS[processor]
    (data_block,) = struct.unpack_from(f"{order}H", head, 16)
    n_blocks = max(n_blocks, data_block - head[0], 1)  # some writers state too few blocks
    return order, processor == _DEC, stream.read(n_blocks * BLOCK - 4)


def _parameters(path: Path, records: bytes, order: str, dec: bool) -> tuple[Parameters, list[str]]:
    """Return the parameters, and a sentence if their chain does not end as it should.

    The pointer of the last record is junk in some files, so that the chain goes on into nothing: it ends there, if the
    labels of the points were found.
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


def _layout(path: Path, head: bytes, order: str, dec: bool, parameters: Parameters, size: int) -> C3dLayout:
    n_points, n_analog, first, last = struct.unpack_from(f"{order}4H", head, 2)
    (data_block,) = struct.unpack_from(f"{order}H", head, 16)
    scale = _float(head[12:16], order, dec)
    rate = _number(parameters, ("POINT", "RATE"), _float(head[20:24], order, dec))
    rate = float(str(np.float32(rate)))  # 59.94, not 59.93999862670898, from which no clean times come
    data_start = (data_block - 1) * BLOCK
    if n_points == 0:
        raise FormatError(path, "byte 2", "the file holds no points; analogue data alone cannot be used")
    if not 0 < data_start < size:
        raise FormatError(path, "byte 16", f"the header puts the data in block {data_block}, outside the file")
    if not (math.isfinite(scale) and 0 < abs(scale) <= _BIGGEST_SCALE):
        raise FormatError(path, "byte 12", f"the scale is {scale:g}; a finite number other than 0 belongs there")
    if not 0 < rate <= _BIGGEST_RATE:
        raise FormatError(path, "byte 20", f"the frame rate is {rate:g} Hz; it must be above 0 and below a million")
    n_frames = _announced_frames(path, first, last, parameters, order)
    sizes = _Sizes(n_frames or 0, n_points, n_analog, scale)
    notices: tuple[str, ...] = ()
    if n_frames is not None and not sizes.fills(size - data_start):
        (samples,) = struct.unpack_from(f"{order}H", head, 18)
        fitting = _fitting(sizes, parameters, samples, rate, size - data_start)
        if fitting is not None:
            sizes, notices = fitting, (sizes.differs_from(fitting),)
    used = _number(parameters, ("POINT", "USED"), n_points) % (MOST_HEADER_FRAMES + 1)
    if not notices and used != n_points:
        raise FormatError(path, "byte 2", f"the header says {n_points} points and POINT:USED {used:g}; one is damaged")
    held = (size - data_start) // sizes.frame_bytes
    counted = n_frames is None
    frames = held if counted else min(sizes.n_frames, held)
    if frames == 0 and not counted:
        what = f"{sizes.n_frames} frames are announced, and the file is cut off within the first one"
        raise FormatError(path, "frame 1", what)
    if not counted and held < sizes.n_frames:
        missing = f"{held} of {sizes.n_frames} frames are there, and are taken; the end of the recording is missing"
        notices = (*notices, f"the file is cut off: {missing}")
    known = (order, dec, parameters, counted, notices)
    return C3dLayout(sizes.n_points, frames, sizes.n_analog, rate, sizes.scale, data_start, *known)


@dataclass(frozen=True)
class _Sizes:
    """What the size of the data follows from."""

    n_frames: int
    n_points: int
    n_analog: int
    scale: float

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame."""
        return (WORDS_PER_POINT * self.n_points + self.n_analog) * (4 if self.scale < 0 else 2)

    def fills(self, n_bytes: int) -> bool:
        """Whether the data take all bytes but what fills the last block."""
        return 0 <= n_bytes - self.n_frames * self.frame_bytes < BLOCK

    def n_differences(self, other: "_Sizes") -> int:
        """In how many numbers another one differs."""
        return sum(ours != theirs for ours, theirs in zip(astuple(self), astuple(other), strict=True))

    def differs_from(self, other: "_Sizes") -> str:
        """Say what is wrong here."""
        words = {"n_frames": "frames", "n_points": "points", "n_analog": "analogue values per frame", "scale": "scale"}
        pairs = [(words[name], getattr(self, name), getattr(other, name)) for name in words]
        wrong = ", ".join(f"{ours:g} {word} where {theirs:g} are" for word, ours, theirs in pairs if ours != theirs)
        return f"the header contradicts the size of the file, which decides: it states {wrong}"


def _fitting(stated: _Sizes, parameters: Parameters, samples: int, rate: float, n_bytes: int) -> _Sizes | None:
    """Return the sizes nearest to those stated that fill the file, by what its parameters say; None if none do."""
    ratio = round(_number(parameters, ("ANALOG", "RATE"), 0.0) / rate)
    channels = int(_number(parameters, ("ANALOG", "USED"), 0.0))
    most = MOST_HEADER_FRAMES + 1
    frames = [stated.n_frames, int(_number(parameters, ("POINT", "FRAMES"), 0.0)) % most]
    points = [stated.n_points, int(_number(parameters, ("POINT", "USED"), 0.0)) % most]
    analog = [stated.n_analog, *(one * times for one in (channels, stated.n_analog) for times in (samples, ratio, 1))]
    scales = [stated.scale, _number(parameters, ("POINT", "SCALE"), 0.0)]
    room = n_bytes // (4 if stated.scale < 0 else 2)  # words; analogue values may be what nothing states
    whole = room // max(stated.n_frames, 1) - WORDS_PER_POINT * stated.n_points
    if whole > stated.n_analog > 0:
        analog.append(whole - whole % stated.n_analog)
    fitting = [
        sizes
        for n_frames, n_points, n_analog in product(*(dict.fromkeys(counts) for counts in (frames, points, analog)))
        for scale in dict.fromkeys(scales)
        if n_frames > 0 and n_points > 0 and 0 < abs(scale) <= _BIGGEST_SCALE
        if (sizes := _Sizes(n_frames, n_points, n_analog, scale)).fills(n_bytes)
    ]
    return min(fitting, key=stated.n_differences, default=None)


def _announced_frames(path: Path, first: int, last: int, parameters: Parameters, order: str) -> int | None:
    """Return how many frames the file says it has; None if there are more than its words can say."""
    start, end = (_long_word(parameters, f"ACTUAL_{which}_FIELD", order) for which in ("START", "END"))
    if start is not None and end is not None and end >= start and end > MOST_HEADER_FRAMES:
        return end - start + 1
    long_frames = _number(parameters, ("POINT", "LONG_FRAMES"), 0.0)
    if long_frames > MOST_HEADER_FRAMES:
        return int(long_frames)
    if last == MOST_HEADER_FRAMES:
        return None
    if last < first:
        raise FormatError(path, "byte 6", f"the first frame is {first} and the last {last}; the header is damaged")
    return last - first + 1


def _long_word(parameters: Parameters, name: str, order: str) -> int | None:
    values = parameters.get(("TRIAL", name))
    if values is None or values.size != 2 or values.dtype.kind != "i":  # low and high word
        return None
    low, high = values.reshape(-1).astype(np.int64) % (MOST_HEADER_FRAMES + 1)
    return int(low + (MOST_HEADER_FRAMES + 1) * high)


def _number(parameters: Parameters, key: tuple[str, str], default: float) -> float:
    values = parameters.get(key)
    if values is None or values.size == 0 or values.dtype.kind == "S":
        return default
    value = float(values.reshape(-1)[0])
    return value if math.isfinite(value) else default


def _float(raw: bytes, order: str, dec: bool) -> float:
    return float(dec_floats(raw)[0]) if dec else float(struct.unpack(f"{order}f", raw)[0])


def _strings(values: Values) -> list[str]:
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
