r"""How markers move within a group, and how two groups move against each other, beside what a rigid body explains.

Markers are aligned to their mean shape in every frame. Of their 3 n residual coordinates a rigid body's displacements
take six; the others are the *inner* coordinates of the group. The rigid displacements of two parts of it span some of
these, at most six: the *relative motion* of the parts. With an orthonormal basis Q of either,

.. math::
    c_f = Q^\top r_f, \qquad \operatorname{cov}(c) = Q^\top \operatorname{diag}(\sigma_i^2)\, Q \quad\text{in one body},

and larger if there are two. The same holds for parts of one marker (three displacements) and two (five), so that every
size of limb has its test.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import rotation_by_quaternion
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats, Ints

TEST_FRAMES = 150
"""Frames from which one motion is estimated: soft tissue and joints are slow, more frames would repeat each other."""

ENOUGH_FRAMES = 30
"""Sampled frames below which the whole take is asked for frames that show the markers."""

LEAST_FRAMES = 8
"""Fewer frames say nothing of a motion."""

SEEN_PART = 0.75
"""A frame counts if it shows this part of the markers, and three at least."""

KEPT_PART = 0.95
"""Part of the frames, those with the smallest motion, that count: a label that jumps is no joint."""

RANK_TOLERANCE = 0.05
"""Of the largest singular value; a displacement that moves the markers less is none (markers on one line)."""

Group = tuple[int, ...]
"""Indices of markers, rising."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Covariance of some coordinates of the residuals of a group.

    Attributes
    ----------
    covariance : ndarray, shape (k, k), mm^2
        Covariance of the k coordinates.
    basis : ndarray, shape (3 n_markers, k)
        The coordinates, orthonormal, in those of the markers.
    markers : ndarray of intp, shape (n_markers,)
        The markers.
    radius : float, mm
        Root mean square distance of the markers from their middle.
    """

    covariance: Floats
    basis: Floats
    markers: Ints
    radius: float

    def ratios(self, variances: Floats) -> Floats:
        """Principal variances in units of what the noise `variances` [mm^2] of all markers explains, shape (k,)."""
        noise = np.repeat(variances[self.markers], 3)
        root = np.linalg.cholesky(self.basis.T @ (noise[:, np.newaxis] * self.basis))
        half = np.linalg.solve(root, self.covariance)
        return np.asarray(np.linalg.eigvalsh(np.linalg.solve(root, half.T)))


class Movements:
    """The markers of a take, asked for their inner and relative motions; answers are kept.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    frames : ndarray of intp
        Sampled frames; markers that they do not show together are looked for in all frames.
    """

    def __init__(self, positions: Floats, frames: Ints) -> None:
        self._all = positions
        self._all_seen: Bools | None = None
        self._sampled = positions[frames]
        self._sampled_seen: Bools = ~np.isnan(self._sampled[:, :, 0])
        self._relative: dict[tuple[Group, Group], Spread | None] = {}
        self._inner: dict[Group, Spread | None] = {}

    @property
    def seen_part(self) -> Floats:
        """Part of the sampled frames that shows each marker, shape (n_markers,)."""
        return np.asarray(self._sampled_seen.mean(axis=0))

    def while_seen(self, marker: int) -> Movements:
        """Return the movements in the sampled frames that show a marker."""
        shown = self._sampled[self._sampled_seen[:, marker]]
        return Movements(shown, np.arange(len(shown)))

    def inner(self, group: Group) -> Spread | None:
        """Return the spread of the inner coordinates of two markers or more; None if too few frames show them."""
        if group not in self._inner:
            self._inner[group] = self.tried(group)
        return self._inner[group]

    def tried(self, group: Group) -> Spread | None:
        """Return `inner` of a group that is one of many: it is not kept, as it may be large."""
        return self._inner[group] if group in self._inner else self._spread(group, _inner_basis)

    def relative(self, first: Group, second: Group) -> Spread | None:
        """Return the spread of the relative motion of two groups; None if too few frames show both.

        Parameters
        ----------
        first, second : tuple of int
            Markers of both groups.
        """
        first, second = min(first, second), max(first, second)
        key = (first, second)
        if key not in self._relative:
            self._relative[key] = self._spread(first + second, lambda shape: _relative_basis(shape, len(first)))
        return self._relative[key]

    def distance(self, marker: int, others: Group) -> float:
        """Return the usual distance [mm] of a marker from the nearest of some others; infinite if none is seen with it.

        Parameters
        ----------
        marker : int
            The marker.
        others : tuple of int
            The others.
        """
        common = self._sampled_seen[:, list(others)] & self._sampled_seen[:, [marker]]
        gaps = [
            float(np.median(np.linalg.norm(self._sampled[both, other] - self._sampled[both, marker], axis=1)))
            for other, both in zip(others, common.T, strict=True)
            if both.any()
        ]
        return min(gaps, default=np.inf)

    def _spread(self, markers: Group, basis_of: Callable[[Floats], Floats]) -> Spread | None:
        shown = self._shown(markers)
        if shown is None:
            return None
        residuals, shape = _aligned(*shown)
        basis = basis_of(shape)
        rows = residuals.reshape(len(residuals), -1)
        size = ((rows @ basis) ** 2).sum(axis=1)
        kept = np.argsort(size, kind="stable")[: max(LEAST_FRAMES, round(KEPT_PART * len(size)))]
        used, seen = rows[kept], shown[1][kept].astype(np.float64)
        common = np.repeat(np.repeat(np.maximum(seen.T @ seen, 1), 3, axis=0), 3, axis=1)
        return Spread(
            covariance=basis.T @ (used.T @ used / common) @ basis,
            basis=basis,
            markers=np.array(markers, dtype=np.intp),
            radius=float(np.sqrt(((shape - shape.mean(axis=0)) ** 2).sum(axis=1).mean())),
        )

    def _shown(self, markers: Group) -> tuple[Floats, Bools] | None:
        """Positions (0 where unseen) and visibility of some markers in frames that show most of them."""
        index = list(markers)
        needed = max(min(3, len(index)), int(np.ceil(SEEN_PART * len(index))))
        positions, seen = self._sampled, self._sampled_seen[:, index]
        frames = np.flatnonzero(seen.sum(axis=1) >= needed)
        if len(frames) < ENOUGH_FRAMES:
            if self._all_seen is None:
                self._all_seen = ~np.isnan(self._all[:, :, 0])
            positions, seen = self._all, self._all_seen[:, index]
            frames = np.flatnonzero(seen.sum(axis=1) >= needed)
        if len(frames) < LEAST_FRAMES:
            return None
        if len(frames) > TEST_FRAMES:
            frames = frames[np.linspace(0, len(frames) - 1, TEST_FRAMES).astype(np.intp)]
        chosen = seen[frames]
        return np.where(chosen[..., np.newaxis], positions[frames[:, np.newaxis], index], 0.0), chosen


def _aligned(points: Floats, seen: Bools) -> tuple[Floats, Floats]:
    """Residuals from the mean shape, in its frame (0 where unseen), and the shape.

    Frames are aligned to the fullest one. Its noise rotates all frames alike, and small rotations are no part of
    the coordinates: aligning again to the mean changes nothing that matters.
    """
    weights = seen.astype(np.float64)
    counts = weights.sum(axis=0)
    start = int(np.argmax(weights.sum(axis=1)))
    shape = points[start]
    both = weights * weights[start]
    both /= both.sum(axis=1, keepdims=True)
    centred = points - (both[:, np.newaxis] @ points)
    turned_shape = shape - (both @ shape)[:, np.newaxis]
    turns = rotation_by_quaternion(np.swapaxes(centred * both[..., np.newaxis], 1, 2) @ turned_shape)
    moved = centred @ turns + (both @ shape)[:, np.newaxis]
    mean = (moved * weights[..., np.newaxis]).sum(axis=0) / np.maximum(counts, 1)[:, np.newaxis]
    return (moved - mean) * weights[..., np.newaxis], mean


def _inner_basis(shape: Floats) -> Floats:
    """Orthonormal coordinates that no rigid displacement changes, shape (3 n, k)."""
    left, sizes, _ = np.linalg.svd(_displacements(shape), full_matrices=True)
    return np.asarray(left[:, int((sizes > RANK_TOLERANCE * sizes[0]).sum()) :])


def _relative_basis(shape: Floats, n_first: int) -> Floats:
    """Orthonormal displacements of two parts as rigid bodies that are none of the whole, shape (3 n, k)."""
    first, second = _basis(_displacements(shape[:n_first])), _basis(_displacements(shape[n_first:]))
    parts = np.zeros((3 * len(shape), first.shape[1] + second.shape[1]))
    parts[: len(first), : first.shape[1]] = first
    parts[len(first) :, first.shape[1] :] = second
    whole = _basis(_displacements(shape))
    left, _, _ = np.linalg.svd(parts - whole @ (whole.T @ parts), full_matrices=False)
    return np.asarray(left[:, : parts.shape[1] - whole.shape[1]])


def _displacements(shape: Floats) -> Floats:
    """Three translations and three small rotations of points, of like size, shape (3 n, 6)."""
    from_middle = shape - shape.mean(axis=0)
    size = float(np.sqrt((from_middle**2).sum(axis=1).mean())) or 1.0
    translations = np.broadcast_to(np.eye(3)[:, np.newaxis], (3, *shape.shape))
    rotations = -cross_matrix(from_middle / size).transpose(2, 0, 1)  # its columns are v x e
    return np.concatenate([translations, rotations]).reshape(6, -1).T


def _basis(columns: Floats) -> Floats:
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, sizes > RANK_TOLERANCE * sizes[0]])
