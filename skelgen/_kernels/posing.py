r"""Poses of a chain frame by frame: Gauss-Newton steps, turns eliminated limb by limb from the leaves to the root.

What a limb's markers and all limbs beyond it say is a quadratic form in the limb's turn :math:`\omega` and the shift
:math:`\delta` of its origin,

.. math::
    \tfrac12 \omega^T A \omega + \omega^T B \delta + \tfrac12 \delta^T C \delta
    - \omega^T g_\omega - \delta^T g_\delta .

The turns that the joint allows are minimised out, and what is left is carried to the parent, of which the joint is a
point: the cost is linear in limbs, as that of the articulated body algorithm (Featherstone 1983). On the way back, from
the root outward, every limb's step follows from that of its parent; so does its covariance.

A form is a row of numbers: the upper half of A, the columns of B, the upper half of C, and the gradients by turn and
shift, called torque and force. A free turn that is minimised out is rest - follow @ shift, with a covariance where the
origin is known; a turn about an axis is rest - by_turn . turn - by_shift . shift, with a variance where all before it
is known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.chain import (
    ARM,
    ERROR,
    FREE,
    FREEDOMS,
    LINK,
    N_ARM,
    N_PLACE,
    ORIGIN,
    ROOT,
    ROTATION,
    SPIN,
    START,
    STEP_SHIFT,
    STEP_TURN,
    WEIGHT,
    ChainTable,
    FramePoses,
    Measured,
    Place,
    copy_rotations,
    forward_kinematics,
    world_axis,
)
from skelgen._kernels.joint_models import PARENT
from skelgen._kernels.small_matrices import (
    Matrix,
    Vector,
    add_symmetric,
    add_vector,
    by_symmetric,
    cross,
    dot,
    inverse,
    largest,
    matrix,
    minus,
    plus,
    product,
    proper,
    refined,
    rotation_by,
    set_matrix,
    set_symmetric,
    set_vector,
    symmetric,
    times,
    upper_of_product,
    vector,
)
from skelgen.model.arrays import Floats

DAMPING = 1e-6
"""Levenberg damping relative to the mean diagonal: what no marker determines stays where it starts."""

LEAST_RIDGE = 1e-12  # keeps the normal matrix of a frame without markers regular

GIVE_UP_DAMPING = 1e6
"""A frame that needs more damping than this does not get better."""

ILL_CONDITIONED = 1e8
"""Condition beyond which solutions are refined: the root of the precision of numbers."""

LEAST_LEVEL = 1e-13
"""Of a form's trace: below this rounding is larger than what it is to level."""

STEP_TOLERANCE = 1e-10
"""rad and, scaled by the arms, far below a micrometre."""

GAIN_TOLERANCE = 1e-9
"""Frames are settled when a step lowers the sum of squares by less than this part."""

TURN, MIXED, SHIFT, TORQUE, FORCE, N_FORM = fixed(0, 6, 15, 21, 24, 27)
"""Where the parts of a form begin, and its length."""

FOLLOW, FREE_REST, COVARIANCE = fixed(0, 9, 12)
"""Where the parts of a free turn that is minimised out begin: columns of follow, rest, covariance."""

