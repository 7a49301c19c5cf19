"""Soft tissue: markers that move on their limb in proportion to the rotations of its joints; their normal equations.

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
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, residuals_in_limbs
from skelgen.kinematics.chain.normal_equations import constant_gradient, frame_information
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

    def gradient_of(self, observed: ObservedChain, tissue: SoftTissue) -> Floats:
        """Return the gradient of the residuals of some frames by the columns, shape (n,).

        Parameters
        ----------
        observed : ObservedChain
            In poses that fit best; measured markers without the displacements that are known.
        tissue : SoftTissue
            With the flexions.
        """
        chain, gradient = observed.chain, constant_gradient(observed)
        n_places = 3 * chain.n_markers
        rigid = self.clusters.of_markers(gradient[:n_places, np.newaxis])[:, 0]
        flat = residuals_in_limbs(chain, observed.poses, observed.positions).reshape(observed.n_frames, -1)
        by_tissue = self.coefficients(flat.T @ tissue.flexions(chain, observed.poses))
        return np.concatenate([gradient[n_places:], rigid, by_tissue])

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


def soft_tissue_equations(observed: ObservedChain, tissue: SoftTissue, follows: Bools) -> SoftTissueEquations:
    """Return the normal equations for some frames.

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise, in poses that fit best; measured markers without the displacements that are known.
    tissue : SoftTissue
        With the flexions.
    follows : ndarray of bool, shape (n_limbs, n_flexions)
        Which flexions the markers of each limb follow.
    """
    clusters = rigid_displacements(observed.chain)
    products, among = frame_information(observed, clusters.basis, clusters.limbs)
    flexions = tissue.flexions(observed.chain, observed.poses)
    matrix = _normal_matrix(products, among, flexions, clusters, follows)
    places = np.nonzero(follows[clusters.limbs])
    n_joints, n_constants = 3 * (observed.chain.n_limbs - 1), products.shape[1]
    system = SoftTissueEquations(matrix, np.zeros(len(matrix)), clusters, n_joints, n_constants, *places)
    return replace(system, gradient=system.gradient_of(observed, tissue))


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
