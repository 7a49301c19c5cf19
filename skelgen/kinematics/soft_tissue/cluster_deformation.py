r"""How clusters of markers bend as the joints of their limb do: slides that are seen without knowing any joint.

Of what a marker does in the frame of its limb, the rigid displacements of the cluster may be errors of the pose; the
rest is the bending of the cluster. Where it follows the bends of a joint, so do, by all experience, the rigid
displacements that nothing shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.chain.chain import Chain, residuals_in_limbs
from skelgen.kinematics.chain.schur_complement import effective_frames
from skelgen.kinematics.soft_tissue.model import SoftTissue
from skelgen.kinematics.soft_tissue.normal_equations import RigidDisplacements
from skelgen.model.arrays import Floats, Ints

VARIANCES = np.geomspace(1e-4, 1e4, 161)
"""Variances of slides that are tried, in units of the noise's: 12 % apart."""

SURE = 6.0
"""Nats by which a joint's bends must explain how a cluster bends, for slides to be looked for at all."""

DOUBTFUL = -8.0
"""Nats above which slides of a cluster with a joint are not ruled out: three markers may slide without bending."""


@dataclass(frozen=True, eq=False)
class ClusterDeformation:
    """What is seen of a limb's cluster before any slide is fitted.

    Attributes
    ----------
    own : ndarray of intp, shape (n_own,)
        Markers of the limb.
    bends : ndarray of intp, shape (n_bends,)
        Bends of its joints.
    squares : ndarray, shape (n_own, n_bends, n_bends)
        Sums of products of bends over the frames that show each marker.
    moments : ndarray, shape (3 n_own, n_bends), mm
        Sums of residuals times bends.
    inner : ndarray, shape (n_inner, 3 n_own)
        Orthonormal ways to bend the cluster.
    """

    own: Ints
    bends: Ints
    squares: Floats
    moments: Floats
    inner: Floats

    @cached_property
    def slopes(self) -> Floats:
        """How residuals follow the bends by least squares, shape (n_own, 3, n_bends)."""
        inverse = np.linalg.pinv(self.squares, hermitian=True)
        return np.asarray(self.moments.reshape(len(self.own), 3, len(self.bends)) @ inverse)

    def ways(self) -> tuple[Floats, Floats]:
        """Information and pull of each way to bend with each bend, shape (n_inner, n_bends); see `ways_to_bend`."""
        squares = np.diagonal(self.squares, axis1=1, axis2=2).sum(axis=0) / max(len(self.own), 1)
        return np.tile(squares, (len(self.inner), 1)), np.asarray(self.inner @ self.moments)

    def with_joint(self, tissue: SoftTissue, joint: int, noise: float) -> tuple[Floats, Floats]:
        """Variances of ways to bend with one joint that other joints do not explain: expected by chance, and seen.

        Both in units of a slide of the variance of the noise.
        """
        if not len(self.inner):
            return np.zeros(0), np.zeros(0)
        chosen = np.flatnonzero(tissue.joints[self.bends] == joint)
        spread = np.linalg.pinv(self.squares.mean(axis=0), hermitian=True)[np.ix_(chosen, chosen)]
        values, vectors = np.linalg.eigh(spread)
        inner = (self.inner @ self.slopes.reshape(3 * len(self.own), len(self.bends)))[:, chosen] @ vectors
        expected = np.tile(values, (len(inner), 1))
        return (expected * len(chosen)).ravel(), (inner**2 * len(chosen) / noise).ravel()


@dataclass(frozen=True, eq=False)
class ObservedDeformations:
    """What is seen of all clusters.

    Attributes
    ----------
    limbs : tuple of ClusterDeformation
        By limb; limbs without markers or bends have empty arrays.
    noise : float, mm^2
        Variance of a coordinate that follows no bend, times the frames that tell as much as one.
    """

    limbs: tuple[ClusterDeformation, ...]
    noise: float

    def likely_slides(self, tissue: SoftTissue) -> Floats:
        """Prior variances of slides, of one size wherever they are not ruled out, shape (n_limbs, n_bends), mm^2.

        All are zero if no cluster is seen to bend with a joint.
        """
        pairs = [(limb, joint) for limb, one in enumerate(self.limbs) for joint in np.unique(tissue.joints[one.bends])]
        seen = [self.limbs[limb].with_joint(tissue, joint, self.noise) for limb, joint in pairs]
        result = np.zeros((len(self.limbs), len(tissue.joints)))
        sure = [one for one in seen if _evidence(one, VARIANCES).max() > SURE]
        if not sure:
            return result
        common = VARIANCES[np.sum([_evidence(one, VARIANCES) for one in sure], axis=0).argmax()]
        for (limb, joint), one in zip(pairs, seen, strict=True):
            if len(self.limbs[limb].own) and _evidence(one, np.array([common]))[0] > DOUBTFUL:
                result[limb, tissue.joints == joint] = common * self.noise
        return result * tissue.shares


