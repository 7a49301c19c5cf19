"""Soft tissue: markers that move on their limb in proportion to the rotations of its joints.

Much of the skin's motion follows the angles of the joints (Lucchetti, Cappozzo, Cappello and Della Croce 1998, *Skin
movement artefact assessment and compensation in the estimation of knee-joint kinematics*). Here a marker is displaced,
in the frame of its limb, in proportion to the flexions of the limb's joints: that to its parent, and those to its
children. A flexion is a component of a joint's rotation vector, scaled to mean square 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import relative_vectors
from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats, Ints

LEAST_SHARE = 0.08
"""Of a joint's largest flexion: smaller ones, such as the third of a universal joint, displace no markers."""

STILL = 0.03
"""rad; joints that rotate less than this displace no markers."""


@dataclass(frozen=True, eq=False)
class SoftTissue:
    """How markers move on their limbs as joints rotate.

    Attributes
    ----------
    joints : ndarray of intp, shape (n_flexions,)
        Limb below the joint of each flexion.
    middles : ndarray, shape (n_limbs, 3, 3)
        Mean rotation of each limb against its parent.
    gains : ndarray, shape (n_flexions, 3), 1 / rad
        A flexion is the scalar product of its gain with the rotation vector from the mean rotation.
    slopes : ndarray, shape (n_markers, 3, n_flexions), mm
        Displacement in the limb's frame for each flexion.
    """

    joints: Ints
    middles: Floats
    gains: Floats
    slopes: Floats

    def flexions(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return the flexions in some frames, shape (n_frames, n_flexions).

        Parameters
        ----------
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.
        """
        turns = _vectors(self.middles, _relative(chain, poses))
        return np.asarray(np.einsum("fbi,bi->fb", turns[:, self.joints], self.gains))

    def displacements(self, chain: Chain, poses: ChainPoses) -> Floats:
        """Return every marker's displacement in the world [mm], shape (n_frames, n_markers, 3).

        Parameters
        ----------
        chain : Chain
            The limbs.
        poses : ChainPoses
            Their poses.
        """
        flexions = self.flexions(chain, poses)
        local = flexions @ self.slopes.reshape(3 * chain.n_markers, -1).T
        turned = poses.rotations[:, chain.limb_of_marker] @ local.reshape(len(flexions), -1, 3, 1)
        return np.asarray(turned[..., 0])

    @property
    def shares(self) -> Floats:
        """Part that each flexion has of the variance of displacements by its joint, shape (n_flexions,)."""
        return np.asarray(1 / np.bincount(self.joints)[self.joints]) if len(self.joints) else np.zeros(0)

    def turned(self, chain: Chain, turn: Floats) -> SoftTissue:
        """Return the soft tissue for limbs whose frames are rotated.

        Parameters
        ----------
        chain : Chain
            The limbs.
        turn : ndarray, shape (n_limbs, 3, 3)
            New frame from old frame of each limb.
        """
        middles = turn[np.maximum(chain.parents, 0)] @ self.middles @ turn.swapaxes(1, 2)
        gains = np.einsum("bij,bj->bi", turn[self.joints], self.gains)
        return SoftTissue(self.joints, middles, gains, turn[chain.limb_of_marker] @ self.slopes)

    def with_slopes(self, slopes: Floats) -> SoftTissue:
        """Return the soft tissue with other slopes."""
        return replace(self, slopes=slopes)

    def reach(self, chain: Chain) -> Bools:
        """Return which flexions are those of a limb's own joints, shape (n_limbs, n_flexions)."""
        limbs = np.arange(chain.n_limbs)[:, np.newaxis]
        return np.asarray((self.joints == limbs) | (chain.parents[self.joints] == limbs))


def soft_tissue_at_rest(chain: Chain, poses: ChainPoses) -> SoftTissue:
    """Return soft tissue that does not move, with the flexions that it could follow.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Their poses, which say how far each joint rotates.
    """
    relative = _relative(chain, poses)
    middles = nearest_rotation(relative.mean(axis=0))
    turns = _vectors(middles, relative)
    joints: list[int] = []
    gains = [np.zeros((0, 3))]
    for limb in range(1, chain.n_limbs):
        values, vectors = np.linalg.eigh(turns[:, limb].T @ turns[:, limb] / len(turns))
        size = np.sqrt(np.maximum(values, 0.0))
        used = size > max(LEAST_SHARE * size[-1], STILL)
        gains.append((vectors[:, used] / size[used]).T)
        joints += [limb] * int(used.sum())
    slopes = np.zeros((chain.n_markers, 3, len(joints)))
    return SoftTissue(np.array(joints, dtype=np.intp), middles, np.concatenate(gains), slopes)


def _relative(chain: Chain, poses: ChainPoses) -> Floats:
    """Rotation of each limb against its parent, of the root the identity, shape (n_frames, n_limbs, 3, 3)."""
    above = poses.rotations[:, np.maximum(chain.parents, 0)]
    return np.asarray(above.swapaxes(2, 3) @ poses.rotations)


def _vectors(middles: Floats, relative: Floats) -> Floats:
    """Rotation vectors [rad] of each limb from its mean rotation, shape (n_frames, n_limbs, 3)."""
    found = relative_vectors(*contiguous(middles, relative.reshape(-1, 3, 3)))
    return np.asarray(found.reshape(relative.shape[:3]))
