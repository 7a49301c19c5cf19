"""Where the images of many cameras come from: a folder with one folder for each camera, videos, the simulated room.

A camera whose image is lost delivers None; the others go on.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from skelgen.capture.calibration.chessboard import Board
from skelgen.capture.images import IMAGE_SUFFIXES, read_image
from skelgen.capture.room import simulated
from skelgen.capture.room.live_sources import EXAMPLES, LiveSets, RecordedTogether, open_live_sets, run_together
from skelgen.capture.simulated_rig import render_view
from skelgen.capture.simulated_rig.board import board_image
from skelgen.capture.simulated_rig.scene import joints_of, targets_of
from skelgen.capture.simulated_rig.view import RenderParameters
from skelgen.capture.sources import SourceKind, open_by_kind
from skelgen.capture.sources.images import natural_order
from skelgen.capture.sources.options import FileOptions, FireWireOptions, GenicamOptions, SourceText, VideoOptions
from skelgen.capture.sources.video import OpenVideos
from skelgen.capture.values import FrameSet, FrameSource, Image, NothingToOpen
from skelgen.errors import CaptureError, InputError
from skelgen.geometry.rotations import transform_from
from skelgen.model.rig import CAMERAS_OF_A_ROOM, CameraRig, RoomSettings
from skelgen.parameters import StageParameters, declare
from skelgen.simulation import Structure


class FolderSets(NothingToOpen):
    """Images in a folder with one folder for each camera; those of one moment bear one name.

    Parameters
    ----------
    folder : Path
        Where the folders are; cameras are in the order of their names.
    options : FileOptions
        Rate and number of sets.

    Raises
    ------
    CaptureError
        If there are no folders with images.
    """

    def __init__(self, folder: Path, options: FileOptions) -> None:
        if not folder.is_dir():
            raise CaptureError(f"{folder}: no such folder")
        below = sorted((path for path in folder.iterdir() if path.is_dir()), key=lambda path: natural_order(path.name))
        found = {path.name: _images_in(path) for path in below}
        found = {name: images for name, images in found.items() if images}
        if not found:
            raise CaptureError(f"{folder}: 0 folders with images; make one for each camera")
        self.name, self.rate, self.cameras = folder.name, options.rate or None, tuple(found)
        stems = sorted(set().union(*found.values()), key=natural_order)
        self._files = [[images.get(stem) for images in found.values()] for stem in stems[: options.frames or None]]

    @property
    def n_frames(self) -> int:
        """Number of moments that at least one camera has an image of."""
        return len(self._files)

    def __iter__(self) -> Iterator[FrameSet]:
        """Read one moment after the other."""
        for index, files in enumerate(self._files):
            images = tuple(None if path is None else read_image(path) for path in files)
            yield FrameSet(images, index / self.rate if self.rate else float(index), index)


def _images_in(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES}


def _check_count(count: int, what: str) -> None:
    fewest, most = CAMERAS_OF_A_ROOM
    if not fewest <= count <= most:
        raise CaptureError(f"{what} ({fewest} to {most})")


class VideoSets(OpenVideos):
    """Videos, one for each camera; one that ends before the others delivers nothing more.

    Parameters
    ----------
    paths : tuple of Path
        The files.
    options : VideoOptions
        Rate and number of sets.

    Raises
    ------
    FormatError
        If a file is no video.
    """

    def __init__(self, paths: tuple[Path, ...], options: VideoOptions) -> None:
        super().__init__(paths, options)
        self.name, self.cameras = paths[0].parent.name or "videos", tuple(path.stem for path in paths)
        with self:
            self._promised, rates = int(max(self._facts("FRAME_COUNT"))), self._facts("FPS")
        self.rate = self.rate or float(np.median(rates)) or None

    def __iter__(self) -> Iterator[FrameSet]:
        """Read frame by frame until all have ended."""
        for index, time, images in self._frames():
            if all(image is None for image in images):
                return
            yield FrameSet(images, time, index)


@dataclass(frozen=True)
class RoomOptions(StageParameters):
    """The simulated room."""

    stage: ClassVar[str] = "room"
    cameras: int = declare(8, "cameras around the room", within=CAMERAS_OF_A_ROOM)
    width: int = declare(640, "of the images; the height is three quarters of it", unit="px", within=(160, 4096))
    rate: float = declare(100.0, "sets a second", unit="Hz", within=(0.1, 1e4))
    frames: int = declare(600, "sets that are rendered", within=(1, 1e9))
    seed: int = declare(0, "of motion and noise", within=(0, 2**31 - 1))
    show: str = declare("", "targets of room:arm whose balls are seen, with commas between them; empty shows all")


_SMALLEST = 7.0  # px across, of a ball at the distance of the middle
_DISTANCE = 3500.0  # mm


class SimulatedRoom(NothingToOpen):
    """A room whose cameras need no hardware.

    Parameters
    ----------
    scene : RoomScene
        What moves.
    rig : CameraRig
        The cameras.
    seed : int
        Of the sensors' noise.
    structure : Structure, optional
        What has targets and joints that a capture may look for.
    """

    def __init__(
        self, scene: simulated.RoomScene, rig: CameraRig, seed: int = 0, structure: Structure | None = None
    ) -> None:
        self.scene, self.rig, self._seed = scene, rig, seed
        known = ((), ()) if structure is None else (targets_of(structure), joints_of(structure))
        self.settings = RoomSettings(rig, *known)
        self.name, self.cameras = "simulated room", rig.names
        self.rate: float | None = scene.rate
        size = _SMALLEST * _DISTANCE / float(rig.cameras[0].matrix[0, 0])
        self.parameters = RenderParameters(size, bright_distance=_DISTANCE, reflections=0)

    @property
    def n_frames(self) -> int:
        """Length of the scene."""
        return self.scene.n_frames

    def __iter__(self) -> Iterator[FrameSet]:
        """Render one moment after the other."""
        for frame in range(self.scene.n_frames):
            images = []
            for index, camera in enumerate(self.rig.cameras):
                shown = np.where(self.scene.hidden[frame, index, :, np.newaxis], np.nan, self.scene.positions[frame])
                images.append(render_view(camera, shown, self.parameters, self._seed, (frame, index))[0])
            yield FrameSet(tuple(images), frame / self.scene.rate, frame)


ROOM_BOARD = Board(9, 6, 90.0)
"""The chessboard of the simulated room."""

_FRONT = 0.3  # cosine of the angle at which a board is still seen from its front


class SimulatedBoards(SimulatedRoom):
    """A chessboard that is held here and there in the simulated room.

    Parameters
    ----------
    scene : RoomScene
        How long it goes on, and at which rate.
    rig : CameraRig
        The cameras.
    seed : int
        Of the places and of the sensors' noise.
    """

    def __iter__(self) -> Iterator[FrameSet]:
        """Render one moment after the other."""
        half = ROOM_BOARD.points.mean(axis=0)
        for frame, pose in enumerate(simulated.board_poses(self.rig, self.n_frames, self._seed)):
            held = pose @ transform_from(np.eye(3), -half)
            images: list[Image] = []
            for index, (camera, place) in enumerate(zip(self.rig.cameras, self.rig.places, strict=True)):
                ahead = pose[:3, 3] - place
                shows = pose[:3, 2] @ ahead > _FRONT * np.linalg.norm(ahead)
                seen = held if shows else np.full((4, 4), np.nan)
                images.append(board_image(camera, ROOM_BOARD, seen, (self._seed, frame, index)))
            yield FrameSet(tuple(images), frame / self.scene.rate, frame)


def _open_folder(text: SourceText, options: FileOptions) -> FrameSource:
    return FolderSets(Path(text.place), options)


def _open_videos(text: SourceText, options: VideoOptions) -> FrameSource:
    return VideoSets(tuple(map(Path, text.places)), options)


def _open_room(text: SourceText, options: RoomOptions) -> FrameSource:
    rig = simulated.room_rig(int(options.cameras), (int(options.width), int(options.width) * 3 // 4))
    n_frames, seed, rate = int(options.frames), int(options.seed), float(options.rate)
    if text.place == "wand":
        return SimulatedRoom(simulated.wand_scene(rig, n_frames, rate=rate, seed=seed), rig, seed)
    if text.place == "board":
        return SimulatedBoards(simulated.wand_scene(rig, n_frames, rate=rate, seed=seed), rig, seed)
    if text.place == "frame":
        return SimulatedRoom(simulated.frame_scene(rig, n_frames), rig, seed)
    if text.place == "arm":
        arm = simulated.room_arm()
        scene = _with_some_targets(
            simulated.person_scene(rig, n_frames, arm, rate=rate, walk=0.0, seed=seed), arm, str(options.show)
        )
        return SimulatedRoom(scene, rig, seed, arm)
    return SimulatedRoom(simulated.person_scene(rig, n_frames, text.place or "human", rate=rate, seed=seed), rig, seed)


def _with_some_targets(scene: simulated.RoomScene, arm: Structure, names: str) -> simulated.RoomScene:
    """The scene with some targets only, or with all if none is named."""
    shown, known = [name.strip() for name in names.split(",") if name.strip()], [limb.name for limb in arm.limbs]
    for name in shown:
        if name not in known:
            raise InputError(f"the arm has no target {name!r} to show; it has {', '.join(known)}")
    away = np.repeat([bool(shown) and name not in shown for name in known], [len(limb.markers) for limb in arm.limbs])
    return replace(scene, hidden=scene.hidden | away)


_BESIDE = re.compile(r"\+(?=(?:folder|video|firewire|gige|gentl|room):)")
_KINDS: tuple[SourceKind, ...] = (
    SourceKind("folder", "folder:recording", "", FileOptions, _open_folder),
    SourceKind("video", "video:one.avi,two.avi,three.avi", "", VideoOptions, _open_videos),
    SourceKind("firewire", EXAMPLES["firewire"], "", FireWireOptions, open_live_sets),
    SourceKind("gige", EXAMPLES["gige"], "", GenicamOptions, open_live_sets),
    SourceKind("gentl", EXAMPLES["gentl"], "", GenicamOptions, open_live_sets),
    SourceKind("room", "room:human?cameras=8", "", RoomOptions, _open_room),
)


def open_room_source(text: str, *, from_file: bool = False) -> FrameSource:
    """Return the source that a text names.

    Parameters
    ----------
    text : str
        ``folder:recording?rate=100`` (a folder for each camera in it), ``video:one.avi,two.avi,...``, or the simulated
        room: ``room:wand``, ``room:board``, ``room:frame``, ``room:human`` or ``room:arm``, with
        ``?cameras=8&frames=600``; or the path of a folder; or cameras that run, each by its name, as
        ``gige:10.0.0.2,10.0.0.3,10.0.0.4``; or several of these with a plus between them.
    from_file : bool
        Whether a file names it, and nobody who is there: then it loads no program from a place that is not trusted.

    Raises
    ------
    InputError
        If no kind of source is meant.
    CaptureError, FormatError
        If files are not there or cannot be read.
    """
    parts = _BESIDE.split(text)
    words = ("images of many cameras", "a folder of folders")
    sources = [open_by_kind(part, _KINDS, words, from_file=from_file) for part in parts]
    if len(sources) == 1:
        (source,) = sources
    elif all(isinstance(source, LiveSets) for source in sources):
        source = run_together([source for source in sources if isinstance(source, LiveSets)])
    elif any(isinstance(source, LiveSets) for source in sources):
        raise InputError(f"{text}: cameras that run and recordings are not of one moment; give one of both")
    else:
        source = RecordedTogether(sources)
    _check_count(len(source.cameras), f"{text}: {len(source.cameras)} cameras; give the images of each camera")
    return source
