"""Targets and points as the search wants them: distances between all pairs, and how far each may be off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import StereoPoints
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget


class Rules(NamedTuple):
    """`BodyParameters` as compiled functions take them."""

    max_distance: float
    min_points: int
    penalty: float
    gate: float
    floor: float
    queue: int


def rules_of(parameters: BodyParameters) -> Rules:
    """Return the rules that parameters stand for."""
    return Rules(*(getattr(parameters, name) for name in Rules._fields))


@dataclass(frozen=True, eq=False)
class TargetTable:
    """A target and the distances between its balls.

    Attributes
    ----------
    points, variances : ndarray, shape (k, 3), mm and mm^2
        Balls in the target's frame, and the variances of their coordinates.
    edges, edge_variances : ndarray, shape (k, k), mm and mm^2
        Distance of each two balls, and its variance.
    """

    points: Floats
    variances: Floats
    edges: Floats
    edge_variances: Floats


def target_table(target: BodyTarget) -> TargetTable:
    """Return the table of one target."""
    points = np.array(target.points)
    variances = np.asarray(target.std) ** 2
    between = points[:, np.newaxis] - points
    edges = np.linalg.norm(between, axis=2)
    along = between / np.where(edges > 0, edges, 1.0)[..., np.newaxis]
    spread = (along**2 * (variances[:, np.newaxis] + variances)).sum(axis=2)
    return TargetTable(points, variances, edges, spread)


@dataclass(frozen=True, eq=False)
class Scene:
    """The points of one frame and the distances between them.

    Attributes
    ----------
    points, covariances : ndarray, shapes (n, 3) and (n, 3, 3), mm and mm^2
        As triangulated.
    spans, span_variances : ndarray, shape (n, n), mm and mm^2
        Distance of each two points, and its variance; infinite distances for points that cannot both be there, because
        they rest on one ball of an image.
    """

    points: Floats
    covariances: Floats
    spans: Floats
    span_variances: Floats


def scene_plain(found: StereoPoints) -> Scene:
    """Return the table of one frame's points: the NumPy twin of the compiled one."""
    points, covariances = np.array(found.points), np.array(found.covariance)
    between = points[:, np.newaxis] - points
    spans = np.linalg.norm(between, axis=2)
    along = between / np.where(spans > 0, spans, 1.0)[..., np.newaxis]
    spread = np.einsum("abi,abij,abj->ab", along, covariances[:, np.newaxis] + covariances, along)
    shared = (found.left[:, np.newaxis] == found.left) | (found.right[:, np.newaxis] == found.right)
    return Scene(points, covariances, np.where(shared, np.inf, spans), spread)
