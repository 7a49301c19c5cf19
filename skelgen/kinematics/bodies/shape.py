"""The rigid shape of a limb and its pose in every frame, from markers with gaps.

Every frame is aligned with a common reference and averaged, until the shape stays (generalised Procrustes analysis).
Its first round, with one frame as the reference, is (Schönauer 2007, 3.8.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator, fit_transform, means_in_body, rotation_by_quaternion
from skelgen.model.arrays import Bools, Floats, Ints

MAX_ROUNDS = 30
SHAPE_TOLERANCE = 1e-9
"""mm; rounds stop when no point moves more."""

MOST_COUNTED = 16
"""Most points whose visible sets are counted in a table of all sets."""

FLATNESS = 0.02
"""Points whose second extent is below this part of the first are on one line, about which no rotation is determined."""

_ROUNDING = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class LimbShape:
    """A rigid limb: its points and where it is.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the limb's frame, whose origin is their centroid.
    world_from_limb : ndarray, shape (n_frames, 4, 4)
        Poses; NaN in frames that do not determine one.
    """

    points: Floats
    world_from_limb: Floats

    @property
    def posed(self) -> Bools:
        """Frames with a pose, shape (n_frames,)."""
        return np.asarray(~np.isnan(self.world_from_limb[:, 0, 0]))

    @property
    def has_pose(self) -> bool:
        """Whether any frame determines a pose."""
        return bool(self.posed.any())


def fit_shape(
    positions: Floats, frames: Ints, rotator: Rotator = rotation_by_quaternion, flatness: float = FLATNESS
) -> LimbShape:
    """Estimate the shape of a limb and its poses.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        World positions of the limb's points, NaN where unseen.
    frames : ndarray of intp
        Frames from which the shape is estimated; poses are computed for all.
    rotator : callable
        Closed form of absolute orientation.
    flatness : float
        Points whose second extent is below this part of the first are on one line and fix no pose.

    Returns
    -------
    LimbShape
        Without any pose if the limb has fewer than three points that are not on one line.
    """
    n_frames, n_points = positions.shape[:2]
    nowhere = np.full((n_frames, 4, 4), np.nan)
    if n_points < 3:
        return LimbShape(np.zeros((n_points, 3)), nowhere)
    points = _average_shape(positions[frames], rotator, flatness)
    known = ~np.isnan(points[:, 0])
    seen = ~np.isnan(positions[:, :, 0]) & known
    points = np.where(known[:, np.newaxis], points, 0.0)
    determined = determines_pose(points, seen, flatness)
    poses = nowhere
    if determined.any():
        poses[determined] = fit_transform(points, positions[determined], seen[determined], rotator)
    return LimbShape(points, poses)


def determines_pose(points: Floats, seen: Bools, flatness: float = FLATNESS) -> Bools:
    """Return in which frames the seen points of a limb fix its pose: three that are not on one line.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the limb's frame.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which are seen.
    flatness : float
        Points whose second extent is below this part of the first are on one line.
    """
    patterns, inverse = distinct_rows(seen)
    spans = patterns.sum(axis=1) >= 3
    counted = patterns[spans].astype(np.float64)
    middles = counted @ points / counted.sum(axis=1, keepdims=True)
    arms = (points - middles[:, np.newaxis]) * counted[..., np.newaxis]
    extents = np.linalg.eigvalsh(arms.swapaxes(1, 2) @ arms)
    spans[spans] = extents[:, 1] > max(flatness**2, _ROUNDING) * extents[:, 2]
    return np.asarray(spans[inverse])


def distinct_rows(seen: Bools) -> tuple[Bools, Ints]:
    """Return the distinct rows of a table of booleans, rising, and which of them each row is.

    Rows are compared as whole numbers, as most limbs show few sets of points.
    """
    n_columns = seen.shape[1]
    if n_columns > MOST_COUNTED:
        rows, inverse = np.unique(seen, axis=0, return_inverse=True)
        return rows, inverse.ravel()
    code = seen @ (1 << np.arange(n_columns)[::-1])
    found = np.flatnonzero(np.bincount(code, minlength=1))
    place = np.zeros(1 << n_columns, dtype=np.intp)
    place[found] = np.arange(len(found))
    return (found[:, np.newaxis] >> np.arange(n_columns)[::-1] & 1).astype(bool), place[code]


def _average_shape(positions: Floats, rotator: Rotator, flatness: float) -> Floats:
    """Centred points, NaN for those that never appear together with three others."""
    seen = ~np.isnan(positions[:, :, 0])
    reference = int(np.argmax(seen.sum(axis=1)))
    points = positions[reference] - np.nanmean(positions[reference], axis=0) if seen[reference].any() else positions[0]
    for _ in range(MAX_ROUNDS):
        known = ~np.isnan(points[:, 0])
        filled = np.where(known[:, np.newaxis], points, 0.0)
        usable = determines_pose(filled, seen & known, flatness)
        if not usable.any():
            break
        poses = fit_transform(filled, positions[usable], seen[usable] & known, rotator)
        mean = means_in_body(poses, positions[usable], seen[usable])
        average = mean - mean[~np.isnan(mean[:, 0])].mean(axis=0)
        moved = np.nanmax(np.abs(average - points), initial=0.0)
        gained = bool((np.isnan(points) & ~np.isnan(average)).any())
        points = average
        if moved < SHAPE_TOLERANCE and not gained:
            break
    return np.asarray(points)
