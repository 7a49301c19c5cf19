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
from skelgen.kinematics.chain.chain import Chain, ObservedChain, residuals_in_limbs
from skelgen.kinematics.chain.normal_equations import constant_gradient, frame_information
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
