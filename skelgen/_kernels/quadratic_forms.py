r"""Quadratic forms of limbs in their turns and shifts: of their markers, without turns, carried to their parents.

What a limb's markers and all limbs beyond it say is a quadratic form in the limb's turn :math:`\omega` and the shift
:math:`\delta` of its origin,

.. math::
    \tfrac12 \omega^T A \omega + \omega^T B \delta + \tfrac12 \delta^T C \delta
    - \omega^T g_\omega - \delta^T g_\delta .

A form is a row of numbers: the upper half of A, the columns of B, the upper half of C, and the gradients by turn and
shift, called torque and force. A free turn that is minimised out is rest - follow @ shift, with a covariance where the
origin is known; a turn about an axis is rest - by_turn . turn - by_shift . shift, with a variance where all before it
is known.
"""

from __future__ import annotations

from skelgen._kernels import fixed, kernel_part
from skelgen._kernels.chain import ARM, ERROR, FREE, FREEDOMS, LINK, START, WEIGHT, ChainTable, Place
from skelgen._kernels.joint_models import PARENT
from skelgen._kernels.small_matrices import (
    Matrix,
    Symmetric,
    Vector,
    add_matrix,
    add_symmetric,
    add_vector,
    by_symmetric,
    cross,
    cross_matrix,
    dot,
    inverse,
    matrix,
    minus,
    plus,
    set_matrix,
    set_symmetric,
    set_vector,
    symmetric,
    times,
    transposed,
    turned,
    upper_of_product,
    vector,
)
from skelgen.model.arrays import Floats

REFINEMENTS = 4
"""Each takes off all but some thousandth of the error, at the least level."""

ILL_CONDITIONED = 1e8
"""Condition beyond which solutions are refined: the root of the precision of numbers."""

LEAST_LEVEL = 1e-13
"""Of a form's trace: below this rounding is larger than what it is to level."""

TURN, MIXED, SHIFT, TORQUE, FORCE, N_FORM = fixed(0, 6, 15, 21, 24, 27)
"""Where the parts of a form begin, and its length."""

FOLLOW, FREE_REST, COVARIANCE = fixed(0, 9, 12)
"""Where the parts of a free turn that is minimised out begin: columns of follow, rest, covariance."""

AXIS, BY_TURN, BY_SHIFT, REST, VARIANCE, N_AXIS = fixed(0, 3, 6, 9, 10, 11)
"""Where the parts of a turn about an axis that is minimised out begin; those of a second axis follow."""


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
        set_matrix(forms, limb, MIXED, transposed(cross_matrix(moment)))
        set_symmetric(forms, limb, SHIFT, (total, 0.0, 0.0, total, 0.0, total))
        set_vector(forms, limb, TORQUE, torque)
        set_vector(forms, limb, FORCE, force)
        all_weights += total
        all_traces += 2.0 * (xx + yy + zz)
    return all_weights, all_traces


@kernel_part
def take_turn(forms: Floats, limb: int, level: float, solved: Floats) -> None:
    """Minimise a free turn out of a limb's form.

    Parameters
    ----------
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms of the limbs.
    limb : int
        The limb.
    level : float
        Ridge under the matrices of the turns.
    solved : ndarray, shape (n_limbs, 22)
        Receives the turns that are minimised out.
    """
    form = symmetric(forms, limb, TURN)
    trace = form[0] + form[3] + form[5]
    level = max(level, LEAST_LEVEL * trace)
    covariance = inverse(form, level)
    a, b, c = matrix(forms, limb, MIXED)
    p, q, r = by_symmetric(covariance, a), by_symmetric(covariance, b), by_symmetric(covariance, c)
    if trace * (covariance[0] + covariance[3] + covariance[5]) > ILL_CONDITIONED:
        p, q, r = (  # else the rounding of a turn that hardly shows would grow from limb to limb
            _refined(form, level, covariance, p, a),
            _refined(form, level, covariance, q, b),
            _refined(form, level, covariance, r, c),
        )
    torque = vector(forms, limb, TORQUE)
    set_matrix(solved, limb, FOLLOW, (p, q, r))
    set_vector(solved, limb, FREE_REST, by_symmetric(covariance, torque))
    set_symmetric(solved, limb, COVARIANCE, covariance)
    add_symmetric(forms, limb, SHIFT, (-dot(a, p), -dot(a, q), -dot(a, r), -dot(b, q), -dot(b, r), -dot(c, r)))
    add_vector(forms, limb, FORCE, (-dot(p, torque), -dot(q, torque), -dot(r, torque)))


@kernel_part
def _refined(form: Symmetric, level: float, covariance: Symmetric, solution: Vector, right: Vector) -> Vector:
    """Return a solution of (form + level) x = right that is more exact than what the inverse, `covariance`, gave."""
    for _ in range(REFINEMENTS):
        left_over = minus(plus(by_symmetric(form, solution), times(level, solution)), right)
        solution = minus(solution, by_symmetric(covariance, left_over))
    return solution


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
    sideways = turned(matrix(forms, limb, MIXED), axis)
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
    x, y, z = _levered(link, (p, q, r))
    add_symmetric(forms, parent, TURN, (x[0], x[1], x[2], y[1], y[2], z[2]))
    add_matrix(forms, parent, MIXED, (p, q, r))
    add_symmetric(forms, parent, SHIFT, shift)
    add_vector(forms, parent, TORQUE, cross(link, force))
    add_vector(forms, parent, FORCE, force)


@kernel_part
def _carry(forms: Floats, limb: int, parent: int, link: Vector) -> None:
    """Add what is said of a limb whose turn counts as its parent's own."""
    _carry_point(forms, limb, parent, link)
    mixed = matrix(forms, limb, MIXED)
    x, y, z = _levered(link, mixed)
    add_symmetric(forms, parent, TURN, symmetric(forms, limb, TURN))
    add_symmetric(forms, parent, TURN, (2 * x[0], x[1] + y[0], x[2] + z[0], 2 * y[1], y[2] + z[1], 2 * z[2]))
    add_matrix(forms, parent, MIXED, mixed)
    add_vector(forms, parent, TORQUE, vector(forms, limb, TORQUE))


@kernel_part
def _levered(link: Vector, columns: Matrix) -> Matrix:
    """Return -M @ [link]x of a matrix M by its columns: each row is link x that of M."""
    x, y, z = transposed(columns)
    return cross(link, x), cross(link, y), cross(link, z)
