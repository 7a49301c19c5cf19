"""Settings of a capture; a room with many cameras, calibrated with a wand or a board, and its floor."""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from skelgen_formats.capture_settings import read_any_settings

from skelgen.capture.parameters import BodyParameters, DetectionParameters
from skelgen.model.rig import AnySettings
from skelgen.progress import SILENT, Monitor

if TYPE_CHECKING:
    from skelgen.capture.room.boards import AnyBoard
    from skelgen.capture.room.calibrate import WandCalibration

NOTICE_EVERY = 10.0
"""s between two sentences on what a wand has covered."""


def read_capture_settings(path: Path) -> AnySettings:
    """Read settings of two cameras or of a room, the parameters checked with their lines; errors as `read_settings`."""
    return read_any_settings(path, DetectionParameters, BodyParameters)


@dataclass(frozen=True)
class Ground:
    """Where an L-frame or three other balls lie on the floor.

    Attributes
    ----------
    source : str
        Their images.
    arms : sequence of float, mm
        Along x and along y; of three other balls also the distance between the last two.
    """

    source: str
    arms: Sequence[float] = (600.0, 400.0)


def calibrate_room(
    waved: str, wand: Sequence[float], ground: Ground | None = None, monitor: Monitor = SILENT
) -> "WandCalibration":
    """Calibrate the cameras of a room from images of a wand and of an L-frame.

    Parameters
    ----------
    waved : str
        Source in which the wand is waved.
    wand : sequence of float, mm
        Where the two or three balls are along it.
    ground : Ground, optional
        The L-frame; without it the world is the first camera's frame.
    monitor : Monitor
        Reports how many images are done, and now and then what they cover; may cancel.

    Raises
    ------
    InputError
        If images, wand or frame are not what they must be; see `calibrate_wand` and `find_ground`.
    """
    from skelgen.capture.room.points import detected_balls, seen_in  # noqa: PLC0415 - loads kernels
    from skelgen.capture.room.sources import open_room_source  # noqa: PLC0415
    from skelgen.capture.room.taking import WandTaking  # noqa: PLC0415

    source = open_room_source(waved)
    with ThreadPoolExecutor(1, "room") as executor:
        taking = WandTaking(source.cameras, wand, executor)
        noticed = time.monotonic()
        for views, sizes in seen_in(source, detected_balls, monitor):
            taking.add(views, sizes)
            if time.monotonic() - noticed > NOTICE_EVERY:
                monitor.notice(str(taking.progress()))
                noticed = time.monotonic()
    return on_floor(taking.calibrate(), ground, monitor)


def calibrate_room_by_boards(
    held: str, board: "AnyBoard", ground: Ground | None = None, monitor: Monitor = SILENT
) -> "WandCalibration":
    """Calibrate the cameras of a room from images of a board that some of them see at a time.

    Parameters
    ----------
    held : str
        Source in which the board is held in many places.
    board : Board or CharucoBoard
        What is seen; see `skelgen.capture.room.boards.room_board`.
    ground : Ground, optional
        The L-frame; without it the world is the first camera's frame.
    monitor : Monitor
        Reports how many images are done; may cancel.

    Raises
    ------
    InputError
        If a camera sees too little of the board, or shares too few views with others.
    """
    import numpy as np  # noqa: PLC0415

    from skelgen.capture.room.boards import corners_in  # noqa: PLC0415
    from skelgen.capture.room.calibrate import calibrate_boards  # noqa: PLC0415 - loads kernels
    from skelgen.capture.room.points import all_seen, seen_in  # noqa: PLC0415
    from skelgen.capture.room.sources import open_room_source  # noqa: PLC0415

    source = open_room_source(held)
    frames, sizes = all_seen(source, seen_in(source, lambda image: corners_in(image, board), monitor))
    return on_floor(calibrate_boards(np.array(frames), board, sizes, source.cameras), ground, monitor)


def on_floor(done: "WandCalibration", ground: Ground | None, monitor: Monitor = SILENT) -> "WandCalibration":
    """Return a calibration with the floor as its world; unchanged if there is no floor.

    Parameters
    ----------
    done : WandCalibration
        In any world.
    ground : Ground or None
        Where the L-frame lies.
    monitor : Monitor
        Reports how many images are done; may cancel.

    Raises
    ------
    InputError
        As `skelgen.capture.room.wand_and_ground.find_ground`.
    """
    if ground is None:
        return done
    from skelgen.capture.room.calibrate import on_ground  # noqa: PLC0415 - loads kernels
    from skelgen.capture.room.points import all_seen, detected_balls, seen_in  # noqa: PLC0415
    from skelgen.capture.room.sources import open_room_source  # noqa: PLC0415
    from skelgen.capture.room.wand_and_ground import find_ground  # noqa: PLC0415

    source = open_room_source(ground.source)
    lying, _ = all_seen(source, seen_in(source, detected_balls, monitor))
    return on_ground(done, find_ground(lying, done.rig, ground.arms))
