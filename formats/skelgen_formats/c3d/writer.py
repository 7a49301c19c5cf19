"""Write C3D: one stream of frames, for takes that are there and for recordings that grow.

Data are f32, so positions keep 7 digits. A point that was not seen has residual -1 and lies at (0, 0, 0). Header and
parameters state how many frames there are; `C3dStream.complete_header` puts these numbers right, so that a recording is
whole whenever it ends. More than 65535 frames are stated in TRIAL:ACTUAL_END_FIELD, as Vicon does, and in
POINT:LONG_FRAMES, as c3d.org proposes; programs that know neither, ezc3d 1.7 among them, show the first 65535 frames.
More than 255 labels go on in POINT:LABELS2 and so forth.
"""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import PositionSource
from skelgen_formats.c3d.companions import Companions
from skelgen_formats.c3d.layout import BLOCK, MAGIC, MOST_HEADER_FRAMES, WORDS_PER_POINT
from skelgen_formats.c3d.parameters import Values
from skelgen_formats.options import per_mm
from skelgen_formats.writing import check_writable_names

_MEASURED_WORD, _COMPUTED_WORD, _UNSEEN_WORD = 257.0, 0.0, -1.0
"""Fourth word of a point: its residual, and 256 times the mask of the cameras that saw it (residual 1, camera 1)."""

_FRAMES_AT_ONCE = 4096
_MOST_TEXTS = 255  # per parameter; more go on in LABELS2 and so forth
_LONGEST_NAME = 127  # the format has signed bytes for some lengths
_MOST_POINTS = 65535
_MOST_BLOCKS = 255  # that the parameters can state; readers find the data by the header
_INTEL, _FLOATS, _INTS, _TEXT = 84, 4, 2, -1
_LAST_FRAME_AT, _RATE_AT = 8, 20  # bytes of the header
_MAX_GAP = 10  # frames that a reader may interpolate; a number belongs there

Words = NDArray[np.float32]


def write_points(
    take: Trajectories,
    path: Path,
    unit: str,
    source: Ints | None = None,
    companions: Companions | None = None,
    descriptions: Sequence[str] = (),
) -> None:
    """Write the points of a C3D file.

    Parameters
    ----------
    take : Trajectories
        The points.
    path : Path
        The file.
    unit : str
        Of the lengths in it.
    source : ndarray of intp, shape (n_frames, n_markers), optional
        A `PositionSource` of each, by which computed points differ from measured ones: these have residual 1, camera 1,
        computed ones residual 0 and no camera. Without it all points have residual 0.
    companions : Companions, optional
        What is written beside them.
    descriptions : sequence of str
        Of the points, empty where there is none; none at all if not given.

    Raises
    ------
    WriteError
        If there is no frame, there are too many points, a name is too long or twice there, or the disk is full.
    """
    names = check_point_names(path, take.names)
    if take.n_frames == 0:
        raise WriteError(f"{path}: a C3D file needs at least one frame")
    with replacing(path) as temporary, temporary.open("wb") as content:
        stream = C3dStream(content, names, take.rate, unit, companions, descriptions)
        for first in range(0, take.n_frames, _FRAMES_AT_ONCE):
            chosen = slice(first, first + _FRAMES_AT_ONCE)
            positions = take.positions[chosen] * per_mm(unit)
            words = point_words(positions, None if source is None else source[chosen])
            analog = None if companions is None else companions.analog(first, len(words))
            stream.append(words, analog)
        stream.complete_header()


def check_point_names(path: Path, names: Sequence[str]) -> list[str]:
    """Return names that a C3D file can hold, stripped.

    Parameters
    ----------
    path : Path
        The file, for errors.
    names : sequence of str
        Of the points.

    Raises
    ------
    WriteError
        If there are too many, or one is too long or twice there; the error begins with `path`.
    """
    stripped = check_writable_names(path, names, "", str.strip)
    too_long = [name for name in stripped if len(name.encode()) > _LONGEST_NAME]
    if too_long or len(names) > _MOST_POINTS:
        what = f"the name {too_long[0]!r} is too long" if too_long else f"{len(names)} markers are too many"
        raise WriteError(f"{path}: {what} for C3D; csm or trc can hold it")
    return stripped


