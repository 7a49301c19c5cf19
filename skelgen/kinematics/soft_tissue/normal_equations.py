r"""The equations of a chain whose markers slide: constants and slides together, poses eliminated.

A limb's markers tell of the chain by their rigid displacements only, which an orthonormal basis U of them spans: a
residual r counts as :math:`U^T r`. What bends the cluster goes beside. In these few numbers for each limb, the markers
follow

- joints in their parents and tilts of axes, as in `skelgen.kinematics.chain.normal_equations`,
- rigid displacements of the limb's markers, which stand for the joint's place in the limb,
- slides: such displacements times a bend.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.calibration.uncertainty import weak_prior
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals, seen_weights, world_arms
from skelgen.kinematics.soft_tissue.model import SoftTissue
from skelgen.model.arrays import Bools, Floats, Ints

DEGENERATE = 1e-6
"""Of the largest: rigid displacements that move the markers less, as the turn about a line of markers, are none."""

UNSEEN = 1e-9
"""Weight of what a frame does not show: keeps the roots of weights regular."""


@dataclass(frozen=True, eq=False)
class RigidDisplacements:
    """Orthonormal rigid displacements of all limbs' markers.

    Attributes
    ----------
    basis : ndarray, shape (n_markers, 3, n_rigid)
        Displacements in the limbs' frames; zero for markers of other limbs.
    limbs : ndarray of intp, shape (n_rigid,)
        Limb of each.
    """

    basis: Floats
    limbs: Ints

    def without_rigid(self, displacements: Floats) -> Floats:
        """Return what is no rigid displacement of a limb's markers, shape (n_markers, 3, n)."""
        return np.asarray(displacements - self.basis @ self.of_markers(displacements))

    def of_markers(self, displacements: Floats) -> Floats:
        """Return the rigid displacements that are in displacements of markers, shape (n_rigid, n)."""
        flat = self.basis.reshape(-1, len(self.limbs))
        return np.asarray(flat.T @ displacements.reshape(len(flat), -1))


@dataclass(frozen=True, eq=False)
class SoftTissueEquations:
    """Normal equations summed over frames; columns are joints, tilts, rigid displacements, slides.

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
    pull : ndarray, shape (n,)
        How residuals pull at the columns, poses eliminated.
    clusters : RigidDisplacements
        Rigid displacements.
    n_joints, n_constants : int
        Where tilts and slides begin; rigid displacements are the last of the constants.
    slide, bend : ndarray of intp, shape (n_slides,)
        Rigid displacement and bend of each slide.
    """

    matrix: Floats
    pull: Floats
    clusters: RigidDisplacements
    n_joints: int
    n_constants: int
    slide: Ints
    bend: Ints

    @property
    def limbs(self) -> Ints:
        """Limb of each slide."""
        return self.clusters.limbs[self.slide]

    def without(self, left_out: Bools) -> SoftTissueEquations:
        """The system without some slides."""
        kept = np.append(np.ones(self.n_constants, dtype=bool), ~left_out)
        return replace(
            self,
            matrix=self.matrix[np.ix_(kept, kept)],
            pull=self.pull[kept],
            slide=self.slide[~left_out],
            bend=self.bend[~left_out],
        )

    def slopes(self, slides: Floats, n_bends: int) -> Floats:
        """Slopes of the markers from the slides, shape (n_markers, 3, n_bends), mm."""
        table = np.zeros((len(self.clusters.limbs), n_bends))
        table[self.slide, self.bend] = slides
        return np.asarray(self.clusters.basis @ table)

    def slides(self, slopes: Floats) -> Floats:
        """The slides that are in slopes of the markers, shape (n_slides,)."""
        return np.asarray(self.clusters.of_markers(slopes)[self.slide, self.bend])


def rigid_displacements(chain: Chain) -> RigidDisplacements:
    """Return the rigid displacements that a chain's markers show."""
    parts = []
    for limb in range(chain.n_limbs):
        own = np.flatnonzero(chain.limb_of_marker == limb)
        offsets = chain.offsets[own]
        about = np.tile(np.eye(3), (len(own), 1, 1))
        motion = np.concatenate([about, -cross_matrix(offsets)], axis=2).reshape(-1, 6)
        size = max(float(np.abs(offsets).max(initial=0.0)), 1.0)
        scaled = motion / np.array([1.0, 1.0, 1.0, size, size, size])
        left, values, _ = np.linalg.svd(scaled, full_matrices=False)
        clear = values > DEGENERATE * values.max(initial=0.0)
        basis = np.zeros((chain.n_markers, 3, int(clear.sum())))
        basis[own] = left[:, clear].reshape(len(own), 3, basis.shape[2])
        parts.append(basis)
    limbs = np.repeat(np.arange(chain.n_limbs), [part.shape[2] for part in parts])
    return RigidDisplacements(np.concatenate(parts, axis=2), limbs)


