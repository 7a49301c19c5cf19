r"""Markers that slide on their limb as its joints bend: what soft tissue does besides shaking.

Much of the skin's motion follows the angles of the joints (Lucchetti, Cappozzo, Cappello and Della Croce 1998, *Skin
movement artefact assessment and compensation in the estimation of knee-joint kinematics*). Here a marker is displaced,
in the frame of its limb, in proportion to the bends of the joints of this limb: that to its parent, and those beyond.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import relative_vectors
from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats, Ints

LEAST_BEND = 0.08
"""Of a joint's largest bend: directions that bend less, as the third of a universal joint, carry nothing."""

STILL = 0.03
"""rad; joints that bend less than this carry no slides."""


@dataclass(frozen=True, eq=False)
class SoftTissue:
    """How markers slide as joints bend.

    Attributes
    ----------
    joints : ndarray of intp, shape (n_bends,)
        Limb below the joint of each bend.
    middles : ndarray, shape (n_limbs, 3, 3)
        Mean rotation of each limb against its parent.
    gains : ndarray, shape (n_bends, 3), 1 / rad
        The rotation vector from there times these is a bend, of mean square 1.
    slopes : ndarray, shape (n_markers, 3, n_bends), mm
        Displacement in the limb's frame for each bend.
    """

    joints: Ints
    middles: Floats
    gains: Floats
    slopes: Floats

    def bends(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the bends in some frames, shape (n_frames, n_bends)."""
        turns = _vectors(self.middles, _relative(chain, poses))
        return np.asarray(np.einsum("fbi,bi->fb", turns[:, self.joints], self.gains))

    def slides(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the displacement of every marker in the world [mm], shape (n_frames, n_markers, 3)."""
        bends = self.bends(chain, poses)
        local = bends @ self.slopes.reshape(3 * chain.n_markers, -1).T
        turned = poses.rotations[:, chain.limb_of_marker] @ local.reshape(len(bends), -1, 3, 1)
        return np.asarray(turned[..., 0])

    @property
    def shares(self) -> Floats:
        """Part that each bend has of the variance of slides with its joint, shape (n_bends,)."""
        return np.asarray(1 / np.bincount(self.joints)[self.joints]) if len(self.joints) else np.zeros(0)

    def turned(self, chain: Chain, turn: Floats) -> SoftTissue:
        """Return the tissue for limbs whose frames are turned: `turn` brings old axes to new ones."""
        middles = turn[np.maximum(chain.parents, 0)] @ self.middles @ turn.swapaxes(1, 2)
        gains = np.einsum("bij,bj->bi", turn[self.joints], self.gains)
        return SoftTissue(self.joints, middles, gains, turn[chain.limb_of_marker] @ self.slopes)

    def with_slopes(self, slopes: Floats) -> SoftTissue:
        """Return the tissue with other slopes."""
        return replace(self, slopes=slopes)

    def reach(self, chain: Chain) -> Bools:
        """Which bends are those of a limb's own joints, shape (n_limbs, n_bends)."""
        limbs = np.arange(chain.n_limbs)[:, np.newaxis]
        return np.asarray((self.joints == limbs) | (chain.parents[self.joints] == limbs))


def soft_tissue_at_rest(chain: Chain, poses: ChainPoses) -> SoftTissue:
    """Return a tissue that does not slide, with the bends that it could follow."""
    relative = _relative(chain, poses)
    middles = nearest_rotation(relative.mean(axis=0))
    turns = _vectors(middles, relative)
    joints: list[int] = []
    gains = [np.zeros((0, 3))]
    for limb in range(1, chain.n_limbs):
        values, vectors = np.linalg.eigh(turns[:, limb].T @ turns[:, limb] / len(turns))
        size = np.sqrt(np.maximum(values, 0.0))
        bent = size > max(LEAST_BEND * size[-1], STILL)
        gains.append((vectors[:, bent] / size[bent]).T)
        joints += [limb] * int(bent.sum())
    slopes = np.zeros((chain.n_markers, 3, len(joints)))
    return SoftTissue(np.array(joints, dtype=np.intp), middles, np.concatenate(gains), slopes)


def _relative(chain: Chain, poses: ChainPoses) -> Floats:
    """Rotation of each limb against its parent, of the root the identity, shape (n_frames, n_limbs, 3, 3)."""
    above = poses.rotations[:, np.maximum(chain.parents, 0)]
    return np.asarray(above.swapaxes(2, 3) @ poses.rotations)


def _vectors(middles: Floats, relative: Floats) -> Floats:
    """Rotation vectors [rad] of each limb from its middle, shape (n_frames, n_limbs, 3)."""
    found = relative_vectors(*contiguous(middles, relative.reshape(-1, 3, 3)))
    return np.asarray(found.reshape(relative.shape[:3]))
