"""A wand while it is waved: what each image and the room have seen of it so far, and what is missing, in words."""

import threading
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field

import numpy as np

from skelgen.capture.calibration.chessboard import PARTS, coverage, uncovered
from skelgen.capture.room.calibrate import ENOUGH_VIEWS, WandCalibration, calibrate_wand, extent_of
from skelgen.capture.room.points import Views
from skelgen.capture.room.start import LEAST_SHARED
from skelgen.capture.room.wand_and_ground import check_wand, find_wand
from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.progress import counted

FIRST_LOOK, MOST_FRAMES = 60, 400
"""Views of each camera before the room is looked at for the first time, and frames that this takes at most."""

GROWTH = 1.5
"""Times the frames of the look before after which the room is looked at again."""

N_PARTS = sum(map(len, PARTS))


@dataclass(frozen=True, eq=False)
class WandProgress:
    """How far the waving is.

    Attributes
    ----------
    names : tuple of str
        What the cameras are called.
    n_frames : int
        Frames that came.
    n_views : ndarray of intp, shape (n_cameras,)
        In how many of them each camera shows the wand.
    linked : ndarray of intp, shape (n_cameras,)
        Views that each camera shares with the one that it shares most with.
    covered : ndarray of intp, shape (n_cameras, 3, 3)
        Balls in each part of each image.
    empty : tuple of list of str
        Parts of each image in which the wand has not been.
    room : WandCalibration or None
        Of some of the frames so far; None before they determine one.
    problem : str
        Why they do not; empty if nothing is wrong.
    """

    names: tuple[str, ...]
    n_frames: int
    n_views: Ints
    linked: Ints
    covered: Ints
    empty: tuple[list[str], ...]
    room: WandCalibration | None = None
    problem: str = ""

    @property
    def is_enough(self) -> bool:
        """Whether a good calibration can be made of it."""
        return bool(self.n_views.min() >= ENOUGH_VIEWS and self.linked.min() >= LEAST_SHARED and not any(self.empty))

    def sentences(self) -> list[str]:
        """Return what is missing, camera by camera, and where the wand was."""
        out = []
        for name, views, linked, empty in zip(self.names, self.n_views, self.linked, self.empty, strict=True):
            if not views:
                out.append(f"{name} has not seen the wand")
            elif linked < LEAST_SHARED:
                out.append(f"{name} shares only {linked} views with any other camera: wave where both look")
            elif empty:
                out.append(f"{name} covers {N_PARTS - len(empty)} of {N_PARTS} parts, not yet {', '.join(empty)}")
            elif views < ENOUGH_VIEWS:
                out.append(f"{name} has {views} of {ENOUGH_VIEWS} views")
        if self.room is not None:
            where = extent_of(self.room.room)
            out.append(f"the wand was in {where} m, where points are known to {self.room.point_std:.2g} mm")
        return [*out, self.problem] if self.problem else out

    def __str__(self) -> str:
        return f"after {counted(self.n_frames, 'frame')}: {'; '.join(self.sentences()) or 'enough'}"


@dataclass
class _Room:
    """What the last look at the room has found; another thread looks."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    found: WandCalibration | None = None
    problem: str = ""


class WandTaking:
    """Takes the frames of a waved wand, and knows what they cover.

    Parameters
    ----------
    names : sequence of str
        What the cameras are called.
    distances : sequence of float, mm
        Where the balls are along the wand.
    executor : Executor, optional
        A thread that looks at the room now and then; without it only the images are checked.
    """

    def __init__(self, names: Sequence[str], distances: Sequence[float], executor: Executor | None = None) -> None:
        self.names, self.distances, self._executor = tuple(names), tuple(distances), executor
        self._wand = check_wand(distances)
        self.frames: list[Views] = []
        self._sizes: list[tuple[int, int] | None] = [None] * len(self.names)
        self._seen: list[list[Floats]] = [[] for _ in self.names]
        self._shared = np.zeros((len(self.names), len(self.names)), dtype=np.intp)
        self._room, self._look, self._looked_at = _Room(), Future[None](), 0
        self._look.set_result(None)

    def add(self, views: Views, sizes: Sequence[tuple[int, int] | None]) -> None:
        """Take the next frame.

        Parameters
        ----------
        views : sequence of Balls
            What each camera sees.
        sizes : sequence of tuple of int or None, px
            Width and height of each image; None where it was lost.

        Raises
        ------
        InputError
            If the images of a camera change their size.
        """
        self.frames.append(views)
        shows = np.zeros(len(self.names), dtype=np.intp)
        for index, (balls, size) in enumerate(zip(views, sizes, strict=True)):
            before = self._sizes[index]
            if size is not None and before is not None and size != before:
                raise InputError(
                    f"{self.names[index]} has images of several sizes, {before[0]} x {before[1]} and {size[0]} x "
                    f"{size[1]}: set it to one"
                )
            self._sizes[index] = size or before
            found = find_wand(balls.centres, self._wand)
            if np.isfinite(found[0, 0]):
                self._seen[index].append(found)
                shows[index] = 1
        self._shared += np.outer(shows, shows)
        self._look_at_room()

    def progress(self) -> WandProgress:
        """Return how far it is."""
        n_views = np.diag(self._shared).copy()
        sizes = [size or (1, 1) for size in self._sizes]
        covered = np.array([coverage(seen, size) for seen, size in zip(self._seen, sizes, strict=True)])
        empty = tuple(uncovered(seen, size) for seen, size in zip(self._seen, sizes, strict=True))
        linked = (self._shared - np.diag(n_views)).max(axis=1)
        with self._room.lock:
            return WandProgress(
                self.names, len(self.frames), n_views, linked, covered, empty, self._room.found, self._room.problem
            )

    def calibrate(self, most: int | None = None) -> WandCalibration:
        """Return the cameras by the frames so far.

        Parameters
        ----------
        most : int, optional
            Frames to take, spread evenly; by default all.

        Raises
        ------
        InputError
            As `calibrate_wand`, and if a camera has sent no image.
        """
        sizes = [size for size in self._sizes if size is not None]
        if len(sizes) < len(self.names):
            name = self.names[self._sizes.index(None)]
            raise InputError(f"{name} has no image: see that it is switched on")
        n_frames = len(self.frames)
        chosen = spread_frames(n_frames, most or n_frames)
        return calibrate_wand([self.frames[index] for index in chosen.tolist()], self.distances, sizes, self.names)

    def _look_at_room(self) -> None:
        if self._executor is None or not self._look.done() or len(self.frames) < GROWTH * self._looked_at:
            return
        if np.diag(self._shared).min() >= FIRST_LOOK:
            self._looked_at = len(self.frames)
            self._look = self._executor.submit(self._find_room)

    def _find_room(self) -> None:
        try:
            found, problem = self.calibrate(MOST_FRAMES), ""
        except InputError as error:
            found, problem = None, str(error)
        with self._room.lock:
            self._room.found, self._room.problem = found or self._room.found, problem
