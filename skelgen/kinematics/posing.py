"""Poses of a known chain in every frame by least squares over all its limbs: Gauss-Newton, limb by limb.

Maximum likelihood for Gaussian noise (Gaschler 2011, 5.3). A frame's step costs as much as it has limbs and markers:
`tree` eliminates the turns from the leaves to the root.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import along, cross, dot, orthonormal, product, rotation_by
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.tree import AxisTurn, FreeTurn, Tree, View, eliminate, frames_last
from skelgen.model.arrays import Floats

CHUNK_FRAMES = 1024
"""Frames solved together: enough that calls cost little, few enough that a limb's arrays stay in the cache."""

DAMPING = 1e-6
"""Levenberg damping relative to the mean diagonal: what no marker determines stays where it starts."""

LEAST_RIDGE = 1e-12
"""Keeps the normal matrix of a frame without markers regular."""

GIVE_UP_DAMPING = 1e6
"""A frame that needs more damping than this does not get better."""

MAX_STEPS = 15
STEP_TOLERANCE = 1e-10
"""rad and, scaled by the arms, far below a micrometre."""

GAIN_TOLERANCE = 1e-9
"""Frames are settled when a step lowers the sum of squares by less than this part."""


def fit_poses(
    chain: Chain,
    start: ChainPoses,
    positions: Floats,
    articulation: Articulation | None = None,
    weights: Floats | None = None,
    max_steps: int = MAX_STEPS,
) -> ChainPoses:
    """Fit a chain to markers in every frame by least squares over all its limbs.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    start : ChainPoses
        First guess; directions that no marker determines stay there. It must obey the joints.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    articulation : Articulation, optional
        What the joints allow; any turn if it is not given.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    max_steps : int
        Gauss-Newton steps at most.
    """
    articulation = articulation or Articulation.free(chain.n_limbs)
    fitted = ChainPoses(np.empty(start.root.shape), np.empty(start.rotations.shape))
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        heard = seen_weights(positions[part], None if weights is None else weights[part])
        tree = Tree(chain, articulation, positions[part], heard)
        root, rotations = _settled(tree, *frames_last(start[part]), max_steps)
        fitted.root[part] = root.T
        fitted.rotations[part] = orthonormal(rotations).transpose(3, 0, 1, 2)
    return fitted


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
