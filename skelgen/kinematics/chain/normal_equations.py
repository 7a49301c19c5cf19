r"""Normal equations of a chain: how its poses and its constants are tied in least squares.

The constants are marker offsets, joints 1 .. n_limbs - 1 in their parents, and tilts of the joints' axes. A marker
follows its own offset by the rotation of its limb, and every joint between the root and its limb by the rotation of the
joint's parent. So all blocks are sums of rotations and of arms, and no Jacobian is ever written down. The block between
the poses of a frame and the constants is called their coupling.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from skelgen._kernels.chain_constants import FIRST, LAST, N_TILTS, ORDER, Columns, add_gradient, constants_in
from skelgen._kernels.information import POSE_RIDGE, FrameInformation, add_frames, write_frames
from skelgen._kernels.posing import room_for
from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain.articulation import AXIS_CONSTANTS, Articulation
from skelgen.kinematics.chain.chain import (
    Chain,
    ChainPoses,
    ObservedChain,
    ancestry,
    residuals,
    rows,
    world_arms,
    writable,
)
from skelgen.model.arrays import Bools, Floats, Ints

CHUNK_FLOATS = 1_000_000
"""Entries of the couplings that are held at once: 8 MB."""

CHUNK_FRAMES = 1024
"""Frames that are summed together before they are added to the others: sums of sums round less."""


@dataclass(frozen=True, eq=False)
class FrameBlocks:
    """Blocks of the normal matrix of a chain in some frames.

    Attributes
    ----------
    own : ndarray, shape (n_frames, n_freedoms, n_freedoms)
        Of the poses, with a ridge that keeps it regular.
    coupling : ndarray, shape (n_frames, n_freedoms, n_constants)
        Between poses and constants.
    turns : ndarray, shape (n_frames, 3 + 3 n_limbs, n_freedoms)
        Derivatives of the translation and the limbs' rotations by the freedoms.
    tilts : ndarray, shape (n_frames, 3 + 3 n_limbs, n_axis_constants)
        Derivatives of the same by the constants of the axes.
    constants : ndarray, shape (n_constants, n_constants)
        Of the constants, summed over the frames.
    """

    own: Floats
    coupling: Floats
    turns: Floats
    tilts: Floats
    constants: Floats


def frames_together(observed: ObservedChain) -> int:
    """Number of frames whose couplings may be held at once."""
    return max(1, CHUNK_FLOATS // (observed.n_constants * (3 + 3 * observed.chain.n_limbs)))


def frame_blocks(observed: ObservedChain, *, poses_only: bool = False) -> FrameBlocks:
    """Return the blocks of the normal matrix.

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise.
    poses_only : bool
        Leave the block of the constants empty, for those who ask only how poses follow them.
    """
    chain, articulation, poses, weights = observed.chain, observed.articulation, observed.poses, observed.weights
    hessian, _ = normal_equations(chain, poses, observed.positions, weights)
    coupling = _coupling(chain, poses, weights)
    turns, tilts = articulation.bases(chain.parents, poses.rotations)
    by_tilt = hessian @ tilts
    constants = np.zeros((0, 0)) if poses_only else _constants(chain, poses, weights)
    if articulation.n_constants:
        if not poses_only:
            flat = tilts.reshape(-1, tilts.shape[2])
            across = coupling.reshape(len(flat), -1).T @ flat
            constants = np.block([[constants, across], [across.T, flat.T @ by_tilt.reshape(flat.shape)]])
        coupling = np.concatenate([coupling, by_tilt], axis=2)
    if not articulation.is_free:
        hessian = turns.swapaxes(1, 2) @ hessian @ turns
        coupling = turns.swapaxes(1, 2) @ coupling
    return FrameBlocks(_with_ridge(hessian), coupling, turns, tilts, constants)


def _with_ridge(own: Floats) -> Floats:
    """Return frames' normal matrices, made regular in directions that no marker determines."""
    diagonal = np.einsum("fqq->fq", own)
    level = np.empty_like(diagonal)
    level[:, :3] = diagonal[:, :3].mean(axis=1, keepdims=True)
    level[:, 3:] = diagonal[:, 3:].mean(axis=1, keepdims=True)
    level = np.where(level > 0, POSE_RIDGE * level, 1.0)  # 1 in frames that show nothing
    return np.asarray(own + level[:, :, np.newaxis] * np.eye(own.shape[1]))


def reduced_information(frames: FrameBlocks) -> Floats:
    """Return the information of the constants, poses eliminated, shape (n_constants, n_constants)."""
    root = np.linalg.solve(np.linalg.cholesky(frames.own), frames.coupling)
    flat = root.reshape(-1, root.shape[2])
    return np.asarray(frames.constants - flat.T @ flat)


