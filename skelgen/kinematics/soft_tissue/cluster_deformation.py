r"""Deformations of marker clusters that follow the joints of their limb: soft tissue that is seen without a fit.

What the markers of a limb do in its frame is a rigid displacement of the cluster and its deformation. The rigid part
cannot be told from an error of the pose. But where the deformation follows the flexions of a joint, the rigid
displacement usually does so, too.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.chain.chain import Chain, residuals_in_limbs
from skelgen.kinematics.chain.schur_complement import effective_frames
from skelgen.kinematics.soft_tissue.model import RigidDisplacements, SoftTissue
from skelgen.model.arrays import Floats, Ints

VARIANCES = np.geomspace(1e-4, 1e4, 161)
"""Variances of displacements that are tried, in units of that of the noise: 12 % apart."""

SURE = 6.0
"""Nats by which a joint's flexions must explain the deformation of a cluster, for displacements to be fitted at all."""

DOUBTFUL = -8.0
"""Nats above which displacements by a joint are not ruled out: three markers may move without deforming."""


@dataclass(frozen=True, eq=False)
class ClusterDeformation:
    """What is seen of a limb's cluster before any displacement is fitted.

    Attributes
    ----------
    own : ndarray of intp, shape (n_own,)
        Markers of the limb.
    flexions : ndarray of intp, shape (n_flexions,)
        Flexions of its joints.
    squares : ndarray, shape (n_own, n_flexions, n_flexions)
        Sums of products of flexions over the frames that show each marker.
    moments : ndarray, shape (3 n_own, n_flexions), mm
        Sums of residuals times flexions.
    modes : ndarray, shape (n_modes, 3 n_own)
        Orthonormal deformations of the cluster.
    """

    own: Ints
    flexions: Ints
    squares: Floats
    moments: Floats
    modes: Floats

    @cached_property
    def slopes(self) -> Floats:
        """Slopes of the residuals by the flexions (least squares) [mm], shape (n_own, 3, n_flexions)."""
        inverse = np.linalg.pinv(self.squares, hermitian=True)
        return np.asarray(self.moments.reshape(len(self.own), 3, len(self.flexions)) @ inverse)

    def modal_equations(self) -> tuple[Floats, Floats]:
        """Return information and gradient of each mode for each flexion, shape (n_modes, n_flexions) each."""
        squares = np.diagonal(self.squares, axis1=1, axis2=2).sum(axis=0) / max(len(self.own), 1)
        return np.tile(squares, (len(self.modes), 1)), np.asarray(self.modes @ self.moments)

    def with_joint(self, tissue: SoftTissue, joint: int, noise: float) -> tuple[Floats, Floats]:
        """Return the variance of each mode that one joint explains and no other does: as noise gives it, and as
        observed.

        Both are in units of a displacement of the variance of the noise.

        Parameters
        ----------
        tissue : SoftTissue
            With the joint of each flexion.
        joint : int
            Limb below the joint.
        noise : float, mm^2
            Variance of a coordinate.
        """
        if not len(self.modes):
            return np.zeros(0), np.zeros(0)
        chosen = np.flatnonzero(tissue.joints[self.flexions] == joint)
        spread = np.linalg.pinv(self.squares.mean(axis=0), hermitian=True)[np.ix_(chosen, chosen)]
        values, vectors = np.linalg.eigh(spread)
        turned = values > len(values) * np.finfo(np.float64).eps * values.max(initial=0.0)  # else never turned
        values, vectors = values[turned], vectors[:, turned]
        modes = (self.modes @ self.slopes.reshape(3 * len(self.own), len(self.flexions)))[:, chosen] @ vectors
        expected = np.tile(values, (len(modes), 1))
        return (expected * len(chosen)).ravel(), (modes**2 * len(chosen) / noise).ravel()


