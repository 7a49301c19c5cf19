"""What the window and a capture tell each other; light, because the window is built of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from skelgen.errors import SkelgenError
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import CaptureSettings, StereoRig
from skelgen_gui.capture.overlay import Eye

if TYPE_CHECKING:
    from skelgen.capture.angles import JointAngle
    from skelgen.capture.calibration.joints import JointMotion
    from skelgen.capture.calibration.taking import BodyProgress
    from skelgen.capture.values import FoundBody
    from skelgen_gui.capture.space import Found

SIMULATED = "simulated:arm?paced=yes&rate=30&frames=3600"
"""The simulated rig as cameras would deliver it, for two minutes."""


@dataclass(frozen=True)
class LiveWish:
    """What shall be captured.

    Attributes
    ----------
    settings : str
        The settings file; empty takes what the simulated rig knows of itself.
    source : str
        Where images come from; empty takes the source of the settings.
    predicts : bool
        Whether poses are predicted and smoothed.
    """

    settings: str
    source: str
    predicts: bool = False


@dataclass(frozen=True, eq=False)
class Shot:
    """All that the window shows of one pair of images.

    Attributes
    ----------
    left, right : Eye
        Both pictures.
    points : ndarray, shape (n_points, 3), mm
        Points in space.
    groups : ndarray of intp, shape (n_points,)
        Index of each point's body in the settings, or `NO_BODY`.
    bodies : dict of str to FoundBody
        Bodies that were found.
    angles : dict of str to JointAngle
        Joints of which both bodies were found.
    settings : CaptureSettings
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

    left: Eye
    right: Eye
    points: Floats
    groups: Ints
    bodies: dict[str, FoundBody]
    angles: dict[str, JointAngle]
    settings: CaptureSettings
    index: int
    rate: float
    latency: float
    n_dropped: int
    recorded: Recorded | None


@dataclass(frozen=True)
class Recorded:
    """A recording: its file, and how many pairs are in it."""

    path: Path
    n_frames: int


@dataclass(frozen=True, eq=False)
class Ended:
    """How a capture ended.

    Attributes
    ----------
    n_frames, n_dropped : int
        Pairs captured, and pairs lost.
    recorded : tuple of Recorded
        What was recorded.
    error : SkelgenError or None
        What broke it off.
    settings : CaptureSettings or None
        What it was captured with; None if it never began.
    """

    n_frames: int
    n_dropped: int
    recorded: tuple[Recorded, ...]
    error: SkelgenError | None
    settings: CaptureSettings | None


@dataclass(eq=False)
class Orders:
    """What the window tells a capture that runs.

    Attributes
    ----------
    stop : Event
        It shall end.
    record : Path or None
        The file that shall be recorded now; None records nothing.
    """

    stop: Event = field(default_factory=Event)
    record: Path | None = None


@dataclass(frozen=True, eq=False)
class BoardShot:
    """What the window shows of one pair of images of a board.

    Attributes
    ----------
    left, right : Eye
        Both pictures.
    """

    left: Eye
    right: Eye


@dataclass(eq=False)
class GatheringOrders:
    """What the window tells while views are gathered.

    Attributes
    ----------
    stop : Event
        It shall end.
    take : Event
        The next pair that shows the whole board shall be kept, whether or not it moves or is like others.
    """

    stop: Event = field(default_factory=Event)
    take: Event = field(default_factory=Event)


@dataclass(frozen=True)
class JointProgress:
    """How far the taking of joints is.

    Attributes
    ----------
    n_frames : int
        Frames that came.
    n_found : dict of str to int
        In how many of them each target was found, in the order of the settings.
    motions : tuple of JointMotion
        How far targets have moved against each other.
    """

    n_frames: int = 0
    n_found: dict[str, int] = field(default_factory=dict)
    motions: tuple[JointMotion, ...] = ()


@dataclass(frozen=True, eq=False)
class TakenShot:
    """What the window shows of one pair of images while a target or joints are taken.

    Attributes
    ----------
    left, right : Eye
        Both pictures.
    found : Found
        Points and targets in space.
    rig : StereoRig
        Who sees them.
    progress : BodyProgress or JointProgress
        How far it is.
    """

    left: Eye
    right: Eye
    found: Found
    rig: StereoRig
    progress: BodyProgress | JointProgress
