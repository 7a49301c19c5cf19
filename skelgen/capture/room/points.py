"""What the steps of a capture by many cameras hand on, and how balls and points are found in all images."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from skelgen._kernels.room_limbs import place_by_balls
from skelgen._kernels.room_matching import Rules, match_room
from skelgen._kernels.room_points import Room
from skelgen.capture.detection import detect_balls
from skelgen.capture.optics import GATE, undistort, view_of
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.values import Balls, FrameSource, Image, StereoPoints
from skelgen.errors import InputError
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, CameraRig
from skelgen.progress import SILENT, Monitor, with_progress


@dataclass(frozen=True, eq=False)
class RoomPoints:
    """Points in space from the images of one moment, the surest first; no ball belongs to two.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        In the rig's world.
    covariance : ndarray, shape (n_points, 3, 3), mm^2
        From the noise in all images.
    balls : ndarray of intp, shape (n_points, n_cameras)
        The ball of each camera that sees the point; -1 of the others.
    misfit : ndarray, shape (n_points,)
        Root mean square misfit of its balls by degree of freedom, in standard deviations: 1 on average.
    evidence : ndarray, shape (n_points,)
        How much more likely it is a marker than chance [nats].
    """

    points: Floats
    covariance: Floats
    balls: Ints
    misfit: Floats
    evidence: Floats

    def __len__(self) -> int:
        return len(self.points)

    @property
    def n_cameras(self) -> Ints:
        """How many cameras see each point, shape (n_points,)."""
        return np.asarray((self.balls >= 0).sum(axis=1))

    def of(self, chosen: Bools | Ints) -> "RoomPoints":
        """Return some of the points."""
        return RoomPoints(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def and_also(self, others: "RoomPoints") -> "RoomPoints":
        """Return these points, and others after them."""
        names = self.__dataclass_fields__
        return RoomPoints(*(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names))

    def as_stereo(self, noise: float) -> StereoPoints:
        """Return points of which no two share a ball, as the search for bodies needs them.

        Parameters
        ----------
        noise : float, px
            Of the balls, by which misfits are distances in images.
        """
        numbers, shared = np.arange(len(self)), np.zeros(len(self), dtype=np.bool_)
        return StereoPoints(self.points, self.covariance, numbers, numbers, noise * self.misfit, shared)


def balls_at(centres: Floats, std: float) -> Balls:
    """Return balls at known places, as a detection would find them.

    Parameters
    ----------
    centres : ndarray, shape (n_balls, 2), px
        Where they are.
    std : float, px
        Standard deviation of a centre along one axis.
    """
    n = len(centres)
    return Balls(centres, np.full(n, 30.0), np.full(n, 3900.0), np.full(n, std), np.zeros(n, dtype=np.bool_))


Views = Sequence[Balls]
"""What all cameras see at one moment, in their order."""


EVIDENCE = 6.0
"""Nats of each number that a point explains: chance spreads balls over 400 times their noise."""

UNSEEN = 0.3
"""Nats that a camera costs which sees no ball where the point is: bodies hide markers from half of the cameras."""

EXPECTED, REACH = 4.0, 25.0
"""Nats for a point where a marker is expected, and how near [mm] it must be."""

MAX_STD = 20.0
"""mm; points that are less certain are left out, such as one between two cameras that look at each other."""

NONE_EXPECTED = np.empty((0, 3))


class PointMatcher:
    """Balls of all cameras to points; holds what does not change from frame to frame.

    Parameters
    ----------
    rig : CameraRig
        The cameras; its noise is the least that a centre has.
    gate : float
        Standard deviations within which balls belong together.
    """

    def __init__(self, rig: CameraRig, gate: float = GATE) -> None:
        self.rig = rig
        poses = np.ascontiguousarray([camera.camera_from_world[:3] for camera in rig.cameras])
        sizes = np.array([_rays_of_border(camera) for camera in rig.cameras])
        turns = poses[:, :, :3] @ poses[:, np.newaxis, :, :3].swapaxes(2, 3)  # by the first camera, then by the second
        shifts = (poses[:, :, :3] @ rig.places[:, np.newaxis, :, np.newaxis])[..., 0] + poses[:, :, 3]
        self._geometry = poses, rig.places, cross_matrix(shifts) @ turns, sizes
        self._rules = Rules(gate, EVIDENCE, UNSEEN, EXPECTED, REACH, MAX_STD)
        self._room: Room | None = None

    def find(self, views: Views, expected: Floats = NONE_EXPECTED) -> RoomPoints:
        """Return the points that the balls of one moment show.

        Parameters
        ----------
        views : sequence of Balls
            What each camera sees; no balls where an image is missing.
        expected : ndarray, shape (n_expected, 3), mm
            Where markers are expected by the time before.

        Raises
        ------
        InputError
            If there are not as many views as cameras.

        Examples
        --------
        >>> from skelgen.capture.optics import project
        >>> from skelgen.capture.room.simulated import room_rig
        >>> from skelgen.capture.room.points import balls_at
        >>> rig, place = room_rig(4), np.array([[100.0, 200.0, 900.0]])
        >>> views = [balls_at(project(camera, place), 0.05) for camera in rig.cameras]
        >>> found = PointMatcher(rig).find(views)
        >>> found.points.round(3), found.n_cameras
        (array([[100., 200., 900.]]), array([4]))
        """
        cameras = self.rig.cameras
        if len(views) != len(cameras):
            raise InputError(f"{len(views)} views of {len(cameras)} cameras; give one of each, without balls if empty")
        seen = [
            view_of(camera, balls.centres, np.fmax(balls.std, self.rig.noise))
            for camera, balls in zip(cameras, views, strict=True)
        ]
        starts = np.concatenate([[0], np.cumsum([len(balls) for balls in views])]).astype(np.intp)
        rays, spread = np.concatenate([one.rays for one in seen]), np.concatenate([one.spread for one in seen])
        self._room = Room(*self._geometry, starts, rays, spread)
        found = match_room(self._room, np.array(expected, dtype=np.float64, order="C"), self._rules)
        freedom = 2 * (found.balls >= 0).sum(axis=1) - 3
        misfit = np.sqrt(found.squares / np.maximum(freedom, 1))
        return RoomPoints(found.points, found.covariances, found.balls, misfit, found.scores)

    def by_single_balls(self, points: RoomPoints, is_settled: Bools, states: Floats, covariances: Floats) -> RoomPoints:
        """Place hidden markers by balls that a single camera sees where they must be; those without one have no ball.

        Parameters
        ----------
        points : RoomPoints
            What `find` has found in this moment.
        is_settled : ndarray of bool, shape (n_points,)
            Which of these are markers for sure: their balls are taken.
        states : ndarray, shape (n, 6), mm and mm/s
            Places and speeds of hidden markers, which the balls correct.
        covariances : ndarray, shape (n, 6, 6)
            Of these; the balls reduce them.
        """
        room = self._room
        assert room is not None, "this goes on with what find has found"
        is_free = np.ones(len(room.rays), dtype=np.bool_)
        taken = points.balls[is_settled]
        is_free[(taken + room.starts[:-1])[taken >= 0]] = False
        balls, squares = place_by_balls(room, is_free, states, covariances, self._rules.gate)
        return RoomPoints(states[:, :3], covariances[:, :3, :3], balls, np.sqrt(squares / 2.0), np.zeros(len(states)))


def _rays_of_border(camera: Camera) -> Floats:
    """Smallest x and y, largest x and y of the rays that an image shows."""
    x, y = np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 9)
    border = [np.stack(np.broadcast_arrays(a, b), axis=-1) for a in (x[0], x[-1]) for b in (y,)]
    border += [np.stack(np.broadcast_arrays(a, b), axis=-1) for a in (x,) for b in (y[0], y[-1])]
    rays = undistort(camera, np.concatenate(border))
    return np.concatenate([np.nanmin(rays, axis=0), np.nanmax(rays, axis=0)])


_Seen = TypeVar("_Seen")


_FrameSeen = tuple[list[_Seen], list[tuple[int, int] | None]]
"""What was found in the images of a moment, and their sizes."""


def all_seen(
    source: FrameSource, frames: Iterable[_FrameSeen[_Seen]]
) -> tuple[list[list[_Seen]], list[tuple[int, int]]]:
    """Return what was found in all images, and the cameras' sizes.

    Parameters
    ----------
    source : FrameSource
        Where they come from.
    frames : iterable
        From `seen_in`.

    Raises
    ------
    InputError
        If a camera has no image at all, or images of two sizes.
    """
    kept: list[list[_Seen]] = []
    found: list[set[tuple[int, int]]] = [set() for _ in source.cameras]
    for seen, sizes in frames:
        kept.append(seen)
        for sizes_of, size in zip(found, sizes, strict=True):
            if size is not None:
                sizes_of.add(size)
    for name, sizes_of in zip(source.cameras, found, strict=True):
        if len(sizes_of) != 1:
            what = "has no image" if not sizes_of else "has images of several sizes"
            raise InputError(f"{name} {what}: see that it is switched on and set to one size")
    return kept, [sizes_of.pop() for sizes_of in found]


def seen_in(
    source: FrameSource, look: Callable[[Image | None], _Seen], monitor: Monitor = SILENT
) -> Iterator[_FrameSeen[_Seen]]:
    """Yield what is found in the images of a source, camera by camera, and their sizes; Ctrl-C ends it.

    Parameters
    ----------
    source : FrameSource
        Not yet entered.
    look : callable
        Finds it in an image, which is None where it was lost.
    monitor : Monitor
        Reports how many sets are done; may cancel.
    """
    monitor.begin("images")
    n_seen = 0
    with ThreadPoolExecutor(os.cpu_count() or 1, "images") as threads, source as sets:
        try:
            for frame in with_progress(sets, source.n_frames or 0, monitor):
                sizes = [None if image is None else (image.shape[1], image.shape[0]) for image in frame.images]
                yield list(threads.map(look, frame.images)), sizes
                n_seen += 1
        except KeyboardInterrupt:
            if not n_seen or source.n_frames is not None:
                raise
            monitor.notice(f"stopped after {n_seen} sets of images; these are used")


def detected_balls(image: Image | None) -> Balls:
    """Return the balls in an image of a camera that is not calibrated; none where it was lost."""
    return balls_at(np.empty((0, 2)), 1.0) if image is None else detect_balls(image, DetectionParameters())
