"""Where pairs of images come from: files, cameras on FireWire, GigE Vision and GenTL, and the simulated rig."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from skelgen.capture.sources.options import (
    CameraOptions,
    FileOptions,
    FireWireOptions,
    GenicamOptions,
    SimulatedOptions,
    SourceText,
    VideoOptions,
    check_two_cameras,
    parse_source,
)
from skelgen.capture.sources.pairs import LivePairs
from skelgen.capture.values import FrameSource
from skelgen.errors import InputError
from skelgen.parameters import StageParameters


@dataclass(frozen=True)
class SourceKind:
    """A row of a table of sources.

    Attributes
    ----------
    name : str
        What stands before the colon.
    example : str
        A text as a user would write it.
    help : str
        What it is, in a few words.
    options : type of StageParameters
        What may stand behind the question mark.
    open : callable
        Makes the source from its text and its options; cameras are opened when the source is entered.
    """

    name: str
    example: str
    help: str
    options: type[StageParameters]
    open: Callable[[SourceText, Any], FrameSource]


def _open_images(text: SourceText, options: FileOptions) -> FrameSource:
    from skelgen.capture.sources import images  # noqa: PLC0415 - each source as it is needed

    place = Path(text.place)
    pairs = images.folder_pairs(place, options) if text.kind == "folder" else images.listed_pairs(place)
    return images.ImagePairs(text.place, pairs, options)


def _open_video(text: SourceText, options: VideoOptions) -> FrameSource:
    from skelgen.capture.sources.video import VideoPairs  # noqa: PLC0415

    left, right = text.two_places("video:left.avi,right.avi")
    return VideoPairs(Path(left), Path(right), options)


def _open_live(text: SourceText, options: CameraOptions) -> FrameSource:
    driver = import_module(f"{__name__}.{text.kind}")
    check_two_cameras(text.kind, text.cameras, driver.EXAMPLE)
    return LivePairs(f"{text.kind}:{','.join(text.places)}", driver.opener(text.places, options), options)


def _open_simulated(text: SourceText, options: SimulatedOptions) -> FrameSource:
    from skelgen.capture.reference_rig import reference_rig  # noqa: PLC0415
    from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig  # noqa: PLC0415
    from skelgen.capture.simulated_rig.board import SimulatedBoard  # noqa: PLC0415
    from skelgen.capture.simulated_rig.scene import hand_held_target  # noqa: PLC0415

    n_frames, rate, seed, paced = options.frames, options.rate, options.seed, options.paced
    if text.place == "board":
        return SimulatedBoard(n_frames=n_frames, rate=rate, seed=seed, paced=paced)
    if text.place == "target":
        scene = hand_held_target(options.show, reference_rig(), n_frames=n_frames, rate=rate, seed=seed)
        return SimulatedRig(scene, seed=seed, paced=paced)
    shown = [name.strip() for name in options.show.split(",") if name.strip()]
    return simulated_rig(text.place or "arm", seed=seed, paced=paced, show=shown, n_frames=n_frames, rate=rate)


SOURCES: tuple[SourceKind, ...] = (
    SourceKind("folder", "folder:images", "a folder with left and right images", FileOptions, _open_images),
    SourceKind("list", "list:pairs.txt", "a list of left and right images, with times", FileOptions, _open_images),
    SourceKind("video", "video:left.avi,right.avi", "two video files", VideoOptions, _open_video),
    SourceKind("firewire", "firewire:GUID1,GUID2", "cameras on an IEEE 1394 bus", FireWireOptions, _open_live),
    SourceKind("gige", "gige:10.0.0.2,10.0.0.3", "GigE Vision cameras", GenicamOptions, _open_live),
    SourceKind("gentl", "gentl:producer.cti", "cameras of a GenTL producer", GenicamOptions, _open_live),
    SourceKind(
        "simulated",
        "simulated:arm",
        "the simulated rig (simulated:board: a chessboard, simulated:target?show=torso: one target)",
        SimulatedOptions,
        _open_simulated,
    ),
)
"""All kinds of frame sources."""


def open_source(text: str, *, from_file: bool = False) -> FrameSource:
    """Return the frame source that a text names.

    Files are looked at at once, cameras when the source is entered.

    Parameters
    ----------
    text : str
        One of the forms of `SOURCES`, e.g. ``folder:images?rate=60`` or ``firewire:``; or the path of a folder.
    from_file : bool
        Whether a file names it, and nobody who is there: then it loads no program from a place that is not trusted.

    Raises
    ------
    InputError
        If no kind of source is meant; the sentence lists all.
    ParameterError
        If an option is unknown or out of its bounds.
    CaptureError, FormatError
        If the files are not there or cannot be read.

    Examples
    --------
    >>> with open_source("simulated:arm?frames=2") as source:  # or "video:left.avi,right.avi"
    ...     [pair.left.shape for pair in source]
    [(480, 640), (480, 640)]
    """
    return open_by_kind(text, SOURCES, ("images", "a folder"), from_file=from_file)


def open_by_kind(text: str, kinds: Sequence[SourceKind], words: tuple[str, str], *, from_file: bool) -> FrameSource:
    """Return the source that a text names, of a table of kinds.

    Parameters
    ----------
    text : str
        Of one of the kinds, or the path of a folder.
    kinds : sequence of SourceKind
        One of them is a folder's.
    words : tuple of str
        What sources are of, and what a folder must be, for messages.
    from_file : bool
        As of `open_source`.

    Raises
    ------
    InputError
        If no kind is meant.
    """
    parsed, rows = parse_source(text), {kind.name: kind for kind in kinds}
    if (parsed is None or parsed.kind not in rows) and text.strip() and Path(text).is_dir():
        parsed = SourceText("folder", text)
    if parsed is None or parsed.kind not in rows:
        known = ", ".join(kind.example for kind in kinds)
        raise InputError(f"{text!r} is no source of {words[0]}; known are {known}, or {words[1]}")
    if from_file and parsed.kind == "gentl":
        from skelgen.capture.sources.gentl import check_trusted  # noqa: PLC0415

        check_trusted(parsed.places)
    kind = rows[parsed.kind]
    return kind.open(parsed, kind.options.from_mapping(parsed.options, str(parsed)))