@dataclass(frozen=True, eq=False)
class ObservedDeformations:
    """What is seen of all clusters.

    Attributes
    ----------
    limbs : tuple of ClusterDeformation
        By limb; empty arrays for limbs without markers or flexions.
    noise : float, mm^2
        Variance of a coordinate that follows no flexion, times the number of frames that count as one independent.
    """

    limbs: tuple[ClusterDeformation, ...]
    noise: float

    def likely_variances(self, tissue: SoftTissue) -> Floats:
        """Return prior variances of displacements [mm^2], shape (n_limbs, n_flexions).

        All displacements that are not ruled out have the same variance. All are 0 if no cluster deforms with a joint.
        """
        joints = [np.unique(tissue.joints[one.flexions]) for one in self.limbs]
        pairs = [(limb, joint) for limb, own in enumerate(joints) for joint in own]
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
    """Find deformations of clusters in the residuals of a fit.

    Parameters
    ----------
    last : Calibration
        Fitted to rigid limbs, frames in the order of time.
    tissue : SoftTissue
        With the flexions.
    clusters : RigidDisplacements
        Rigid displacements of the markers.
    """
    local = residuals_in_limbs(last.chain, last.poses, last.positions)
    flexions, reach = tissue.flexions(last.chain, last.poses), tissue.reach(last.chain)
    limbs, after = [], local.copy()
    for limb in range(last.chain.n_limbs):
        own, followed = np.flatnonzero(last.chain.limb_of_marker == limb), np.flatnonzero(reach[limb])
        some = flexions[:, followed]
        products = (some[:, :, np.newaxis] * some[:, np.newaxis]).reshape(len(some), -1)
        squares = (last.weights[:, own].T @ products).reshape(len(own), len(followed), len(followed))
        moments = local[:, own].reshape(len(local), 3 * len(own)).T @ some
        rigid = clusters.basis[own][:, :, clusters.limbs == limb]
        rigid = rigid.reshape(3 * len(own), rigid.shape[2])
        modes = np.linalg.svd(rigid, full_matrices=True)[0][:, rigid.shape[1] :].T
        one = ClusterDeformation(own, followed, squares, moments, modes)
        limbs.append(one)
        explained = flexions[:, one.flexions] @ one.slopes.reshape(3 * len(one.own), len(one.flexions)).T
        after[:, one.own] -= explained.reshape(len(local), len(one.own), 3) * last.weights[:, one.own, np.newaxis]
    kept = float((after**2).sum()) / max(float((local**2).sum()), np.finfo(np.float64).tiny)
    growth = len(after) / effective_frames(after.reshape(len(after), -1))
    noise = kept * last.noise**2 * growth
    return ObservedDeformations(tuple(limbs), noise)


def _evidence(modes: tuple[Floats, Floats], variances: Floats) -> Floats:
    """Nats that displacements of each variance gain over none."""
    expected, seen = modes
    total = expected + variances[:, np.newaxis]
    return np.asarray((seen / expected - seen / total - np.log(total / expected)).sum(axis=1) / 2)


def deformation_slopes(chain: Chain, seen: ObservedDeformations, variances: Floats) -> Floats:
    """Return slopes of the deformations with a prior, shape (n_markers, 3, n_flexions), mm.

    Parameters
    ----------
    chain : Chain
        The limbs.
    seen : ObservedDeformations
        What is seen.
    variances : ndarray, shape (n_limbs, n_flexions), mm^2
        Prior variances of displacements; 0 where there are none.
    """
    result = np.zeros((chain.n_markers, 3, variances.shape[1]))
    for limb, one in enumerate(seen.limbs):
        kept = np.flatnonzero(variances[limb, one.flexions])
        squares = one.squares.mean(axis=0)[np.ix_(kept, kept)] if len(kept) else np.zeros((0, 0))
        held = squares + np.diag(seen.noise / variances[limb, one.flexions[kept]])
        slopes = one.modes.T @ (one.modes @ one.moments[:, kept]) @ np.linalg.inv(held)
        result[np.ix_(one.own, np.arange(3), one.flexions[kept])] = slopes.reshape(len(one.own), 3, len(kept))
    return result
