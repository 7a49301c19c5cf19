"""The frame sources: ``kind:places?option=value&option=value`` in one line of text, its options, and who opens it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from skelgen.capture.values import FrameSource
from skelgen.errors import InputError, ParameterError
from skelgen.parameters import StageParameters, declare

_TEXT = re.compile(r"(?P<kind>[a-z][a-z0-9]+):(?P<place>.*?)(\?(?P<options>\w+=[^?]*))?", re.DOTALL)
_MAX_FRAMES = 1e9  # frames: half a year at 60 Hz


@dataclass(frozen=True)
class SourceText:
    """What a text says, before anybody knows whether it exists.

    Attributes
    ----------
    kind : str
        ``folder``, ``video``, ``firewire``, ...; one letter before a colon is a drive of Windows, not a kind.
    place : str
        What stands between the colon and the options, e.g. ``left.avi,right.avi``.
    options : mapping
        Names and values behind the last question mark.
    """

    kind: str
    place: str
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def places(self) -> tuple[str, ...]:
        """The places between commas, without those that are empty."""
        return tuple(part.strip() for part in self.place.split(",") if part.strip())

    def __str__(self) -> str:
        options = "&".join(f"{name}={value}" for name, value in self.options.items())
        return f"{self.kind}:{self.place}" + (f"?{options}" if options else "")

    def two_places(self, example: str) -> tuple[str, str]:
        """Return the places of the left and the right camera.

        Raises
        ------
        ParameterError
            If there are not two; `example` shows how it should be.
        """
        if len(self.places) != 2:
            raise ParameterError(f"{self}: names {len(self.places)} where left and right belong, as in {example}")
        return self.places[0], self.places[1]


def parse_source(text: str) -> SourceText | None:
    """Take a text apart; None if it has no kind.

    Examples
    --------
    >>> parse_source("video:left.avi,right.avi?frames=99")
    SourceText(kind='video', place='left.avi,right.avi', options={'frames': '99'})
    """
    parts = _TEXT.fullmatch(text.strip())
    if parts is None:
        return None
    pairs = [option.partition("=") for option in (parts["options"] or "").split("&") if option]
    return SourceText(parts["kind"], parts["place"].strip(), {name: value for name, _, value in pairs})


def check_two_cameras(kind: str, names: tuple[str, ...], example: str) -> None:
    """Check that a text names two cameras, or none and leaves the choice to what is there.

    Parameters
    ----------
    kind : str
        Of the source, for messages.
    names : tuple of str
        The cameras.
    example : str
        A right text, for messages.

    Raises
    ------
    ParameterError
        If it names one, three or more, or one twice.
    """
    if len(names) not in (0, 2):
        raise ParameterError(f"{kind}: names {len(names)} cameras where left and right belong, as in {example}")
    if len(names) == 2 and names[0] == names[1]:
        raise ParameterError(f"{kind}: left and right are both {names[0]}; a pair needs two cameras, as in {example}")


@dataclass(frozen=True)
class FileOptions(StageParameters):
    """Image files: in a folder or in a list."""

    stage: ClassVar[str] = "images"
    rate: float = declare(0.0, "pairs a second; 0 stands for unknown, and counts one", unit="Hz", within=(0, 1e5))
    frames: int = declare(0, "pairs that are read at most; 0 reads all", within=(0, _MAX_FRAMES))
    left: str = declare("", "names of the left images in the folder, as in 'cam0_*.png'; empty finds them")
    right: str = declare("", "names of the right images, with a * where the left ones have it")


@dataclass(frozen=True)
class VideoOptions(StageParameters):
    """Two video files."""

    stage: ClassVar[str] = "video"
    rate: float = declare(0.0, "pairs a second; 0 takes what the files say", unit="Hz", within=(0, 1e5))
    frames: int = declare(0, "pairs that are read at most; 0 reads all", within=(0, _MAX_FRAMES))


@dataclass(frozen=True)
class SimulatedOptions(StageParameters):
    """The simulated rig."""

    stage: ClassVar[str] = "simulated"
    rate: float = declare(60.0, "pairs a second", unit="Hz", within=(0.1, 1e4))
    frames: int = declare(600, "pairs that are rendered", within=(1, _MAX_FRAMES))
    seed: int = declare(0, "of motion and noise", within=(0, 2**31 - 1))
    show: str = declare("", "targets whose balls are seen, with commas between them; empty shows all")
    paced: bool = declare(False, "yes lets pairs come by the clock, as from cameras, and be lost by who is slow")


@dataclass(frozen=True)
class CameraOptions(StageParameters):
    """What all cameras that run live have in common."""

    stage: ClassVar[str] = "camera"
    rate: float = declare(0.0, "pairs a second; 0 takes 60 or what the cameras can", unit="Hz", within=(0, 1e4))
    frames: int = declare(0, "pairs after which the source ends; 0 goes on until it is closed", within=(0, _MAX_FRAMES))
    order: str = declare(
        "newest",
        "newest hands out the newest pair and counts older ones as dropped; every hands out all in turn while the "
        "buffers last, for recording",
        choices=("newest", "every"),
    )
    timeout: float = declare(2.0, "a camera that sends nothing for so long has failed", unit="s", within=(0.01, 3600))
    skew: float = declare(1.0, "how far apart the two images of a pair may be taken", unit="ms", within=(0.001, 1000))


@dataclass(frozen=True)
class FireWireOptions(CameraOptions):
    """Cameras on an IEEE 1394 bus."""

    stage: ClassVar[str] = "firewire"
    size: str = declare("", "image size as in 640x480; empty takes the largest that both cameras have at the rate")
    shutter: int = declare(-1, "shutter in the camera's own units; -1 keeps its value", within=(-1, 4095))
    gain: int = declare(-1, "gain in the camera's own units; -1 keeps its value", within=(-1, 4095))
    speed: int = declare(
        0, "speed of the bus in Mb/s; 0 takes 800 if both cameras know 1394b, else 400", within=(0, 800)
    )
    buffers: int = declare(16, "images that the ring in memory holds for each camera", within=(2, 1024))


@dataclass(frozen=True)
class GenicamOptions(CameraOptions):
    """Cameras that describe themselves by GenICam: GigE Vision and GenTL."""

    stage: ClassVar[str] = "genicam"
    exposure: float = declare(0.0, "exposure time; 0 keeps the camera's", unit="us", within=(0, 1e7))
    gain: float = declare(-1.0, "gain in the camera's own unit; -1 keeps its value", within=(-1, 1e4))
    trigger: str = declare("", "the line that triggers both cameras, as in Line1; empty lets them run freely")


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
    from skelgen.capture.simulated_rig import SimulatedBoard, SimulatedRig, hand_held_target, simulated_rig  # noqa: PLC0415

    options = SimulatedOptions.from_mapping(text.options, str(text)).as_mapping()
    if text.place == "board":
        del options["show"]
        return SimulatedBoard(n_frames=options.pop("frames"), **options)
    if text.place == "target":
        name, paced, n_frames = options.pop("show"), options.pop("paced"), options.pop("frames")
        scene = hand_held_target(name, reference_rig(), n_frames=n_frames, **options)
        return SimulatedRig(scene, seed=options["seed"], paced=paced)
    shown = [name.strip() for name in options.pop("show").split(",") if name.strip()]
    return simulated_rig(text.place or "arm", n_frames=options.pop("frames"), show=shown, **options)


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
