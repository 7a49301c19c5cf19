"""What names a frame source: a text, ``kind:places?option=value&option=value``, with the options of each kind."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from skelgen.errors import CaptureError, ParameterError
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

    @property
    def cameras(self) -> tuple[str, ...]:
        """The places that are names of cameras: all but the first of GenTL, which is the producer's file."""
        return self.places[1:] if self.kind == "gentl" else self.places

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


def only_two(found: list[Any], listed: str, example: str) -> list[Any]:
    """Return the only two cameras that there are, where the user names none.

    Parameters
    ----------
    found : list
        All cameras.
    listed : str
        What was found, in words.
    example : str
        A text that names two, for messages.

    Raises
    ------
    CaptureError
        If there are not two.
    """
    if len(found) == 1:
        raise CaptureError(f"one camera is missing: {listed}, and a pair needs two")
    if len(found) != 2:
        raise CaptureError(f"{listed}; name left and right, as {example}")
    return found


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
