"""The recording of two cameras as a take: settings and their source of images become unlabelled points."""

from __future__ import annotations

import re
from pathlib import Path

from skelgen_formats.registry import SNIFF_BYTES, Format, Option

from skelgen.model import PointCloud
from skelgen.progress import SILENT, Monitor

# The root of capture settings, behind what XML allows before it.
_ROOT = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<\?.*?\?>\s*|<!--.*?-->\s*|<!DOCTYPE[^>]*>\s*)*<capture[\s>/]", re.DOTALL)


def read_stereo(path: Path | str, source: str = "", frames: int = 0, *, monitor: Monitor = SILENT) -> PointCloud:
    """Turn all images of a stereo recording into unlabelled points.

    Parameters
    ----------
    path : Path or str
        Settings of the capture.
    source : str
        Where images come from; empty takes what the settings say.
    frames : int
        Pairs of images at most; 0 takes all.
    monitor : Monitor
        Told of progress; may cancel.

    Returns
    -------
    PointCloud
        See `skelgen.capture.markers.markers_of`.

    Raises
    ------
    FormatError
        If the settings are not what they must be.
    SkelgenError
        If there is no source, it breaks off, or its images do not belong to the settings.
    """
    from skelgen.app.capture import read_capture_settings, source_of  # noqa: PLC0415 - numba takes a second
    from skelgen.capture.markers import markers_of  # noqa: PLC0415

    path = Path(path)
    settings = read_capture_settings(path)
    images = source_of(settings, source or None)
    return markers_of(settings, images, n_frames=frames or None, name=path.name, monitor=monitor)


def is_stereo(path: Path | str, format: str | None = None) -> bool:
    """Whether a file is to be read as a stereo recording: it is named so, or begins as settings of a capture do."""
    if format is not None:
        return format == STEREO.name
    try:
        with Path(path).open("rb") as stream:
            return _sniff(stream.read(SNIFF_BYTES), Path(path))
    except OSError:
        return False  # who reads it next says why it cannot be read


def _sniff(head: bytes, path: Path) -> bool:
    return _ROOT.match(head) is not None


STEREO = Format(
    name="stereo",
    title="stereo recording",
    suffixes=(".xml",),
    holds="points",
    sniff=_sniff,
    read=read_stereo,
    options=(
        Option("source", "", "where images come from; empty takes what the settings say"),
        Option("frames", 0, "pairs of images at most; 0 takes all", low=0),
    ),
    note="Settings of a capture: the balls in its images become points.",
)
"""Read by the application and not by the formats, because it needs `skelgen.capture`."""
