"""Poses of a chain frame by frame: Gauss-Newton steps, turns eliminated limb by limb from the leaves to the root.

What a limb's markers and all limbs beyond it say is a quadratic form in its turn and shift (`quadratic_forms`). The
turns that the joint allows are minimised out, and what is left is carried to the parent, of which the joint is a point:
the cost is linear in limbs, as that of the articulated body algorithm (Featherstone 1983). On the way back, from the
root outward, every limb's step follows from that of its parent; so does its covariance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.chain import (
    FREE,
    FREEDOMS,
    LINK,
    N_ARM,
    N_PLACE,
    ORIGIN,
    ROOT,
    ROTATION,
    SPIN,
    STEP_SHIFT,
    STEP_TURN,
    ChainTable,
    FramePoses,
    Measured,
    Place,
    copy_rotations,
    forward_kinematics,
    world_axis,
)
from skelgen._kernels.joint_models import PARENT
from skelgen._kernels.quadratic_forms import (
    AXIS,
    BY_SHIFT,
    BY_TURN,
    FOLLOW,
    FORCE,
    FREE_REST,
    N_AXIS,
    N_FORM,
    REST,
    SHIFT,
    carry_form,
    find_forms,
    take_axis,
    take_turn,
)
from skelgen._kernels.rotations import proper, rotation_by
from skelgen._kernels.small_matrices import (
    Vector,
    by_symmetric,
    cross,
    dot,
    inverse,
    largest,
    matrix,
    minus,
    plus,
    product,
    set_matrix,
    set_vector,
    symmetric,
    times,
    vector,
)
from skelgen.model.arrays import Floats

DAMPING = 1e-6
"""Levenberg damping relative to the mean diagonal: what no marker determines stays where it starts."""

LEAST_RIDGE = 1e-12  # keeps the normal matrix of a frame without markers regular

GIVE_UP_DAMPING = 1e6
"""A frame that needs more damping than this does not get better."""

STEP_TOLERANCE = 1e-10
"""rad and, scaled by the arms, far below a micrometre."""

GAIN_TOLERANCE = 1e-9
"""Frames are settled when a step lowers the sum of squares by less than this part."""


class Room(NamedTuple):
    """What the frames of a chain are worked in, one after the other.

    Attributes
    ----------
    here, there : Place
        Where the chain is, and where a step leads.
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms of the limbs.
    spare : ndarray, shape (n_limbs, 27)
        For what else is kept of each limb.
    solved : ndarray, shape (n_limbs, 22)
        Turns that are minimised out.
    """

    here: Place
    there: Place
    forms: Floats
    spare: Floats
    solved: Floats


def room_for(table: ChainTable) -> Room:
    """Return room for the frames of a chain."""
    n_limbs = len(table.joints)
    here, there = (Place(np.zeros((n_limbs, N_PLACE)), np.empty((len(table.markers), N_ARM))) for _ in range(2))
    forms, spare = np.empty((2, n_limbs, N_FORM))
    return Room(here, there, forms, spare, np.empty((n_limbs, 2 * N_AXIS)))


@kernel
def solve_frames(table: ChainTable, measured: Measured, poses: FramePoses, max_steps: int, room: Room) -> None:
    """Step each frame's pose until it does not gain.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    measured : tuple
        Markers and weights.
    poses : tuple
        Where the root's origin and the limbs' rotations start, which obey the joints; replaced by what fits best.
    max_steps : int
        Steps at most.
    room : Room
        Where to work.
    """
    positions, weights = measured
    roots, rotations = poses
    here, there, forms, _, solved = room
    n_limbs, n_markers = len(table.joints), len(table.markers)
    for frame in range(len(roots)):
        first = frame * n_markers
        set_vector(here.limbs, ROOT, ORIGIN, vector(roots, frame, ROOT))
        copy_rotations(rotations, frame * n_limbs, here.limbs)
        squares = forward_kinematics(table, positions, weights, first, here)
        damping = DAMPING
        for _ in range(max_steps):
            total, trace = find_forms(table, here, forms)
            eliminate(table, here, forms, max(damping * trace / (3 * n_limbs), LEAST_RIDGE), solved)
            size = _back_substitute(table, here, forms, max(damping * total, LEAST_RIDGE), solved, there)
            after = forward_kinematics(table, positions, weights, first, there)
            gain = squares - after
            is_settled = size < STEP_TOLERANCE or 0.0 <= gain <= GAIN_TOLERANCE * squares
            if gain >= 0.0:
                here, there = there, here
                squares, damping = after, max(damping / 10, DAMPING)
            else:
                damping *= 100
            if is_settled or damping >= GIVE_UP_DAMPING:
                break
        set_vector(roots, frame, ROOT, vector(here.limbs, ROOT, ORIGIN))
        for limb in range(n_limbs):
            set_matrix(rotations, frame * n_limbs + limb, ROTATION, proper(matrix(here.limbs, limb, ROTATION)))


@kernel_part
def eliminate(table: ChainTable, place: Place, forms: Floats, level: float, solved: Floats) -> None:
    """Minimise all turns out, from the leaves to the root; of the root's form, what is said of its shift is left.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where the chain is.
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms of the limbs.
    level : float
        Ridge under the matrices of the turns.
    solved : ndarray, shape (n_limbs, 22)
        Receives the turns that are minimised out.
    """
    for limb in range(len(table.joints) - 1, 0, -1):
        if table.limbs[limb, FREEDOMS] == FREE:
            take_turn(forms, limb, level, solved)
        else:
            for axis in range(table.limbs[limb, FREEDOMS] - 1, -1, -1):
                take_axis(forms, limb, world_axis(table, place, limb, axis), level, solved, N_AXIS * axis)
        carry_form(table, place, forms, limb)
    take_turn(forms, ROOT, level, solved)


@kernel_part
def _back_substitute(
    table: ChainTable, here: Place, forms: Floats, level: float, solved: Floats, there: Place
) -> float:
    """Find the steps from the root outward, and the pose after them; return the largest number of a step."""
    size = 0.0
    for limb in range(len(table.joints)):
        parent = max(table.limbs[limb, PARENT], ROOT)
        if limb == 0:
            shift = by_symmetric(inverse(symmetric(forms, ROOT, SHIFT), level), vector(forms, ROOT, FORCE))
            set_vector(there.limbs, ROOT, ORIGIN, plus(vector(here.limbs, ROOT, ORIGIN), shift))
            size = largest(shift)
        else:
            away = cross(vector(there.limbs, parent, STEP_TURN), vector(here.limbs, limb, LINK))
            shift = plus(vector(there.limbs, parent, STEP_SHIFT), away)
        if table.limbs[limb, FREEDOMS] == FREE:
            turn = _free_turn(solved, limb, shift)
            spin = rotation_by(turn)
        else:
            turn, spin = vector(there.limbs, parent, STEP_TURN), matrix(there.limbs, parent, SPIN)
            for first in range(0, table.limbs[limb, FREEDOMS] * N_AXIS, N_AXIS):
                about = _turn_about(solved, limb, first, turn, shift)
                turn, spin = plus(turn, about), product(spin, rotation_by(about))
        size = max(size, largest(turn))
        set_vector(there.limbs, limb, STEP_TURN, turn)
        set_vector(there.limbs, limb, STEP_SHIFT, shift)
        set_matrix(there.limbs, limb, SPIN, spin)
        set_matrix(there.limbs, limb, ROTATION, product(spin, matrix(here.limbs, limb, ROTATION)))
    return size


@kernel_part
def _free_turn(solved: Floats, limb: int, shift: Vector) -> Vector:
    """Return the turn of a limb below a ball joint whose origin is shifted."""
    x, y, z = matrix(solved, limb, FOLLOW)
    turn = minus(vector(solved, limb, FREE_REST), times(shift[0], x))
    return minus(minus(turn, times(shift[1], y)), times(shift[2], z))


@kernel_part
def _turn_about(solved: Floats, limb: int, first: int, turn: Vector, shift: Vector) -> Vector:
    """Return the turn about an axis of a limb that is turned and shifted already."""
    by_turn, by_shift = vector(solved, limb, first + BY_TURN), vector(solved, limb, first + BY_SHIFT)
    angle = solved[limb, first + REST] - dot(by_turn, turn) - dot(by_shift, shift)
    return times(angle, vector(solved, limb, first + AXIS))
