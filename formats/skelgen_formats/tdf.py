"""TDF: marker tracks as BTS' SMART Tracker writes them.

All numbers are little-endian. The header has a signature, the number of entries, and entries that say of each block
what it is and where; the block of 3D points is one of them. Its tracks have a name of 256 bytes in windows-1252 and
segments: the frames in which the marker was seen, one after the other. Lengths are in metres. Layout after public
readers of such files (basictdf).
"""

from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import FormatError
from skelgen.files import read_content
from skelgen.model import PointCloud, Trajectories
from skelgen_formats.markers import scaled, take_from_markers, zeros_unseen
from skelgen_formats.options import POINTS, Format

_SIGNATURE = b"\x82K`A\xd3\x11\x84\xca`\x00\xb6\xac\x16h\x0c\x08"
_HEADER = np.dtype([("signature", "S16"), ("version", "<u4"), ("n_entries", "<i4"), ("rest", "V40")])
_ENTRY = np.dtype(
    [("type", "<u4"), ("format", "<u4"), ("offset", "<i4"), ("size", "<i4"), ("dates", "<i4", 4), ("comment", "V256")]
)
_BLOCK = np.dtype(
    [
        *(("n_frames", "<i4"), ("rate", "<i4"), ("start", "<f4"), ("n_tracks", "<u4")),
        *(("volume", "<f4", 3), ("turn", "<f4", 9), ("shift", "<f4", 3), ("flags", "<u4")),
    ]
)
_TRACK = np.dtype([("name", "V256"), ("n_segments", "<i4"), ("padding", "V4")])
_SEGMENT = np.dtype([("first", "<i4"), ("n_frames", "<i4")])
_POINTS_3D = 5  # type of the block
_BY_TRACK, _BY_TRACK_WITHOUT_LINKS = 1, 2  # its formats that are read
_LINK_BYTES, _COUNT_BYTES = 8, 8
_MM_PER_M = 1000.0
_MOST_TIMES, _FREE_BYTES = 100, 1 << 24  # positions of tracks that are seldom seen, beside the size of the file


def read_tdf(path: Path) -> Trajectories | PointCloud:
    """Read the 3D points of a TDF file.

    Returns
    -------
    Trajectories
        Positions in mm; a `PointCloud` if no trajectory has a label.

    Raises
    ------
    FormatError
        If the file is damaged, or holds no 3D points by track.
    """
    content = read_content(path)
    n_entries = int(_record(path, content, 0, _HEADER)["n_entries"])
    if not 0 <= n_entries <= len(content) // _ENTRY.itemsize:
        raise FormatError(path, "byte 20", f"announces {n_entries} blocks: the file is cut off or damaged")
    entries = [_record(path, content, _HEADER.itemsize + n * _ENTRY.itemsize, _ENTRY) for n in range(n_entries)]
    found = [entry for entry in entries if entry["type"] == _POINTS_3D]
    if not found:
        raise FormatError(path, "", "holds no 3D points; track the markers first, or export them as C3D")
    if found[0]["format"] not in (_BY_TRACK, _BY_TRACK_WITHOUT_LINKS):
        raise FormatError(path, "", "holds 3D points frame by frame, which is not read; export them as C3D")
    at = int(found[0]["offset"])
    block = _record(path, content, at, _BLOCK)
    at += _BLOCK.itemsize
    if found[0]["format"] == _BY_TRACK:
        n_links = int(_record(path, content, at, np.dtype([("n", "<i4"), ("padding", "V4")]))["n"])
        at += _COUNT_BYTES + max(0, n_links) * _LINK_BYTES
    if block["rate"] <= 0:
        raise FormatError(path, f"byte {found[0]['offset'] + 4}", f"the rate is {block['rate']} Hz; it must be above 0")
    positions, names = _tracks(path, content, at, int(block["n_frames"]), int(block["n_tracks"]))
    return take_from_markers(path, scaled(path, zeros_unseen(positions), _MM_PER_M), names, float(block["rate"]))


def _tracks(path: Path, content: bytes, at: int, n_frames: int, n_tracks: int) -> tuple[np.ndarray, list[str]]:
    """Return positions in m, shape (n_frames, n_tracks, 3), and the names of the tracks."""
    size = 24 * max(0, n_frames) * n_tracks
    if n_frames < 0 or n_tracks > len(content) // _TRACK.itemsize or size > _MOST_TIMES * len(content) + _FREE_BYTES:
        raise FormatError(path, f"byte {at}", f"announces {n_tracks} tracks of {n_frames} frames: not in such a file")
    positions, names = np.full((n_frames, n_tracks, 3), np.nan), []
    for track in range(n_tracks):
        head = _record(path, content, at, _TRACK)
        name = head["name"].tobytes().split(b"\0")[0].decode("windows-1252", "replace").strip()
        names.append(name or f"unlabelled {track + 1}")
        at += _TRACK.itemsize
        segments = _records(path, content, at, _SEGMENT, int(head["n_segments"]))
        at += segments.nbytes
        for first, count in zip(segments["first"].tolist(), segments["n_frames"].tolist(), strict=True):
            if first < 0 or count < 0 or first + count > n_frames:
                what = f"track {track + 1} lies in frames beyond the {n_frames} announced"
                raise FormatError(path, f"byte {at}", what)
            seen = _records(path, content, at, np.dtype("<f4"), 3 * count)
            with np.errstate(invalid="ignore"):  # a NaN that signals is a NaN
                positions[first : first + count, track] = seen.reshape(-1, 3)
            at += seen.nbytes
    return positions, names


def _record(path: Path, content: bytes, at: int, kind: np.dtype[Any]) -> Any:
    return _records(path, content, at, kind, 1)[0]


def _records(path: Path, content: bytes, at: int, kind: np.dtype[Any], count: int) -> Any:
    if at < 0 or count < 0 or at + count * kind.itemsize > len(content):
        raise FormatError(path, f"byte {at}", "the file is cut off or damaged: what is announced here is not there")
    return np.frombuffer(content, kind, count, at)


FORMAT = Format(
    name="tdf",
    title="BTS TDF",
    suffixes=(".tdf",),
    holds="markers",
    sniff=lambda head, path: head.startswith(_SIGNATURE),
    read=lambda path, options: read_tdf(path),
    options=(POINTS,),
    note="Tracks of BTS SMART, in metres; force plates, muscle signals and events are left out.",
)
