r"""Markers that slide on their limb as its joint bends: what soft tissue does besides shaking.

Much of the skin's motion follows the angles of the joint (Lucchetti, Cappozzo, Cappello and Della Croce 1998, *Skin
movement artefact assessment and compensation in the estimation of knee-joint kinematics*). Here a marker is displaced,
in the frame of its limb, in proportion to the bends of the joint above it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import nearest_rotation, vector_from_matrix
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats

LEAST_BEND = 0.08
"""Of a joint's largest bend: directions that bend less, as the third of a universal joint, carry nothing."""

STILL = 0.03
"""rad; joints that bend less than this carry no slides."""


@dataclass(frozen=True, eq=False)
class Skin:
    """How markers slide as joints bend.

    Attributes
    ----------
    middles : ndarray, shape (n_limbs, 3, 3)
        Mean rotation of each limb against its parent.
    gains : ndarray, shape (n_limbs, 3, 3), 1 / rad
        What the rotation vector from there is multiplied with for three bends of mean square 1; zero columns for
        directions in which the joint hardly bends.
    slopes : ndarray, shape (n_markers, 3, 3), mm
        Displacement in the limb's frame for each bend.
    """

    middles: Floats
    gains: Floats
    slopes: Floats

    @property
    def is_bent(self) -> Bools:
        """Which bends there are, shape (n_limbs, 3)."""
        return np.asarray((self.gains != 0).any(axis=1))

    def bends(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the bends of the joint above each limb, shape (n_frames, n_limbs, 3)."""
        turns = vector_from_matrix(self.middles.swapaxes(1, 2) @ _relative(chain, poses))
        return np.asarray((turns[:, :, np.newaxis] @ self.gains)[:, :, 0])

    def slides(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the displacement of every marker in the world [mm], shape (n_frames, n_markers, 3)."""
        limb = chain.limb_of_marker
        local = self.slopes @ self.bends(chain, poses)[:, limb, :, np.newaxis]
        return np.asarray((poses.rotations[:, limb] @ local)[..., 0])

    def with_slopes(self, slopes: Floats) -> Skin:
        """Return the skin with other slopes."""
        return replace(self, slopes=slopes)


def skin_at_rest(chain: Chain, poses: ChainPoses) -> Skin:
    """Return a skin that does not slide, with the bends that it could follow."""
    relative = _relative(chain, poses)
    middles = nearest_rotation(relative.mean(axis=0))
    turns = vector_from_matrix(middles.swapaxes(1, 2) @ relative)
    gains = np.zeros((chain.n_limbs, 3, 3))
    for limb in range(1, chain.n_limbs):
        values, vectors = np.linalg.eigh(turns[:, limb].T @ turns[:, limb] / len(turns))
        size = np.sqrt(np.maximum(values, 0.0))
        bent = size > max(LEAST_BEND * size[-1], STILL)
        gains[limb][:, bent] = vectors[:, bent] / size[bent]
    return Skin(middles, gains, np.zeros((chain.n_markers, 3, 3)))


def _relative(chain: Chain, poses: ChainPoses) -> Floats:
    """Rotation of each limb against its parent, of the root the identity, shape (n_frames, n_limbs, 3, 3)."""
    above = poses.rotations[:, np.maximum(chain.parents, 0)]
    return np.asarray(above.swapaxes(2, 3) @ poses.rotations)