def soft_tissue_equations(
    chain: Chain,
    articulation: Articulation,
    poses: ChainPoses,
    positions: Floats,
    tissue: SoftTissue,
    follows: Bools,
    noise: float,
) -> SoftTissueEquations:
    """Return the normal equations for some frames.

    Parameters
    ----------
    chain, articulation, poses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers without the slides that are known, NaN where unseen.
    tissue : SoftTissue
        What bends.
    follows : ndarray of bool, shape (n_limbs, n_bends)
        Which bends the markers of each limb follow.
    noise : float, mm
        Standard deviation of a coordinate.
    """
    weights, clusters = seen_weights(positions), rigid_displacements(chain)
    n_frames, n_rigid = len(weights), len(clusters.limbs)
    basis = clusters.basis.reshape(-1, n_rigid).T
    against = poses.rotations[:, chain.limb_of_marker].swapaxes(2, 3)

    def seen_by_limbs(slopes: Floats) -> Floats:
        return np.asarray(basis @ (against @ slopes).reshape(n_frames, 3 * chain.n_markers, -1))

    turns, tilts = articulation.bases(chain.parents, poses.rotations)
    by_pose = seen_by_limbs(_pose_slopes(chain, poses))
    joints, by_tilt, by_pose = seen_by_limbs(_joint_slopes(chain, poses)), by_pose @ tilts, by_pose @ turns
    rigid = np.broadcast_to(np.eye(n_rigid), (n_frames, n_rigid, n_rigid))
    constants = np.concatenate([joints, by_tilt, rigid], axis=2)
    root = _root_of_weights(clusters, weights)
    heard, own = root @ constants, root @ by_pose
    follow = np.linalg.solve(own.swapaxes(1, 2) @ own + weak_prior(articulation, noise), own.swapaxes(1, 2) @ heard)
    left = heard - own @ follow
    error = residuals(chain, poses, positions) * weights[:, :, np.newaxis]
    local = seen_by_limbs(error[..., np.newaxis]).swapaxes(1, 2)
    pull = (local @ constants - local @ by_pose @ follow)[:, 0]
    slide, bend = np.nonzero(follows[clusters.limbs])
    bends, column = tissue.bends(chain, poses)[:, bend], constants.shape[2] - n_rigid + slide
    flat = np.concatenate([left, left[:, :, column] * bends[:, np.newaxis]], axis=2).reshape(n_frames * n_rigid, -1)
    return SoftTissueEquations(
        matrix=flat.T @ flat,
        pull=np.concatenate([pull.sum(axis=0), (pull[:, column] * bends).sum(axis=0)]),
        clusters=clusters,
        n_joints=joints.shape[2],
        n_constants=constants.shape[2],
        slide=slide,
        bend=bend,
    )


def _pose_slopes(chain: Chain, poses: ChainPoses) -> Floats:
    """How markers follow translation and turns of all limbs, shape (n_frames, n_markers, 3, 3 + 3 n_limbs)."""
    turning = -cross_matrix(world_arms(chain.arms(), poses)).transpose(0, 1, 3, 2, 4)
    shape = (*turning.shape[:3], 3)
    shift = np.broadcast_to(np.eye(3), shape)
    return np.concatenate([shift, turning.reshape(*shape[:3], -1)], axis=3)


def _joint_slopes(chain: Chain, poses: ChainPoses) -> Floats:
    """How markers follow joints in their parents, shape (n_frames, n_markers, 3, 3 (n_limbs - 1))."""
    beyond = chain.ancestry()[1:, chain.limb_of_marker].T.astype(np.float64)
    above = poses.rotations[:, chain.parents[1:]].swapaxes(1, 2)
    slopes = beyond[:, np.newaxis, :, np.newaxis] * above[:, np.newaxis]
    return np.asarray(slopes.reshape(*slopes.shape[:3], -1))


def _root_of_weights(clusters: RigidDisplacements, weights: Floats) -> Floats:
    """What rigid displacements count in each frame: roots of their weights, shape (n_frames, n_rigid, n_rigid)."""
    basis = clusters.basis
    counts = np.einsum("mie,fm,mik->fek", basis, weights, basis, optimize=True)
    return np.linalg.cholesky(counts + UNSEEN * np.eye(basis.shape[2])).swapaxes(1, 2)
