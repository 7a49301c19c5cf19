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

import numpy as np

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.posing import (
    ARM,
    BY_SHIFT,
    BY_TURN,
    FREE,
    FREEDOMS,
    LINK,
    MIXED,
    N_ARM,
    N_AXIS,
    N_FORM,
    N_PLACE,
    PARENT,
    ROOT,
    ROTATION,
    SHIFT,
    START,
    TURN,
    VARIANCE,
    ChainTable,
    Place,
    carry_form,
    copy_rotations,
    find_forms,
    put,
    take_axis,
    world_axis,
)
from skelgen._kernels.small_matrices import (
    Matrix,
    Symmetric,
    Vector,
    add_symmetric,
    by_symmetric,
    cross,
    dot,
    matrix,
    plus,
    symmetric,
    times,
    transposed,
    turned,
    vector,
)
from skelgen.model.arrays import Floats, Ints

PARALLEL = 1e-9
"""Sine below which two directions have no common perpendicular."""

POSE_RIDGE = 1e-12
"""Relative ridge under a frame's normal matrix: for turns that no marker determines."""

FIRST_AXIS, SECOND_AXIS = fixed(0, 1)

TORQUES, FORCES, ROWS = fixed(0, 3, 6)
"""Rows of the table of columns: T, F, and what a turn that is minimised out leaves."""


ORDER, FIRST, LAST, N_TILTS = fixed(0, 1, 2, 3)
"""Columns of `Columns.limbs`."""


class Columns(NamedTuple):
    """Where the constants stand, sorted so that those of a limb and all beyond it stand side by side.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_limbs, 4)
        The limbs in an order in which each comes before all beyond it; for each limb, where its constants and those
        beyond it begin and end: joint, tilts, offsets, limbs beyond; and the constants of the axis of its joint.
    across : ndarray, shape (2 * n_limbs, 3)
        Two directions in the parent of each limb about which axes are tilted.
    """

    limbs: Ints
    across: Floats


@kernel
def add_frames(table: ChainTable, columns: Columns, rotations: Floats, weights: Floats, total: Floats) -> None:
    """Add what some frames tell to the upper half of S.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    columns : Columns
        Where the constants stand.
    rotations : ndarray, shape (n_frames * n_limbs, 9)
        World from limb by its rows, frame by frame.
    weights : ndarray, shape (n_frames * n_markers,)
        Of the squared distances, 0 where unseen.
    total : ndarray, shape (n_constants, n_constants)
        S, of which the upper half is added to.
    """
    n_limbs, n_markers = len(table.joints), len(table.markers)
    place = Place(np.zeros((n_limbs, N_PLACE)), np.empty((n_markers, N_ARM)))
    nowhere = np.zeros((len(weights), 3))  # what is measured does not count
    forms, whole, solved = np.empty((n_limbs, N_FORM)), np.empty((n_limbs, N_FORM)), np.empty((n_limbs, 2 * N_AXIS))
    work = np.zeros((ROWS + 3, len(total)))
    for root in range(0, len(rotations), n_limbs):
        marker = root // n_limbs * n_markers
        copy_rotations(rotations, root, place.limbs)
        put(table, nowhere, weights, marker, place)
        all_weights, _ = find_forms(table, weights, marker, place, forms)
        level = ridge(mean_turn(table, place, forms, whole))
        for entry in range(n_limbs - 1, -1, -1):
            limb = columns.limbs[entry, ORDER]
            add_offsets(table, columns, weights, marker, place, limb, work, total)
            if table.limbs[limb, FREEDOMS] == FREE:
                own = 3 if limb > 0 else 0
                take_free_turn(
                    forms, limb, level, work, columns.limbs[limb, FIRST] + own, columns.limbs[limb, LAST], total
                )
            else:
                add_tilts(table, columns, place, forms, limb, work, total)
                take_axes(table, columns, place, forms, limb, level, solved, work, total)
            if limb > 0:
                add_joint(columns, place, table.limbs[limb, PARENT], forms, limb, work, total)
                carry_columns(table, columns, place, forms, limb, work)
        factor = inverse_root(symmetric(forms, ROOT, SHIFT), ridge(all_weights))
        take_rows(factor, work, FORCES, ROOT, len(total), total)


@kernel_part
def ridge(diagonal: float) -> float:
    """What keeps a matrix regular that has this mean diagonal: 1 in frames that show nothing."""
    return POSE_RIDGE * diagonal if diagonal > 0.0 else 1.0


