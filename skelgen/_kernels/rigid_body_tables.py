"""A rigid body, the points of a frame and the limits of a search as kernels take them, and what they find."""

from __future__ import annotations

from typing import NamedTuple

from skelgen.model.arrays import Floats, Ints


class SearchRules(NamedTuple):
    """Limits of the search for a rigid body: `BodyParameters` as kernels take them."""

    max_distance: float
    min_points: int
    penalty: float
    gate: float
    floor: float
    queue: int


class TargetTable(NamedTuple):
    """The balls of a rigid body and the distances between them.

    Attributes
    ----------
    points, variances : ndarray, shape (k, 3), mm and mm^2
        Balls in the body's frame, and the variances of their coordinates.
    distances, distance_variances : ndarray, shape (k, k), mm and mm^2
        Distance of each two balls, and its variance.
    """

    points: Floats
    variances: Floats
    distances: Floats
    distance_variances: Floats


class PointTable(NamedTuple):
    """The points of one frame and the distances between them.

    Attributes
    ----------
    points, covariances : ndarray, shapes (n, 3) and (n, 3, 3), mm and mm^2
        As triangulated.
    distances, distance_variances : ndarray, shape (n, n), mm and mm^2
        Distance of each two points, and its variance; infinite distances for points that cannot both be there, because
        they share a ball of an image.
    """

    points: Floats
    covariances: Floats
    distances: Floats
    distance_variances: Floats


class PosedBody(NamedTuple):
    """A rigid body that was found.

    Attributes
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body.
    covariance : ndarray, shape (6, 6)
        Of a small rotation about the world's axes [rad] and a shift [mm].
    matched : ndarray of intp, shape (k,)
        The point that each ball is; -1 where none is.
    rms : float, mm
        Root mean square distance of the balls from their points.
    misfit : float
        Sum of the squared distances in standard deviations, the floor added to these.
    is_sound : bool
        Whether enough balls are within the gate, and near enough.
    """

    pose: Floats
    covariance: Floats
    matched: Ints
    rms: float
    misfit: float
    is_sound: bool
