"""Soft tissue: markers that move on their limb in proportion to the rotations of its joints, and its normal equations.

Much of the skin's motion follows the angles of the joints (Lucchetti, Cappozzo, Cappello and Della Croce 1998, *Skin
movement artefact assessment and compensation in the estimation of knee-joint kinematics*). Here a marker is displaced,
in the frame of its limb, in proportion to the flexions of the limb's joints: that to its parent, and those to its
children. A flexion is a component of a joint's rotation vector, scaled to mean square 1.

In the normal equations constants and displacements stand together, and poses are eliminated. A limb's markers determine
the chain by their rigid displacements only, which an orthonormal basis U of them spans: a residual r counts as
:math:`U^T r`, and the deformation of the cluster is left out. In these few numbers for each limb, the markers follow

- joints in their parents and tilts of axes, as in `skelgen.kinematics.chain.normal_equations`,
- rigid displacements of the limb's markers, which stand for the joint's position in the limb,
- soft tissue: such displacements times a flexion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import relative_vectors
from skelgen.geometry.rotations import cross_matrix, nearest_rotation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, world_arms
from skelgen.kinematics.inverse.poses import weak_prior
from skelgen.model.arrays import Bools, Floats, Ints

LEAST_SHARE = 0.08
"""Of a joint's largest flexion: smaller ones, such as the third of a universal joint, displace no markers."""

STILL = 0.03
"""rad; joints that rotate less than this displace no markers."""
DEGENERATE = 1e-6
"""Of the largest: rigid displacements that move the markers less, such as about a line of markers, are none."""

UNSEEN = 1e-9
"""Weight of markers that a frame does not show: keeps the roots of weights regular."""


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


@dataclass(frozen=True, eq=False)
class RigidDisplacements:
    """Orthonormal rigid displacements of the markers of all limbs.

    Attributes
    ----------
    basis : ndarray, shape (n_markers, 3, n_rigid)
        Displacements in the limbs' frames; zero for markers of other limbs.
    limbs : ndarray of intp, shape (n_rigid,)
        Limb of each.
    """

    basis: Floats
    limbs: Ints

    def of_markers(self, displacements: Floats) -> Floats:
        """Return the rigid displacements in displacements of markers, shapes (n_rigid, n) from (n_markers, 3, n)."""
        flat = self.basis.reshape(-1, len(self.limbs))
        return np.asarray(flat.T @ displacements.reshape(len(flat), -1))


@dataclass(frozen=True, eq=False)
class SoftTissueEquations:
    """Normal equations summed over frames; columns are joints, tilts, rigid displacements, soft tissue.

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
        Normal matrix, poses eliminated.
    gradient : ndarray, shape (n,)
        Right-hand side.
    clusters : RigidDisplacements
        Rigid displacements.
    n_joints, n_constants : int
        Where tilts and soft tissue begin; rigid displacements are the last of the constants.
    rigid, flexion : ndarray of intp, shape (n_tissue,)
        Rigid displacement and flexion of each column of soft tissue.
    """

    matrix: Floats
    gradient: Floats
    clusters: RigidDisplacements
    n_joints: int
    n_constants: int
    rigid: Ints
    flexion: Ints

    @property
    def limbs(self) -> Ints:
        """Limb of each column of soft tissue."""
        return self.clusters.limbs[self.rigid]

    def without(self, left_out: Bools) -> SoftTissueEquations:
        """Return the equations without some columns of soft tissue, shape (n_tissue,)."""
        kept = np.append(np.ones(self.n_constants, dtype=bool), ~left_out)
        matrix, gradient = self.matrix[np.ix_(kept, kept)], self.gradient[kept]
        rigid, flexion = self.rigid[~left_out], self.flexion[~left_out]
        return replace(self, matrix=matrix, gradient=gradient, rigid=rigid, flexion=flexion)

    def slopes(self, coefficients: Floats, n_flexions: int) -> Floats:
        """Return the markers' slopes from the coefficients of soft tissue, shape (n_markers, 3, n_flexions), mm.

        Parameters
        ----------
        coefficients : ndarray, shape (n_tissue,), mm
            Size of each column of soft tissue.
        n_flexions : int
            Number of flexions.
        """
        table = np.zeros((len(self.clusters.limbs), n_flexions))
        table[self.rigid, self.flexion] = coefficients
        return np.asarray(self.clusters.basis @ table)

    def coefficients(self, slopes: Floats) -> Floats:
        """Return the coefficients of soft tissue [mm], shape (n_tissue,), from slopes of the markers."""
        return np.asarray(self.clusters.of_markers(slopes)[self.rigid, self.flexion])


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
    observed: ObservedChain, tissue: SoftTissue, follows: Bools, noise: float
) -> SoftTissueEquations:
    """Return the normal equations for some frames.

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise; measured markers without the displacements that are known.
    tissue : SoftTissue
        With the flexions.
    follows : ndarray of bool, shape (n_limbs, n_flexions)
        Which flexions the markers of each limb follow.
    noise : float, mm
        Standard deviation of a coordinate.
    """
    chain, articulation, poses = observed.chain, observed.articulation, observed.poses
    clusters = rigid_displacements(chain)
    n_frames, n_rigid = observed.n_frames, len(clusters.limbs)
    basis = clusters.basis.reshape(-1, n_rigid).T
    against = poses.rotations[:, chain.limb_of_marker].swapaxes(2, 3)

    def in_basis(slopes: Floats) -> Floats:
        return np.asarray(basis @ (against @ slopes).reshape(n_frames, 3 * chain.n_markers, -1))

    turns, tilts = articulation.bases(chain.parents, poses.rotations)
    by_pose = in_basis(_pose_slopes(chain, poses))
    joints, by_tilt, by_pose = in_basis(_joint_slopes(chain, poses)), by_pose @ tilts, by_pose @ turns
    unit = np.broadcast_to(np.eye(n_rigid), (n_frames, n_rigid, n_rigid))
    constants = np.concatenate([joints, by_tilt, unit], axis=2)
    counts = np.einsum("mie,fm,mik->fek", clusters.basis, observed.weights, clusters.basis, optimize=True)
    root = np.linalg.cholesky(counts + UNSEEN * np.eye(n_rigid)).swapaxes(1, 2)
    weighted, own = root @ constants, root @ by_pose
    normal = own.swapaxes(1, 2) @ own + weak_prior(articulation, noise)
    follow = _solved(normal, own.swapaxes(1, 2) @ weighted)
    reduced = weighted - own @ follow
    error = observed.residuals * observed.weights[:, :, np.newaxis]
    local = in_basis(error[..., np.newaxis]).swapaxes(1, 2)
    gradient = (local @ constants - local @ by_pose @ follow)[:, 0]
    rigid, flexion = np.nonzero(follows[clusters.limbs])
    flexions, n_joints, n_constants = tissue.flexions(chain, poses), joints.shape[2], constants.shape[2]
    of_tissue = gradient[:, n_constants - n_rigid + rigid] * flexions[:, flexion]
    total = np.concatenate([gradient.sum(axis=0), of_tissue.sum(axis=0)])
    matrix = _normal_matrix(reduced, flexions, clusters, rigid, flexion)
    return SoftTissueEquations(matrix, total, clusters, n_joints, n_constants, rigid, flexion)


