r"""What the joints of a chain allow: any rotation, rotations about two axes, about one, or none.

A limb below a ball joint rotates freely. Below a hinge with axis a in the parent and b in the child, its rotation
against the parent keeps :math:`R b = a`; below a universal joint it keeps the angle between a and R b. A small rotation
of such a limb is that of its parent plus rotations about the axes. So a constrained chain needs two matrices in each
frame: the derivatives of all limbs' rotations by the freedoms of the frame, and those by the constants of the axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen._kernels.chain_constants import PARALLEL
from skelgen.geometry.rotations import matrix_from_vector, nearest_rotation
from skelgen.model.arrays import Floats, Ints

FREEDOMS = {"ball": 3, "undetermined": 3, "universal": 2, "hinge": 1, "rigid": 0}
"""Degrees of freedom of each type of joint."""

AXIS_CONSTANTS = {"ball": 0, "undetermined": 0, "universal": 3, "hinge": 2, "rigid": 0}
"""Constants of the axes of each type of joint: two tilts in the parent, and the angle between the axes of a universal
joint. Axes in the child need none, as the child's frame is free to rotate."""


@dataclass(frozen=True, eq=False)
class Articulation:
    """Types and axes of a chain's joints.

    Attributes
    ----------
    types : tuple of str, length n_limbs
        Of the joint above each limb; that of the root is ``ball``.
    in_parent, in_child : ndarray, shape (n_limbs, 3)
        Unit axes: of a hinge in both limbs, of a universal joint that fixed in the parent and that fixed in the child.
    between : ndarray, shape (n_limbs,), rad
        Angle between the axes of a universal joint.
    rest : ndarray, shape (n_limbs, 3, 3), optional
        Rotation child against parent of rigid joints; their mean rotation if it is not given.
    """

    types: tuple[str, ...]
    in_parent: Floats
    in_child: Floats
    between: Floats
    rest: Floats | None = None

    @classmethod
    def free(cls, n_limbs: int) -> Articulation:
        """Return ball joints only."""
        axes = np.tile([0.0, 0.0, 1.0], (n_limbs, 1))
        return cls(("ball",) * n_limbs, axes, axes, np.zeros(n_limbs))

    @cached_property
    def is_free(self) -> bool:
        """Whether every limb rotates freely."""
        return all(FREEDOMS[kind] == 3 for kind in self.types)

    @cached_property
    def columns(self) -> list[slice]:
        """Freedoms of each limb's rotation; the root's translation comes first."""
        return _slices([FREEDOMS[kind] for kind in self.types], 3)

    @cached_property
    def constant_columns(self) -> list[slice]:
        """Constants of the axis above each limb."""
        return _slices([AXIS_CONSTANTS[kind] for kind in self.types], 0)

    @property
    def n_freedoms(self) -> int:
        """Freedoms of one frame."""
        return int(self.columns[-1].stop)

    @property
    def n_constants(self) -> int:
        """Constants of all axes."""
        return int(self.constant_columns[-1].stop)

    @cached_property
    def across_axes(self) -> Floats:
        """Two unit vectors across each axis in the parent, as columns, shape (n_limbs, 3, 2): axes tilt about them."""
        return np.asarray(np.linalg.svd(self.in_parent[:, np.newaxis])[2][:, 1:].swapaxes(1, 2))

    def bases(self, parents: Ints, rotations: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives of translation and rotations by the freedoms and by the constants of the axes.

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            World from limb.

        Returns
        -------
        tuple of ndarray, shapes (n_frames, 3 + 3 n_limbs, n_freedoms) and (n_frames, 3 + 3 n_limbs, n_constants)
        """
        n_frames, n_limbs = rotations.shape[:2]
        turns = np.zeros((n_frames, 3 + 3 * n_limbs, self.n_freedoms))
        tilts = np.zeros((n_frames, 3 + 3 * n_limbs, self.n_constants))
        turns[:, :3, :3] = np.eye(3)
        columns, constants = self.columns, self.constant_columns
        for limb, kind in enumerate(self.types):
            rows = slice(3 + 3 * limb, 6 + 3 * limb)
            if FREEDOMS[kind] == 3:
                turns[:, rows, columns[limb]] = np.eye(3)
                continue
            parent = int(parents[limb])
            above = slice(3 + 3 * parent, 6 + 3 * parent)
            turns[:, rows], tilts[:, rows] = turns[:, above], tilts[:, above]
            own, change = self.axes_of(limb, rotations[:, parent], rotations[:, limb])
            turns[:, rows, columns[limb]] += own
            tilts[:, rows, constants[limb]] += change
        return turns, tilts

    def axes_of(self, limb: int, parent: Floats, child: Floats) -> tuple[Floats, Floats]:
        """Return world axes of a constrained limb's freedoms and constants, shape (n_frames, 3, n) each.

        Parameters
        ----------
        limb : int
            Limb below the joint.
        parent, child : ndarray, shape (n_frames, 3, 3)
            World from parent, and from the limb itself.
        """
        first = parent @ self.in_parent[limb]
        tilt = parent @ self.across_axes[limb]
        if self.types[limb] == "hinge":
            return first[:, :, np.newaxis], tilt
        if self.types[limb] == "rigid":
            return np.zeros((len(parent), 3, 0)), np.zeros((len(parent), 3, 0))
        second = child @ self.in_child[limb]
        normal = _unit(np.cross(first, second))
        return np.stack([first, second], axis=2), np.concatenate([tilt, normal[:, :, np.newaxis]], axis=2)

    def tilted(self, parents: Ints, rotations: Floats, change: Floats) -> tuple[Articulation, Floats]:
        """Tilt the axes by changes of their constants, and rotate the limbs so that the joints still allow it.

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            World from limb.
        change : ndarray, shape (n_constants,)
            Of the axes.
        """
        if not self.n_constants:
            return self, rotations
        new = rotations.copy()
        axes, between = self.in_parent.copy(), self.between.copy()
        for limb, (kind, own) in enumerate(zip(self.types, self.constant_columns, strict=True)):
            if FREEDOMS[kind] == 3:
                continue
            parent, axis, tilt = int(parents[limb]), self.in_parent[limb], change[own]
            relative = rotations[:, parent].swapaxes(1, 2) @ rotations[:, limb]
            if kind == "universal":
                normal = _unit(np.cross(axis, relative @ self.in_child[limb]))
                relative = matrix_from_vector(tilt[2] * normal) @ relative
                # Axes that pass each other are as far apart again on the other side: angles have no sign
                between[limb] = abs(np.remainder(between[limb] + tilt[2] + np.pi, 2 * np.pi) - np.pi)
            if kind != "rigid":
                turn = matrix_from_vector(self.across_axes[limb] @ tilt[:2])
                axes[limb] = turn @ axis
                relative = turn @ relative
            new[:, limb] = new[:, parent] @ relative
        return replace(self, in_parent=axes, between=between), new

    def hinge_axes(self, parents: Ints, rotations: Floats) -> Floats:
        """Return the unit axes of the hinges in the world, 0 for other limbs, shape (n_frames, n_limbs, 3).

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            World from limb.
        """
        result = np.zeros(rotations.shape[:3])
        for limb, kind in enumerate(self.types):
            if kind == "hinge":
                result[:, limb] = rotations[:, parents[limb]] @ self.in_parent[limb]
        return result

    def across_hinges(self, parents: Ints, rotations: Floats) -> Floats:
        """Return projectors across the hinges' axes, the identity for other limbs, shape (n_frames, n_limbs, 3, 3).

        Parameters
        ----------
        parents, rotations : ndarray
            As for `hinge_axes`.
        """
        axes = self.hinge_axes(parents, rotations)
        return np.asarray(np.eye(3) - axes[..., np.newaxis] * axes[..., np.newaxis, :])

    def projected(self, parents: Ints, rotations: Floats) -> Floats:
        """Return the nearest rotations that the joints allow, from the root outward.

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            World from limb.
        """
        new = rotations.copy()
        for limb, kind in enumerate(self.types):
            if FREEDOMS[kind] < 3:
                parent = int(parents[limb])
                turned = new[:, parent] @ rotations[:, parent].swapaxes(1, 2) @ rotations[:, limb]
                new[:, limb] = self.allowed(limb, new[:, parent], turned)
        return new

    def turned(self, parents: Ints, turn: Floats) -> Articulation:
        """Return the same joints for limbs whose frames are rotated.

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        turn : ndarray, shape (n_limbs, 3, 3)
            New frame from old frame of each limb.
        """
        above = np.maximum(parents, 0)
        in_parent = np.einsum("lij,lj->li", turn[above], self.in_parent)
        in_child = np.einsum("lij,lj->li", turn, self.in_child)
        rest = None if self.rest is None else turn[above] @ self.rest @ turn.swapaxes(1, 2)
        return replace(self, in_parent=in_parent, in_child=in_child, rest=rest)

    def allowed(self, limb: int, parent: Floats, child: Floats) -> Floats:
        """Return the nearest rotations of a limb that its joint allows, shape (n_frames, 3, 3).

        Parameters
        ----------
        limb : int
            Not the root.
        parent, child : ndarray, shape (n_frames, 3, 3)
            World from parent, and world from limb.
        """
        kind = self.types[limb]
        if FREEDOMS[kind] == 3:
            return child
        relative = parent.swapaxes(1, 2) @ child
        if kind == "rigid":
            rest = nearest_rotation(relative.mean(axis=0)) if self.rest is None else self.rest[limb]
            return np.asarray(parent @ rest)
        axis, second = self.in_parent[limb], relative @ self.in_child[limb]
        wanted = self.between[limb] if kind == "universal" else 0.0
        cross = np.cross(second, axis)
        angle = np.arctan2(np.linalg.norm(cross, axis=1), second @ axis)
        turn = matrix_from_vector((angle - wanted)[:, np.newaxis] * _unit(cross))
        return np.asarray(parent @ turn @ relative)

    def at_rest(self, parents: Ints, rotations: Floats) -> Articulation:
        """Return the joints with rigid ones fixed as they are in the first frame.

        Parameters
        ----------
        parents : ndarray of intp, shape (n_limbs,)
            Of the chain.
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            World from limb.
        """
        relative = rotations[0, np.maximum(parents, 0)].swapaxes(1, 2) @ rotations[0]
        return replace(self, rest=relative)


def _slices(sizes: list[int], first: int) -> list[slice]:
    ends = first + np.cumsum(sizes)
    return [slice(int(end) - size, int(end)) for size, end in zip(sizes, ends, strict=True)]


def _unit(vectors: Floats) -> Floats:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(size > PARALLEL, vectors / np.maximum(size, PARALLEL), 0.0)