def _beyond_joints(chain: Chain) -> Bools:
    """Whether each marker lies beyond the joint above each limb, shape (n_limbs, n_markers); False for the root."""
    beyond = chain.ancestry()[:, chain.limb_of_marker]
    beyond[0] = False
    return np.asarray(beyond)


def _coupling(chain: Chain, poses: ChainPoses, weights: Floats) -> Floats:
    """Coupling of translation and rotations, shape (n_frames, 3 + 3 n_limbs, 3 (n_markers + n_limbs - 1))."""
    n_frames, n_limbs = poses.rotations.shape[:2]
    beyond = _beyond_joints(chain)[1:].astype(np.float64)
    arms = world_arms(chain.arms(), poses) * weights[:, :, np.newaxis, np.newaxis]
    behind = (beyond @ arms.reshape(n_frames, chain.n_markers, -1)).reshape(n_frames, n_limbs - 1, n_limbs, 3)
    shift = np.concatenate([weights, weights @ beyond.T], axis=1)
    carrier = np.concatenate([chain.limb_of_marker, chain.parents[1:]])
    rotations = poses.rotations[:, carrier]
    coupling = np.zeros((n_frames, 1 + n_limbs, 3, len(carrier), 3))
    coupling[:, 0] = (shift[:, :, np.newaxis, np.newaxis] * rotations).swapaxes(1, 2)
    levers = np.concatenate([arms, behind], axis=1)
    for limb in range(n_limbs):
        moved = np.flatnonzero(np.abs(levers[:, :, limb]).max(axis=(0, 2), initial=0.0) > 0)
        coupling[:, 1 + limb][:, :, moved] = (cross_matrix(levers[:, moved, limb]) @ rotations[:, moved]).swapaxes(1, 2)
    return coupling.reshape(n_frames, 3 + 3 * n_limbs, -1)


def _constants(chain: Chain, poses: ChainPoses, weights: Floats) -> Floats:
    """Normal matrix of offsets and joints, summed over frames."""
    n_markers = chain.n_markers
    n_points = n_markers + chain.n_limbs - 1
    beyond = _beyond_joints(chain)
    matrix = np.zeros((n_points, 3, n_points, 3))
    diagonal = np.arange(n_markers)
    matrix[diagonal, :, diagonal] = weights.sum(axis=0)[:, np.newaxis, np.newaxis] * np.eye(3)
    for joint in range(1, chain.n_limbs):
        parent = poses.rotations[:, chain.parents[joint]].reshape(len(weights), 3, 3)
        column = n_markers + joint - 1
        for limb in np.unique(chain.limb_of_marker[beyond[joint]]):
            markers = np.flatnonzero(chain.limb_of_marker == limb)
            relative = (poses.rotations[:, limb].swapaxes(1, 2) @ parent).reshape(len(weights), 9)
            block = (weights[:, markers].T @ relative).reshape(-1, 3, 3)
            matrix[markers, :, column] = block
            matrix[column, :, markers] = block.swapaxes(1, 2)
        for other in range(joint, chain.n_limbs):
            shared = weights[:, beyond[joint] & beyond[other]].sum(axis=1)
            if not shared.any():
                continue
            relative = (parent.swapaxes(1, 2) @ poses.rotations[:, chain.parents[other]]).reshape(len(weights), 9)
            block = (shared @ relative).reshape(3, 3)
            matrix[column, :, n_markers + other - 1] = block
            matrix[n_markers + other - 1, :, column] = block.T
    return matrix.reshape(3 * n_points, 3 * n_points)


def total_information(observed: ObservedChain) -> Floats:
    """Return the information of the constants for noise 1, poses eliminated, shape (n_constants, n_constants).

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise. Of the measured markers only the weights count.
    """
    table, (columns, order) = observed.table, _columns_of(observed.chain, observed.articulation)
    upper = np.zeros((len(order), len(order)))
    room, none = room_for(table), np.zeros((observed.chain.n_markers, 3, 0))
    for part in observed.in_parts(CHUNK_FRAMES):
        constants = constants_in(columns, room, none)
        add_frames(table, constants, part.measured, rows(part.poses.rotations, 9), room)
        upper += constants.total
    column = np.argsort(order)
    return np.asarray((upper + np.triu(upper, 1).T)[np.ix_(column, column)])


