r"""Information of a chain's constants, frame by frame, poses eliminated.


As in `posing`, what a limb's markers and all beyond it say is a quadratic form in the limb's turn :math:`\omega` and
the shift :math:`\delta` of its origin, and the turns are minimised out from the leaves to the root. Here the constants
c come into it on the way, each where it belongs, by columns T and F and what they cost by themselves,

.. math::
    \omega^T T c + \delta^T F c + \tfrac12 c^T S c .

A marker's offset comes in with its limb, the tilts of an axis before the turn about it is minimised out, a joint when
its limb is carried to the parent. So a limb knows of no constants but those of its own and beyond, which stand side by
side; when the root's turn and shift are gone too, S is left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.chain import (
    FREE,
    FREEDOMS,
    LINK,
    ROOT,
    ChainTable,
    Measured,
    Place,
    copy_rotations,
    forward_kinematics,
    world_axis,
)
from skelgen._kernels.chain_constants import (
    FIRST,
    FORCES,
    LAST,
    ORDER,
    ROWS,
    TORQUES,
    Constants,
    Span,
    add_displacements,
    add_joint,
    add_offsets,
    add_rows,
    add_tilts,
)
from skelgen._kernels.posing import Room
from skelgen._kernels.quadratic_forms import (
    BY_SHIFT,
    BY_TURN,
    MIXED,
    N_FORM,
    SHIFT,
    TURN,
    VARIANCE,
    carry_form,
    find_forms,
    take_axis,
)
from skelgen._kernels.small_matrices import (
    Matrix,
    Symmetric,
    Vector,
    add_symmetric,
    by_symmetric,
    dot,
    matrix,
    product,
    symmetric,
    times,
    transposed,
    vector,
)
from skelgen.model.arrays import Floats, Ints

POSE_RIDGE = 1e-12
"""Relative ridge under a frame's normal matrix: for turns that no marker determines."""


class FrameInformation(NamedTuple):
    """What single frames say of the constants, where displacements stand for offsets.

    Attributes
    ----------
    places : ndarray of intp, shape (n_columns,)
        Which constant each column is, displacements last; -1 for none.
    products : ndarray, shape (n_frames, n_constants, n_displacements)
        S of each frame between all constants and the displacements.
    among : ndarray, shape (n_before, n_before)
        S between the constants before the displacements, summed over frames.
    """

    places: Ints
    products: Floats
    among: Floats


@kernel
def add_frames(table: ChainTable, constants: Constants, measured: Measured, rotations: Floats, room: Room) -> None:
    """Add what some frames tell to the upper half of S.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    constants : Constants
        What is added to.
    measured : tuple
        Markers and weights, of which only the weights count.
    rotations : ndarray, shape (n_frames * n_limbs, 9)
        World from limb by its rows, frame by frame.
    room : Room
        Where to work.
    """
    for root in range(0, len(rotations), len(table.joints)):
        _add_frame(table, constants, measured, rotations, root, room)


@kernel
def write_frames(
    table: ChainTable, constants: Constants, measured: Measured, rotations: Floats, room: Room, out: FrameInformation
) -> None:
    """Write what each frame tells by itself, but for what it tells of the constants before displacements.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    constants : Constants
        Displacements stand for offsets; S is used for each frame in turn.
    measured : tuple
        Markers and weights, of which only the weights count.
    rotations : ndarray, shape (n_frames * n_limbs, 9)
        World from limb by its rows, frame by frame.
    room : Room
        Where to work.
    out : FrameInformation
        Receives the results, sums of 0 at first.
    """
    total, n_before = constants.total, len(out.among)
    for frame in range(len(out.products)):
        for row in range(len(total)):
            for column in range(row, len(total)):
                total[row, column] = 0.0
        _add_frame(table, constants, measured, rotations, frame * len(table.joints), room)
        for row in range(len(total)):
            for column in range(row, len(total)):
                one, other = out.places[row], out.places[column]
                if one >= 0 and other >= 0:
                    low, high = min(one, other), max(one, other)
                    if high < n_before:
                        out.among[low, high] += total[row, column]
                    else:
                        out.products[frame, low, high - n_before] = total[row, column]
                    if low >= n_before:
                        out.products[frame, high, low - n_before] = total[row, column]