AXIS, BY_TURN, BY_SHIFT, REST, VARIANCE, N_AXIS = fixed(0, 3, 6, 9, 10, 11)
"""Where the parts of a turn about an axis that is minimised out begin; those of a second axis follow."""


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
def find_forms(table: ChainTable, place: Place, forms: Floats) -> tuple[float, float]:
    """Write what each limb's markers say by themselves; return sum of weights and trace of the turns' matrices.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where the chain is.
    forms : ndarray, shape (n_limbs, 27)
        Receives the quadratic forms.
    """
    all_weights, all_traces = 0.0, 0.0
    for limb in range(len(table.joints)):
        total, xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        moment, torque, force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
            weight = place.markers[own, WEIGHT]
            if weight > 0.0:
                arm, own_force = vector(place.markers, own, ARM), times(weight, vector(place.markers, own, ERROR))
                x, y, z = arm
                total += weight
                xx, xy, xz = xx + weight * x * x, xy + weight * x * y, xz + weight * x * z
                yy, yz, zz = yy + weight * y * y, yz + weight * y * z, zz + weight * z * z
                moment, force = plus(moment, times(weight, arm)), plus(force, own_force)
                torque = plus(torque, cross(arm, own_force))
        set_symmetric(forms, limb, TURN, (yy + zz, -xy, -xz, xx + zz, -yz, xx + yy))
        x, y, z = moment
        set_vector(forms, limb, MIXED, (0.0, z, -y))
        set_vector(forms, limb, MIXED + 3, (-z, 0.0, x))
        set_vector(forms, limb, MIXED + 6, (y, -x, 0.0))
        set_symmetric(forms, limb, SHIFT, (total, 0.0, 0.0, total, 0.0, total))
        set_vector(forms, limb, TORQUE, torque)
        set_vector(forms, limb, FORCE, force)
        all_weights += total
        all_traces += 2.0 * (xx + yy + zz)
    return all_weights, all_traces


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
            _take_turn(forms, limb, level, solved)
        else:
            for axis in range(table.limbs[limb, FREEDOMS] - 1, -1, -1):
                take_axis(forms, limb, world_axis(table, place, limb, axis), level, solved, N_AXIS * axis)
        carry_form(table, place, forms, limb)
    _take_turn(forms, ROOT, level, solved)


@kernel_part
def _take_turn(forms: Floats, limb: int, level: float, solved: Floats) -> None:
    """Minimise a free turn out of a limb's form."""
    form = symmetric(forms, limb, TURN)
    trace = form[0] + form[3] + form[5]
    level = max(level, LEAST_LEVEL * trace)
    covariance = inverse(form, level)
    a, b, c = vector(forms, limb, MIXED), vector(forms, limb, MIXED + 3), vector(forms, limb, MIXED + 6)
    p, q, r = by_symmetric(covariance, a), by_symmetric(covariance, b), by_symmetric(covariance, c)
    if trace * (covariance[0] + covariance[3] + covariance[5]) > ILL_CONDITIONED:
        p, q, r = (  # else the rounding of a turn that hardly shows would grow from limb to limb
            refined(form, level, covariance, p, a),
            refined(form, level, covariance, q, b),
            refined(form, level, covariance, r, c),
        )
    torque = vector(forms, limb, TORQUE)
    set_vector(solved, limb, FOLLOW, p)
    set_vector(solved, limb, FOLLOW + 3, q)
    set_vector(solved, limb, FOLLOW + 6, r)
    set_vector(solved, limb, FREE_REST, by_symmetric(covariance, torque))
    set_symmetric(solved, limb, COVARIANCE, covariance)
    add_symmetric(forms, limb, SHIFT, (-dot(a, p), -dot(a, q), -dot(a, r), -dot(b, q), -dot(b, r), -dot(c, r)))
    add_vector(forms, limb, FORCE, (-dot(p, torque), -dot(q, torque), -dot(r, torque)))


@kernel_part
def take_axis(forms: Floats, limb: int, axis: Vector, level: float, solved: Floats, first: int) -> None:
    """Minimise a turn about an axis out of a limb's form.

    Parameters
    ----------
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms of the limbs.
    limb : int
        The limb.
    axis : tuple of float
        In the world, of length 1.
    level : float
        Ridge under the matrices of the turns.
    solved : ndarray, shape (n_limbs, 22)
        Receives the turns that are minimised out.
    first : int
        Where to write in the limb's row.
    """
    along = by_symmetric(symmetric(forms, limb, TURN), axis)
    sideways = (
        dot(axis, vector(forms, limb, MIXED)),
        dot(axis, vector(forms, limb, MIXED + 3)),
        dot(axis, vector(forms, limb, MIXED + 6)),
    )
    variance = 1.0 / (max(dot(axis, along), 0.0) + level)
    by_turn, by_shift = times(variance, along), times(variance, sideways)
    rest = variance * dot(axis, vector(forms, limb, TORQUE))
    set_vector(solved, limb, first + AXIS, axis)
    set_vector(solved, limb, first + BY_TURN, by_turn)
    set_vector(solved, limb, first + BY_SHIFT, by_shift)
    solved[limb, first + REST], solved[limb, first + VARIANCE] = rest, variance
    add_symmetric(forms, limb, TURN, upper_of_product(along, times(-1.0, by_turn)))
    for column in range(3):
        add_vector(forms, limb, MIXED + 3 * column, times(-by_shift[column], along))
    add_symmetric(forms, limb, SHIFT, upper_of_product(sideways, times(-1.0, by_shift)))
    add_vector(forms, limb, TORQUE, times(-rest, along))
    add_vector(forms, limb, FORCE, times(-rest, sideways))


