"""Calibration of a room with a board that some cameras see at a time: start values for the adjustment.

Each camera's lens comes from its own views. How two cameras stand to each other is taken from the moment at which both
see the board and with which most other moments agree; a chessboard that looks alike when it is turned by half is turned
as it fits.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import BoardBundle
from skelgen.capture.calibration.chessboard import Board, board_from_text, find_board, turned_boards
from skelgen.capture.calibration.lens import fit_camera
from skelgen.capture.images import opencv
from skelgen.capture.values import Image
from skelgen.errors import InputError, ParameterError
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.arrays import Floats, Ints, evenly_spread, spread_frames
from skelgen.model.rig import Camera
from skelgen.progress import counted

FEWEST_CORNERS = 6
"""Corners of a view that place a board."""

FEWEST_VIEWS, MOST_VIEWS = 5, 40
"""Views of a camera for its lens: with fewer none is known, with more none is better."""

LEAST_SHARED = 3
"""Moments that two cameras must share."""

CANDIDATES = 40
AGREES = np.radians(3.0), 0.05
"""Angle, and shift as a part of the distance of two cameras, up to which a moment agrees with their relation."""


@dataclass(frozen=True)
class CharucoBoard:
    """A chessboard with a marker in each white square, so that parts of it are enough.

    Attributes
    ----------
    columns, rows : int
        Squares.
    square, marker : float, mm
        Sides of a square and of a marker.
    dictionary : str
        Of the markers, as OpenCV calls it: ``4X4_50``.
    """

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str = "4X4_50"

    @property
    def points(self) -> Floats:
        """Inner corners in the board's frame, row by row, shape (n_corners, 3), mm."""
        corner = np.array([self.square, self.square, 0.0])
        return np.asarray(Board(self.columns - 1, self.rows - 1, self.square).points + corner)

    @property
    def orders(self) -> tuple[Ints, ...]:
        """The only way to number its corners: markers tell them apart."""
        return (np.arange((self.columns - 1) * (self.rows - 1)),)

    def detector(self) -> object:
        """Return OpenCV's detector of it."""
        aruco = opencv().aruco
        known = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{self.dictionary}"))
        return aruco.CharucoDetector(aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, known))


AnyBoard = Board | CharucoBoard


def room_board(text: str, square: float, marker: float | None = None) -> AnyBoard:
    """Return the board that a text names.

    Parameters
    ----------
    text : str
        Inner corners of a chessboard, ``9x6``; or squares and dictionary of a ChArUco board, ``charuco:10x7:4X4_50``.
    square : float, mm
        Side of a square.
    marker : float, optional, mm
        Side of a marker; by default three quarters of a square.

    Raises
    ------
    ParameterError
        If the text does not look like that, or OpenCV knows no such dictionary.
    """
    if not text.startswith("charuco:"):
        return board_from_text(text, square)
    match = re.fullmatch(r"charuco:(\d+)x(\d+)(?::(?:DICT_)?(\w+))?", text)
    if match is None:
        raise ParameterError(f"{text!r} is no board; give its squares and dictionary as in charuco:10x7:4X4_50")
    columns, rows, dictionary = int(match[1]), int(match[2]), (match[3] or "4X4_50").upper()
    side = 0.75 * square if marker is None else marker
    if not (0 < side < square and np.isfinite(square)) or min(columns, rows) < LEAST_SHARED:
        raise ParameterError(
            f"a board of {columns}x{rows} squares of {square:g} mm with markers of {side:g} mm is none: markers are "
            "smaller than squares, and there are three squares each way at least"
        )
    if not hasattr(opencv().aruco, f"DICT_{dictionary}"):
        raise ParameterError(f"{dictionary!r} is no dictionary of markers; 4X4_50, 5X5_100, 6X6_250 are some")
    return CharucoBoard(columns, rows, square, side, dictionary)


def corners_in(image: Image | None, board: AnyBoard) -> Floats:
    """Return where an image shows the corners of a board, shape (n_corners, 2), px; NaN of those it does not show.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width), or None
        Grey.
    board : Board or CharucoBoard
        What is looked for.
    """
    corners = np.full((len(board.points), 2), np.nan)
    if image is None:
        return corners
    if isinstance(board, Board):
        # Most images of a room show no board: a look of a millisecond spares a search of a second.
        there = opencv().checkChessboard(image, (board.columns, board.rows))
        view = find_board(image, board) if there else None
        return corners if view is None else view.corners
    found, numbers, _, _ = board.detector().detectBoard(image)  # type: ignore[attr-defined]  # OpenCV has no types
    if numbers is not None and len(numbers) >= FEWEST_CORNERS:
        corners[np.ravel(numbers)] = found.reshape(-1, 2)
    return corners


def board_start(seen: Floats, board: AnyBoard, sizes: Sequence[tuple[int, int]], names: Sequence[str]) -> BoardBundle:
    """Return cameras and boards near the truth; the first camera's frame is the world.

    Parameters
    ----------
    seen : ndarray, shape (n_frames, n_cameras, n_corners, 2), px
        Where the corners were seen; NaN where one was not.
    board : Board or CharucoBoard
        What was seen.
    sizes : sequence of tuple of int, px
        Width and height of each camera's images.
    names : sequence of str
        What the cameras are called.

    Raises
    ------
    InputError
        If a camera has too few views of the board, or shares too few with the others.
    """
    lenses, poses = [], np.full((*seen.shape[:2], 4, 4), np.nan)
    for index, (size, name) in enumerate(zip(sizes, names, strict=True)):
        lens = _lens(seen[:, index], board, size, name)
        lenses.append(lens)
        for frame in range(len(seen)):
            poses[frame, index] = _board_pose(seen[frame, index], board, lens)
    places = _camera_poses(poses, board, names)
    cameras = [
        Camera(*lens.size, lens.matrix, lens.distortion, place, lens.name)
        for lens, place in zip(lenses, places, strict=True)
    ]
    ordered, world_from_board = _turned_alike(seen, poses, places, board)
    placed = np.asarray(np.isfinite(world_from_board[:, 0, 0]))
    return BoardBundle(tuple(cameras), ordered, board.points, world_from_board).of(placed)


