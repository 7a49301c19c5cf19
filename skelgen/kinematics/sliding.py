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

from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.calibration import Calibration, calibrate
from skelgen.kinematics.chain import Chain, ChainPoses, residuals, seen_weights
from skelgen.kinematics.correlated import effective_frames
from skelgen.kinematics.pose_covariances import LEAST_NOISE
from skelgen.kinematics.posing import fit_poses
from skelgen.kinematics.pull import constant_pull
from skelgen.kinematics.skin import Skin, skin_at_rest
from skelgen.kinematics.sliding_system import Clusters, SlidingSystem, sliding_system
from skelgen.model.arrays import Floats, Ints

SYSTEM_FRAMES = 100
"""Frames on which slides and their uncertainty rest, evenly spread: soft tissue is slow, more would tell the same."""

VARIANCES = np.geomspace(1e-4, 1e4, 161)
"""Variances of slides that are tried, in units of the noise's: 12 % apart."""

LEAST_EVIDENCE = 5.0
"""Nats by which slides must make the take more likely to be believed."""

MAX_STEPS = 5
STEP_TOLERANCE = 0.1
"""mm; less than a tenth of what soft tissue leaves uncertain."""

POSE_STEPS = 4
LOOSE = 30.0
"""mm; constants that the frames do not determine (a joint along its hinge) move little with this spread."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """A chain whose markers slide.

    Attributes
    ----------
    chain, articulation
        Fitted without the slides.
    skin : Skin
        The slides.
    bending : ndarray, shape (n_markers, 3, 3), mm
        The part of the slopes that bends clusters and tells nothing of joints.
    variance : float, mm^2
        Of a coordinate's slides.
    """

    chain: Chain
    articulation: Articulation
    skin: Skin
    bending: Floats
    variance: float


@dataclass(frozen=True, eq=False)
class Settled:
    """The chain of all frames, fitted without slides.

    Attributes
    ----------
    calibration : Calibration
        Its information counts that slides are not known either.
    skin : Skin
        The slides.
    growth : float
        How many frames tell as much as one that is independent.
    """

    calibration: Calibration
    skin: Skin
    growth: float


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is seen of slides before any is fitted: moments of residuals in the limbs' frames with bends.

    Attributes
    ----------
    bends : ndarray, shape (n_markers, 3, 3)
        Sums of products of bends.
    moments : ndarray, shape (n_markers, 3, 3), mm
        Sums of residuals times bends.
    noise : float, mm^2
        Variance of a coordinate that follows no bend, times the frames that tell as much as one.
    """

    bends: Floats
    moments: Floats
    noise: float


def fit_sliding(last: Calibration, positions: Floats) -> Sliding | None:
    """Fit slides of markers, and the chain with them; None if there is no sign of slides.

    Parameters
    ----------
    last : Calibration
        The chain fitted to markers that do not slide.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What it was fitted to, in the order of time.
    """
    if last.noise <= LEAST_NOISE:
        return None
    skin = skin_at_rest(last.chain, last.poses)
    seen = _seen_slides(last, positions, skin)
    everywhere = np.diagonal(seen.bends, axis1=1, axis2=2)[:, np.newaxis] * np.ones((1, 3, 1))
    if _evidence(everywhere.ravel(), seen.moments.ravel(), seen.noise).max() < LEAST_EVIDENCE:
        return None
    frames = _system_frames(positions)
    share = seen_weights(positions).sum() / max(seen_weights(positions[frames]).sum(), 1.0)
    return _settled(last, positions[frames], frames, skin, seen, float(share))


def _settled(
    last: Calibration, positions: Floats, frames: Ints, skin: Skin, seen: _Seen, share: float
) -> Sliding | None:
    """Gauss-Newton steps of constants and slides on some frames, each of which counts `share` times."""
    chain, articulation, poses = last.chain, last.articulation, last.poses[frames]
    variance, bent = 0.0, np.zeros_like(skin.slopes)
    for step_number in range(MAX_STEPS):
        without = positions - skin.slides(chain, poses)
        system = sliding_system(chain, articulation, poses, without, skin, last.noise)
        matrix, pull = share * system.matrix, share * system.pull
        n = system.n_constants
        matrix[np.arange(n), np.arange(n)] += seen.noise / _looseness(system, chain) ** 2
        if step_number == 0:
            variance, evidence = _likeliest_variance(matrix, pull, system, chain, skin, seen)
            if evidence < LEAST_EVIDENCE:
                return None
            bent = _bent_slopes(system.clusters, skin, chain, seen, variance)
        prior = system.n_bends * seen.noise / variance
        slides = system.slides(skin.slopes - bent)
        pull[n:] -= prior * slides
        matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
        step: Floats = np.asarray(np.linalg.solve(matrix, pull))
        chain, articulation, poses = _stepped(chain, articulation, poses, system, step)
        skin = skin.with_slopes(system.slopes(slides + step[n:]) + bent)
        for _ in range(2):  # bends follow the poses, and poses the slides
            poses = fit_poses(chain, poses, positions - skin.slides(chain, poses), articulation, None, POSE_STEPS)
        if np.abs(step[: system.n_joints]).max(initial=0.0) < STEP_TOLERANCE:
            break
    return Sliding(chain, articulation, skin, bent, variance)