def point_words(positions: Floats, source: Ints | None = None) -> Words:
    """Return x, y, z and the fourth word of points as they stand in a file, shape (n_frames, n_points, 4).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3)
        In the file's unit; NaN where unseen.
    source : ndarray of intp, shape (n_frames, n_points), optional
        A `PositionSource` of each.
    """
    unseen = np.isnan(positions).any(axis=-1)
    words = np.zeros((*positions.shape[:2], WORDS_PER_POINT), dtype="<f4")
    words[..., :3] = positions
    words[unseen, :3] = 0.0
    if source is not None:
        words[..., 3] = np.where(source == PositionSource.MEASURED, _MEASURED_WORD, _COMPUTED_WORD)
    words[unseen, 3] = _UNSEEN_WORD
    return words


class C3dStream:
    """Header and parameters of a C3D file, and its frames as they come.

    Parameters
    ----------
    content : binary stream
        Open for writing, at its beginning; the caller closes it.
    names : sequence of str
        Of the points, from `check_point_names`.
    rate : float, Hz
        Frame rate.
    unit : str
        Of the lengths.
    companions : Companions, optional
        What is written beside the points.
    descriptions : sequence of str
        Of the points, or none.

    Attributes
    ----------
    n_frames : int
        Frames appended so far.
    """

    def __init__(
        self,
        content: BinaryIO,
        names: Sequence[str],
        rate: float,
        unit: str,
        companions: Companions | None = None,
        descriptions: Sequence[str] = (),
    ) -> None:
        self._content, self.n_frames = content, 0
        records = _Records(names, descriptions, rate, unit, {} if companions is None else companions.groups)
        self._first, n_analog, samples = 1, 0, 0
        if companions is not None:
            self._first, n_analog, samples = companions.first_frame, companions.layout.n_analog, companions.samples
        n_blocks = -(-len(records.chain) // BLOCK)
        records.put("POINT:DATA_START", struct.pack("<H", 2 + n_blocks))
        header = (2, MAGIC, len(names), n_analog, self._first, 0, _MAX_GAP, -1.0, 2 + n_blocks, samples, rate)
        records.chain[:4] = bytes([1, MAGIC, min(n_blocks, _MOST_BLOCKS), _INTEL])
        events = b"" if companions is None else companions.events
        content.write(struct.pack("<BBHHHHHfHHf", *header).ljust(BLOCK - len(events), b"\0") + events)
        content.write(records.chain.ljust(n_blocks * BLOCK, b"\0"))
        self._place_of = {name: BLOCK + place for name, place in records.place_of.items()}
        self._end = BLOCK * (1 + n_blocks)

    def append(self, words: Words, analog: Words | None = None) -> None:
        """Append frames.

        Parameters
        ----------
        words : ndarray, shape (n_frames, n_points, 4)
            From `point_words`.
        analog : ndarray, shape (n_frames, n per frame), optional
            Analogue values.
        """
        frames = words if analog is None else np.concatenate([words.reshape(len(words), -1), analog], axis=1)
        self._content.write(frames.tobytes())
        self._end += frames.nbytes
        self.n_frames += len(words)

    def complete_header(self, rate: float | None = None) -> None:
        """State how many frames there are, and fill the last block; more frames may follow.

        Parameters
        ----------
        rate : float, Hz, optional
            A better frame rate than that of the beginning.
        """
        last = self._first + self.n_frames - 1
        self._put(_LAST_FRAME_AT, struct.pack("<H", min(last, MOST_HEADER_FRAMES)))
        self._put(self._place_of["POINT:FRAMES"], struct.pack("<H", min(self.n_frames, MOST_HEADER_FRAMES)))
        self._put(self._place_of["POINT:LONG_FRAMES"], struct.pack("<f", self.n_frames))
        self._put(self._place_of["TRIAL:ACTUAL_START_FIELD"], struct.pack("<HH", self._first, 0))
        high, low = divmod(last, MOST_HEADER_FRAMES + 1)
        self._put(self._place_of["TRIAL:ACTUAL_END_FIELD"], struct.pack("<HH", low, high))
        if rate is not None:
            for place in (_RATE_AT, self._place_of["POINT:RATE"]):
                self._put(place, struct.pack("<f", rate))
        self._put(self._end, bytes(-self._end % BLOCK))
        self._content.seek(self._end)
        self._content.flush()

    def _put(self, place: int, content: bytes) -> None:
        self._content.seek(place)
        self._content.write(content)


class _Records:
    """The chain of groups and parameters behind four bytes of its own, with the place of each parameter's values."""

    def __init__(
        self,
        names: Sequence[str],
        descriptions: Sequence[str],
        rate: float,
        unit: str,
        others: Mapping[tuple[str, str], Values],
    ) -> None:
        self.chain, self.place_of = bytearray(4), dict[str, int]()
        self._group, self._number = "", 0
        self._add_group("POINT")
        self._add("USED", _INTS, struct.pack("<H", len(names)))
        self._add("SCALE", _FLOATS, struct.pack("<f", -1.0))
        self._add("RATE", _FLOATS, struct.pack("<f", rate))
        self._add("DATA_START", _INTS, bytes(2))
        self._add("FRAMES", _INTS, bytes(2))
        self._add("LONG_FRAMES", _FLOATS, bytes(4))
        self._add("UNITS", _TEXT, unit.encode(), len(unit.encode()))
        for number, first in enumerate(range(0, len(names), _MOST_TEXTS), start=1):
            chosen, suffix = slice(first, first + _MOST_TEXTS), "" if number == 1 else str(number)
            self._add_texts(f"LABELS{suffix}", names[chosen])
            self._add_texts(f"DESCRIPTIONS{suffix}", descriptions[chosen] or [""] * len(names[chosen]))
        others = {key: values for key, values in others.items() if "ACTUAL_" not in key[1] or key[0] != "TRIAL"}
        if not any(group == "ANALOG" for group, _ in others):
            self._add_no_analog()
        for group in dict.fromkeys(group for group, _ in others):
            self._add_group(group)
            for (of, name), values in others.items():
                if of == group:
                    self._add_values(name, values)
            if group == "TRIAL":
                self._add_fields()
        if "TRIAL" not in {group for group, _ in others}:
            self._add_group("TRIAL")
            self._add_fields()
        self.chain += bytes(4)  # an empty record ends the chain

    def _add_fields(self) -> None:
        self._add("ACTUAL_START_FIELD", _INTS, struct.pack("<HH", 1, 0), 2)
        self._add("ACTUAL_END_FIELD", _INTS, bytes(4), 2)

    def _add_values(self, name: str, values: Values) -> None:
        """Add a parameter as it was read from another file, whatever its byte order."""
        little = values if values.dtype.kind == "S" else values.astype(values.dtype.newbyteorder("<"))
        kind = -1 if values.dtype.kind == "S" else values.dtype.itemsize
        self._add(name, kind, little.tobytes(order="F"), *values.shape)

    def _add_no_analog(self) -> None:
        self._add_group("ANALOG")
        self._add("USED", _INTS, bytes(2))
        for empty in ("LABELS", "DESCRIPTIONS", "UNITS"):
            self._add(empty, _TEXT, b"", 0, 0)
        self._add("GEN_SCALE", _FLOATS, struct.pack("<f", 1.0))
        self._add("SCALE", _FLOATS, b"", 0)
        self._add("OFFSET", _INTS, b"", 0)
        self._add("RATE", _FLOATS, bytes(4))
        self._add_group("FORCE_PLATFORM")
        self._add("USED", _INTS, bytes(2))

    def put(self, name: str, values: bytes) -> None:
        """Replace the values of a parameter, such as ``POINT:DATA_START``."""
        place = self.place_of[name]
        self.chain[place : place + len(values)] = values

    def _add_texts(self, name: str, texts: Sequence[str]) -> None:
        coded = [text.encode() for text in texts]
        width = max(map(len, coded))
        self._add(name, _TEXT, b"".join(text.ljust(width) for text in coded), width, len(coded))

    def _add_group(self, name: str) -> None:
        self._group, self._number = name, self._number + 1
        self._record(name, -self._number, b"")

    def _add(self, name: str, kind: int, values: bytes, *dimensions: int) -> None:
        head = struct.pack("<bB", kind, len(dimensions)) + bytes(dimensions)
        self.place_of[f"{self._group}:{name}"] = len(self.chain) + 2 + len(name) + 2 + len(head)
        self._record(name, self._number, head + values)

    def _record(self, name: str, number: int, content: bytes) -> None:
        rest = content + b"\0"  # no description
        self.chain += struct.pack("<bb", len(name), number) + name.encode() + struct.pack("<H", 2 + len(rest)) + rest
