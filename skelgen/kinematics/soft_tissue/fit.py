r"""A chain fitted to markers that slide: slides are unknowns with a prior, so that they do not pass for joints.

A cluster that slides in proportion to the bends moves the joint that is found, and hardly leaves residuals: a slide
:math:`\delta \times \varphi` looks like a joint that is :math:`\delta` away. So slides are fitted together with the
constants of the chain, drawn to nothing by a prior whose variance is that which makes all that is seen of them most
likely: how clusters bend, and how their joints fail to meet. The common covariance of both tells how far
joints may be off by slides that nothing shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.kinematics.calibration.calibrate import Calibration, calibrate
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals_in_limbs
from skelgen.kinematics.chain.normal_equations import constant_gradient
from skelgen.kinematics.chain.schur_complement import effective_frames
from skelgen.kinematics.inverse.poses import LEAST_NOISE, fit_poses
from skelgen.kinematics.soft_tissue.cluster_deformation import (
    ObservedDeformations,
    deformation_slopes,
    observe_deformations,
)
from skelgen.kinematics.soft_tissue.model import SoftTissue, soft_tissue_at_rest
from skelgen.kinematics.soft_tissue.normal_equations import (
    SoftTissueEquations,
    rigid_displacements,
    soft_tissue_equations,
)
from skelgen.model.arrays import Floats, Ints

SYSTEM_FRAMES = 100
"""Frames on which slides and their uncertainty rest, evenly spread: soft tissue is slow, more would tell the same."""

ESTIMATES = 4
"""Rounds in which variances of slides are estimated."""

WEIGHT_OF_COMMON = 1.0
"""Numbers that the common variance counts for beside those of a cluster and a joint."""

LEAST_PART = 0.02
"""Of the largest variance: slides of less are left out."""

MAX_STEPS = 5
STEP_TOLERANCE = 0.1
"""mm; less than a tenth of what soft tissue leaves uncertain."""

POSE_STEPS = 4
LOOSE = 30.0
"""mm; constants that the frames do not determine (a joint along its hinge) move little with this spread."""


@dataclass(frozen=True, eq=False)
class SoftTissueFit:
    """A chain whose markers slide.

    Attributes
    ----------
    chain, articulation
        Fitted without the slides.
    tissue : SoftTissue
        The slides.
    bending : ndarray, shape (n_markers, 3, n_bends), mm
        The part of the slopes that bends clusters and tells nothing of joints.
    variances : ndarray, shape (n_limbs, n_bends), mm^2
        Of a coordinate's slides with each bend; 0 where the markers of a limb do not follow it.
    """

    chain: Chain
    articulation: Articulation
    tissue: SoftTissue
    bending: Floats
    variances: Floats


@dataclass(frozen=True, eq=False)
class SoftTissueCalibration:
    """The chain of all frames, fitted without slides.

    Attributes
    ----------
    calibration : Calibration
        Its information counts that slides are not known either.
    tissue : SoftTissue
        The slides.
    growth : float
        How many frames tell as much as one that is independent.
    """

    calibration: Calibration
    tissue: SoftTissue
    growth: float


def fit_soft_tissue(last: Calibration) -> SoftTissueFit | None:
    """Fit slides of markers, and the chain with them; None if there is no sign of slides.

    Parameters
    ----------
    last : Calibration
        The chain fitted to markers that do not slide, frames in the order of time.
    """
    if last.noise <= LEAST_NOISE:
        return None
    tissue = soft_tissue_at_rest(last.chain, last.poses)
    seen = observe_deformations(last, tissue, rigid_displacements(last.chain))
    variances = seen.likely_slides(tissue)
    return _fitted(last, tissue, seen, variances) if variances.any() else None


def _fitted(last: Calibration, tissue: SoftTissue, seen: ObservedDeformations, variances: Floats) -> SoftTissueFit:
    """Gauss-Newton steps of constants and slides on some frames."""
    frames, share = _system_frames(last)
    chain, articulation, poses = last.chain, last.articulation, last.poses[frames]
    positions, bent = last.positions[frames], np.zeros_like(tissue.slopes)
    for step_number in range(MAX_STEPS):
        without = positions - tissue.slides(chain, poses)
        system = soft_tissue_equations(chain, articulation, poses, without, tissue, variances > 0, last.noise)
        matrix, pull = share * system.matrix, share * system.pull
        n = system.n_constants
        matrix[np.arange(n), np.arange(n)] += seen.noise / _looseness(system, chain) ** 2
        if step_number == 0:
            variances = _estimated(matrix, pull, system, tissue, seen, variances)
            bent = deformation_slopes(chain, seen, variances)
            kept = np.append(np.ones(n, dtype=bool), variances[system.limbs, system.bend] > 0)
            system = system.without(~kept[n:])
            matrix, pull = matrix[np.ix_(kept, kept)], pull[kept]
        prior = seen.noise / variances[system.limbs, system.bend]
        slides = system.slides(tissue.slopes - bent)
        pull[n:] -= prior * slides
        matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
        step: Floats = np.asarray(np.linalg.solve(matrix, pull))
        chain, articulation, poses = _stepped(chain, articulation, poses, system, step)
        tissue = tissue.with_slopes(system.slopes(slides + step[n:], len(tissue.joints)) + bent)
        for _ in range(2):  # bends follow the poses, and poses the slides
            poses = fit_poses(chain, poses, positions - tissue.slides(chain, poses), articulation, None, POSE_STEPS)
        if np.abs(step[: system.n_joints]).max(initial=0.0) < STEP_TOLERANCE:
            break
    return SoftTissueFit(chain, articulation, tissue, bent, variances)


def calibrate_soft_tissue(sliding: SoftTissueFit, poses: ChainPoses, positions: Floats) -> SoftTissueCalibration:
    """Take the last step with what all frames tell, and find out how sure everything is.

    Parameters
    ----------
    sliding : SoftTissueFit
        From `fit_soft_tissue`.
    poses : ChainPoses
        Poses of the markers without their slides.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, as given to `fit_soft_tissue`.
    """
    chain, articulation = sliding.chain, sliding.articulation
    still = positions - sliding.tissue.slides(chain, poses)
    last = calibrate(chain, poses, still, 0, articulation)
    growth = len(still) / effective_frames(residuals_in_limbs(chain, last.poses, still).reshape(len(still), -1))
    variance, (frames, share) = growth * last.noise**2, _system_frames(last)
    some, tissue = last.poses[frames], sliding.tissue
    system = soft_tissue_equations(chain, articulation, some, still[frames], tissue, sliding.variances > 0, last.noise)
    n, prior = system.n_constants, variance / sliding.variances[system.limbs, system.bend]
    matrix = share * system.matrix
    matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
    known = matrix[:n, :n] - matrix[:n, n:] @ np.linalg.solve(matrix[n:, n:], matrix[n:, :n])
    pull = _pull_of_all(last, still, system, tissue)
    slides = system.slides(tissue.slopes - sliding.bending)
    pull[n:] -= prior * slides
    held = matrix + np.diag(np.concatenate([variance / _looseness(system, chain) ** 2, np.zeros(len(prior))]))
    step: Floats = np.asarray(np.linalg.solve(held, pull))
    chain, articulation, settled = _stepped(chain, articulation, last.poses, system, step)
    tissue = tissue.with_slopes(system.slopes(slides + step[n:], len(tissue.joints)) + sliding.bending)
    still = positions - tissue.slides(chain, settled)
    settled = fit_poses(chain, settled, still, articulation, None, POSE_STEPS)
    information = _of_offsets(known, system, last.weights.sum(axis=0))
    last = replace(last, chain=chain, articulation=articulation, poses=settled, positions=still, known=information)
    return SoftTissueCalibration(last, tissue, growth)


def _pull_of_all(last: Calibration, positions: Floats, system: SoftTissueEquations, tissue: SoftTissue) -> Floats:
    """How the residuals of all frames pull at the columns of a system."""
    chain, clusters = last.chain, system.clusters
    pull = constant_gradient(chain, last.articulation, last.poses, positions, last.weights)
    n_places = 3 * chain.n_markers
    rigid = clusters.of_markers(pull[:n_places, np.newaxis])[:, 0]
    flat = residuals_in_limbs(chain, last.poses, positions).reshape(len(positions), -1)
    return np.concatenate([pull[n_places:], rigid, system.slides(flat.T @ tissue.bends(chain, last.poses))])


def _of_offsets(known: Floats, system: SoftTissueEquations, sights: Floats) -> Floats:
    """Information of offsets, joints and axes from that of joints, axes and rigid displacements.

    What bends a cluster is known from the sights of its markers alone.
    """
    basis = system.clusters.basis
    n_markers, _, n_rigid = basis.shape
    n_axes = system.n_constants - system.n_joints - n_rigid
    from_offsets = np.zeros((system.n_constants, 3 * n_markers + system.n_joints + n_axes))
    from_offsets[: system.n_joints, 3 * n_markers : 3 * n_markers + system.n_joints] = np.eye(system.n_joints)
    from_offsets[system.n_joints : system.n_joints + n_axes, 3 * n_markers + system.n_joints :] = np.eye(n_axes)
    from_offsets[system.n_joints + n_axes :, : 3 * n_markers] = basis.reshape(-1, n_rigid).T
    information = from_offsets.T @ known @ from_offsets
    each = np.sqrt(np.repeat(sights, 3))
    flat = basis.reshape(-1, n_rigid)
    bending = (np.eye(3 * n_markers) - flat @ flat.T) * np.outer(each, each)
    information[: 3 * n_markers, : 3 * n_markers] += bending
    return np.asarray((information + information.T) / 2)


def _system_frames(last: Calibration) -> tuple[Ints, float]:
    """Evenly spread frames among those that show anything, and how many of all frames each stands for."""
    shown = np.flatnonzero((last.weights > 0).any(axis=1))
    frames = shown[np.unique(np.linspace(0, len(shown) - 1, min(len(shown), SYSTEM_FRAMES)).astype(np.intp))]
    return frames, float(last.weights.sum() / max(last.weights[frames].sum(), 1.0))


def _estimated(
    matrix: Floats,
    pull: Floats,
    system: SoftTissueEquations,
    tissue: SoftTissue,
    seen: ObservedDeformations,
    variances: Floats,
) -> Floats:
    """Variances of the slides of each limb with each of its joints, from how clusters bend and joints fail to meet.

    MacKay's updates (1992, *Bayesian interpolation*): a variance is the sum of squares over the numbers that data tell.
    """
    n = system.n_constants
    across = np.linalg.solve(matrix[:n, :n], np.column_stack([matrix[:n, n:], pull[:n]]))
    reduced = (matrix[n:, n:] - matrix[n:, :n] @ across[:, :-1]) / seen.noise
    left = (pull[n:] - matrix[n:, :n] @ across[:, -1]) / seen.noise
    found, limbs, bend = variances.copy(), system.limbs, system.bend
    for _ in range(ESTIMATES):
        prior = found[limbs, bend]
        spread = np.linalg.inv(reduced + np.diag(1 / prior))
        squares, told = np.zeros_like(found), np.zeros_like(found)
        np.add.at(squares, (limbs, bend), (spread @ left) ** 2)
        np.add.at(told, (limbs, bend), 1 - np.diag(spread) / prior)
        _add_bending(seen, found, squares, told)
        found = _shared_by_joint(tissue, variances, squares, told)
    return np.asarray(np.where(found > LEAST_PART * found.max(), found, 0.0))


def _add_bending(seen: ObservedDeformations, variances: Floats, squares: Floats, told: Floats) -> None:
    for limb, one in enumerate(seen.limbs):
        kept = variances[limb, one.bends] > 0
        information, pull = (ways[:, kept] / seen.noise for ways in one.ways())
        prior = variances[limb, one.bends[kept]]
        spread = 1 / (information + 1 / prior)
        squares[limb, one.bends[kept]] += ((spread * pull) ** 2).sum(axis=0)
        told[limb, one.bends[kept]] += (1 - spread / prior).sum(axis=0)


def _shared_by_joint(tissue: SoftTissue, common: Floats, squares: Floats, told: Floats) -> Floats:
    """One variance for all bends of a joint, drawn to the common one."""
    of_joint = tissue.joints[:, np.newaxis] == tissue.joints
    squares, told = squares @ of_joint, told @ of_joint
    variance = (WEIGHT_OF_COMMON * common + squares) / (WEIGHT_OF_COMMON + told)
    return np.asarray(np.where(common > 0, variance, 0.0))


def _looseness(system: SoftTissueEquations, chain: Chain) -> Floats:
    """How far each constant may go if nothing determines it: mm, of tilts rad."""
    loose = np.full(system.n_constants, LOOSE)
    tilts = slice(system.n_joints, system.n_constants - len(system.clusters.limbs))
    loose[tilts] /= max(np.sqrt(3 * float((chain.offsets**2).mean())), 1.0)
    return loose


def _stepped(
    chain: Chain, articulation: Articulation, poses: ChainPoses, system: SoftTissueEquations, step: Floats
) -> tuple[Chain, Articulation, ChainPoses]:
    n_rigid = len(system.clusters.limbs)
    joints = chain.joints.copy()
    joints[1:] += step[: system.n_joints].reshape(-1, 3)
    offsets = chain.offsets + system.clusters.basis @ step[system.n_constants - n_rigid : system.n_constants]
    tilts: Floats = np.asarray(step[system.n_joints : system.n_constants - n_rigid])
    changed, rotations = articulation.tilted(chain.parents, poses.rotations, tilts)
    return chain.moved(joints, offsets), changed, ChainPoses(poses.root, rotations)