def _lens(seen: Floats, board: AnyBoard, size: tuple[int, int], name: str) -> Camera:
    shown = np.isfinite(seen[..., 0])
    views = np.flatnonzero(shown.sum(axis=1) >= FEWEST_CORNERS)
    if len(views) < FEWEST_VIEWS:
        raise InputError(
            f"{name} shows the board in {counted(len(views), 'image')}; at least {FEWEST_VIEWS} are needed: "
            "hold it where this camera looks, turned about different axes; is the camera dark, "
            "are the board's squares counted right?"
        )
    views = evenly_spread(views, MOST_VIEWS)
    points, pixels = zip(*((board.points[shown[view]], seen[view, shown[view]]) for view in views), strict=True)
    return replace(fit_camera(points, pixels, size, f"what {name} sees of the board")[0], name=name)


def _board_pose(corners: Floats, board: AnyBoard, camera: Camera) -> Floats:
    """camera_from_board, shape (4, 4); NaN if too little of the board is seen."""
    shown = np.isfinite(corners[:, 0])
    if shown.sum() < FEWEST_CORNERS:
        return np.full((4, 4), np.nan)
    done, turn, shift = opencv().solvePnP(board.points[shown], corners[shown], camera.matrix, camera.distortion)
    return transform_from(matrix_from_vector(np.ravel(turn)), np.ravel(shift)) if done else np.full((4, 4), np.nan)


def _camera_poses(poses: Floats, board: AnyBoard, names: Sequence[str]) -> list[Floats]:
    """camera_from_first of all cameras, by the pairs that share most moments."""
    shows = np.isfinite(poses[..., 0, 0])
    n_cameras, ways = len(names), turned_boards(board.points, board.orders)
    relations: dict[tuple[int, int], tuple[int, Floats]] = {}
    for one, two in combinations(range(n_cameras), 2):
        both = shows[:, one] & shows[:, two]
        if both.sum() >= LEAST_SHARED:
            count, second = _relative_pose(poses[both, one], poses[both, two], ways)
            relations[one, two] = count, second
            relations[two, one] = count, np.asarray(np.linalg.inv(second))
    places: dict[int, Floats] = {0: np.eye(4)}
    while len(places) < n_cameras:
        open_ends = [(relations[pair][0], pair) for pair in relations if pair[0] in places and pair[1] not in places]
        count, (known, new) = max(open_ends, default=(0, (0, 0)))
        if count < LEAST_SHARED:
            name = next(name for index, name in enumerate(names) if index not in places)
            others = ", ".join(names[index] for index in sorted(places))
            raise InputError(
                f"{name} shares {count} views of the board with {others}; at least {LEAST_SHARED} are needed: hold the "
                "board still where both see it"
            )
        places[new] = relations[known, new][1] @ places[known]
    return [places[index] for index in range(n_cameras)]


def _relative_pose(one: Floats, two: Floats, ways: Floats) -> tuple[int, Floats]:
    """How many moments agree with the best relation of two cameras, and that: second_from_first."""
    relations = two[:, np.newaxis] @ ways @ np.linalg.inv(one)[:, np.newaxis]  # (n, n_ways, 4, 4)
    flat = relations.reshape(-1, 4, 4)
    best, most = flat[0], 0
    for candidate in flat[spread_frames(len(flat), CANDIDATES)]:
        angle, shift = _pose_difference(relations, candidate)
        count = int(((angle <= AGREES[0]) & (shift <= AGREES[1])).any(axis=1).sum())
        if count > most:
            best, most = candidate, count
    return most, best


def _pose_difference(poses: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Angle [rad] between poses and another, and the shift as a part of how far the other is away."""
    turn = poses[..., :3, :3] @ other[:3, :3].T
    angle = np.linalg.norm(vector_from_matrix(turn.reshape(-1, 3, 3)), axis=1).reshape(turn.shape[:-2])
    distance = max(float(np.linalg.norm(other[:3, 3])), 1.0)
    return angle, np.linalg.norm(poses[..., :3, 3] - other[:3, 3], axis=-1) / distance


def _turned_alike(seen: Floats, poses: Floats, places: Sequence[Floats], board: AnyBoard) -> tuple[Floats, Floats]:
    """The corners of all cameras in the order of the first one that shows the board, and where it is in each frame."""
    ordered, ways = seen.copy(), turned_boards(board.points, board.orders)
    world_from_board = np.full((len(seen), 4, 4), np.nan)
    for frame in range(len(seen)):
        for index, place in enumerate(places):
            if not np.isfinite(poses[frame, index, 0, 0]):
                continue
            here = np.linalg.inv(place) @ poses[frame, index] @ ways
            if np.isnan(world_from_board[frame, 0, 0]):
                world_from_board[frame] = here[0]
                continue
            angle, _ = _pose_difference(here, world_from_board[frame])
            best = int(angle.argmin())
            ordered[frame, index] = seen[frame, index][board.orders[best]]
            if angle[best] > 5 * AGREES[0]:
                ordered[frame, index] = np.nan
    return ordered, world_from_board
