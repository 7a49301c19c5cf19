"""A simulated room: cameras around it, a wand that is waved in it, a person whose body hides markers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.capture.reference_rig import reference_arm
from skelgen.capture.simulated_rig.scene import moved_truth
from skelgen.geometry.rotations import matrix_from_vector, transform_from, unit_vectors
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera, CameraRig
from skelgen.parameters import ParameterValue
from skelgen.simulation import Structure, Truth, find_structure, simulate
from skelgen.simulation.motion import smooth_curves
from skelgen.simulation.visibility import blocked_by_limbs

WAND = (0.0, 180.0, 500.0)
"""mm; the balls of a wand along it: which end is which shows in every image."""

ROOM_RATE = 100.0
"""Hz; images a second."""

_HEIGHTS = (2600.0, 1700.0)  # mm: cameras hang high and low in turn
_LOOKED_AT = np.array([0.0, 0.0, 950.0])  # mm
_SIDE = 4000.0  # mm, of the square that is seen
_NOISE = 0.05  # px, of a ball's centre along one axis
_FOCAL = 0.8  # of the width: 64 degrees across
_LENS = np.array([-0.12, 0.06, 0.0008, -0.0006, 0.0])
_SLOW, _TURNING = (0.15, 0.6), (0.1, 0.5)  # Hz
_WAVED = np.array([[1500.0, 1500.0, 750.0]])  # mm about the middle
_COVERED = 0.2  # of curves within -1 .. 1: who waves stands between the wand and every third camera


def room_rig(n_cameras: int = 8, size: tuple[int, int] = (1280, 1024)) -> CameraRig:
    """Return cameras around a room of 4 x 4 m, all looking at its middle: the origin is on the floor, z points up.

    Parameters
    ----------
    n_cameras : int
        How many.
    size : tuple of int, px
        Width and height of their images.
    """
    width, height = size
    matrix = np.array([[_FOCAL * width, 0, width / 2 - 0.5], [0, _FOCAL * width, height / 2 - 0.5], [0, 0, 1.0]])
    rng = np.random.default_rng(n_cameras)
    cameras = []
    for number in range(n_cameras):
        turn = 2 * np.pi * (number + 0.5) / n_cameras
        place = np.array([np.cos(turn), np.sin(turn), 0.0]) * _SIDE * 0.85
        place[2] = _HEIGHTS[number % len(_HEIGHTS)]
        own = matrix.copy()
        own[[0, 1, 0, 1], [0, 1, 2, 2]] += rng.normal(scale=(6.0, 6.0, 8.0, 8.0))
        cameras.append(
            Camera(width, height, own, _LENS * rng.uniform(0.8, 1.2, 5), _looking(place), f"camera {number + 1}")
        )
    return CameraRig(cameras, _NOISE)


def _looking(place: Floats) -> Floats:
    """camera_from_world of a camera that looks at the middle of the room, upright."""
    ahead = unit_vectors(_LOOKED_AT - place)
    right = unit_vectors(np.cross(ahead, [0.0, 0.0, 1.0]))
    turn = np.stack([right, np.cross(ahead, right), ahead])
    return transform_from(turn, -turn @ place)


@dataclass(frozen=True, eq=False)
class RoomScene:
    """Balls that move in a room.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, n_balls, 3), mm
        Where they are.
    hidden : ndarray of bool, shape (n_frames, n_cameras, n_balls)
        Whether something stands before them.
    rate : float, Hz
        Frames a second.
    truth : Truth or None
        Of a person: all that stages are judged by.
    """

    positions: Floats
    hidden: Bools
    rate: float = ROOM_RATE
    truth: Truth | None = None

    @property
    def n_frames(self) -> int:
        """Length of the scene."""
        return len(self.positions)


def wand_scene(
    rig: CameraRig, n_frames: int, distances: Sequence[float] = WAND, *, rate: float = ROOM_RATE, seed: int = 0
) -> RoomScene:
    """Return a wand that is waved through the room.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    n_frames : int
        How long.
    distances : sequence of float, mm
        Where its balls are along it.
    rate : float, Hz
        Frames a second.
    seed : int
        Of the motion.
    """
    rng = np.random.default_rng(seed)
    middle = _LOOKED_AT + 1.6 * _WAVED * smooth_curves(rng, n_frames, rate, 3, _SLOW)
    along = unit_vectors(smooth_curves(rng, n_frames, rate, 3, _TURNING))
    offsets = np.array(distances, dtype=np.float64)
    offsets -= offsets.mean()
    positions = middle[:, np.newaxis] + offsets[:, np.newaxis] * along[:, np.newaxis]
    covered = smooth_curves(rng, n_frames, rate, len(rig.cameras), _SLOW) > _COVERED
    return RoomScene(positions, np.repeat(covered[..., np.newaxis], len(offsets), axis=2), rate)


def board_poses(rig: CameraRig, n_frames: int, seed: int = 0) -> Floats:
    """Return where a board is held before two neighbouring cameras, shape (n_frames, 4, 4), mm; z away from them.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    n_frames : int
        How many places.
    seed : int
        Of the places.
    """
    rng, places = np.random.default_rng(seed), rig.places
    one = rng.integers(len(places), size=n_frames)
    before = (places[one] + places[(one + 1) % len(places)]) / 2 * [1, 1, 0.6]
    middle = rng.uniform((-900, -900, 500), (900, 900, 1700), (n_frames, 3))
    away = unit_vectors(middle - before)
    across = unit_vectors(np.cross([0.0, 0.0, 1.0], away))
    turn = np.stack([across, np.cross(away, across), away], axis=2)
    return transform_from(turn @ matrix_from_vector(rng.uniform(-0.5, 0.5, (n_frames, 3))), middle)


FRAME = (600.0, 400.0)
"""mm; arms of an L-frame that lies in the origin."""


def frame_scene(rig: CameraRig, n_frames: int = 20, arms: tuple[float, float] = FRAME) -> RoomScene:
    """Return an L-frame that lies on the floor.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    n_frames : int
        How long.
    arms : tuple of float, mm
        Along x and along y.
    """
    balls = np.array([[0.0, 0.0, 0.0], [arms[0], 0.0, 0.0], [0.0, arms[1], 0.0]])
    positions = np.repeat(balls[np.newaxis], n_frames, axis=0)
    return RoomScene(positions, np.zeros((n_frames, len(rig.cameras), len(balls)), dtype=np.bool_))


def person_scene(
    rig: CameraRig,
    n_frames: int = 600,
    structure: Structure | str = "human",
    *,
    seed: int = 0,
    **options: ParameterValue,
) -> RoomScene:
    """Return a person in the room, whose limbs hide markers from cameras.

    Parameters
    ----------
    rig : CameraRig
        The cameras.
    n_frames : int
        How long.
    structure : Structure or str
        Who moves.
    seed : int
        Of the motion.
    **options
        Of `skelgen.simulate`: ``rate``, ``walk``, ``motion_range``, ...
    """
    body = find_structure(structure, seed) if isinstance(structure, str) else structure
    wanted = {"rate": ROOM_RATE, "walk": 700.0, **options, "labelled": True, "n_frames": n_frames}
    made = simulate(body, seed=seed, parameters=None, **wanted)
    truth = made.truth
    shift = -truth.marker_positions.mean(axis=(0, 1)) * [1.0, 1.0, 0.0]
    there = moved_truth(truth, transform_from(np.eye(3), shift))
    poses, positions = there.world_from_limb, there.marker_positions
    hidden = np.stack([blocked_by_limbs(body, poses, positions, place) for place in rig.places], axis=1)
    return RoomScene(positions, hidden, made.take.rate, there)


ARM_SPREAD = 3.0
"""Larger than before two cameras: from 3.5 m the balls of the reference arm's targets are one spot."""


def room_arm() -> Structure:
    """Return the reference arm with larger targets, as a room's cameras need them."""
    arm = reference_arm()
    return replace(arm, limbs=tuple(replace(limb, markers=ARM_SPREAD * limb.markers) for limb in arm.limbs))
