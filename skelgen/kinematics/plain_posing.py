"""Poses of a chain in many frames at once by Gauss-Newton steps, plain: the twin of `compiled_posing`, and its meaning.

A frame's step costs as much as it has limbs and markers: `tree` eliminates the turns from the leaves to the root.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import along, cross, dot, orthonormal, product, rotation_by
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.elimination import AxisTurn, FreeTurn, Tree, View, eliminate, frames_last
from skelgen.model.arrays import Floats

DAMPING = 1e-6
"""Levenberg damping relative to the mean diagonal: what no marker determines stays where it starts."""

LEAST_RIDGE = 1e-12
"""Keeps the normal matrix of a frame without markers regular."""

GIVE_UP_DAMPING = 1e6
"""A frame that needs more damping than this does not get better."""

STEP_TOLERANCE = 1e-10
"""rad and, scaled by the arms, far below a micrometre."""

GAIN_TOLERANCE = 1e-9
"""Frames are settled when a step lowers the sum of squares by less than this part."""


def settled(
    chain: Chain, articulation: Articulation, start: ChainPoses, positions: Floats, weights: Floats, max_steps: int
) -> ChainPoses:
    """Return the poses that fit best.

    Parameters
    ----------
    chain, articulation
        The limbs, and what their joints allow.
    start : ChainPoses
        Where to start; it obeys the joints.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers; any number where the weight is 0.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances.
    max_steps : int
        Steps at most.
    """
    tree = Tree(chain, articulation, positions, weights)
    root, rotations = _settled(tree, *frames_last(start), max_steps)
    return ChainPoses(root.T, orthonormal(rotations).transpose(3, 0, 1, 2))


def _settled(tree: Tree, root: Floats, rotations: Floats, max_steps: int) -> tuple[Floats, Floats]:
    """Step until no frame gains; frames that are settled are left alone."""
    active = np.arange(root.shape[1])
    here = tree.view(root, rotations)
    damping = np.full(len(active), DAMPING)
    for _ in range(max_steps):
        there, size = _stepped(tree, here, damping)
        better = there.squares <= here.squares
        settled = better & (here.squares - there.squares <= GAIN_TOLERANCE * here.squares)
        settled |= size < STEP_TOLERANCE
        damping = np.where(better, np.maximum(damping / 10, DAMPING), damping * 100)
        root[:, active[better]] = there.root[:, better]
        rotations[..., active[better]] = there.rotations[..., better]
        going = np.flatnonzero(~settled & (damping < GIVE_UP_DAMPING))
        if not len(going):
            break
        if better.all() and len(going) == len(active):
            here = there
            continue
        active, damping, tree = active[going], damping[going], tree.of(going)
        here = tree.view(root[:, active], rotations[..., active])
    return root, rotations


def _stepped(tree: Tree, view: View, damping: Floats) -> tuple[View, Floats]:
    """View after a damped step, and the largest number in the step of each frame."""
    forms = tree.forms(view)
    trace = np.asarray(sum(np.einsum("iif->f", form.turn) for form in forms))
    turn_level = np.maximum(damping * trace / (3 * len(forms)), LEAST_RIDGE)
    shift_level = np.maximum(damping * tree.total_weight, LEAST_RIDGE)
    solved = eliminate(tree, view, forms, turn_level, shift_level)
    shifts, turns = [solved.root_shift], [_turn(solved.root_turn, solved.root_shift)]
    spins = [rotation_by(turns[0])]
    for limb in range(1, tree.chain.n_limbs):
        parent, found = int(tree.chain.parents[limb]), solved.turns[limb]
        shifts.append(shifts[parent] + cross(turns[parent], view.links[limb]))
        if isinstance(found, FreeTurn):
            turns.append(_turn(found, shifts[limb]))
            spins.append(rotation_by(turns[limb]))
        else:
            turn, spin = _turned_about(found, turns[parent], shifts[limb], spins[parent])
            turns.append(turn)
            spins.append(spin)
    rotations = np.stack([product(spin, rotation) for spin, rotation in zip(spins, view.rotations, strict=True)])
    size = np.abs(np.stack([solved.root_shift, *turns])).max(axis=(0, 1))
    return tree.view(view.root + solved.root_shift, rotations), size


def _turn(found: FreeTurn, shift: Floats) -> Floats:
    return found.rest - along(found.follow, shift)


def _turned_about(axes: tuple[AxisTurn, ...], turn: Floats, shift: Floats, spin: Floats) -> tuple[Floats, Floats]:
    """Turn a limb as its parent, then about its axes; also as a rotation."""
    for one in axes:
        angle = one.rest - dot(one.by_turn, turn) - dot(one.by_shift, shift)
        turn = turn + angle * one.axis
        spin = product(spin, rotation_by(angle * one.axis))
    return turn, spin
