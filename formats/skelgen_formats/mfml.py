"""mfml: unlabelled points per frame as an optical tracker records them; layout in `mfml_stream`."""

import itertools
import mmap
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, WriteError
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled
from skelgen.model.rates import rate_of
from skelgen.progress import Monitor, with_progress
from skelgen_formats.lines import Sample
from skelgen_formats.markers import FARTHEST, cloud_from_markers
from skelgen_formats.mfml_stream import (
    FRAME_HEADER,
    MARKER_DTYPES,
    SECONDS_PER_UNIT,
    Content,
    Markers,
    UnparsableError,
    find_id_width,
    frame_headers,
    iterate_mfml,
    write_frames,
)
from skelgen_formats.options import Format, Option, Options, Writable

_HEADER_ROW = [("start", np.intp), ("count", np.intp), ("stamp", np.uint64)]
_EXACT_INTEGERS = 2**53  # up to here float64 holds every whole number, as the attribute `id` must
_PLAUSIBLE_MARKERS = 10_000  # a frame of a real capture has fewer; only for sniffing
_U32 = 2**32
_REMARK = "The recording is written as it was read: labels that were found or repaired are not in it."

__all__ = ["FORMAT", "iterate_mfml", "read_mfml", "write_frames"]


def read_mfml(
    path: Path, id_width: str = "auto", timestamp_unit: str = "us", sample: Sample | None = None
) -> PointCloud:
    """Read a tracker recording.

    Parameters
    ----------
    path : Path
        The file.
    id_width : str
        Bytes of a unique id: ``4``, ``8``, ``16``, or ``auto`` to find out.
    timestamp_unit : str
        ``us``, ``ms``, ``s`` or ``ns``.
    sample : Sample, optional
        Some frames only.

    Returns
    -------
    PointCloud
        Points in mm, time stamps in s, attributes ``reprojection_error`` [mm], ``n_blobs`` and ``id``; the notices say
        which id width was used.

    Raises
    ------
    FormatError
        If the file does not parse with any (or the given) id width, or holds no point.
    """
    with Content(path) as content:
        width, n_frames = find_id_width(path, content.view, id_width)
        headers = np.fromiter(frame_headers(content.view, width), dtype=_HEADER_ROW, count=n_frames)
        if not headers["count"].any():
            raise FormatError(path, "", "no marker is seen in any frame: there is nothing to reconstruct from")
        if sample:
            sample.rate = rate_of(headers["stamp"].astype(np.float64) * SECONDS_PER_UNIT[timestamp_unit])
            headers = headers[sample.of(np.arange(n_frames))]
            markers = _markers_in(content.view, width, headers)
        else:
            markers = _all_markers(content.view, width, headers["start"])
    starts = np.concatenate(([0], np.cumsum(headers["count"]))).astype(np.intp)
    _check_numbers(path, markers, starts)
    notices = [
        f"mfml names no unit of time: time stamps are read as {timestamp_unit} (--timestamp-unit states another one), "
        f"ids of points as {width} bytes"
    ]
    attributes = {
        "reprojection_error": markers["reprojection_error"],
        "n_blobs": markers["n_blobs"],
        "id": _plain_ids(markers["id"], notices),
    }
    times = headers["stamp"].astype(np.float64) * SECONDS_PER_UNIT[timestamp_unit]
    return PointCloud(markers["center"], starts, times, attributes, path.name, tuple(notices))


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write points as a tracker recording; labelled markers lose their labels."""
    take = _take_of(value)
    cloud = take if isinstance(take, PointCloud) else cloud_from_markers(take.positions, take.rate, take.name)
    width = 8 if options.id_width == "auto" else int(options.id_width)
    markers = _markers_of(path, cloud, width)
    spans = itertools.pairwise(cloud.frame_starts.tolist())
    frames = ((time, markers[start:end]) for time, (start, end) in zip(cloud.times.tolist(), spans, strict=True))
    write_frames(path, with_progress(frames, cloud.n_frames, monitor), str(width), options.timestamp_unit)


def _all_markers(view: mmap.mmap, width: int, starts: Ints) -> Markers:
    """What is left of the file without the headers of the frames."""
    is_marker = np.ones(len(view), dtype=np.bool_)
    for byte in range(FRAME_HEADER.itemsize):
        is_marker[starts - FRAME_HEADER.itemsize + byte] = False
    return np.frombuffer(view, np.uint8)[is_marker].view(MARKER_DTYPES[width])


def _markers_in(view: mmap.mmap, width: int, headers: Markers) -> Markers:
    """What stands behind some headers of frames."""
    dtype = MARKER_DTYPES[width]
    spans = zip(headers["start"].tolist(), headers["count"].tolist(), strict=True)
    return np.frombuffer(b"".join(view[start : start + count * dtype.itemsize] for start, count in spans), dtype)


def _check_numbers(path: Path, markers: Markers, starts: Ints) -> None:
    good = (np.abs(markers["center"]) <= FARTHEST).all(axis=1) & np.isfinite(markers["reprojection_error"])
    if not good.all():
        bad = int(np.argmin(good))
        frame = int(np.searchsorted(starts, bad, side="right"))
        numbers = [*markers["center"][bad].tolist(), float(markers["reprojection_error"][bad])]
        raise FormatError(path, f"frame {frame}", f"a marker has the numbers {numbers}; the file is damaged")


def _plain_ids(ids: Markers, notices: list[str]) -> Floats:
    """Return ids as float64, which the attributes are; renumber those that float64 cannot hold."""
    low, high = (ids, None) if ids.ndim == 1 else (ids[:, 0], ids[:, 1])
    if (low < _EXACT_INTEGERS).all() and (high is None or not high.any()):
        return low.astype(np.float64)
    notices.append("unique ids are too large for plain numbers and were renumbered; equal ones stay equal")
    _, numbers = np.unique(ids, axis=0, return_inverse=True)
    return numbers.reshape(-1).astype(np.float64)


def _take_of(value: Writable) -> PointCloud | Trajectories:
    take = value.take if isinstance(value, Project) else value.measured if isinstance(value, Filled) else value
    if isinstance(take, Poses):
        raise WriteError("mfml holds points and this value has bodies with orientation: write them as poses-csv")
    return take


def _markers_of(path: Path, cloud: PointCloud, width: int) -> Markers:
    markers = np.zeros(cloud.n_points, MARKER_DTYPES[width])
    ids = cloud.attributes.get("id", np.arange(cloud.n_points, dtype=np.float64))
    n_blobs = cloud.attributes.get("n_blobs", np.zeros(cloud.n_points))
    limit = _U32 if width == 4 else _EXACT_INTEGERS
    for what, numbers, below in (("id", ids, limit), ("number of blobs", n_blobs, _U32)):
        if not ((numbers >= 0) & (numbers < below) & (numbers == np.floor(numbers))).all():
            raise WriteError(f"{path}: a point has an {what} that is no whole number from 0 to {below - 1}")
    markers["center"] = cloud.points
    markers["reprojection_error"] = cloud.attributes.get("reprojection_error", 0.0)
    markers["n_blobs"] = n_blobs.astype(np.uint32)
    if markers["id"].ndim == 1:
        markers["id"] = ids.astype(np.uint64)
    else:
        markers["id"][:, 0] = ids.astype(np.uint64)
    return markers


def _looks_right(head: bytes, width: int) -> bool:
    counts, stamps = [], []
    try:
        for _, count, stamp in frame_headers(head, width):
            counts.append(count)
            stamps.append(stamp)
    except UnparsableError as error:
        if "cut off" not in error.problem:
            return False
    rises = len(stamps) == 1 or (len(stamps) > 1 and stamps[-1] > stamps[0])
    return rises and 0 < max(counts) < _PLAUSIBLE_MARKERS


FORMAT = Format(
    name="mfml",
    title="mfml (optical tracker)",
    suffixes=(".mfml",),
    holds="points",
    sniff=lambda head, path: any(_looks_right(head, width) for width in MARKER_DTYPES),
    read=lambda path, options: read_mfml(path, options.id_width, options.timestamp_unit, options.sample),
    write=_write,
    check=lambda value, options: _take_of(value),
    keeps=("points", "markers"),
    remarks=lambda project, options: (_REMARK,),
    options=(
        Option("id_width", "auto", "Bytes of a unique id; auto finds out, and writes 8.", ("auto", "4", "8", "16")),
        Option("timestamp_unit", "us", "Unit of the time stamps.", tuple(SECONDS_PER_UNIT)),
    ),
    note="Points with reprojection error, number of blobs and id; the width of the ids is found by parsing.",
)
