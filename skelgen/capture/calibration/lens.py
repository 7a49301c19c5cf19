"""Cameras and their lenses from views of a chessboard (Zhang 2000; Bouguet; Gaschler 2011, equation 4.8).

Views that do not fit are left out: those that are blurred, moved between exposures, or have mistaken corners.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import N_MATRIX, Adjusted, BoardBundle, adjust, free_numbers
from skelgen.capture.calibration.chessboard import Board
from skelgen.capture.images import opencv
from skelgen.errors import InputError, ParameterError
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera

LENSES = {"radial": (0, 1), "tangential": (0, 1, 2, 3), "full": (0, 1, 2, 3, 4)}
"""Lens models: which of k1 k2 p1 p2 k3 are estimated. Gaschler (2011) uses the first."""

FOCAL_LENGTHS = (0.05, 1000.0)
"""Least and largest focal length in widths of the image: lenses that see 170 degrees, and a twentieth of one."""

AUTO = "auto"
"""The lens model that the views themselves ask for: the least Bayesian information criterion."""


def guess_camera(corners: Floats, board: Board, size: tuple[int, int]) -> tuple[Camera, Floats]:
    """Return a camera with a radial lens and the poses of the board, by OpenCV's calibration.

    Parameters
    ----------
    corners : ndarray, shape (n_views, n_corners, 2), px
        Where they were seen.
    board : Board
        What was seen.
    size : tuple of int, px
        Width and height of the images.

    Returns
    -------
    Camera
        Its frame is the world.
    ndarray, shape (n_views, 4, 4), mm
        camera_from_board.

    Raises
    ------
    InputError
        If the views are too few, or no camera explains them.
    """
    if len(corners) < LEAST_VIEWS:
        raise InputError(
            f"{len(corners)} views of the board are too few; at least {LEAST_VIEWS} are needed, 10 to 20 are better"
        )
    return fit_camera([board.points] * len(corners), list(corners), size, "these views of the board")


def fit_camera(
    points: Sequence[Floats], pixels: Sequence[Floats], size: tuple[int, int], views: str
) -> tuple[Camera, Floats]:
    """Return what `guess_camera` does, from views that may each show a part of a board.

    Parameters
    ----------
    points : sequence of ndarray, shape (n_shown, 3), mm
        The corners that each view shows, in the board's frame.
    pixels : sequence of ndarray, shape (n_shown, 2), px
        Where it shows them.
    size : tuple of int, px
        Width and height of the images.
    views : str
        What the views are, for the message.

    Raises
    ------
    InputError
        If no camera explains them.
    """
    cv2 = opencv()
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    corners = [one.astype(np.float32) for one in points], [one.astype(np.float32).reshape(-1, 1, 2) for one in pixels]
    try:
        _, matrix, lens, turns, shifts = cv2.calibrateCamera(*corners, size, None, None, flags=flags)
        low, high = (part * max(size) for part in FOCAL_LENGTHS)
        focal = matrix[0, 0], matrix[1, 1]
        fits = bool(np.isfinite(matrix).all() and np.isfinite(lens).all() and low < min(focal) and max(focal) < high)
    except cv2.error:
        fits = False
    if not fits:
        raise InputError(f"no camera explains {views}; see that its corners are counted right, and tilt the board more")
    poses = [transform_from(matrix_from_vector(np.ravel(t)), np.ravel(s)) for t, s in zip(turns, shifts, strict=True)]
    return Camera(*size, np.asarray(matrix, dtype=np.float64), np.ravel(lens)), np.stack(poses)


OUTLIER_RATIO = 3.0
"""A view is left out whose error is so many times the median view's: those of one recording differ by less than two,
and a view that errs three times as much would weigh as much as nine others."""

MAX_ROUNDS = 10
LEAST_VIEWS = 3
"""Two views leave a camera undetermined in practice; three determine it without redundancy, and the verdict says so."""


class Robust(NamedTuple):
    """An adjustment and the views that it was made from.

    Attributes
    ----------
    adjusted : Adjusted[BoardBundle]
        Of the kept views.
    kept : ndarray of bool, shape (n_views,)
        Which they are.
    view_rms : ndarray, shape (n_cameras, n_views), px
        Error of all views; those left out with their pose fitted to the others' cameras.
    """

    adjusted: Adjusted[BoardBundle]
    kept: Bools
    view_rms: Floats


def adjust_lens(bundle: BoardBundle, inliers: Bools, lens: str) -> Robust:
    """Return the robust adjustment with a lens model.

    Parameters
    ----------
    bundle : BoardBundle
        All views.
    inliers : ndarray of bool, shape (n_views,)
        Views to begin with; see `adjust_robustly`.
    lens : str
        One of `LENSES`, or `AUTO`: the model with the least Bayesian information criterion.

    Raises
    ------
    ParameterError
        If there is no such lens model.
    """
    if lens != AUTO and lens not in LENSES:
        raise ParameterError(f"lens {lens!r} is unknown; it must be one of {', '.join([AUTO, *LENSES])}")
    first = adjust_robustly(bundle, _free(bundle, "radial" if lens == AUTO else lens), inliers)
    if lens != AUTO:
        return first
    fitting = bundle.of(first.kept)
    tried = {name: adjust_robustly(fitting, _free(bundle, name)) for name in LENSES}
    best = min(tried, key=lambda name: _information(tried[name], int(_free(bundle, name).sum())))
    return adjust_robustly(bundle, _free(bundle, best), first.kept)


def _free(bundle: BoardBundle, lens: str) -> Bools:
    return free_numbers(len(bundle.cameras), (*range(N_MATRIX), *(N_MATRIX + index for index in LENSES[lens])))


def _information(found: Robust, n_free: int) -> float:
    """Bayesian information criterion, but for a constant: poses of the board are the same for all models."""
    squares, n = float((found.adjusted.residuals**2).sum()), found.adjusted.residuals.size
    return float(n * np.log(squares / n) + n_free * np.log(n))


def adjust_robustly(bundle: BoardBundle, free: Bools, inliers: Bools | None = None) -> Robust:
    """Return the most likely cameras by the views that fit each other; a view may come back once the others agree.

    Parameters
    ----------
    bundle : BoardBundle
        All views.
    free : ndarray of bool
        See `adjust`.
    inliers : ndarray of bool, shape (n_views,), optional
        Views to begin with; all if not given.

    Raises
    ------
    InputError
        If fewer than three views fit each other, or they do not determine the cameras.
    """
    kept = np.ones(len(bundle.seen), dtype=np.bool_) if inliers is None else inliers
    for _ in range(MAX_ROUNDS):
        adjusted = adjust(bundle.of(kept), free)
        view_rms = _rms_of_all(bundle, adjusted, kept)
        limit = OUTLIER_RATIO * np.median(view_rms[:, kept], axis=1)
        fits = np.asarray((view_rms <= limit[:, np.newaxis]).all(axis=0))
        if (fits == kept).all():
            break
        if fits.sum() < LEAST_VIEWS:
            raise InputError(
                f"only {int(fits.sum())} views of the board fit each other; at least {LEAST_VIEWS} are needed, 10 to "
                "20 are better: hold the board still, or trigger both cameras together"
            )
        kept = fits
    return Robust(adjusted, kept, view_rms)


def _rms_of_all(bundle: BoardBundle, adjusted: Adjusted[BoardBundle], kept: Bools) -> Floats:
    out = np.full((len(bundle.cameras), len(kept)), np.inf)
    out[:, kept] = adjusted.view_rms
    held = np.zeros(len(adjusted.covariance), dtype=np.bool_)
    for view in np.flatnonzero(~kept):
        alone = bundle.of(np.arange(len(kept)) == view)
        posed = adjust(replace(alone, cameras=adjusted.bundle.cameras), held)
        out[:, view] = posed.view_rms[:, 0]
    return out
