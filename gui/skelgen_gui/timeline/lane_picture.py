"""The picture of lanes: full bars where seen, thin ones where filled, a stripe at the foot where doubtful."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats
from skelgen_gui.timeline.lanes import State

_BAR = (0.16, 0.84)  # of a lane's height
_THIN = (0.42, 0.58)
_STRIPE = (0.62, 0.94)
_FILLED, _LEFT_OUT = 0.75, 0.5  # opacity
_DIP = 0.3  # of opacity, for a gap that is shorter than a pixel
_LEAST_DOUBT = 0.7  # opacity of a doubt that is shorter than a pixel


def lane_picture(
    shares: Floats, colours: NDArray[np.uint8], doubt: NDArray[np.uint8], height: int
) -> NDArray[np.uint8]:
    """Draw lanes.

    Parameters
    ----------
    shares : ndarray, shape (n_lanes, n_columns, 5)
        Part of each `State` in each column of pixels.
    colours : ndarray of uint8, shape (n_lanes, 3)
        Red, green and blue of each lane.
    doubt : ndarray of uint8, shape (3,)
        Colour of what is doubtful.
    height : int, px
        Of a lane.

    Returns
    -------
    ndarray of uint8, shape (n_lanes * height, n_columns, 4)
        Red, green, blue and opacity. Gaps and doubts shorter than a pixel can still be seen.
    """
    n_lanes, n_columns, _ = shares.shape
    solid = shares[..., State.SEEN] + shares[..., State.DOUBTFUL] + _LEFT_OUT * shares[..., State.LEFT_OUT]
    missing = shares[..., State.FILLED] + shares[..., State.UNSEEN]
    solid = np.where(missing > 0, np.minimum(solid, 1 - _DIP), solid)
    doubtful = shares[..., State.DOUBTFUL]
    doubtful = np.where(doubtful > 0, np.maximum(doubtful, _LEAST_DOUBT), 0.0)
    thin = np.maximum(solid, solid + _FILLED * shares[..., State.FILLED])

    picture = np.zeros((n_lanes, height, n_columns, 4), dtype=np.uint8)
    picture[..., :3] = colours[:, np.newaxis, np.newaxis]
    picture[:, _rows(_BAR, height), :, 3] = _opacity(solid)
    picture[:, _rows(_THIN, height), :, 3] = _opacity(thin)
    stripe = picture[:, _rows(_STRIPE, height)]
    marked = np.broadcast_to((doubtful > 0)[:, np.newaxis], stripe.shape[:3])
    stripe[marked, :3] = doubt
    stripe[..., 3] = np.where(marked, _opacity(doubtful), stripe[..., 3])
    return picture.reshape(n_lanes * height, n_columns, 4)


def _rows(part: tuple[float, float], height: int) -> slice:
    first = round(part[0] * height)
    return slice(first, max(round(part[1] * height), first + 1))


def _opacity(part: Floats) -> NDArray[np.uint8]:
    return np.round(255 * np.clip(part, 0.0, 1.0)).astype(np.uint8)[:, np.newaxis]
