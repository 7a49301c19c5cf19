"""Where pairs of images come from: files, cameras on FireWire, GigE Vision and GenTL, and the simulated rig."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from skelgen.capture.sources.options import (
    FileOptions,
    FireWireOptions,
    GenicamOptions,
    SimulatedOptions,
    SourceText,
    VideoOptions,
    parse_source,
)
from skelgen.capture.values import FrameSource
from skelgen.errors import InputError
from skelgen.parameters import StageParameters


@dataclass(frozen=True)
class SourceKind:
    """A row of the table.

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
        Makes the source from its text; cameras are opened when the source is entered.
    """

    name: str
    example: str
    help: str
    options: type[StageParameters]
    open: Callable[[SourceText], FrameSource]


def _open_images(text: SourceText) -> FrameSource:
    from skelgen.capture.sources import images  # noqa: PLC0415 - each source as it is needed

    options, place = FileOptions.from_mapping(text.options, str(text)), Path(text.place)
    pairs = images.folder_pairs(place, options) if text.kind == "folder" else images.listed_pairs(place)
    return images.ImagePairs(text.place, pairs, options)


def _open_video(text: SourceText) -> FrameSource:
    from skelgen.capture.sources.video import VideoPairs  # noqa: PLC0415

    left, right = text.two_places("video:left.avi,right.avi")
    return VideoPairs(Path(left), Path(right), VideoOptions.from_mapping(text.options, str(text)))


def _open_firewire(text: SourceText) -> FrameSource:
    from skelgen.capture.sources.firewire import firewire_pairs  # noqa: PLC0415

    return firewire_pairs(text.places, FireWireOptions.from_mapping(text.options, str(text)))


def _open_gige(text: SourceText) -> FrameSource:
    from skelgen.capture.sources.gige import gige_pairs  # noqa: PLC0415

    return gige_pairs(text.places, GenicamOptions.from_mapping(text.options, str(text)))


def _open_gentl(text: SourceText) -> FrameSource:
    from skelgen.capture.sources.gentl import gentl_pairs  # noqa: PLC0415

    return gentl_pairs(text.places, GenicamOptions.from_mapping(text.options, str(text)))


def _open_simulated(text: SourceText) -> FrameSource:
    from skelgen.capture.reference_rig import reference_rig  # noqa: PLC0415
    from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig  # noqa: PLC0415
    from skelgen.capture.simulated_rig.board import SimulatedBoard  # noqa: PLC0415
    from skelgen.capture.simulated_rig.scene import hand_held_target  # noqa: PLC0415

    options = SimulatedOptions.from_mapping(text.options, str(text))
    n_frames, rate, seed, paced = options.frames, options.rate, options.seed, options.paced
    if text.place == "board":
        return SimulatedBoard(n_frames=n_frames, rate=rate, seed=seed, paced=paced)
    if text.place == "target":
        scene = hand_held_target(options.show, reference_rig(), n_frames=n_frames, rate=rate, seed=seed)
        return SimulatedRig(scene, seed=seed, paced=paced)
    shown = [name.strip() for name in options.show.split(",") if name.strip()]
    return simulated_rig(text.place or "arm", seed=seed, paced=paced, show=shown, n_frames=n_frames, rate=rate)


SOURCES = (
    SourceKind("folder", "folder:images", "a folder with left and right images", FileOptions, _open_images),
    SourceKind("list", "list:pairs.txt", "a list of left and right images, with times", FileOptions, _open_images),
    SourceKind("video", "video:left.avi,right.avi", "two video files", VideoOptions, _open_video),
    SourceKind("firewire", "firewire:GUID1,GUID2", "cameras on an IEEE 1394 bus", FireWireOptions, _open_firewire),
    SourceKind("gige", "gige:10.0.0.2,10.0.0.3", "GigE Vision cameras", GenicamOptions, _open_gige),
    SourceKind("gentl", "gentl:producer.cti", "cameras of a GenTL producer", GenicamOptions, _open_gentl),
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
    parsed = parse_source(text)
    kind = next((kind for kind in SOURCES if parsed is not None and kind.name == parsed.kind), None)
    if parsed is not None and kind is not None:
        if from_file and kind.name == "gentl":
            from skelgen.capture.sources.gentl import check_trusted  # noqa: PLC0415

            check_trusted(parsed.places)
        return kind.open(parsed)
    if text.strip() and Path(text).is_dir():
        return _open_images(SourceText("folder", text))
    known = ", ".join(kind.example for kind in SOURCES)
    raise InputError(f"{text!r} is no source of images; known are {known}, or a folder")