def _normal_matrix(
    constants: Floats, flexions: Floats, clusters: RigidDisplacements, rigid: Ints, flexion: Ints
) -> Floats:
    """Sum over frames of the products of all columns, those of soft tissue being rigid displacements times flexions.

    Flexions are the same for all rows of a frame: the products of the constants' columns, which are few, are taken
    once in each frame, and weighted by the flexions limb by limb.

    Parameters
    ----------
    constants : ndarray, shape (n_frames, n_rigid, n_constants)
        Columns of the constants, of which rigid displacements are the last.
    flexions : ndarray, shape (n_frames, n_flexions)
        In the frames.
    clusters : RigidDisplacements
        Rigid displacements.
    rigid, flexion : ndarray of intp, shape (n_tissue,)
        Rigid displacement, rising, and flexion of each column of soft tissue.
    """
    n_frames, n_rigid, n_constants = constants.shape
    first = n_constants - n_rigid
    matrix = np.empty((n_constants + len(rigid), n_constants + len(rigid)))
    flat = constants.reshape(-1, n_constants)
    matrix[:n_constants, :n_constants] = flat.T @ flat
    products = constants.swapaxes(1, 2) @ constants[:, :, first:]
    limbs, factors = clusters.limbs[rigid], flexions[:, flexion]
    for limb in np.unique(limbs).tolist():
        own, columns = np.flatnonzero(clusters.limbs == limb), np.flatnonzero(limbs == limb)
        among, after = flexion[columns[rigid[columns] == own[0]]], slice(int(columns[0]), None)
        by_limb = products[:, :, own[0] : own[-1] + 1]
        weighted = by_limb[:, first + rigid[after]] * factors[:, after, np.newaxis]
        rows = np.concatenate([by_limb, weighted], axis=1).reshape(n_frames, -1)
        sums = (flexions[:, among].T @ rows).reshape(len(among), -1, len(own)).transpose(1, 2, 0)
        sums = sums.reshape(len(sums), len(columns))
        columns += n_constants
        matrix[:n_constants, columns] = sums[:n_constants]
        matrix[columns[0] :, columns] = sums[n_constants:]
        matrix[columns, :n_constants] = sums[:n_constants].T
        matrix[columns, columns[0] :] = sums[n_constants:].T
    return matrix


def _pose_slopes(chain: Chain, poses: ChainPoses) -> Floats:
    """Derivatives of markers by translation and rotations, shape (n_frames, n_markers, 3, 3 + 3 n_limbs)."""
    turning = -cross_matrix(world_arms(chain.arms(), poses)).transpose(0, 1, 3, 2, 4)
    shape = (*turning.shape[:3], 3)
    shift = np.broadcast_to(np.eye(3), shape)
    return np.concatenate([shift, turning.reshape(*shape[:3], -1)], axis=3)


def _joint_slopes(chain: Chain, poses: ChainPoses) -> Floats:
    """Derivatives of markers by joints in their parents, shape (n_frames, n_markers, 3, 3 (n_limbs - 1))."""
    beyond = chain.ancestry()[1:, chain.limb_of_marker].T.astype(np.float64)
    above = poses.rotations[:, chain.parents[1:]].swapaxes(1, 2)
    slopes = beyond[:, np.newaxis, :, np.newaxis] * above[:, np.newaxis]
    return np.asarray(slopes.reshape(*slopes.shape[:3], -1))


def _solved(normal: Floats, right: Floats) -> Floats:
    """Solve equations of many frames; the shortest solutions, where rounding leaves a frame's equations singular."""
    try:
        return np.asarray(np.linalg.solve(normal, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(normal, hermitian=True) @ right)