def settle_sliding(sliding: Sliding, poses: ChainPoses, positions: Floats) -> Settled:
    """Take the last step with what all frames tell, and find out how sure everything is.

    Parameters
    ----------
    sliding : Sliding
        From `fit_sliding`.
    poses : ChainPoses
        Poses of the markers without their slides.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, as given to `fit_sliding`.
    """
    chain, articulation = sliding.chain, sliding.articulation
    still = positions - sliding.skin.slides(chain, poses)
    last = calibrate(chain, poses, still, 0, articulation)
    growth = len(still) / effective_frames(_in_limbs(last, still).reshape(len(still), -1))
    variance = growth * last.noise**2
    frames = _system_frames(still)
    share = last.weights.sum() / max(last.weights[frames].sum(), 1.0)
    system = sliding_system(chain, articulation, last.poses[frames], still[frames], sliding.skin, last.noise)
    n, prior = system.n_constants, system.n_bends * variance / sliding.variance
    matrix = share * system.matrix
    matrix[np.arange(n, len(matrix)), np.arange(n, len(matrix))] += prior
    known = matrix[:n, :n] - matrix[:n, n:] @ np.linalg.solve(matrix[n:, n:], matrix[n:, :n])
    pull = _pull_of_all(last, still, system, sliding.skin)
    slides = system.slides(sliding.skin.slopes - sliding.bending)
    pull[n:] -= prior * slides
    held = matrix + np.diag(np.concatenate([variance / _looseness(system, chain) ** 2, np.zeros(len(prior))]))
    step: Floats = np.asarray(np.linalg.solve(held, pull))
    chain, articulation, settled = _stepped(chain, articulation, last.poses, system, step)
    skin = sliding.skin.with_slopes(system.slopes(slides + step[n:]) + sliding.bending)
    still = positions - skin.slides(chain, settled)
    settled = fit_poses(chain, settled, still, articulation, None, POSE_STEPS)
    information = _of_offsets(known, system, last.weights.sum(axis=0))
    last = replace(last, chain=chain, articulation=articulation, poses=settled, positions=still, known=information)
    return Settled(last, skin, growth)


def _pull_of_all(last: Calibration, positions: Floats, system: SlidingSystem, skin: Skin) -> Floats:
    """How the residuals of all frames pull at the columns of a system."""
    chain, clusters = last.chain, system.clusters
    pull = constant_pull(chain, last.articulation, last.poses, positions, last.weights)
    n_places = 3 * chain.n_markers
    rigid = pull[:n_places] @ clusters.basis.reshape(n_places, -1)
    bends = skin.bends(chain, last.poses)[:, chain.limb_of_marker]
    moments = np.einsum("fmi,fma->mia", _in_limbs(last, positions), bends, optimize=True)
    return np.concatenate([pull[n_places:], rigid, system.slides(moments)])


def _of_offsets(known: Floats, system: SlidingSystem, sights: Floats) -> Floats:
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


def _system_frames(positions: Floats) -> Ints:
    shown = np.flatnonzero((~np.isnan(positions[:, :, 0])).any(axis=1))
    return np.asarray(shown[np.unique(np.linspace(0, len(shown) - 1, min(len(shown), SYSTEM_FRAMES)).astype(np.intp))])


def _seen_slides(last: Calibration, positions: Floats, skin: Skin) -> _Seen:
    chain, poses, weights = last.chain, last.poses, seen_weights(positions)
    limb = chain.limb_of_marker
    local = _in_limbs(last, positions).transpose(1, 2, 0)
    bends = skin.bends(chain, poses).transpose(1, 0, 2)[limb] * weights.T[:, :, np.newaxis]
    squares, moments = bends.swapaxes(1, 2) @ bends, local @ bends
    slopes = moments @ np.linalg.pinv(squares, hermitian=True)
    after = local - slopes @ bends.swapaxes(1, 2)
    kept = float((after**2).sum()) / max(float((local**2).sum()), np.finfo(np.float64).tiny)
    growth = len(weights) / effective_frames(after.reshape(-1, len(weights)).T)
    return _Seen(squares, moments, kept * last.noise**2 * growth)


