r"""The articulated chain: a tree of rigid limbs with markers, its poses, and its forward kinematics.

In a frame the unknowns are the root's translation and one rotation per limb. A marker m on limb l is at

.. math::
    x = t + \sum_{a \to b} R_a v_b + R_l m,

where the sum runs over the joints b between the root and the limb. Turning limb a by a small rotation vector
:math:`\omega_a` moves the marker by :math:`\omega_a \times A_a` with the arm :math:`A_a = R_a v_b` (or
:math:`R_l m`). So the normal matrix consists of sums of outer products of arms. Unseen markers are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.chain import errors_of, markers_of, origins_of, turned_back
from skelgen.geometry.rotations import matrix_from_vector
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

    def moved(self, joints: Floats, offsets: Floats) -> Chain:
        """Return the chain with other joints, shape (n_limbs, 3), and offsets, shape (n_markers, 3), mm."""
        return replace(self, joints=joints, offsets=offsets)

    def ancestry(self) -> Bools:
        """Return whether limb b is limb a or lies beyond it, shape (n_limbs a, n_limbs b)."""
        below = np.eye(self.n_limbs, dtype=bool)
        for limb in range(1, self.n_limbs):
            below[:, limb] |= below[:, self.parents[limb]]
        return below

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
    return np.asarray(errors_of(*contiguous(positions, poses.markers(chain))))


def residuals_in_limbs(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Return residuals in the limbs' frames [mm], in which soft tissue lasts; parameters as for `residuals`."""
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