def observe_deformations(last: Calibration, tissue: SoftTissue, clusters: RigidDisplacements) -> ObservedDeformations:
    """Look for bending of clusters in the residuals of a fit.

    Parameters
    ----------
    last : Calibration
        Fitted to markers that do not slide, in the order of time.
    tissue : SoftTissue
        What bends.
    clusters : RigidDisplacements
        Rigid displacements of the markers.
    """
    local = residuals_in_limbs(last.chain, last.poses, last.positions)
    bends, reach = tissue.bends(last.chain, last.poses), tissue.reach(last.chain)
    limbs, after = [], local.copy()
    for limb in range(last.chain.n_limbs):
        one = _bending_of(last, local, bends, clusters, limb, np.flatnonzero(reach[limb]))
        limbs.append(one)
        explained = bends[:, one.bends] @ one.slopes.reshape(3 * len(one.own), len(one.bends)).T
        after[:, one.own] -= explained.reshape(len(local), len(one.own), 3) * last.weights[:, one.own, np.newaxis]
    kept = float((after**2).sum()) / max(float((local**2).sum()), np.finfo(np.float64).tiny)
    growth = len(after) / effective_frames(after.reshape(len(after), -1))
    noise = kept * last.noise**2 * growth
    return ObservedDeformations(tuple(limbs), noise)


def _bending_of(
    last: Calibration, local: Floats, bends: Floats, clusters: RigidDisplacements, limb: int, reach: Ints
) -> ClusterDeformation:
    own, some = np.flatnonzero(last.chain.limb_of_marker == limb), bends[:, reach]
    products = (some[:, :, np.newaxis] * some[:, np.newaxis]).reshape(len(some), -1)
    squares = (last.weights[:, own].T @ products).reshape(len(own), len(reach), len(reach))
    rigid = clusters.basis[own][:, :, clusters.limbs == limb]
    rigid = rigid.reshape(3 * len(own), rigid.shape[2])
    inner = np.linalg.svd(rigid, full_matrices=True)[0][:, rigid.shape[1] :].T
    return ClusterDeformation(own, reach, squares, local[:, own].reshape(len(local), 3 * len(own)).T @ some, inner)


def _evidence(ways: tuple[Floats, Floats], variances: Floats) -> Floats:
    """Nats that slides of each variance gain over none."""
    expected, seen = ways
    total = expected + variances[:, np.newaxis]
    return np.asarray((seen / expected - seen / total - np.log(total / expected)).sum(axis=1) / 2)


def deformation_slopes(chain: Chain, seen: ObservedDeformations, variances: Floats) -> Floats:
    """Return slopes of what bends clusters, drawn to nothing by a prior, shape (n_markers, 3, n_bends), mm.

    Parameters
    ----------
    chain : Chain
        The limbs.
    seen : ObservedDeformations
        What is seen.
    variances : ndarray, shape (n_limbs, n_bends), mm^2
        Prior variances of slides; 0 where there are none.
    """
    result = np.zeros((chain.n_markers, 3, variances.shape[1]))
    for limb, one in enumerate(seen.limbs):
        kept = np.flatnonzero(variances[limb, one.bends])
        squares = one.squares.mean(axis=0)[np.ix_(kept, kept)] if len(kept) else np.zeros((0, 0))
        held = squares + np.diag(seen.noise / variances[limb, one.bends[kept]])
        slopes = one.inner.T @ (one.inner @ one.moments[:, kept]) @ np.linalg.inv(held)
        result[np.ix_(one.own, np.arange(3), one.bends[kept])] = slopes.reshape(len(one.own), 3, len(kept))
    return result
