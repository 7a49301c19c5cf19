"""Bodies that distances part, and that a joint holds together: links of machines are long, and their markers sparse.

Two rigid plates of markers that turn about a point of both show it to within noise, wherever it lies. Bodies that have
nothing to do with each other do not, unless one of them stands still: what turns about a place in the room turns about
one of all that is still.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from skelgen.geometry.rotations import N_POSE, moved_points
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.kinematics.rigid_bodies import fit_shape
from skelgen.model.arrays import Floats, Ints, evenly_spread

LOOKED_AT = 400
"""Frames: the gap of a joint is well known by then."""

EXPLAINED = 1.5
"""Times what noise explains, root mean square, that places of a joint may be apart in two plates."""

CLEAR = 25.0
"""Times what noise explains that plates move against each other, and in the room: within a second, bodies by themselves
move along one screw, about which they turn as about a joint where it hardly rises; of 100 pairs 2 were joined at 10."""

LEAST_NOISE = 1e-3
"""mm: files round, and simulated takes may have no noise at all."""


class _Plate(NamedTuple):
    """Markers of a plate, its poses, the markers in its frame, that of their centroid [mm], and their noise [mm]."""

    markers: Ints
    poses: Floats
    points: Floats
    noise: float

    def variance_at(self, point: Floats) -> float:
        """Variance by noise of where a point of the plate is [mm^2], of all coordinates together."""
        moments, axes = np.linalg.eigh((self.points**2).sum() * np.eye(3) - self.points.T @ self.points)
        lever = axes.T @ point
        turned = ((lever @ lever - lever**2) / moments).sum()
        return float(self.noise**2 * (3.0 / len(self.points) + turned))


def with_held_bodies(positions: Floats, body_of_marker: Ints, plates: Sequence[Ints]) -> Ints:
    """Return the body of each marker, where those are one that a joint of two plates holds together.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    body_of_marker : ndarray of intp, shape (n_markers,)
        Bodies as they are told apart by distances.
    plates : sequence of ndarray of intp
        Markers of limbs that are rigid as far as noise tells, three and more each.
    """
    body_of_marker = body_of_marker.copy()
    frames = evenly_spread(np.arange(len(positions)), LOOKED_AT)
    known = [_plate(positions[frames], markers) for markers in plates]
    for one, other in combinations([plate for plate in known if plate is not None], 2):
        kept, merged = body_of_marker[[one.markers[0], other.markers[0]]]
        if kept != merged and _are_joined(one, other):
            body_of_marker[body_of_marker == merged] = kept
    return body_of_marker


def _plate(positions: Floats, markers: Ints) -> _Plate | None:
    """A plate with its poses; None if it does not move in the room, or has hardly any poses."""
    own = positions[:, markers]
    shape = fit_shape(own, np.arange(len(own)))
    seen = shape.posed & ~np.isnan(own).any(axis=(1, 2))
    if seen.sum() < len(own) / 4:
        return None
    errors = own[seen] - moved_points(shape.world_from_limb[seen], shape.points)
    n_free = (3 * len(markers) - N_POSE) * seen.sum()
    noise = max(float(np.sqrt((errors**2).sum() / n_free)), LEAST_NOISE)
    moved = float(own[seen].std(axis=0).max())
    return _Plate(markers, shape.world_from_limb, shape.points, noise) if moved > CLEAR * noise else None


def _are_joined(one: _Plate, other: _Plate) -> bool:
    """Whether two plates turn about a point of both, as far as noise tells."""
    found = fit_fixed_point(one.poses, other.poses, np.zeros(3), np.zeros(3))
    if found is None:
        return False
    explained = one.variance_at(found.in_first) + other.variance_at(found.in_second)
    if found.gap > EXPLAINED**2 * explained:
        return False
    return all(_moved(still, moving) > CLEAR**2 * explained for still, moving in ((one, other), (other, one)))


def _moved(still: _Plate, moving: _Plate) -> float:
    """Variance of the place of one plate's centre in the frame of the other [mm^2], of all coordinates together."""
    apart = moving.poses[:, :3, 3] - still.poses[:, :3, 3]
    return float(np.nanvar(np.einsum("fji,fj->fi", still.poses[:, :3, :3], apart), axis=0).sum())