@kernel_part
def mean_turn(table: ChainTable, place: Place, forms: Floats, whole: Floats) -> float:
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
def add_offsets(
    table: ChainTable,
    columns: Columns,
    weights: Floats,
    first: int,
    place: Place,
    limb: int,
    work: Floats,
    total: Floats,
) -> None:
    """Let the offsets of a limb's markers come in."""
    column = columns.limbs[limb, FIRST] + columns.limbs[limb, N_TILTS] + (3 if limb > 0 else 0)
    axes = transposed(matrix(place.limbs, limb, ROTATION))
    for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
        weight = weights[first + table.markers[own]]
        for axis in range(3):
            force = times(weight, axes[axis])
            torque = cross(vector(place.markers, own, ARM), force) if weight > 0.0 else force
            set_column(work, FORCES, column, force)
            set_column(work, TORQUES, column, torque)
            total[column, column] += weight
            column += 1


@kernel_part
def add_tilts(
    table: ChainTable, columns: Columns, place: Place, forms: Floats, limb: int, work: Floats, total: Floats
) -> None:
    """Let the constants of the axis of a limb's joint come in: they turn it."""
    a, b, c = vector(forms, limb, MIXED), vector(forms, limb, MIXED + 3), vector(forms, limb, MIXED + 6)
    for tilt in range(columns.limbs[limb, N_TILTS] - 1, -1, -1):
        change = tilted(table, columns, place, limb, tilt)
        column = columns.limbs[limb, FIRST] + 3 + tilt
        set_column(work, TORQUES, column, by_symmetric(symmetric(forms, limb, TURN), change))
        set_column(work, FORCES, column, (dot(a, change), dot(b, change), dot(c, change)))
        mix(total, column, 1.0, change, work, TORQUES, column, columns.limbs[limb, LAST])


@kernel_part
def tilted(table: ChainTable, columns: Columns, place: Place, limb: int, tilt: int) -> Vector:
    """Return how a constant of the axis of a limb's joint turns the limb; see `Articulation.axes_of`."""
    if tilt < 2:
        return turned(
            matrix(place.limbs, table.limbs[limb, PARENT], ROTATION), vector(columns.across, 2 * limb + tilt, ROOT)
        )
    normal = cross(world_axis(table, place, limb, FIRST_AXIS), world_axis(table, place, limb, SECOND_AXIS))
    size = math.sqrt(dot(normal, normal))
    return times(1.0 / size if size > PARALLEL else 0.0, normal)


@kernel_part
def add_joint(
    columns: Columns, place: Place, parent: int, forms: Floats, limb: int, work: Floats, total: Floats
) -> None:
    """Let the joint above a limb come in: it shifts the origin."""
    a, b, c = vector(forms, limb, MIXED), vector(forms, limb, MIXED + 3), vector(forms, limb, MIXED + 6)
    axes = transposed(matrix(place.limbs, parent, ROTATION))
    for axis in range(2, -1, -1):
        column, shift = columns.limbs[limb, FIRST] + axis, axes[axis]
        set_column(work, FORCES, column, by_symmetric(symmetric(forms, limb, SHIFT), shift))
        set_column(work, TORQUES, column, plus(plus(times(shift[0], a), times(shift[1], b)), times(shift[2], c)))
        mix(total, column, 1.0, shift, work, FORCES, column, columns.limbs[limb, LAST])


@kernel_part
def take_free_turn(forms: Floats, limb: int, level: float, work: Floats, first: int, last: int, total: Floats) -> None:
    """Minimise a free turn out."""
    factor = inverse_root(symmetric(forms, limb, TURN), level)
    a = turned(factor, vector(forms, limb, MIXED))
    b = turned(factor, vector(forms, limb, MIXED + 3))
    c = turned(factor, vector(forms, limb, MIXED + 6))
    add_symmetric(forms, limb, SHIFT, (-dot(a, a), -dot(a, b), -dot(a, c), -dot(b, b), -dot(b, c), -dot(c, c)))
    take_rows(factor, work, TORQUES, first, last, total)
    mix(work, FORCES, 1.0, times(-1.0, a), work, ROWS, first, last)
    mix(work, FORCES + 1, 1.0, times(-1.0, b), work, ROWS, first, last)
    mix(work, FORCES + 2, 1.0, times(-1.0, c), work, ROWS, first, last)


