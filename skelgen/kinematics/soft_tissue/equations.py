"""Normal equations of a chain with soft tissue: constants and displacements stand together, poses are eliminated.

A limb's markers determine the chain by their rigid displacements only, which an orthonormal basis U of them spans: a
residual r counts as :math:`U^T r`, and the deformation of the cluster is left out. In these few numbers for each limb,
the markers follow

- joints in their parents and tilts of axes, as in `skelgen.kinematics.chain.normal_equations`,
- rigid displacements of the limb's markers, which stand for the joint's position in the limb,
- soft tissue: such displacements times a flexion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, world_arms
from skelgen.kinematics.inverse.poses import weak_prior
from skelgen.kinematics.soft_tissue.model import SoftTissue
from skelgen.model.arrays import Bools, Floats, Ints

DEGENERATE = 1e-6
"""Of the largest: rigid displacements that move the markers less, such as about a line of markers, are none."""


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

    def rows_of(self, limb: int) -> slice:
        """Where the rigid displacements of a limb stand, one after the other."""
        return slice(*np.searchsorted(self.limbs, (limb, limb + 1)).tolist())

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
    n_rigid, n_joints = len(clusters.limbs), 3 * (chain.n_limbs - 1)
    turns, tilts = articulation.bases(chain.parents, poses.rotations)
    by_pose, joints = _rigid_slopes(chain, poses, clusters)
    before = np.concatenate([joints, by_pose @ tilts], axis=2)
    first = before.shape[2]
    error = observed.residuals * observed.weights[:, :, np.newaxis]
    against = poses.rotations[:, chain.limb_of_marker].swapaxes(2, 3)
    in_limbs = (against @ error[..., np.newaxis]).reshape(observed.n_frames, -1)
    local = in_limbs @ clusters.basis.reshape(-1, n_rigid)
    counts = _counts(observed, clusters)
    by_pose = by_pose @ turns
    products, among, follow = _reduced(clusters, counts, before, by_pose, weak_prior(articulation, noise))
    row = local[:, np.newaxis]
    gradient = np.concatenate([(row @ before)[:, 0], local], axis=1) - (row @ by_pose @ follow)[:, 0]
    rigid, flexion = np.nonzero(follows[clusters.limbs])
    flexions = tissue.flexions(chain, poses)
    of_tissue = gradient[:, first + rigid] * flexions[:, flexion]
    total = np.concatenate([gradient.sum(axis=0), of_tissue.sum(axis=0)])
    matrix = _normal_matrix(products, among, flexions, clusters, follows)
    return SoftTissueEquations(matrix, total, clusters, n_joints, first + n_rigid, rigid, flexion)


def _rigid_slopes(chain: Chain, poses: ChainPoses, clusters: RigidDisplacements) -> tuple[Floats, Floats]:
    """Derivatives of rigid displacements by poses, shape (n_frames, n_rigid, 3 + 3 n_limbs), and by joints.

    All markers of a limb move alike as the limbs before it turn, so that the sum over markers of a rigid displacement
    stands for them; as the limb itself turns, so does the sum of its moments. The second shape is (n_frames, n_rigid,
    3 (n_limbs - 1)).
    """
    limbs, every = clusters.limbs, np.arange(len(clusters.limbs))
    shift = clusters.basis.sum(axis=0).T
    moment = np.cross(chain.offsets[:, np.newaxis], clusters.basis.swapaxes(1, 2)).sum(axis=0)
    turned = poses.rotations[:, limbs]
    along = (turned @ shift[..., np.newaxis])[..., 0]
    a_marker = np.zeros(chain.n_limbs, dtype=np.intp)
    a_marker[chain.limb_of_marker] = np.arange(chain.n_markers)
    arms = world_arms(chain.arms()[a_marker[limbs]], poses)
    slopes = np.empty((len(along), len(limbs), 1 + chain.n_limbs, 3))
    slopes[:, :, 0] = along
    for axis, (second, third) in enumerate(((1, 2), (2, 0), (0, 1))):
        slopes[:, :, 1:, axis] = arms[..., second] * along[:, :, np.newaxis, third]
        slopes[:, :, 1:, axis] -= arms[..., third] * along[:, :, np.newaxis, second]
    slopes[:, every, 1 + limbs] = (turned @ moment[..., np.newaxis])[..., 0]
    beyond = chain.ancestry()[1:, limbs].T
    above = poses.rotations[:, chain.parents[1:]].transpose(0, 2, 1, 3).reshape(len(along), 3, -1)
    joints = (along @ above) * np.repeat(beyond, 3, axis=1)
    return slopes.reshape(*along.shape[:2], -1), joints


def _counts(observed: ObservedChain, clusters: RigidDisplacements) -> Floats:
    """Return how much the markers that are seen say of rigid displacements, shape (n_frames, n_rigid, n_rigid).

    Of two limbs it is 0.
    """
    counts = np.zeros((observed.n_frames, len(clusters.limbs), len(clusters.limbs)))
    for limb in np.unique(clusters.limbs).tolist():
        own, markers = clusters.rows_of(limb), np.flatnonzero(observed.chain.limb_of_marker == limb)
        basis = clusters.basis[markers, :, own].reshape(3 * len(markers), -1)
        squares = (basis[:, :, np.newaxis] * basis[:, np.newaxis]).reshape(len(markers), 3, -1).sum(axis=1)
        counts[:, own, own] = (observed.weights[:, markers] @ squares).reshape(observed.n_frames, *[basis.shape[1]] * 2)
    return counts


def _reduced(
    clusters: RigidDisplacements, counts: Floats, before: Floats, by_pose: Floats, prior: Floats
) -> tuple[Floats, Floats, Floats]:
    """Eliminate the poses of all frames: what is left of residuals when poses follow the constants.

    With what markers say of rigid displacements C, their derivatives B by constants and A by poses, and a prior P on
    poses, these follow by :math:`F = (A^T C A + P)^{-1} A^T C B`, and
    :math:`(B - A F)^T C (B - A F) = B^T C B - (A^T C B + P F)^T F`.

    Parameters
    ----------
    clusters : RigidDisplacements
        Rigid displacements.
    counts : ndarray, shape (n_frames, n_rigid, n_rigid)
        What markers say of them.
    before : ndarray, shape (n_frames, n_rigid, n_before)
        Derivatives by the constants that stand before the rigid displacements, of which the derivatives are known.
    by_pose : ndarray, shape (n_frames, n_rigid, n_freedoms)
        Derivatives by the freedoms of the poses.
    prior : ndarray, shape (n_freedoms, n_freedoms)
        Information on poses without any marker.

    Returns
    -------
    products : ndarray, shape (n_frames, n_constants, n_rigid)
        Normal matrix of all constants and the rigid displacements in each frame.
    among : ndarray, shape (n_before, n_before)
        Normal matrix of the constants before them, summed over frames.
    follow : ndarray, shape (n_frames, n_freedoms, n_constants)
        How poses follow constants.
    """
    first = before.shape[2]
    counted = np.concatenate([before, by_pose], axis=2)
    for own in map(clusters.rows_of, np.unique(clusters.limbs).tolist()):
        counted[:, own] = counts[:, own, own] @ counted[:, own]
    of_before, of_poses = counted[:, :, :first], counted[:, :, first:]
    across = by_pose.swapaxes(1, 2)
    right = np.concatenate([across @ of_before, of_poses.swapaxes(1, 2)], axis=2)
    follow = _solved(across @ of_poses + prior, right)
    taken = right + np.diag(prior)[:, np.newaxis] * follow
    products = np.concatenate([of_before.swapaxes(1, 2), counts], axis=1)
    products -= taken.swapaxes(1, 2) @ follow[:, :, first:]
    known, given, lost, led = (part[:, :, :first].reshape(-1, first) for part in (before, of_before, taken, follow))
    return products, known.T @ given - lost.T @ led, follow


def _normal_matrix(
    products: Floats, among: Floats, flexions: Floats, clusters: RigidDisplacements, follows: Bools
) -> Floats:
    """Sum over frames of the products of all columns, those of soft tissue being rigid displacements times flexions.

    Flexions are the same for all rows of a frame: the products of the constants' columns, which are few, are taken
    once in each frame, and weighted by the flexions, one pair of limbs after the other.

    Parameters
    ----------
    products : ndarray, shape (n_frames, n_constants, n_rigid)
        Of the constants' columns, of which rigid displacements are the last, with those.
    among : ndarray, shape (n_constants - n_rigid, n_constants - n_rigid)
        Of the others with each other, summed over frames.
    flexions : ndarray, shape (n_frames, n_flexions)
        In the frames.
    clusters : RigidDisplacements
        Rigid displacements.
    follows : ndarray of bool, shape (n_limbs, n_flexions)
        Which flexions the markers of each limb follow.
    """
    n_frames, n_constants, n_rigid = products.shape
    first, size = n_constants - n_rigid, n_constants
    before: list[tuple[slice, slice, Floats]] = []
    for limb in np.flatnonzero(follows.any(axis=1)).tolist():
        own, followed = clusters.rows_of(limb), flexions[:, follows[limb]]
        width = (own.stop - own.start) * followed.shape[1]
        before.append((own, slice(size, size + width), followed))
        size += width
    matrix = np.zeros((size, size))
    matrix[:first, :first] = among
    matrix[:n_constants, first:n_constants] = products.sum(axis=0)
    for index, (own, columns, followed) in enumerate(before):
        by_limb = products[:, :, own].reshape(n_frames, -1).T @ followed
        matrix[:n_constants, columns] = by_limb.reshape(n_constants, -1)
        for rows, places, other in before[: index + 1]:
            both = (other[:, :, np.newaxis] * followed[:, np.newaxis]).reshape(n_frames, -1)
            block = products[:, first + rows.start : first + rows.stop, own]
            sums = (block.reshape(n_frames, -1).T @ both).reshape(*block.shape[1:], other.shape[1], -1)
            matrix[places, columns] = sums.transpose(0, 2, 1, 3).reshape(places.stop - places.start, -1)
    upper = np.triu(matrix)
    return np.asarray(upper + np.triu(upper, 1).T)


def _solved(normal: Floats, right: Floats) -> Floats:
    """Solve equations of many frames; the shortest solutions, where rounding leaves a frame's equations singular."""
    try:
        return np.asarray(np.linalg.solve(normal, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(normal, hermitian=True) @ right)
