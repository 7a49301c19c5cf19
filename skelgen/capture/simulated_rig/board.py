"""A chessboard before the simulated rig, held here and there as one does to calibrate cameras, with its truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter

from skelgen._kernels.rendering import PADDING
from skelgen.capture.calibration.chessboard import Board, coverage, shortest_side
from skelgen.capture.optics import project
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import RenderedPairs
from skelgen.capture.simulated_rig.view import corner_rays
from skelgen.capture.values import FrameSet, Image
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, moved_points, transform_from, vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, StereoRig

BORDER = 1.0
"""Width of the white border around the squares, in squares."""

MOVING = 0.5
"""Part of the time at each place that the board takes to get there; then it is held still."""

N_PLACES = 30
"""Places to which the board goes in turn: calibrations want 10 to 20."""

SMALLEST_SQUARE = 10.0
"""px: on smaller squares edges are as wide as the squares, and nobody can tell whether they are sharp."""

_BLACK, _WHITE, _ROOM = 35.0, 205.0, 90.0  # grey levels
_BLUR, _NOISE = 0.7, 1.5  # px and grey levels, as of the rendered balls
_SAMPLES = 4  # along each side of a pixel: what edges lose by them is below 0.01 px
_CANDIDATES = 1000  # places that are tried
_DISTANCES = (1.1, 3.0)  # times the base between the cameras
_ASIDE, _LEAN, _TURN = 0.5, np.radians(35.0), np.radians(25.0)


@dataclass(frozen=True, eq=False)
class BoardTruth:
    """What is true of a rendered pair.

    Attributes
    ----------
    left, right : ndarray, shape (n_corners, 2), px
        Its corners in both images.
    """

    left: Floats
    right: Floats


class SimulatedBoard(RenderedPairs):
    """A chessboard before the cameras of `reference_rig`; a `FrameSource` to try calibrations with.

    The board goes from place to place, one a second, so that the places cover both images, and is held still at each.

    Parameters
    ----------
    n_frames : int
        Pairs until it ends.
    rate : float, Hz
        Pairs a second.
    seed : int
        Of the places and the sensors' noise.
    paced : bool
        Whether pairs come by the clock, as from cameras: who is slow loses pairs, which are counted.
    """

    def __init__(self, *, n_frames: int = 600, rate: float = 60.0, seed: int = 0, paced: bool = False) -> None:
        super().__init__("simulated board", reference_rig(), n_frames, rate, paced)
        self.board, self._seed = Board(), seed

    def render(self, index: int, dropped: int = 0) -> tuple[FrameSet, BoardTruth]:
        """Return any pair with its truth; the same index gives the same pair.

        Parameters
        ----------
        index : int
            Which, from 0.
        dropped : int
            Number of pairs lost before it.
        """
        pose = self._pose(index / self.rate)
        corners = moved_points(pose, self.board.points)
        cameras = self.rig.left, self.rig.right
        images = [
            board_image(camera, self.board, pose, (self._seed, index, side)) for side, camera in enumerate(cameras)
        ]
        truth = BoardTruth(project(self.rig.left, corners), project(self.rig.right, corners))
        return FrameSet(tuple(images), index / self.rate, index, dropped), truth

    @cached_property
    def _places(self) -> Floats:
        return board_places(self.board, self.rig, N_PLACES, self._seed)

    def _pose(self, seconds: float) -> Floats:
        """Where the board is: on its way from the place before in the first part of a second, then still."""
        places, number = self._places, int(seconds)
        here, before = places[number % len(places)], places[max(number - 1, 0) % len(places)]
        part = min((seconds - number) / MOVING, 1.0)
        part = part * part * (3 - 2 * part)
        turn = vector_from_matrix(before[:3, :3].T @ here[:3, :3])
        shift = before[:3, 3] + part * (here[:3, 3] - before[:3, 3])
        return transform_from(before[:3, :3] @ matrix_from_vector(part * turn), shift)


def board_image(camera: Camera, board: Board, pose: Floats, seed: Sequence[int]) -> Image:
    """Return what a camera sees of a chessboard.

    Parameters
    ----------
    camera : Camera
        What looks.
    board : Board
        What is looked at, from its front.
    pose : ndarray, shape (4, 4), mm
        Where the board is in the camera's world.
    seed : sequence of int
        Of the sensor's noise.
    """
    light = np.full((camera.height, camera.width), _ROOM)
    _draw_board(light, camera, board, pose)
    light = gaussian_filter(light, _BLUR)
    noise = np.random.default_rng(seed).normal(0.0, _NOISE, light.shape)
    image: Image = np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)
    image.flags.writeable = False
    return image


def _draw_board(light: Floats, camera: Camera, board: Board, pose: Floats) -> None:
    """Draw a chessboard with its white border into an image.

    Parameters
    ----------
    light : ndarray, shape (height, width), grey levels
        The image, which is changed.
    camera : Camera
        What looks.
    board : Board
        What is looked at.
    pose : ndarray, shape (4, 4), mm
        Where the board is in the camera's world.
    """
    outline = project(camera, moved_points(pose, _outline(board)))
    if not np.isfinite(outline).all():
        return
    low = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 2, (camera.width, camera.height))
    if (low >= high).any():
        return
    rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
    corner_rows = slice(low[1] + PADDING, high[1] + PADDING + 1)
    rays = corner_rays(camera)[corner_rows, low[0] + PADDING : high[0] + PADDING + 1]
    camera_from_board = camera.camera_from_world @ pose
    board_from_ray: Floats = np.asarray(np.linalg.inv(camera_from_board[:3, [0, 1, 3]]), dtype=np.float64)
    total = np.zeros((high[1] - low[1], high[0] - low[0]))
    seen = np.zeros_like(total)
    for across in (np.arange(_SAMPLES) + 0.5) / _SAMPLES:
        for down in (np.arange(_SAMPLES) + 0.5) / _SAMPLES:
            level, inside = _look(_between(rays, across, down), board_from_ray, board)
            total += level
            seen += inside
    light[rows, columns] = (total + (_SAMPLES**2 - seen) * light[rows, columns]) / _SAMPLES**2


def board_places(board: Board, rig: StereoRig, n_places: int, seed: int = 0) -> Floats:
    """Return places of a board that both cameras see whole and that cover both images, shape (n, 4, 4), mm.

    Parameters
    ----------
    board : Board
        The chessboard.
    rig : StereoRig
        The cameras.
    n_places : int
        Number of places at most.
    seed : int
        Of the random places that are tried.

    Raises
    ------
    InputError
        If hardly any place is seen by both cameras.
    """
    rng = np.random.default_rng(seed)
    candidates, views = _candidates(board, rig, rng)
    if len(candidates) < min(n_places, 3):
        raise InputError("a board fits into both images hardly anywhere; turn the cameras towards each other")
    counts = np.zeros((len(candidates), 2, 9))
    for index, pair in enumerate(views):
        for side, camera in enumerate((rig.left, rig.right)):
            counts[index, side] = coverage([pair[side]], camera.size).ravel()
    total = np.zeros((2, 9))
    chosen: list[int] = []
    while len(chosen) < min(n_places, len(candidates)):
        gain = np.sqrt(total + counts).sum(axis=(1, 2))  # corners count most where there are few yet
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        total += counts[chosen[-1]]
    return np.asarray(candidates[chosen])


def _candidates(board: Board, rig: StereoRig, rng: np.random.Generator) -> tuple[Floats, list[tuple[Floats, Floats]]]:
    """Places that both cameras see whole, and the corners in both images."""
    poses = [np.linalg.inv(camera.camera_from_world) for camera in (rig.left, rig.right)]
    middle, ahead = (poses[0][:3, 3] + poses[1][:3, 3]) / 2, poses[0][:3, 2] + poses[1][:3, 2]
    ahead /= np.linalg.norm(ahead)
    level = poses[0][:3, 0] - (poses[0][:3, 0] @ ahead) * ahead
    level /= np.linalg.norm(level)
    facing = np.stack([level, np.cross(ahead, level), ahead], axis=1)
    centre = board.points.mean(axis=0)
    poses, views = [], []
    for _ in range(_CANDIDATES):
        distance = rig.baseline * rng.uniform(*_DISTANCES)
        aside = distance * rng.uniform(-_ASIDE, _ASIDE, 2)
        lean = np.append(rng.uniform(-_LEAN, _LEAN, 2), rng.uniform(-_TURN, _TURN))
        turn = facing @ matrix_from_vector(lean)
        place = middle + facing @ np.array([*aside, distance]) - turn @ centre
        pose = transform_from(turn, place)
        if all(_is_whole(camera, board, pose) for camera in (rig.left, rig.right)):
            corners = board.points @ turn.T + place
            view = project(rig.left, corners), project(rig.right, corners)
            if min(shortest_side(side, board) for side in view) >= SMALLEST_SQUARE:
                poses.append(pose)
                views.append(view)
    return np.array(poses).reshape(-1, 4, 4), views


def _is_whole(camera: Camera, board: Board, pose: Floats) -> bool:
    outline = project(camera, moved_points(pose, _outline(board)))
    return bool(((outline > 1) & (outline < np.array(camera.size) - 2)).all())


def _outline(board: Board) -> Floats:
    """Points along the rim of the border, shape (n, 3), mm; more than its corners, as lenses bend it."""
    low = -(1 + BORDER) * board.square
    high = np.array([board.columns + BORDER, board.rows + BORDER]) * board.square
    along = np.linspace(0.0, 1.0, 5)
    x, y = low + along * (high[0] - low), low + along * (high[1] - low)
    sides = [(x, np.full(5, low)), (x, np.full(5, high[1])), (np.full(5, low), y), (np.full(5, high[0]), y)]
    return np.concatenate([np.stack([*side, np.zeros(5)], axis=1) for side in sides])


def _between(rays: Floats, across: float, down: float) -> Floats:
    """Rays within pixels, from those through their corners."""
    above = (1 - across) * rays[:-1, :-1] + across * rays[:-1, 1:]
    below = (1 - across) * rays[1:, :-1] + across * rays[1:, 1:]
    return np.asarray((1 - down) * above + down * below)


def _look(rays: Floats, board_from_ray: Floats, board: Board) -> tuple[Floats, Floats]:
    """Grey level where each ray meets the board, 0 beside it, and whether it does."""
    met = rays @ board_from_ray[:, :2].T + board_from_ray[:, 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y = met[..., 0] / met[..., 2] / board.square, met[..., 1] / met[..., 2] / board.square
    rim = 1 + BORDER
    inside = (x > -rim) & (x < board.columns - 1 + rim) & (y > -rim) & (y < board.rows - 1 + rim)
    squares = (x > -1) & (x < board.columns) & (y > -1) & (y < board.rows)
    dark = squares & ((np.floor(x) + np.floor(y)) % 2 == 0)
    return np.where(inside, np.where(dark, _BLACK, _WHITE), 0.0), inside.astype(np.float64)
