r"""The articulated chain: a tree of rigid limbs with markers, its poses, its forward kinematics, and what was measured.

In a frame the unknowns are the root's translation and one rotation per limb. A marker m on limb l is at

.. math::
    x = t + \sum_{a \to b} R_a v_b + R_l m,

where the sum runs over the joints b between the root and the limb. Turning limb a by a small rotation vector
:math:`\omega_a` moves the marker by :math:`\omega_a \times A_a` with the arm :math:`A_a = R_a v_b` (or
:math:`R_l m`). So the normal matrix consists of sums of outer products of arms. Unseen markers are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.chain import FREEDOMS, START, ChainTable, Measured, markers_of, origins_of, turned_back
from skelgen._kernels.joint_models import PARENT
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.articulation import FREEDOMS as FREEDOMS_OF_TYPE
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Chain:
    """A tree of rigid limbs with markers; limbs are in outward order, the root is 0.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, smaller than its own index; -1 for the root.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    joints : ndarray, shape (n_limbs, 3), mm
        The joint to the parent in the parent's frame; zero for the root.
    offsets : ndarray, shape (n_markers, 3), mm
        Markers in the frames of their limbs, whose origins are the joints to the parents.
    """

    parents: Ints
    limb_of_marker: Ints
    joints: Floats
    offsets: Floats

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_markers(self) -> int:
        """Number of markers."""
        return len(self.limb_of_marker)

    def joints_of(self, limb: int) -> list[int]:
        """Return the joints of a limb by the limbs below them: that to its parent, if it has one, then the others."""
        inner = [limb] if self.parents[limb] >= 0 else []
        return inner + np.flatnonzero(self.parents == limb).tolist()

    def moved(self, joints: Floats, offsets: Floats) -> Chain:
        """Return the chain with other joints and offsets.

        Parameters
        ----------
        joints : ndarray, shape (n_limbs, 3), mm
            In the parents' frames.
        offsets : ndarray, shape (n_markers, 3), mm
            In the frames of the markers' limbs.
        """
        return replace(self, joints=joints, offsets=offsets)

    def ancestry(self) -> Bools:
        """Return whether limb b is limb a or lies beyond it, shape (n_limbs a, n_limbs b)."""
        return ancestry(self.parents.tolist())

    def arms(self) -> Floats:
        """Return the arm of each limb for each marker, in the limb's frame [mm], shape (n_markers, n_limbs, 3).

        It is 0 for limbs that do not carry the marker.
        """
        arms = np.zeros((self.n_markers, self.n_limbs, 3))
        for marker, limb in enumerate(self.limb_of_marker):
            arms[marker, limb] = self.offsets[marker]
            beyond = int(limb)
            while (parent := int(self.parents[beyond])) >= 0:
                arms[marker, parent] = self.joints[beyond]
                beyond = parent
        return arms


def ancestry(parents: Sequence[int]) -> Bools:
    """Return whether limb b is limb a or lies beyond it, shape (n_limbs a, n_limbs b).

    Parameters
    ----------
    parents : sequence of int
        Of each limb, before it in their order; of the first -1.
    """
    below = np.eye(len(parents), dtype=bool)
    for limb in range(1, len(parents)):
        below[:, limb] |= below[:, parents[limb]]
    return below


@dataclass(frozen=True, eq=False)
class ChainPoses:
    """Where a chain is in some frames.

    Attributes
    ----------
    root : ndarray, shape (n_frames, 3), mm
        World position of the root's origin.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb.
    """

    root: Floats
    rotations: Floats

    def origins(self, chain: Chain) -> Floats:
        """Return the world positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3)."""
        pose = contiguous(chain.parents, chain.joints, self.root, self.rotations)
        return np.asarray(origins_of(*pose))

    def markers(self, chain: Chain) -> Floats:
        """Return the world positions of the markers [mm], shape (n_frames, n_markers, 3)."""
        places = contiguous(self.origins(chain), self.rotations, chain.limb_of_marker, chain.offsets)
        return np.asarray(markers_of(*places))

    def stepped(self, step: Floats) -> ChainPoses:
        """Apply translations [mm] and rotation vectors [rad], shape (n_frames, 3 + 3 n_limbs)."""
        turn = matrix_from_vector(step[:, 3:].reshape(len(step), -1, 3))
        return ChainPoses(self.root + step[:, :3], turn @ self.rotations)

    def __getitem__(self, frames: slice | Ints | Bools) -> ChainPoses:
        return ChainPoses(self.root[frames], self.rotations[frames])


def seen_weights(positions: Floats, weights: Floats | None = None) -> Floats:
    """Return weights that are 0 where markers are unseen, shape (n_frames, n_markers).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the others; 1 if not given.
    """
    seen = ~np.isnan(positions[:, :, 0])
    return seen.astype(np.float64) if weights is None else np.where(seen, weights, 0.0)


def residuals(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Return measured minus predicted markers [mm], 0 where unseen, shape (n_frames, n_markers, 3).

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Their poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    errors: Floats = positions - poses.markers(chain)
    errors[np.isnan(errors)] = 0.0
    return errors


def residuals_in_limbs(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Return residuals in the limbs' frames [mm], in which soft tissue lasts, shape as of `residuals`.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Their poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    """
    turned = contiguous(poses.rotations, chain.limb_of_marker, residuals(chain, poses, positions))
    return np.asarray(turned_back(*turned))