@kernel_part
def carry_form(table: ChainTable, place: Place, forms: Floats, limb: int) -> None:
    """Add what is said of a limb to what is said of its parent.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where the chain is.
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms of the limbs.
    limb : int
        Whose form is added to that of its parent.
    """
    link = vector(place.limbs, limb, LINK)
    if table.limbs[limb, FREEDOMS] == FREE:
        _carry_point(forms, limb, table.limbs[limb, PARENT], link)
    else:
        _carry(forms, limb, table.limbs[limb, PARENT], link)


@kernel_part
def _carry_point(forms: Floats, limb: int, parent: int, link: Vector) -> None:
    """Add what is said of the point of a parent at `link`, the origin of a limb that turns freely."""
    shift, force = symmetric(forms, limb, SHIFT), vector(forms, limb, FORCE)
    a, b, c, d, e, f = shift
    p, q, r = cross(link, (a, b, c)), cross(link, (b, d, e)), cross(link, (c, e, f))
    x, y, z = _levered(link, p, q, r)
    add_symmetric(forms, parent, TURN, (x[0], x[1], x[2], y[1], y[2], z[2]))
    _add_columns(forms, parent, p, q, r)
    add_symmetric(forms, parent, SHIFT, shift)
    add_vector(forms, parent, TORQUE, cross(link, force))
    add_vector(forms, parent, FORCE, force)


@kernel_part
def _carry(forms: Floats, limb: int, parent: int, link: Vector) -> None:
    """Add what is said of a limb whose turn counts as its parent's own."""
    _carry_point(forms, limb, parent, link)
    a, b, c = vector(forms, limb, MIXED), vector(forms, limb, MIXED + 3), vector(forms, limb, MIXED + 6)
    x, y, z = _levered(link, a, b, c)
    add_symmetric(forms, parent, TURN, symmetric(forms, limb, TURN))
    add_symmetric(forms, parent, TURN, (2 * x[0], x[1] + y[0], x[2] + z[0], 2 * y[1], y[2] + z[1], 2 * z[2]))
    _add_columns(forms, parent, a, b, c)
    add_vector(forms, parent, TORQUE, vector(forms, limb, TORQUE))


@kernel_part
def _levered(link: Vector, a: Vector, b: Vector, c: Vector) -> Matrix:
    """Return -[a b c] @ [link]x, of which each row is link x that of [a b c]."""
    return (
        cross(link, (a[0], b[0], c[0])),
        cross(link, (a[1], b[1], c[1])),
        cross(link, (a[2], b[2], c[2])),
    )


@kernel_part
def _add_columns(forms: Floats, limb: int, a: Vector, b: Vector, c: Vector) -> None:
    """Add columns to those of a mixed matrix."""
    add_vector(forms, limb, MIXED, a)
    add_vector(forms, limb, MIXED + 3, b)
    add_vector(forms, limb, MIXED + 6, c)


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
    x = times(shift[0], vector(solved, limb, FOLLOW))
    y = times(shift[1], vector(solved, limb, FOLLOW + 3))
    z = times(shift[2], vector(solved, limb, FOLLOW + 6))
    return minus(minus(minus(vector(solved, limb, FREE_REST), x), y), z)


@kernel_part
def _turn_about(solved: Floats, limb: int, first: int, turn: Vector, shift: Vector) -> Vector:
    """Return the turn about an axis of a limb that is turned and shifted already."""
    by_turn, by_shift = vector(solved, limb, first + BY_TURN), vector(solved, limb, first + BY_SHIFT)
    angle = solved[limb, first + REST] - dot(by_turn, turn) - dot(by_shift, shift)
    return times(angle, vector(solved, limb, first + AXIS))
