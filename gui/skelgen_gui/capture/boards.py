"""Where the boards of a calibration were in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skelgen.capture.calibration.board import Board
from skelgen.capture.calibration.verdict import PairSeen
from skelgen.capture.optics.triangulation import triangulate
from skelgen.model.arrays import Floats
from skelgen.model.rig import StereoRig
from skelgen_gui.capture.space import Found


def boards_in_space(rig: StereoRig, pairs: Sequence[PairSeen], board: Board) -> Found:
    """Return the corners of the boards that a calibration rests on, each board a group of its own."""
    used = [(pair.left, pair.right) for pair in pairs if pair.is_used]
    corners = [
        _corners(rig, left.corners, right.corners, board)
        for left, right in used
        if left is not None and right is not None
    ]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    groups = np.repeat(np.arange(len(corners), dtype=np.intp), board.columns * board.rows)
    is_known = np.isfinite(points).all(axis=1)
    return Found(points[is_known], groups[is_known])


def _corners(rig: StereoRig, left: Floats, right: Floats, board: Board) -> Floats:
    """Corners in space; the detector may have begun at another end of the board in one of the images."""
    tried = [triangulate(rig, left, right[order]).points for order in board.orders]
    steps = [np.linalg.norm(np.diff(points.reshape(board.rows, -1, 3), axis=1), axis=-1) for points in tried]
    errors = [float(np.abs(np.nan_to_num(step, nan=np.inf) - board.square).mean()) for step in steps]
    return tried[int(np.argmin(errors))]