def _evidence(information: Floats, pull: Floats, noise: float) -> Floats:
    """Nats that each of `VARIANCES` gains over none, for unknowns with independent normal equations."""
    spread = VARIANCES[:, np.newaxis] * information
    gain = VARIANCES[:, np.newaxis] * pull**2 / (1 + spread)
    return np.asarray((gain / noise - np.log1p(spread)).sum(axis=1) / 2)


def _likeliest_variance(
    matrix: Floats, pull: Floats, system: SlidingSystem, chain: Chain, skin: Skin, seen: _Seen
) -> tuple[float, float]:
    """Variance [mm^2] of a coordinate's slides, and the evidence for it [nats]."""
    n = system.n_constants
    across = np.linalg.solve(matrix[:n, :n], np.column_stack([matrix[:n, n:], pull[:n]]))
    reduced = matrix[n:, n:] - matrix[n:, :n] @ across[:, :-1]
    scale = 1 / np.sqrt(system.n_bends)
    values, vectors = np.linalg.eigh(reduced * np.outer(scale, scale))
    found = _evidence(
        np.maximum(values, 0.0), vectors.T @ (scale * (pull[n:] - matrix[n:, :n] @ across[:, -1])), seen.noise
    )
    found += _evidence(*_bending(system.clusters, chain, skin, seen), seen.noise)
    best = int(found.argmax())
    return float(VARIANCES[best] * seen.noise), float(found[best])


def _bending(clusters: Clusters, chain: Chain, skin: Skin, seen: _Seen) -> tuple[Floats, Floats]:
    """Information and pull of what bends clusters as their joint bends, poses have no part in it."""
    information, pulls = [np.zeros(0)], [np.zeros(0)]
    for limb in range(1, chain.n_limbs):
        own, bent = np.flatnonzero(chain.limb_of_marker == limb), np.flatnonzero(skin.is_bent[limb])
        rigid = clusters.basis[own][:, :, clusters.limbs == limb]
        rigid = rigid.reshape(3 * len(own), rigid.shape[2])
        inner = np.linalg.svd(rigid, full_matrices=True)[0][:, rigid.shape[1] :].T
        squares = np.repeat(seen.bends[own], 3, axis=0)[:, bent, bent]
        information.append(((inner**2) @ squares).ravel() / max(len(bent), 1))
        pulls.append((inner @ seen.moments[own].reshape(-1, 3)[:, bent]).ravel() / np.sqrt(max(len(bent), 1)))
    return np.concatenate(information), np.concatenate(pulls)


def _bent_slopes(clusters: Clusters, skin: Skin, chain: Chain, seen: _Seen, variance: float) -> Floats:
    """Slopes of what bends clusters, shape (n_markers, 3, 3)."""
    n_bends = skin.is_bent.sum(axis=1)[chain.limb_of_marker]
    prior = np.maximum(n_bends, 1) * seen.noise / variance
    held = seen.bends + prior[:, np.newaxis, np.newaxis] * np.eye(3)
    return np.asarray(clusters.without_rigid(seen.moments) @ np.linalg.inv(held))


def _looseness(system: SlidingSystem, chain: Chain) -> Floats:
    """How far each constant may go if nothing determines it: mm, of tilts rad."""
    loose = np.full(system.n_constants, LOOSE)
    tilts = slice(system.n_joints, system.n_constants - len(system.clusters.limbs))
    loose[tilts] /= max(np.sqrt(3 * float((chain.offsets**2).mean())), 1.0)
    return loose


def _stepped(
    chain: Chain, articulation: Articulation, poses: ChainPoses, system: SlidingSystem, step: Floats
) -> tuple[Chain, Articulation, ChainPoses]:
    n_rigid = len(system.clusters.limbs)
    joints = chain.joints.copy()
    joints[1:] += step[: system.n_joints].reshape(-1, 3)
    offsets = chain.offsets + system.clusters.basis @ step[system.n_constants - n_rigid : system.n_constants]
    tilts: Floats = np.asarray(step[system.n_joints : system.n_constants - n_rigid])
    changed, rotations = articulation.tilted(chain.parents, poses.rotations, tilts)
    return chain.moved(joints, offsets), changed, ChainPoses(poses.root, rotations)


def _in_limbs(last: Calibration, positions: Floats) -> Floats:
    """Residuals in the limbs' frames, where soft tissue lasts [mm], shape (n_frames, n_markers, 3)."""
    limbs = last.poses.rotations[:, last.chain.limb_of_marker]
    error = residuals(last.chain, last.poses, positions)
    return np.asarray((limbs.swapaxes(2, 3) @ error[..., np.newaxis])[..., 0])
