r"""Calibration of a chain with soft tissue: displacements are unknowns with a prior, and not taken for joints.

A cluster that moves in proportion to the flexions shifts the joint that is found, and hardly leaves residuals: a
displacement :math:`\delta \times \varphi` looks like a joint that is :math:`\delta` away. So displacements are fitted
together with the constants of the chain. Their prior has mean 0 and the most likely variance, given how clusters deform
and how far joints fail to meet. The covariance of constants and displacements together says how far joints may be off
by displacements that cannot be observed.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration, calibrate
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, observed, residuals_in_limbs
from skelgen.kinematics.chain.schur_complement import effective_frames
from skelgen.kinematics.inverse.poses import LEAST_NOISE, fit_poses
from skelgen.kinematics.soft_tissue.cluster_deformation import (
    ObservedDeformations,
    deformation_slopes,
    observe_deformations,
)
from skelgen.kinematics.soft_tissue.model import (
    SoftTissue,
    SoftTissueEquations,
    rigid_displacements,
    soft_tissue_at_rest,
    soft_tissue_equations,
)
from skelgen.model.arrays import Floats, Ints, evenly_spread

EQUATION_FRAMES = 100
"""Frames from which soft tissue and its uncertainty are computed, evenly spread: it is slow, more would add nothing."""

LEAST_FRAMES = 20
"""Fewer frames show no soft tissue: the flexions of a limb, three for each joint, would fit anything in them."""

ESTIMATES = 4
"""Rounds in which variances of displacements are estimated."""

WEIGHT_OF_COMMON = 1.0
"""Coefficients that the common variance counts for beside those of a cluster and a joint."""

LEAST_PART = 0.02
"""Of the largest variance: displacements of less are left out."""

MAX_STEPS = 3
"""Steps of constants and displacements together: more hardly improve joints, which the joint prior fits afterwards."""

DIVERGED = 10.0
"""A fit is given up as diverged if its squared residuals exceed those at the start so many times."""

STEP_TOLERANCE = 0.1
"""mm; less than a tenth of what soft tissue leaves uncertain."""

POSE_STEPS = 4
PRIOR_SPREAD = 30.0
"""mm; standard deviation of constants that the frames do not determine (a joint along its hinge)."""


@dataclass(frozen=True, eq=False)
class SoftTissueFit:
    """A chain fitted together with its soft tissue.

    Attributes
    ----------
    chain : Chain
        Limbs, fitted without the displacements.
    articulation : Articulation
        What their joints allow.
    tissue : SoftTissue
        How markers are displaced.
    deformation : ndarray, shape (n_markers, 3, n_flexions), mm
        The part of the slopes that deforms clusters and does not move joints.
    variances : ndarray, shape (n_limbs, n_flexions), mm^2
        Of a coordinate's displacement by each flexion; 0 where the markers of a limb do not follow it.
    """

    chain: Chain
    articulation: Articulation
    tissue: SoftTissue
    deformation: Floats
    variances: Floats


@dataclass(frozen=True, eq=False)
class SoftTissueCalibration:
    """A chain that was calibrated on all frames, with its soft tissue.

    Attributes
    ----------
    calibration : Calibration
        Fitted to the markers without their displacements; its information counts that these are not known either.
    tissue : SoftTissue
        How markers are displaced.
    growth : float
        How many frames determine as much as one independent frame.
    cost : float, mm^2
        What the displacements cost beside the squares of residuals, by how likely displacements so large are.
    """

    calibration: Calibration
    tissue: SoftTissue
    growth: float
    cost: float


def fit_soft_tissue(last: Calibration) -> SoftTissueFit | None:
    """Fit soft tissue together with the chain; None if no cluster deforms with a joint, it diverges, or frames are few.

    Parameters
    ----------
    last : Calibration
        The chain fitted to rigid limbs, frames in the order of time.
    """
    if last.noise <= LEAST_NOISE or last.n_frames < LEAST_FRAMES:
        return None
    tissue = soft_tissue_at_rest(last.chain, last.poses)
    seen = observe_deformations(last, tissue, rigid_displacements(last.chain))
    variances = seen.likely_variances(tissue)
    return _fitted(last, tissue, seen, variances) if variances.any() else None


def _fitted(
    last: Calibration, tissue: SoftTissue, seen: ObservedDeformations, variances: Floats
) -> SoftTissueFit | None:
    """Take Gauss-Newton steps of constants and displacements on some frames; None if they diverge."""
    frames, share = _equation_frames(last)
    chain, articulation, poses = last.chain, last.articulation, last.poses[frames]
    positions, deformation = last.positions[frames], np.zeros_like(tissue.slopes)
    most = DIVERGED * last.at(frames).squares
    for step_number in range(MAX_STEPS):
        rigid = positions - tissue.displacements(chain, poses)
        poses = fit_poses(chain, poses, rigid, articulation)
        here = observed(chain, articulation, poses, rigid)
        if here.squares > most:
            return None
        system = soft_tissue_equations(here, tissue, variances > 0)
        matrix, gradient = share * system.matrix, share * system.gradient
        n = system.n_constants
        matrix[np.arange(n), np.arange(n)] += seen.noise / _prior_spread(system, chain) ** 2
        if step_number == 0:
            scaled = replace(system, matrix=matrix, gradient=gradient)
            variances = _estimated_variances(scaled, tissue, seen, variances)
            deformation = deformation_slopes(chain, seen, variances)
            scaled = scaled.without(variances[system.limbs, system.flexion] == 0)
            system, matrix, gradient = scaled, scaled.matrix.copy(), scaled.gradient.copy()
        prior = seen.noise / variances[system.limbs, system.flexion]
        coefficients = system.coefficients(tissue.slopes - deformation)
        gradient[n:] -= prior * coefficients
        matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
        step: Floats = np.asarray(np.linalg.solve(matrix, gradient))
        moved = _stepped(here, system, step)
        chain, articulation, poses = moved.chain, moved.articulation, moved.poses
        tissue = tissue.with_slopes(system.slopes(coefficients + step[n:], len(tissue.joints)) + deformation)
        # Flexions follow the poses, and poses the displacements
        poses = fit_poses(chain, poses, positions - tissue.displacements(chain, poses), articulation, None, POSE_STEPS)
        if np.abs(step[: system.n_joints]).max(initial=0.0) < STEP_TOLERANCE:
            break
    return SoftTissueFit(chain, articulation, tissue, deformation, variances)


def calibrate_soft_tissue(fit: SoftTissueFit, poses: ChainPoses, positions: Floats) -> SoftTissueCalibration:
    """Take the last step on all frames, and compute the information of the constants.

    Parameters
    ----------
    fit : SoftTissueFit
        From `fit_soft_tissue`.
    poses : ChainPoses
        Poses of the markers without their displacements.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, as given to `fit_soft_tissue`.
    """
    chain, articulation, tissue = fit.chain, fit.articulation, fit.tissue
    rigid = positions - tissue.displacements(chain, poses)
    last = calibrate(chain, poses, rigid, 0, articulation)
    growth = len(rigid) / effective_frames(residuals_in_limbs(chain, last.poses, rigid).reshape(len(rigid), -1))
    variance, (frames, share) = growth * last.noise**2, _equation_frames(last)
    some = observed(chain, articulation, last.poses[frames], rigid[frames])
    system = soft_tissue_equations(some, tissue, fit.variances > 0)
    n, prior = system.n_constants, variance / fit.variances[system.limbs, system.flexion]
    matrix = share * system.matrix
    matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
    reduced = matrix[:n, :n] - matrix[:n, n:] @ np.linalg.solve(matrix[n:, n:], matrix[n:, :n])
    gradient = system.gradient_of(last, tissue)
    coefficients = system.coefficients(tissue.slopes - fit.deformation)
    gradient[n:] -= prior * coefficients
    held = matrix + np.diag(np.concatenate([variance / _prior_spread(system, chain) ** 2, np.zeros(len(prior))]))
    step: Floats = np.asarray(np.linalg.solve(held, gradient))
    moved = _stepped(replace(last, articulation=articulation), system, step)
    chain, articulation, found = moved.chain, moved.articulation, moved.poses
    coefficients += step[n:]
    tissue = tissue.with_slopes(system.slopes(coefficients, len(tissue.joints)) + fit.deformation)
    rigid = positions - tissue.displacements(chain, found)
    found = fit_poses(chain, found, rigid, articulation, None, POSE_STEPS)
    information = _information_of_offsets(reduced, system, last.weights.sum(axis=0))
    fitted = replace(last, chain=chain, articulation=articulation, poses=found, positions=rigid)
    known = replace(fitted, known_information=information)
    return SoftTissueCalibration(known, tissue, growth, float(prior @ coefficients**2))


def _information_of_offsets(reduced: Floats, system: SoftTissueEquations, sights: Floats) -> Floats:
    """Information of offsets, joints and axes from that of joints, axes and rigid displacements.

    Deformations of a cluster are determined by the observations of its markers alone.
    """
    basis = system.clusters.basis
    n_markers, _, n_rigid = basis.shape
    n_axes = system.n_constants - system.n_joints - n_rigid
    from_offsets = np.zeros((system.n_constants, 3 * n_markers + system.n_joints + n_axes))
    from_offsets[: system.n_joints, 3 * n_markers : 3 * n_markers + system.n_joints] = np.eye(system.n_joints)
    from_offsets[system.n_joints : system.n_joints + n_axes, 3 * n_markers + system.n_joints :] = np.eye(n_axes)
    from_offsets[system.n_joints + n_axes :, : 3 * n_markers] = basis.reshape(-1, n_rigid).T
    information = from_offsets.T @ reduced @ from_offsets
    each = np.sqrt(np.repeat(sights, 3))
    flat = basis.reshape(-1, n_rigid)
    information[: 3 * n_markers, : 3 * n_markers] += (np.eye(3 * n_markers) - flat @ flat.T) * np.outer(each, each)
    return np.asarray((information + information.T) / 2)


def _equation_frames(last: Calibration) -> tuple[Ints, float]:
    """Evenly spread frames among those that show anything, and how many of all frames each stands for."""
    shown = np.flatnonzero((last.weights > 0).any(axis=1))
    frames = evenly_spread(shown, EQUATION_FRAMES)
    return frames, float(last.weights.sum() / max(last.weights[frames].sum(), 1.0))


def _estimated_variances(
    system: SoftTissueEquations, tissue: SoftTissue, seen: ObservedDeformations, variances: Floats
) -> Floats:
    """Variances of the displacements of each limb by each flexion, from deformations and from joints that fail to meet.

    MacKay's updates (1992, *Bayesian interpolation*): a variance is the sum of squares divided by the number of
    coefficients that the data determine.
    """
    n, matrix, gradient = system.n_constants, system.matrix, system.gradient
    across = np.linalg.solve(matrix[:n, :n], np.column_stack([matrix[:n, n:], gradient[:n]]))
    reduced = (matrix[n:, n:] - matrix[n:, :n] @ across[:, :-1]) / seen.noise
    left = (gradient[n:] - matrix[n:, :n] @ across[:, -1]) / seen.noise
    found, limbs, flexion = variances.copy(), system.limbs, system.flexion
    of_joint = tissue.joints[:, np.newaxis] == tissue.joints
    for _ in range(ESTIMATES):
        prior = found[limbs, flexion]
        spread = np.linalg.inv(reduced + np.diag(1 / prior))
        squares, determined = np.zeros_like(found), np.zeros_like(found)
        np.add.at(squares, (limbs, flexion), (spread @ left) ** 2)
        np.add.at(determined, (limbs, flexion), 1 - np.diag(spread) / prior)
        _add_deformations(seen, found, squares, determined)
        # One variance for all flexions of a joint, drawn to the common one.
        squares, determined = squares @ of_joint, determined @ of_joint
        drawn = (WEIGHT_OF_COMMON * variances + squares) / (WEIGHT_OF_COMMON + determined)
        found = np.where(variances > 0, drawn, 0.0)
    return np.asarray(np.where(found > LEAST_PART * found.max(), found, 0.0))


def _add_deformations(seen: ObservedDeformations, variances: Floats, squares: Floats, determined: Floats) -> None:
    for limb, one in enumerate(seen.limbs):
        kept = variances[limb, one.flexions] > 0
        information, gradient = (part[:, kept] / seen.noise for part in one.modal_equations())
        prior = variances[limb, one.flexions[kept]]
        spread = 1 / (information + 1 / prior)
        squares[limb, one.flexions[kept]] += ((spread * gradient) ** 2).sum(axis=0)
        determined[limb, one.flexions[kept]] += (1 - spread / prior).sum(axis=0)


def _prior_spread(system: SoftTissueEquations, chain: Chain) -> Floats:
    """Standard deviation of each constant that nothing determines: mm, of tilts rad."""
    spread = np.full(system.n_constants, PRIOR_SPREAD)
    tilts = slice(system.n_joints, system.n_constants - len(system.clusters.limbs))
    spread[tilts] /= max(np.sqrt(3 * float((chain.offsets**2).mean())), 1.0)
    return spread


def _stepped(here: ObservedChain, system: SoftTissueEquations, step: Floats) -> ObservedChain:
    """Apply a step of the constants to a chain, its joints, and poses that follow them."""
    first_rigid = system.n_constants - len(system.clusters.limbs)
    offsets = system.clusters.basis @ step[first_rigid : system.n_constants]
    return here.stepped(offsets, step[: system.n_joints], step[system.n_joints : first_rigid])