def frame_information(observed: ObservedChain, basis: Floats, limbs: Ints) -> tuple[Floats, Floats]:
    """Return the information of the constants of each frame for noise 1, displacements of markers instead of offsets.

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise. Of the measured markers only the weights count.
    basis : ndarray, shape (n_markers, 3, n_displacements)
        Displacements in the limbs' frames, each of the markers of one limb.
    limbs : ndarray of intp, shape (n_displacements,), rising
        Which.

    Returns
    -------
    tuple of ndarray
        Between all constants, displacements last, and the displacements, shape (n_frames, n_constants,
        n_displacements), and among the others, summed over frames, shape (n_before, n_before).
    """
    chain, table = observed.chain, observed.table
    own = np.arange(len(limbs)) - np.searchsorted(limbs, limbs)
    width = int(own.max(initial=-1)) + 1
    columns, order = _columns_of(chain, observed.articulation, width)
    n_before = len(order) - width * chain.n_limbs
    places = np.concatenate([np.full(width * chain.n_limbs, -1), np.arange(n_before)])
    places[width * limbs + own] = n_before + np.arange(len(limbs))
    of_limbs = basis @ np.eye(width)[own]  # other limbs' markers are not displaced
    room = room_for(table)
    constants = constants_in(columns, room, writable(of_limbs[table.markers]))
    products = np.empty((observed.n_frames, n_before + len(limbs), len(limbs)))
    found = FrameInformation(places[order], products, np.zeros((n_before, n_before)))
    write_frames(table, constants, observed.measured, rows(observed.poses.rotations, 9), room, found)
    return products, found.among + np.triu(found.among, 1).T


def constant_gradient(observed: ObservedChain) -> Floats:
    """Return the gradient of the residuals by the constants, for poses that fit best, shape (n_constants,).

    It is minus the gradient of half the sum of squares. Residuals act as forces on offsets and on all joints between
    root and marker, and as torques on axes.

    Parameters
    ----------
    observed : ObservedChain
        Where to linearise.
    """
    table, (columns, order) = observed.table, _columns_of(observed.chain, observed.articulation)
    total = np.zeros(len(order))
    for part in observed.in_parts(CHUNK_FRAMES):
        pose = writable(part.poses.root), rows(part.poses.rotations, 9)
        found = np.zeros_like(total)
        add_gradient(table, columns, part.measured, pose, found, room_for(table))
        total[order] += found
    return total


def _columns_of(chain: Chain, articulation: Articulation, n_displacements: int = 0) -> tuple[Columns, Ints]:
    """Return where kernels keep the constants of each limb, and which constant each of their columns is.

    Parameters
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What their joints allow.
    n_displacements : int
        Displacements of the markers of each limb that stand for their offsets; 0 if none do.
    """
    structure = tuple(chain.parents.tolist()), tuple(chain.limb_of_marker.tolist()), tuple(articulation.types)
    limbs, places = _layout(*structure, n_displacements)
    return Columns(limbs, articulation.across_axes.swapaxes(1, 2).reshape(-1, 3)), places


@lru_cache(maxsize=8)
def _layout(
    parents: tuple[int, ...], limb_of_marker: tuple[int, ...], types: tuple[str, ...], n_displacements: int
) -> tuple[Ints, Ints]:
    """Where constants stand by the structure alone, found once for all steps of a fit."""
    n_limbs = len(parents)
    n_offsets = n_displacements * n_limbs or 3 * len(limb_of_marker)
    below = ancestry(parents)
    order = sorted(range(n_limbs), key=lambda limb: np.flatnonzero(below[:, limb]).tolist())
    ends = n_offsets + 3 * (n_limbs - 1) + np.cumsum([AXIS_CONSTANTS[kind] for kind in types])
    own = []
    for limb, kind in enumerate(types):
        joint = np.arange(3) + n_offsets + 3 * (limb - 1) if limb else np.zeros(0, dtype=np.intp)
        tilts = np.arange(ends[limb] - AXIS_CONSTANTS[kind], ends[limb])
        markers = np.flatnonzero(np.array(limb_of_marker) == limb)
        offsets = (3 * markers[:, np.newaxis] + np.arange(3)).ravel()
        if n_displacements:
            offsets = n_displacements * limb + np.arange(n_displacements)
        own.append(np.concatenate([joint, tilts, offsets]))
    sizes = np.array([len(one) for one in own])
    limbs = np.zeros((n_limbs, 4), dtype=np.intp)
    limbs[:, ORDER] = order
    limbs[order, FIRST] = np.cumsum(sizes[order]) - sizes[order]
    limbs[:, LAST] = limbs[:, FIRST] + below @ sizes
    limbs[:, N_TILTS] = [AXIS_CONSTANTS[kind] for kind in types]
    return limbs, np.concatenate([own[limb] for limb in order]).astype(np.intp)