def world_arms(body_arms: Floats, poses: ChainPoses) -> Floats:
    """Return arms in the world [mm], shape (n_frames, n_markers, n_limbs, 3).

    Parameters
    ----------
    body_arms : ndarray, shape (n_markers, n_limbs, 3), mm
        From `Chain.arms`.
    poses : ChainPoses
        Poses of the limbs.
    """
    return (poses.rotations @ body_arms.transpose(1, 2, 0)).transpose(0, 3, 1, 2)


@dataclass(frozen=True, eq=False)
class ObservedChain:
    """A chain in some frames, with what was measured there.

    Attributes
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What the joints allow.
    poses : ChainPoses
        Poses in the frames.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """

    chain: Chain
    articulation: Articulation
    poses: ChainPoses
    positions: Floats
    weights: Floats

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def n_constants(self) -> int:
        """Number of constants: marker offsets, joints 1 .. n_limbs - 1, and those of the joints' axes."""
        return 3 * (self.chain.n_markers + self.chain.n_limbs - 1) + self.articulation.n_constants

    @property
    def residuals(self) -> Floats:
        """Measured minus predicted markers [mm], 0 where unseen, shape (n_frames, n_markers, 3)."""
        return residuals(self.chain, self.poses, self.positions)

    @property
    def squares(self) -> float:
        """Weighted sum of the squared residuals [mm^2]."""
        error = self.residuals
        return float(np.einsum("fmi,fmi,fm->", error, error, self.weights))

    @property
    def table(self) -> ChainTable:
        """Chain and joints as kernels take them."""
        return chain_table(self.chain, self.articulation)

    @property
    def measured(self) -> Measured:
        """Measured markers and weights as kernels take them."""
        return rows(self.positions, 3), writable(self.weights).ravel()

    def at(self, frames: slice | Ints | Bools) -> ObservedChain:
        """Return some of the frames."""
        observations = self.poses[frames], self.positions[frames], self.weights[frames]
        return ObservedChain(self.chain, self.articulation, *observations)

    def in_parts(self, together: int) -> Iterator[ObservedChain]:
        """Return all frames, so many at a time."""
        return (self.at(slice(first, first + together)) for first in range(0, self.n_frames, together))

    def stepped(self, offsets: Floats, joints: Floats, tilts: Floats) -> Self:
        """Return the chain after a step of its constants; the limbs turn as the tilted axes demand.

        Parameters
        ----------
        offsets : ndarray, 3 n_markers numbers, mm
            Steps of the markers in their limbs.
        joints : ndarray, 3 (n_limbs - 1) numbers, mm
            Steps of joints 1 .. n_limbs - 1 in their parents.
        tilts : ndarray, shape (n_axis_constants,), rad
            Steps of the constants of the axes, see `Articulation.tilted`.
        """
        places = self.chain.joints.copy()
        places[1:] += joints.reshape(-1, 3)
        chain = self.chain.moved(places, self.chain.offsets + offsets.reshape(-1, 3))
        articulation, rotations = self.articulation.tilted(chain.parents, self.poses.rotations, tilts)
        return replace(self, chain=chain, articulation=articulation, poses=ChainPoses(self.poses.root, rotations))


def observed(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats | None = None
) -> ObservedChain:
    """Return a chain with what was measured.

    Parameters
    ----------
    chain, articulation, poses : Chain, Articulation and ChainPoses
        The limbs, what their joints allow, and their poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    """
    return ObservedChain(chain, articulation, poses, positions, seen_weights(positions, weights))


def chain_table(chain: Chain, articulation: Articulation) -> ChainTable:
    """Return a chain as the table that kernels take: copies in the order of memory that they were compiled for.

    Parameters
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What their joints allow.
    """
    markers = np.argsort(chain.limb_of_marker, kind="stable").astype(np.intp)
    limbs = np.zeros((chain.n_limbs + 1, 3), dtype=np.intp)
    limbs[:-1, PARENT] = chain.parents
    limbs[:-1, FREEDOMS] = [FREEDOMS_OF_TYPE[kind] for kind in articulation.types]
    limbs[:, START] = np.searchsorted(chain.limb_of_marker[markers], np.arange(chain.n_limbs + 1))
    joints = np.concatenate([articulation.in_parent, articulation.in_child, chain.joints], axis=1)
    return ChainTable(limbs, writable(joints), markers, writable(chain.offsets[markers]))


def rows(values: Floats, length: int) -> Floats:
    """Return values of all frames one below the other, in rows of some length: a copy that may be written to.

    Parameters
    ----------
    values : ndarray, shape (n_frames, ...)
        Of all frames.
    length : int
        Of a row.
    """
    return writable(values).reshape(-1, length)


def writable(values: Floats) -> Floats:
    """Return a contiguous copy that may be written to.

    Parameters
    ----------
    values : ndarray
        Of any shape.
    """
    return np.array(values, dtype=np.float64, order="C")
