"""What a C3D file holds beside its points: analogue values, force plates, events; kept when it is written back."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.files import open_regular, read_content
from skelgen.geometry.up_axis import TURNS
from skelgen.model import Trajectories
from skelgen_formats.c3d.layout import BLOCK, MAGIC, MOST_HEADER_FRAMES, WORDS_PER_POINT, C3dLayout, read_layout
from skelgen_formats.c3d.parameters import Values, dec_floats
from skelgen_formats.markers import mm_per_unit
from skelgen_formats.options import per_mm

EVENTS_AT = 298
"""Byte of the header at which the events of older files begin."""

_FIRST_AT, _SAMPLES_AT = 6, 18  # bytes of the header
_SAME_RATE = 1e-6  # of it
_CORNERS, _ORIGIN = ("FORCE_PLATFORM", "CORNERS"), ("FORCE_PLATFORM", "ORIGIN")


@dataclass(frozen=True, eq=False)
class Companions:
    """What lies beside the points in a file whose frames are those of a take.

    Attributes
    ----------
    path : Path
        The file.
    layout : C3dLayout
        Where its data are.
    groups : mapping of (group, parameter) to ndarray
        All parameters but those of POINT, force plates in the axes and the unit of the new file.
    first_frame, samples : int
        Number of the first frame; analogue samples per frame and channel.
    events : bytes
        The part of the header that older files keep events in.
    """

    path: Path
    layout: C3dLayout
    groups: dict[tuple[str, str], Values]
    first_frame: int
    samples: int
    events: bytes

    def analog(self, first: int, count: int) -> NDArray[np.float32]:
        """Return the analogue values of some frames as they stand in the file, shape (count, n per frame).

        Parameters
        ----------
        first, count : int
            The first frame, counted from 0, and how many.
        """
        layout = self.layout
        frame_bytes = layout.frame_words * layout.word_bytes
        with open_regular(self.path) as stream:
            stream.seek(layout.data_start + first * frame_bytes)
            raw = stream.read(count * frame_bytes)
        if layout.scale < 0:
            words = dec_floats(raw) if layout.dec else np.frombuffer(raw, f"{layout.order}f4")
        else:
            is_unsigned = "UNSIGNED" in layout.texts("ANALOG", "FORMAT")
            words = np.frombuffer(raw, f"{layout.order}{'u2' if is_unsigned else 'i2'}")
        frames = words.reshape(-1, layout.frame_words)[:, WORDS_PER_POINT * layout.n_points :]
        return np.asarray(frames, dtype="<f4")


def companions_of(take: Trajectories, axes: str, unit: str) -> Companions | None:
    """Return what lies beside the points of the C3D file that a take was read from.

    Parameters
    ----------
    take : Trajectories
        The take.
    axes : str
        Axes that it was turned to, a key of `TURNS`.
    unit : str
        Of the lengths in the new file.

    Returns
    -------
    Companions or None
        None if the take comes from another format, the file is not there any more, or its frames are others.
    """
    path = Path(take.origin)
    try:
        head = read_content(path, BLOCK) if take.origin else b""
        if len(head) < BLOCK or head[1] != MAGIC:
            return None
        layout = read_layout(path)
    except FormatError:
        return None
    if layout.n_frames != take.n_frames or abs(layout.rate / take.rate - 1) > _SAME_RATE:
        return None
    first, samples = (struct.unpack_from(f"{layout.order}H", head, at)[0] for at in (_FIRST_AT, _SAMPLES_AT))
    groups = {key: values for key, values in layout.parameters.items() if key[0] not in {"POINT", "ROTATION", ""}}
    stated = [text for text in layout.texts("POINT", "UNITS") if text]
    factor = mm_per_unit(path, "POINT:UNITS", stated[0]) * per_mm(unit) if stated else 1.0
    for key in (_CORNERS, _ORIGIN):
        if key in groups and groups[key].dtype.kind == "f":
            groups[key] = groups[key] * np.float32(factor)
    if (corners := groups.get(_CORNERS)) is not None and corners.ndim > 1 and corners.shape[0] == len(TURNS[axes][0]):
        order, signs = TURNS[axes]
        groups[_CORNERS] = (corners[list(order)].T * np.array(signs)).T.astype("<f4")
    first = first if first > 0 and first + take.n_frames <= MOST_HEADER_FRAMES else 1
    events = b"" if layout.order == ">" or layout.dec else head[EVENTS_AT:]
    return Companions(path, layout, groups, first, samples, events)