@kernel_part
def take_rows(factor: Matrix, work: Floats, source: int, first: int, last: int, total: Floats) -> None:
    """Take what three unknowns tell from S, their columns multiplied by the root of their inverse matrix."""
    mix(work, ROWS, 0.0, factor[0], work, source, first, last)
    mix(work, ROWS + 1, 0.0, factor[1], work, source, first, last)
    mix(work, ROWS + 2, 0.0, factor[2], work, source, first, last)
    for row in range(first, last):
        own = (-work[ROWS, row], -work[ROWS + 1, row], -work[ROWS + 2, row])
        mix(total, row, 1.0, own, work, ROWS, row, last)


@kernel_part
def take_axes(
    table: ChainTable,
    columns: Columns,
    place: Place,
    forms: Floats,
    limb: int,
    level: float,
    solved: Floats,
    work: Floats,
    total: Floats,
) -> None:
    """Minimise the turns about the axes of a limb's joint out, the outer first."""
    first, last = columns.limbs[limb, FIRST] + 3, columns.limbs[limb, LAST]
    for place_of_axis in range(table.limbs[limb, FREEDOMS] - 1, -1, -1):
        axis = world_axis(table, place, limb, place_of_axis)
        take_axis(forms, limb, axis, level, solved, ROOT)
        root = math.sqrt(solved[limb, VARIANCE])
        by_turn, by_shift = vector(solved, limb, BY_TURN), vector(solved, limb, BY_SHIFT)
        mix(work, ROWS, 0.0, times(root, axis), work, TORQUES, first, last)
        for row in range(first, last):
            take_row(total, row, work[ROWS, row], work, row, last)
        for part in range(3):
            take_row(work, TORQUES + part, by_turn[part] / root, work, first, last)
            take_row(work, FORCES + part, by_shift[part] / root, work, first, last)


@kernel_part
def carry_columns(table: ChainTable, columns: Columns, place: Place, forms: Floats, limb: int, work: Floats) -> None:
    """Carry a limb's form with its columns to its parent."""
    first, last = columns.limbs[limb, FIRST], columns.limbs[limb, LAST]
    kept = 0.0 if table.limbs[limb, FREEDOMS] == FREE else 1.0
    carry_form(table, place, forms, limb)
    x, y, z = vector(place.limbs, limb, LINK)
    mix(work, TORQUES, kept, (0.0, -z, y), work, FORCES, first, last)
    mix(work, TORQUES + 1, kept, (z, 0.0, -x), work, FORCES, first, last)
    mix(work, TORQUES + 2, kept, (-y, x, 0.0), work, FORCES, first, last)


@kernel_part
def inverse_root(matrix: Symmetric, level: float) -> Matrix:
    """Return W with W^T W = (matrix + level)^-1, lower, no pivot below the level."""
    a, b, c, d, e, f = matrix
    pivot = max(a + level, level)
    low, lower, first = b / pivot, c / pivot, 1.0 / math.sqrt(pivot)
    pivot = max(d + level - low * b, level)
    mixed = e - lower * b
    across, second = mixed / pivot, 1.0 / math.sqrt(pivot)
    third = 1.0 / math.sqrt(max(f + level - lower * c - across * mixed, level))
    return (
        (first, 0.0, 0.0),
        (-low * second, second, 0.0),
        ((low * across - lower) * third, -across * third, third),
    )


@kernel_part
def set_column(work: Floats, top: int, column: int, value: Vector) -> None:
    """Write three numbers one below the other."""
    work[top, column], work[top + 1, column], work[top + 2, column] = value


@kernel_part
def mix(
    target: Floats, row: int, kept: float, factors: Vector, source: Floats, top: int, first: int, last: int
) -> None:
    """Replace a part of a row by `kept` times itself and three rows of a table times factors."""
    a, b, c = factors
    out = target[row, first:last]  # numbers from 0 on tell the compiler that nothing counts from the end
    x, y, z = source[top, first:last], source[top + 1, first:last], source[top + 2, first:last]
    for place in range(len(out)):
        out[place] = kept * out[place] + a * x[place] + b * y[place] + c * z[place]


@kernel_part
def take_row(target: Floats, row: int, factor: float, work: Floats, first: int, last: int) -> None:
    """Take a part of the first of what is left by an unknown, times a factor, from a row."""
    out, taken = target[row, first:last], work[ROWS, first:last]
    for place in range(len(out)):
        out[place] -= factor * taken[place]
