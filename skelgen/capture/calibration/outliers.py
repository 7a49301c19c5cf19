"""Bundle adjustment that leaves out views which do not fit: blurred, moved between exposures, corners mistaken."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from skelgen.capture.calibration.adjustment import Adjusted, Bundle, adjust
from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats

OUTLIER_RATIO = 3.0
"""A view is left out whose error is so many times the median view's: those of one recording differ by less than two,
and a view that errs three times as much would weigh as much as nine others."""

MAX_ROUNDS = 10
LEAST_VIEWS = 3
"""Two views leave a camera undetermined in practice; three leave nothing to judge it by, and the verdict says so."""


class Robust(NamedTuple):
    """An adjustment and the views that it rests on.

    Attributes
    ----------
    adjusted : Adjusted
        Of the kept views.
    kept : ndarray of bool, shape (n_views,)
        Which they are.
    view_rms : ndarray, shape (n_cameras, n_views), px
        Error of all views; those left out with their pose fitted to the others' cameras.
    """

    adjusted: Adjusted
    kept: Bools
    view_rms: Floats


def adjust_robustly(bundle: Bundle, free: Bools, trusted: Bools | None = None) -> Robust:
    """Return the most likely cameras by the views that fit each other; a view may come back once the others agree.

    Parameters
    ----------
    bundle : Bundle
        All views.
    free : ndarray of bool
        See `adjust`.
    trusted : ndarray of bool, shape (n_views,), optional
        Views to begin with; all if not given.

    Raises
    ------
    InputError
        If fewer than three views fit each other, or they do not determine the cameras.
    """
    kept = np.ones(len(bundle.first_from_board), dtype=np.bool_) if trusted is None else trusted
    for _ in range(MAX_ROUNDS):
        adjusted = adjust(bundle_of(bundle, kept), free)
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


def bundle_of(bundle: Bundle, kept: Bools) -> Bundle:
    """Return the bundle of some of its views."""
    return replace(bundle, first_from_board=bundle.first_from_board[kept], corners=bundle.corners[:, kept])


def _rms_of_all(bundle: Bundle, adjusted: Adjusted, kept: Bools) -> Floats:
    out = np.full(bundle.corners.shape[:2], np.inf)
    out[:, kept] = adjusted.view_rms
    held = np.zeros(len(adjusted.covariance), dtype=np.bool_)
    for view in np.flatnonzero(~kept):
        alone = bundle_of(bundle, np.arange(len(kept)) == view)
        try:
            posed = adjust(replace(alone, cameras=adjusted.bundle.cameras), held)
        except InputError:  # no pose fits: as far out as can be
            continue
        out[:, view] = posed.view_rms[:, 0]
    return out
