"""How sure poses are, for many frames at once: the meaning of its twin `compiled_covariances`.

`tree.eliminate` says how each limb's turn follows its parent and how sure it is then; so covariances of turn and place
follow from those of the parent, at a cost that is linear in limbs.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import along, cross_matrix, dot, outer, product, transposed_product
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.elimination import AxisTurn, FreeTurn, Tree, eliminate, frames_last
from skelgen.model.arrays import Floats


def outward(
    chain: Chain, articulation: Articulation, poses: ChainPoses, weights: Floats, levels: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return covariances of the limbs' origins and of their turns for noise 1, shape (n_frames, n_limbs, 3, 3) each.

    Parameters
    ----------
    chain, articulation, poses
        A calibrated chain, and where it is.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    levels : tuple of float
        Information on turns and on the root's place that is there without any marker.
    """
    tree = Tree(chain, articulation, poses.markers(chain), weights)
    places, turns = _outward(tree, *frames_last(poses), levels)
    return places.transpose(3, 0, 1, 2), turns.transpose(3, 0, 1, 2)


def _outward(tree: Tree, root: Floats, rotations: Floats, levels: tuple[float, float]) -> tuple[Floats, Floats]:
    """Covariances for noise 1 with a weak prior, shapes (n_limbs, 3, 3, n_frames)."""
    view = tree.view(root, rotations)
    turn_level, shift_level = np.tile(np.array(levels)[:, np.newaxis], root.shape[1])
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
