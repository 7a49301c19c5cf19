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

The data hold, frame by frame, x, y, z and residual of each point and then the analogue samples, all f32 or all i16.

Frames beyond 65535 do not fit the header's words. Vicon and this writer state them in TRIAL:ACTUAL_START_FIELD and
ACTUAL_END_FIELD (two u16, low word first), c3d.org in POINT:LONG_FRAMES; without either the data are counted.
"""

import math
import os
import struct
from dataclasses import astuple, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import open_regular
from skelgen.progress import counted
from skelgen_formats.c3d.parameters import Parameters, float_of, number_of, parameters_of, strings_of

BLOCK = 512
MAGIC = 0x50
MOST_HEADER_FRAMES = 65535
WORDS_PER_POINT = 4
_PROCESSORS = {84: "<", 85: "<", 86: ">"}  # DEC words are little-endian; only its f32 differ
_DEC = 85
_BIGGEST_RATE = 1e6  # Hz; no camera is faster
_RATE_TOLERANCE = 0.01  # of the rate: what rounding makes of it
_BIGGEST_SCALE = 1e6  # units per count of an i16
_PIECE = 1 << 20  # bytes read at once


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
            found += strings_of(self.parameters[group, name if number == 1 else f"{name}{number}"])
            number += 1
        return found


def read_layout(path: Path) -> C3dLayout:
    """Read and check header and parameters.

    Raises
    ------
    FormatError
        If the file is no C3D file, or its header or parameters contradict each other or the file's size.
    """
    with open_regular(path) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        head = stream.read(BLOCK)
        order, dec, records = _parameter_section(path, head, stream, size)
    parameters, junk = parameters_of(path, records, order, dec)
    layout = _layout(path, head, order, dec, parameters, size)
    return replace(layout, notices=(*junk, *layout.notices))


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


def _layout(path: Path, head: bytes, order: str, dec: bool, parameters: Parameters, size: int) -> C3dLayout:
    n_points, n_analog, first, last = struct.unpack_from(f"{order}4H", head, 2)
    notices: list[str] = []
    scale, rate = float_of(head[12:16], order, dec), _rate(head, order, dec, parameters, notices)
    data_start = _data_start(path, head, order, parameters, size, notices)
    if n_points == 0 and not has_rotations(parameters):
        raise FormatError(path, "byte 2", "the file holds no points; analogue data alone cannot be used")
    if not (math.isfinite(scale) and 0 < abs(scale) <= _BIGGEST_SCALE):
        raise FormatError(path, "byte 12", f"the scale is {scale:g}; a finite number other than 0 belongs there")
    if not 0 < rate <= _BIGGEST_RATE:
        raise FormatError(path, "byte 20", f"the frame rate is {rate:g} Hz; it must be above 0 and below a million")
    n_frames = _announced_frames(first, last, parameters)
    known = (order, dec, parameters, n_frames is None)
    if n_points == 0:
        return C3dLayout(0, n_frames or 0, n_analog, rate, scale, data_start, *known, tuple(notices))
    sizes = _Sizes(n_frames or 0, n_points, n_analog, scale)
    room = _end_of_points(parameters, data_start, size) - data_start
    used = number_of(parameters, ("POINT", "USED"), n_points) % (MOST_HEADER_FRAMES + 1)
    if n_frames is not None and not (sizes.fills(room) or sizes.is_followed_by_zeros(path, data_start, room)):
        (samples,) = struct.unpack_from(f"{order}H", head, 18)
        fitting = _fitting(sizes, parameters, samples, rate, room)
        if fitting is not None:
            notices.append(sizes.differs_from(fitting))
            sizes = fitting
        elif last < first:
            raise FormatError(path, "byte 6", f"the first frame is {first} and the last {last}; the header is damaged")
        elif used != n_points:
            what = f"the header says {counted(n_points, 'point')} and POINT:USED {used:g}; one is damaged"
            raise FormatError(path, "byte 2", what)
    elif used != n_points:
        notices.append(f"POINT:USED says {used:g} points; the {n_points} of the header are what the file has")
    frames = _frames_held(path, sizes, data_start, room, n_frames is None, notices)
    return C3dLayout(sizes.n_points, frames, sizes.n_analog, rate, sizes.scale, data_start, *known, tuple(notices))


def _rate(head: bytes, order: str, dec: bool, parameters: Parameters, notices: list[str]) -> float:
    """Return the frame rate by POINT:RATE, or by the header where it says none."""
    # 59.94, not 59.93999862670898, from which no clean times come
    stated, other = (
        float(str(np.float32(rate)))
        for rate in (number_of(parameters, ("POINT", "RATE"), 0.0), float_of(head[20:24], order, dec))
    )
    if stated > 0 and 0 < other <= _BIGGEST_RATE and abs(stated - other) > _RATE_TOLERANCE * stated:
        notices.append(f"the header says {other:g} Hz and POINT:RATE {stated:g} Hz, which is taken")
    return stated if stated > 0 else other


def has_rotations(parameters: Parameters) -> bool:
    """Whether a file holds the rotations of segments, as Theia and Visual3D write them behind the points."""
    return number_of(parameters, ("ROTATION", "USED"), 0.0) > 0 and ("ROTATION", "DATA_START") in parameters


def byte_of_block(parameters: Parameters, group: str) -> int:
    """Return the byte at which the data of a group begin by its DATA_START; below 0 if it says nothing.

    Parameters
    ----------
    parameters : mapping of (group, parameter) to ndarray
        As `C3dLayout` has them.
    group : str
        ``POINT`` or ``ROTATION``.
    """
    return (int(number_of(parameters, (group, "DATA_START"), 0.0)) % (MOST_HEADER_FRAMES + 1) - 1) * BLOCK


def _data_start(path: Path, head: bytes, order: str, parameters: Parameters, size: int, notices: list[str]) -> int:
    """Return the byte at which the data begin: as the header says, or POINT:DATA_START where that cannot be."""
    data_block = int(struct.unpack_from(f"{order}H", head, 16)[0])
    stated, other = (data_block - 1) * BLOCK, byte_of_block(parameters, "POINT")
    if 0 < stated < size:
        return stated
    if not 0 < other < size:
        raise FormatError(path, "byte 16", f"the header puts the data in block {data_block}, outside the file")
    notices.append(f"the header puts the data in block {data_block}, outside the file; POINT:DATA_START is taken")
    return other


def _end_of_points(parameters: Parameters, data_start: int, size: int) -> int:
    rotations = byte_of_block(parameters, "ROTATION") if has_rotations(parameters) else size
    return rotations if data_start < rotations < size else size


def _frames_held(path: Path, sizes: "_Sizes", data_start: int, room: int, counted: bool, notices: list[str]) -> int:
    """Return how many of the frames are there; say so where the file is cut off."""
    held = room // sizes.frame_bytes
    if counted:
        return held
    if held == 0:
        what = f"{sizes.n_frames} frames are announced, and the file is cut off within the first one"
        raise FormatError(path, "frame 1", what)
    if held < sizes.n_frames:
        missing = f"{held} of {sizes.n_frames} frames are there, and are taken; the end of the recording is missing"
        notices.append(f"the file is cut off: {missing}")
    surplus = room - sizes.n_frames * sizes.frame_bytes
    if surplus >= BLOCK and not sizes.is_followed_by_zeros(path, data_start, room):
        notices.append(f"{surplus} bytes behind the frames, of which nothing says what they are, are left out")
    return min(sizes.n_frames, held)


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

    def is_followed_by_zeros(self, path: Path, start: int, n_bytes: int) -> bool:
        """Whether behind the data, which begin at a byte of the file, nothing but zeros stand."""
        end = self.n_frames * self.frame_bytes
        if not 0 < end <= n_bytes:
            return False
        with open_regular(path) as stream:
            stream.seek(start + end)
            return not any(stream.read(min(_PIECE, n_bytes - at)).strip(b"\0") for at in range(end, n_bytes, _PIECE))

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
    ratio = round(number_of(parameters, ("ANALOG", "RATE"), 0.0) / rate)
    channels = int(number_of(parameters, ("ANALOG", "USED"), 0.0))
    most = MOST_HEADER_FRAMES + 1
    named = int(number_of(parameters, ("POINT", "FRAMES"), 0.0))
    wraps = (n_bytes // stated.frame_bytes - stated.n_frames) // most  # of a word that counts to 65535
    frames = [stated.n_frames, named % most, named, stated.n_frames + max(0, wraps) * most]
    points = [stated.n_points, int(number_of(parameters, ("POINT", "USED"), 0.0)) % most]
    analog = [stated.n_analog, *(one * times for one in (channels, stated.n_analog) for times in (samples, ratio, 1))]
    scales = [stated.scale, number_of(parameters, ("POINT", "SCALE"), 0.0)]
    room = n_bytes // (4 if stated.scale < 0 else 2)  # words; analogue values may be what nothing states
    whole = room // max(stated.n_frames, 1) - WORDS_PER_POINT * stated.n_points
    if whole > stated.n_analog > 0 and channels * ratio != stated.n_analog:
        analog.append(whole - whole % stated.n_analog)
    fitting = [
        sizes
        for n_frames, n_points, n_analog in product(*(dict.fromkeys(counts) for counts in (frames, points, analog)))
        for scale in dict.fromkeys(scales)
        if n_frames > 0 and n_points > 0 and 0 < abs(scale) <= _BIGGEST_SCALE
        if (sizes := _Sizes(n_frames, n_points, n_analog, scale)).fills(n_bytes)
    ]
    return min(fitting, key=stated.n_differences, default=None)


def _announced_frames(first: int, last: int, parameters: Parameters) -> int | None:
    """Return how many frames the file says it has; None if there are more than its words can say."""
    start, end = (_long_word(parameters, f"ACTUAL_{which}_FIELD") for which in ("START", "END"))
    if start is not None and end is not None and end >= start and end > MOST_HEADER_FRAMES:
        return end - start + 1
    long_frames = number_of(parameters, ("POINT", "LONG_FRAMES"), 0.0)
    if long_frames > MOST_HEADER_FRAMES:
        return int(long_frames)
    return None if last == MOST_HEADER_FRAMES else (last - first + 1) % (MOST_HEADER_FRAMES + 1)


def _long_word(parameters: Parameters, name: str) -> int | None:
    values = parameters.get(("TRIAL", name))
    if values is None or values.size != 2 or values.dtype.kind != "i":  # low and high word
        return None
    low, high = values.reshape(-1).astype(np.int64) % (MOST_HEADER_FRAMES + 1)
    return int(low + (MOST_HEADER_FRAMES + 1) * high)