@kernel_part
def _add_frame(
    table: ChainTable, constants: Constants, measured: Measured, rotations: Floats, root: int, room: Room
) -> None:
    """Add what a frame tells, whose rotations begin in row `root`, to the upper half of S."""
    positions, weights = measured
    columns, place, forms = constants.columns, room.here, room.forms
    n_limbs, n_markers = len(table.joints), len(table.markers)
    copy_rotations(rotations, root, place.limbs)
    forward_kinematics(table, positions, weights, root // n_limbs * n_markers, place)
    all_weights, _ = find_forms(table, place, forms)
    level = _ridge(_mean_turn(table, place, forms, room.spare))
    for entry in range(n_limbs - 1, -1, -1):
        limb = columns.limbs[entry, ORDER]
        if constants.basis.shape[2] > 0:
            add_displacements(table, place, limb, constants)
        else:
            add_offsets(table, place, limb, constants)
        if table.limbs[limb, FREEDOMS] == FREE:
            _eliminate_free_turn(forms, limb, level, constants)
        else:
            add_tilts(table, place, forms, limb, constants)
            _eliminate_axes(table, place, forms, limb, level, constants)
        if limb > 0:
            add_joint(table, place, forms, limb, constants)
            _carry_columns(table, place, forms, limb, constants)
    factor = _inverse_root(symmetric(forms, ROOT, SHIFT), _ridge(all_weights))
    _eliminate_rows(factor, FORCES, (ROOT, len(constants.total)), constants)


@kernel_part
def _ridge(diagonal: float) -> float:
    """What keeps a matrix regular that has this mean diagonal: 1 in frames that show nothing."""
    return POSE_RIDGE * diagonal if diagonal > 0.0 else 1.0


@kernel_part
def _mean_turn(table: ChainTable, place: Place, forms: Floats, whole: Floats) -> float:
    """Return the mean diagonal of all turns' matrix while all of them are unknown."""
    total, n_turns = 0.0, 0
    for limb in range(len(forms)):
        for column in range(N_FORM):
            whole[limb, column] = forms[limb, column]
    for limb in range(len(forms) - 1, -1, -1):
        turn = symmetric(whole, limb, TURN)
        n_turns += table.limbs[limb, FREEDOMS]
        if table.limbs[limb, FREEDOMS] == FREE:
            total += turn[0] + turn[3] + turn[5]
        else:
            for which in range(table.limbs[limb, FREEDOMS]):
                axis = world_axis(table, place, limb, which)
                total += dot(axis, by_symmetric(turn, axis))
        if limb > 0:
            carry_form(table, place, whole, limb)
    return total / n_turns


@kernel_part
def _eliminate_free_turn(forms: Floats, limb: int, level: float, constants: Constants) -> None:
    """Minimise a free turn out."""
    limbs, coupling = constants.columns.limbs, constants.coupling
    span = limbs[limb, FIRST] + (3 if limb > 0 else 0), limbs[limb, LAST]
    factor = _inverse_root(symmetric(forms, limb, TURN), level)
    a, b, c = product(matrix(forms, limb, MIXED), transposed(factor))
    add_symmetric(forms, limb, SHIFT, (-dot(a, a), -dot(a, b), -dot(a, c), -dot(b, b), -dot(b, c), -dot(c, c)))
    _eliminate_rows(factor, TORQUES, span, constants)
    _mix(coupling, FORCES, 1.0, times(-1.0, a), ROWS, span)
    _mix(coupling, FORCES + 1, 1.0, times(-1.0, b), ROWS, span)
    _mix(coupling, FORCES + 2, 1.0, times(-1.0, c), ROWS, span)


@kernel_part
def _eliminate_rows(factor: Matrix, source: int, span: Span, constants: Constants) -> None:
    """Take what three unknowns tell from S, their columns multiplied by the root of their inverse matrix."""
    coupling = constants.coupling
    _mix(coupling, ROWS, 0.0, factor[0], source, span)
    _mix(coupling, ROWS + 1, 0.0, factor[1], source, span)
    _mix(coupling, ROWS + 2, 0.0, factor[2], source, span)
    for row in range(span[0], span[1]):
        own = (-coupling[ROWS, row], -coupling[ROWS + 1, row], -coupling[ROWS + 2, row])
        add_rows(constants, row, own, ROWS, span[1])


@kernel_part
def _eliminate_axes(
    table: ChainTable, place: Place, forms: Floats, limb: int, level: float, constants: Constants
) -> None:
    """Minimise the turns about the axes of a limb's joint out, the outer first."""
    solved, coupling, total = constants.solved, constants.coupling, constants.total
    first, last = constants.columns.limbs[limb, FIRST] + 3, constants.columns.limbs[limb, LAST]
    for place_of_axis in range(table.limbs[limb, FREEDOMS] - 1, -1, -1):
        axis = world_axis(table, place, limb, place_of_axis)
        take_axis(forms, limb, axis, level, solved, ROOT)
        root = math.sqrt(solved[limb, VARIANCE])
        by_turn, by_shift = vector(solved, limb, BY_TURN), vector(solved, limb, BY_SHIFT)
        _mix(coupling, ROWS, 0.0, times(root, axis), TORQUES, (first, last))
        for row in range(first, last):
            _subtract_row(total, row, coupling[ROWS, row], coupling, row, last)
        for part in range(3):
            _subtract_row(coupling, TORQUES + part, by_turn[part] / root, coupling, first, last)
            _subtract_row(coupling, FORCES + part, by_shift[part] / root, coupling, first, last)


@kernel_part
def _carry_columns(table: ChainTable, place: Place, forms: Floats, limb: int, constants: Constants) -> None:
    """Carry a limb's form with its columns to its parent."""
    limbs, coupling = constants.columns.limbs, constants.coupling
    span = limbs[limb, FIRST], limbs[limb, LAST]
    kept = 0.0 if table.limbs[limb, FREEDOMS] == FREE else 1.0
    carry_form(table, place, forms, limb)
    x, y, z = vector(place.limbs, limb, LINK)
    _mix(coupling, TORQUES, kept, (0.0, -z, y), FORCES, span)
    _mix(coupling, TORQUES + 1, kept, (z, 0.0, -x), FORCES, span)
    _mix(coupling, TORQUES + 2, kept, (-y, x, 0.0), FORCES, span)


@kernel_part
def _inverse_root(upper: Symmetric, level: float) -> Matrix:
    """Return W with W^T W = (matrix + level)^-1, lower, no pivot below the level."""
    a, b, c, d, e, f = upper
    pivot = max(a + level, level)
    low, lower, first = b / pivot, c / pivot, 1.0 / math.sqrt(pivot)
    pivot = max(d + level - low * b, level)
    mixed = e - lower * b
    across, second = mixed / pivot, 1.0 / math.sqrt(pivot)
    third = 1.0 / math.sqrt(max(f + level - lower * c - across * mixed, level))
    return ((first, 0.0, 0.0), (-low * second, second, 0.0), ((low * across - lower) * third, -across * third, third))


@kernel_part
def _mix(rows: Floats, row: int, kept: float, factors: Vector, top: int, span: Span) -> None:
    """Replace a part of a row by `kept` times itself and three other rows of the table times factors."""
    first, last = span
    a, b, c = factors
    out = rows[row, first:last]  # numbers from 0 on tell the compiler that nothing counts from the end
    x, y, z = rows[top, first:last], rows[top + 1, first:last], rows[top + 2, first:last]
    for place in range(len(out)):
        out[place] = kept * out[place] + a * x[place] + b * y[place] + c * z[place]


@kernel_part
def _subtract_row(target: Floats, row: int, factor: float, coupling: Floats, first: int, last: int) -> None:
    """Take a part of the first of what is left by an unknown, times a factor, from a row."""
    out, taken = target[row, first:last], coupling[ROWS, first:last]
    for place in range(len(out)):
        out[place] -= factor * taken[place]
