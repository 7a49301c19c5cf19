"""What a window and the jobs of a capture hand to each other: options, controls, images with what was found."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from skelgen.app.capture_jobs.images import NO_BODY, CameraImage
from skelgen.errors import SkelgenError
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import AnySettings, CameraRig, StereoRig

if TYPE_CHECKING:
    from skelgen.capture.room.taking import WandProgress
    from skelgen.capture.target_joints import JointAngle
    from skelgen.capture.values import FoundBody, StereoPoints

_T = TypeVar("_T")
_Progress = TypeVar("_Progress")

SIMULATED = "simulated:arm?paced=yes&rate=30&frames=3600"
"""The simulated rig as cameras would deliver it, for two minutes."""

ROOM = "room:"
"""What the name of a simulated room begins with."""

SIMULATED_ROOM = "room:arm?cameras=4&rate=30&frames=1800"
"""Four simulated cameras around an arm with targets."""


INTERVAL = 1 / 40
"""s between two results that a feed announces: more pictures a second cost time and show nothing."""


class Feed(Generic[_T]):
    """The newest result of a job, handed from its thread to the window's; one that nobody has looked at is replaced.

    Parameters
    ----------
    announce : callable ()
        Is called, in the thread of the job, when there is something new: once until it is taken.
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self._announce = announce
        self._lock = threading.Lock()
        self._newest: _T | None = None
        self._notices: list[str] = []
        self._is_announced = False
        self._announced_at = 0.0

    def put(self, newest: _T) -> None:
        """Replace the result; from any thread."""
        with self._lock:
            self._newest = newest
            announces = self._is_due
            if announces:
                self._is_announced, self._announced_at = True, time.monotonic()
        if announces:
            self._announce()

    def notice(self, sentence: str) -> None:
        """Add a sentence, which waits until it is taken; from any thread."""
        with self._lock:
            self._notices.append(sentence)

    def take(self) -> tuple[_T | None, tuple[str, ...]]:
        """Return the newest result, None if it was taken already, and the notices since."""
        with self._lock:
            newest, notices = self._newest, tuple(self._notices)
            self._newest, self._is_announced = None, False
            self._notices.clear()
        return newest, notices

    @property
    def is_waiting(self) -> bool:
        """Whether a result would be announced now; others need not be made."""
        with self._lock:
            return self._is_due

    @property
    def _is_due(self) -> bool:
        return not self._is_announced and time.monotonic() - self._announced_at >= INTERVAL


@dataclass(frozen=True)
class CaptureOptions:
    """What shall be captured.

    Attributes
    ----------
    settings : str
        The settings file; empty takes what the simulated rig knows of itself.
    source : str
        Where images come from; empty takes the source of the settings.
    predicts : bool
        Whether poses are predicted and smoothed.
    predicts_joints : bool
        Whether all joint angles are, together.
    """

    settings: str
    source: str
    predicts: bool = False
    predicts_joints: bool = False


@dataclass(eq=False)
class CaptureControl:
    """What the window tells a job that captures, or that collects images for a calibration.

    Attributes
    ----------
    stop : Event
        It shall end.
    keep_next : Event
        The next pair that shows the whole board shall be kept, whether or not it moves or is like others.
    record : Path or None
        The file that shall be recorded now; None records nothing.
    """

    stop: Event = field(default_factory=Event)
    keep_next: Event = field(default_factory=Event)
    record: Path | None = None


@dataclass(frozen=True, eq=False)
class FoundInSpace:
    """What was found in space.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        Points in the rig's world.
    groups : ndarray of intp, shape (n,)
        The body of each, or `NO_BODY`.
    bodies : mapping of str to FoundBody
        Bodies by their names.
    """

    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    groups: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    bodies: Mapping[str, FoundBody] = field(default_factory=dict)

    @classmethod
    def of(cls, points: StereoPoints, bodies: Mapping[int, FoundBody]) -> FoundInSpace:
        """Return points with their bodies.

        Parameters
        ----------
        points : StereoPoints
            Points of a pair of images.
        bodies : mapping of int to FoundBody
            Bodies by their groups.
        """
        groups = np.full(len(points), NO_BODY, dtype=np.intp)
        for group, body in bodies.items():
            groups[body.points[body.points >= 0]] = group
        return cls(points.points, groups, {body.name: body for body in bodies.values()})


@dataclass(frozen=True)
class Recorded:
    """A recording: its file, and how many pairs are in it."""

    path: Path
    n_frames: int


@dataclass(frozen=True, eq=False)
class LiveShot:
    """All that the window shows of one pair of images of a live capture.

    Attributes
    ----------
    images : tuple of CameraImage
        The pictures of all cameras, in the order of the settings.
    found : FoundInSpace
        Points and bodies; the group of a body is its index in the settings.
    angles : mapping of str to JointAngle
        Joints of which both bodies were found.
    settings : CaptureSettings or RoomSettings
        What it was found with.
    index : int
        Number of the pair.
    rate, latency : float, Hz and s
        Pairs captured in a second, and the time that one takes, lately.
    n_dropped : int
        Pairs lost so far.
    recorded : Recorded or None
        What is being recorded.
    """

    images: tuple[CameraImage, ...]
    found: FoundInSpace
    angles: Mapping[str, JointAngle]
    settings: AnySettings
    index: int
    rate: float
    latency: float
    n_dropped: int
    recorded: Recorded | None


@dataclass(frozen=True, eq=False)
class CaptureEnd:
    """How a capture ended.

    Attributes
    ----------
    n_frames, n_dropped : int
        Pairs captured, and pairs lost.
    recorded : tuple of Recorded
        What was recorded.
    error : SkelgenError or None
        What broke it off.
    settings : CaptureSettings, RoomSettings or None
        What it was captured with; None if it never began.
    """

    n_frames: int
    n_dropped: int
    recorded: tuple[Recorded, ...]
    error: SkelgenError | None
    settings: AnySettings | None


@dataclass(frozen=True, eq=False)
class TargetShot(Generic[_Progress]):
    """What the window shows of one pair of images while a target or joints are calibrated.

    Attributes
    ----------
    images : tuple of CameraImage
        The pictures of all cameras.
    found : FoundInSpace
        Points and targets.
    rig : StereoRig or CameraRig
        The cameras.
    progress : BodyProgress or JointProgress
        How far it is.
    """

    images: tuple[CameraImage, ...]
    found: FoundInSpace
    rig: StereoRig | CameraRig
    progress: _Progress


@dataclass(frozen=True, eq=False)
class WandShot:
    """What the window shows of one moment of a waved wand.

    Attributes
    ----------
    images : tuple of CameraImage
        What all cameras see.
    progress : WandProgress
        What is covered so far.
    """

    images: tuple[CameraImage, ...]
    progress: WandProgress