def normal_equations(chain: Chain, poses: ChainPoses, positions: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the Gauss-Newton normal matrix and right-hand side of every frame, all rotations free.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, d, d) and (n_frames, d) with d = 3 + 3 n_limbs: translation first, then rotation vectors.
    """
    total, arms, spread, force, own_moment = _limb_sums(chain, poses, positions, weights)
    n_frames, n_limbs = total.shape
    flat = arms.reshape(n_frames, n_limbs, 3 * n_limbs)
    weighted = flat * total[:, :, np.newaxis]
    outer = (weighted.swapaxes(1, 2) @ flat).reshape(n_frames, n_limbs, 3, n_limbs, 3)
    every = np.arange(n_limbs)
    outer[:, every, :, every] += spread.swapaxes(0, 1)
    trace = np.einsum("faibi->fab", outer)
    hessian = np.zeros((n_frames, 3 + 3 * n_limbs, 3 + 3 * n_limbs))
    turns = trace[:, :, np.newaxis, :, np.newaxis] * np.eye(3)[:, np.newaxis] - outer.transpose(0, 1, 4, 3, 2)
    hessian[:, 3:, 3:] = turns.reshape(n_frames, 3 * n_limbs, 3 * n_limbs)
    hessian[:, :3, :3] = total.sum(axis=1)[:, np.newaxis, np.newaxis] * np.eye(3)
    mixed = -cross_matrix(weighted.sum(axis=1).reshape(n_frames, n_limbs, 3))
    mixed = mixed.transpose(0, 2, 1, 3).reshape(n_frames, 3, 3 * n_limbs)
    hessian[:, :3, 3:] = mixed
    hessian[:, 3:, :3] = mixed.swapaxes(1, 2)
    moment = (flat.swapaxes(1, 2) @ force).reshape(n_frames, n_limbs, 3, 3) + own_moment
    torque = np.stack([moment[..., i, j] - moment[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
    gradient = np.concatenate([force.sum(axis=1), torque.reshape(n_frames, -1)], axis=1)
    return hessian, gradient


def _limb_sums(
    chain: Chain, poses: ChainPoses, positions: Floats, weights: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Sums over the markers of each limb: to any other limb, all of them hang on the same arm.

    Returns
    -------
    weights : ndarray, shape (n_frames, n_limbs)
        Sums of weights.
    arms : ndarray, shape (n_frames, n_limbs, n_limbs, 3), mm
        World arms of the limbs' centroids: that of limb a for limb l is at [l, a].
    spread : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Weighted outer products of the markers' arms from the centroid.
    force, moment : ndarray, shapes (n_frames, n_limbs, 3) and (n_frames, n_limbs, 3, 3)
        Weighted sums of residuals, and of their outer products with arms from the centroid.
    """
    n_frames, n_limbs = poses.rotations.shape[:2]
    arms_of_markers = chain.arms()
    forces = residuals(chain, poses, positions) * weights[:, :, np.newaxis]
    total, force = np.zeros((n_frames, n_limbs)), np.zeros((n_frames, n_limbs, 3))
    centre, spread = np.zeros((n_limbs, n_frames, 3)), np.zeros((n_frames, n_limbs, 3, 3))
    moment = np.zeros((n_frames, n_limbs, 3, 3))
    carried = np.zeros((n_limbs, n_limbs, 3))
    for limb in range(n_limbs):
        own = np.flatnonzero(chain.limb_of_marker == limb)
        if not len(own):
            continue
        used, offsets = weights[:, own], chain.offsets[own]
        carried[limb] = arms_of_markers[own[0]]
        total[:, limb], force[:, limb] = used.sum(axis=1), forces[:, own].sum(axis=1)
        centre[limb] = (used @ offsets) / np.maximum(total[:, limb], np.finfo(np.float64).tiny)[:, np.newaxis]
        squares = used @ (offsets[:, :, np.newaxis] * offsets[:, np.newaxis]).reshape(-1, 9)
        of_centre = centre[limb][:, :, np.newaxis] * centre[limb][:, np.newaxis]
        about = squares.reshape(-1, 3, 3) - total[:, limb, np.newaxis, np.newaxis] * of_centre
        turn = poses.rotations[:, limb]
        spread[:, limb] = turn @ about @ turn.swapaxes(1, 2)
        moments = offsets.T @ forces[:, own] - centre[limb][:, :, np.newaxis] * force[:, limb][:, np.newaxis]
        moment[:, limb] = turn @ moments
    arms = world_arms(carried, poses)
    for limb in range(n_limbs):
        arms[:, limb, limb] = np.einsum("fij,fj->fi", poses.rotations[:, limb], centre[limb])
    return total, arms, spread, force, moment
