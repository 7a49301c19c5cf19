r"""A tree of rigid limbs in every frame, and how its markers follow its poses.

In a frame the unknowns are the root's translation and one rotation per limb. A marker m on limb l is at

.. math::
    x = t + \sum_{a \to b} R_a v_b + R_l m,

the sum running over the joints b on the way from the root. Turning limb a by a small rotation vector
:math:`\omega_a` moves the marker by :math:`\omega_a \times A_a` with the arm :math:`A_a = R_a v_b` (or
:math:`R_l m`). The normal matrix needs nothing but sums of outer products of arms; unseen markers are simply absent.
`posing` finds the poses.
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
        """Return the chain with other joints and offsets."""
        return replace(self, joints=joints, offsets=offsets)

    def ancestry(self) -> Bools:
        """Whether limb b is limb a or lies beyond it, shape (n_limbs a, n_limbs b)."""
        below = np.eye(self.n_limbs, dtype=bool)
        for limb in range(1, self.n_limbs):
            below[:, limb] |= below[:, self.parents[limb]]
        return below

    def arms(self) -> Floats:
        """Vector of each limb that carries each marker, in the limb's frame [mm], shape (n_markers, n_limbs, 3)."""
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
        """World positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3)."""
        pose = contiguous(chain.parents, chain.joints, self.root, self.rotations)
        return np.asarray(origins_of(*pose))

    def markers(self, chain: Chain) -> Floats:
        """World positions of the markers [mm], shape (n_frames, n_markers, 3)."""
        places = contiguous(self.origins(chain), self.rotations, chain.limb_of_marker, chain.offsets)
        return np.asarray(markers_of(*places))

    def stepped(self, step: Floats) -> ChainPoses:
        """Apply translations and rotation vectors, shape (n_frames, 3 + 3 n_limbs)."""
        turn = matrix_from_vector(step[:, 3:].reshape(len(step), -1, 3))
        return ChainPoses(self.root + step[:, :3], turn @ self.rotations)

    def __getitem__(self, frames: slice | Ints | Bools) -> ChainPoses:
        return ChainPoses(self.root[frames], self.rotations[frames])


def seen_weights(positions: Floats, weights: Floats | None = None) -> Floats:
    """Weights that are 0 where markers are unseen, shape (n_frames, n_markers)."""
    seen = ~np.isnan(positions[:, :, 0])
    return seen.astype(np.float64) if weights is None else np.where(seen, weights, 0.0)


def residuals(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Measured minus predicted markers [mm], zero where unseen, shape (n_frames, n_markers, 3)."""
    return np.asarray(errors_of(*contiguous(positions, poses.markers(chain))))


def residuals_in_limbs(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    """Residuals in the limbs' frames [mm], where soft tissue lasts, shape (n_frames, n_markers, 3)."""
    turned = contiguous(poses.rotations, chain.limb_of_marker, residuals(chain, poses, positions))
    return np.asarray(turned_back(*turned))


def world_arms(body_arms: Floats, poses: ChainPoses) -> Floats:
    """Arms turned into the world [mm], shape (n_frames, n_markers, n_limbs, 3)."""
    return (poses.rotations @ body_arms.transpose(1, 2, 0)).transpose(0, 3, 1, 2)
