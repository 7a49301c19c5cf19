"""How sure the poses of a known chain are in each frame: covariances carried from the root outward.

`tree.eliminate` says how each limb's turn follows its parent and how sure it is then; so covariances of turn and place
follow from those of the parent, at a cost that is linear in limbs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.frames_last import along, cross_matrix, dot, outer, product, transposed_product
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.tree import AxisTurn, FreeTurn, Tree, eliminate, frames_last
from skelgen.model.arrays import Floats

CHUNK_FRAMES = 1024

UNKNOWN_TURN = 1.0
"""rad; what is stated for a turn that nothing in the frame determines."""

UNKNOWN_SHIFT = 1000.0
"""mm; the same for the place of the root."""

LEAST_NOISE = 1e-6
"""mm; keeps matrices regular for exact takes."""


@dataclass(frozen=True, eq=False)
class PoseCovariances:
    """What noise of a frame makes uncertain, if the skeleton is known exactly.

    Attributes
    ----------
    origins : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of each limb's origin in the world, the joint above it.
    turns : ndarray, shape (n_frames, n_limbs, 3, 3), rad^2
        Of small turns of each limb against its parent, in the parent's axes; of the root, in the world.
    """

    origins: Floats
    turns: Floats


def pose_covariances(
    chain: Chain,
    articulation: Articulation,
    poses: ChainPoses,
    positions: Floats,
    noise: float,
    weights: Floats | None = None,
) -> PoseCovariances:
    """Return the covariances of places and turns in every frame.

    Parameters
    ----------
    chain, articulation, poses
        A calibrated chain, and where it is.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    """
    shape = (len(positions), chain.n_limbs, 3, 3)
    found = PoseCovariances(np.empty(shape), np.empty(shape))
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        heard = seen_weights(positions[part], None if weights is None else weights[part])
        tree = Tree(chain, articulation, positions[part], heard)
        origins, turns = _outward(tree, *frames_last(poses[part]), max(noise, LEAST_NOISE))
        found.origins[part] = noise**2 * origins.transpose(3, 0, 1, 2)
        found.turns[part] = noise**2 * turns.transpose(3, 0, 1, 2)
    return found


def _outward(tree: Tree, root: Floats, rotations: Floats, noise: float) -> tuple[Floats, Floats]:
    """Covariances for noise 1 with a weak prior, shapes (n_limbs, 3, 3, n_frames)."""
    view = tree.view(root, rotations)
    turn_level = np.full(root.shape[1], (noise / UNKNOWN_TURN) ** 2)
    shift_level = np.full(root.shape[1], (noise / UNKNOWN_SHIFT) ** 2)
    solved = eliminate(tree, view, tree.forms(view), turn_level, shift_level)
    places, turns = np.empty_like(rotations), np.empty_like(rotations)
    places[0] = solved.root_covariance
    known = [_of_free_turn(solved.root_turn, places[0])]  # of each limb: covariance of its turn, of turn and origin
    turns[0] = known[0][0]
    for limb in range(1, len(rotations)):
        parent, found = int(tree.chain.parents[limb]), solved.turns[limb]
        before, mixed = known[parent]
        lever = cross_matrix(view.links[limb])
        at_link = mixed + product(before, lever)
        places[limb] = places[parent] + transposed_product(mixed, lever) - product(lever, at_link)
        if isinstance(found, FreeTurn):
            known.append(_of_free_turn(found, places[limb]))
            across = -product(found.follow, at_link.swapaxes(0, 1))
        else:
            turn, by_place, across = _of_axis_turns(found, before, at_link, places[limb])
            known.append((turn, by_place))
        relative = known[limb][0] - across - across.swapaxes(0, 1) + before
        turns[limb] = product(transposed_product(rotations[parent], relative), rotations[parent])
    return places, turns


def _of_free_turn(found: FreeTurn, place: Floats) -> tuple[Floats, Floats]:
    """Covariance of a free turn, and of turn and origin."""
    mixed = -product(found.follow, place)
    return found.covariance - product(mixed, found.follow.swapaxes(0, 1)), mixed


def _of_axis_turns(
    axes: tuple[AxisTurn, ...], turn: Floats, mixed: Floats, place: Floats
) -> tuple[Floats, Floats, Floats]:
    """Covariance of a turn about axes, of it and the origin, and of it and the parent's turn."""
    across, parent_mixed, parent_turn = turn, mixed, turn
    parents = (parent_turn, parent_mixed)
    for one in axes:
        by_parent = -along(across.swapaxes(0, 1), one.by_turn) - along(parents[1], one.by_shift)
        with_turn = -along(turn, one.by_turn) - along(mixed, one.by_shift)
        with_place = -np.einsum("jif,jf->if", mixed, one.by_turn) - along(place, one.by_shift)
        variance = one.variance - dot(one.by_turn, with_turn) - dot(one.by_shift, with_place)
        side = outer(one.axis, with_turn)
        turn = turn + side + side.swapaxes(0, 1) + outer(variance * one.axis, one.axis)
        mixed = mixed + outer(one.axis, with_place)
        across = across + outer(one.axis, by_parent)
    return turn, mixed, across
