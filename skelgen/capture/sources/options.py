"""What can be said of a source behind its question mark, declared once each like the parameters of a stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare

_LONGEST_TAKE = 1e9  # frames: half a year at 60 Hz


@dataclass(frozen=True)
class FileOptions(StageParameters):
    """Image files: in a folder or in a list."""

    stage: ClassVar[str] = "images"
    rate: float = declare(0.0, "pairs a second; 0 counts one a second, as nobody knows", unit="Hz", low=0, high=1e5)
    frames: int = declare(0, "pairs that are read at most; 0 reads all", low=0, high=_LONGEST_TAKE)
    left: str = declare("", "names of the left images in the folder, as in 'cam0_*.png'; empty finds them")
    right: str = declare("", "names of the right images, with a * where the left ones have it")


@dataclass(frozen=True)
class VideoOptions(StageParameters):
    """Two video files."""

    stage: ClassVar[str] = "video"
    rate: float = declare(0.0, "pairs a second; 0 takes what the files say", unit="Hz", low=0, high=1e5)
    frames: int = declare(0, "pairs that are read at most; 0 reads all", low=0, high=_LONGEST_TAKE)


@dataclass(frozen=True)
class SimulatedOptions(StageParameters):
    """The simulated rig."""

    stage: ClassVar[str] = "simulated"
    rate: float = declare(60.0, "pairs a second", unit="Hz", low=0.1, high=1e4)
    frames: int = declare(600, "pairs that are rendered", low=1, high=_LONGEST_TAKE)
    seed: int = declare(0, "of motion and noise", low=0, high=2**31 - 1)
    show: str = declare("", "targets whose balls are seen, with commas between them; empty shows all")
    paced: bool = declare(False, "yes lets pairs come by the clock, as from cameras, and be lost by who is slow")


@dataclass(frozen=True)
class CameraOptions(StageParameters):
    """What all cameras that run live have in common."""

    stage: ClassVar[str] = "camera"
    rate: float = declare(0.0, "pairs a second; 0 takes 60 or what the cameras can", unit="Hz", low=0, high=1e4)
    frames: int = declare(
        0, "pairs after which the source ends; 0 goes on until it is closed", low=0, high=_LONGEST_TAKE
    )
    order: str = declare(
        "newest",
        "newest hands out the newest pair and counts older ones as dropped; every hands out all in turn while the "
        "buffers last, for recording",
        choices=("newest", "every"),
    )
    timeout: float = declare(2.0, "a camera that sends nothing for so long has failed", unit="s", low=0.01, high=3600)
    skew: float = declare(1.0, "how far apart the two images of a pair may be taken", unit="ms", low=0.001, high=1000)


@dataclass(frozen=True)
class FireWireOptions(CameraOptions):
    """Cameras on an IEEE 1394 bus."""

    stage: ClassVar[str] = "firewire"
    size: str = declare("", "image size as in 640x480; empty takes the largest that both cameras have at the rate")
    shutter: int = declare(-1, "shutter in the camera's own units; -1 keeps its value", low=-1, high=4095)
    gain: int = declare(-1, "gain in the camera's own units; -1 keeps its value", low=-1, high=4095)
    speed: int = declare(
        0, "speed of the bus in Mb/s; 0 takes 800 if both cameras know 1394b, else 400", low=0, high=800
    )
    buffers: int = declare(16, "images that the ring in memory holds for each camera", low=2, high=1024)


@dataclass(frozen=True)
class GenicamOptions(CameraOptions):
    """Cameras that describe themselves by GenICam: GigE Vision and GenTL."""

    stage: ClassVar[str] = "genicam"
    exposure: float = declare(0.0, "exposure time; 0 keeps the camera's", unit="us", low=0, high=1e7)
    gain: float = declare(-1.0, "gain in the camera's own unit; -1 keeps its value", low=-1, high=1e4)
    trigger: str = declare("", "the line that triggers both cameras, as in Line1; empty lets them run freely")


__all__ = ["CameraOptions", "FileOptions", "FireWireOptions", "GenicamOptions", "SimulatedOptions", "VideoOptions"]
