"""Constants of a chain: where they stand, how they come into the forms of limbs, and the gradient by them.

The forms are those of `information`. The gradient is that of the squared residuals, frame by frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.chain import (
    ARM,
    ERROR,
    FREE,
    FREEDOMS,
    LINK,
    ORIGIN,
    ROOT,
    ROTATION,
    START,
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
from skelgen._kernels.posing import Room
from skelgen._kernels.quadratic_forms import MIXED, SHIFT, TURN
from skelgen._kernels.small_matrices import (
    Vector,
    add_vector,
    by_symmetric,
    cross,
    dot,
    matrix,
    plus,
    set_vector,
    symmetric,
    times,
    transposed,
    turned,
    vector,
)
from skelgen.model.arrays import Floats, Ints

PARALLEL = 1e-9
"""Sine below which two directions have no common perpendicular."""

FIRST_AXIS, SECOND_AXIS = fixed(0, 1)

TORQUES, FORCES, ROWS = fixed(0, 3, 6)
"""Rows of `Constants.coupling`: T, F, and what a turn that is minimised out leaves."""

Span = tuple[int, int]
"""First and last of the columns that are worked on, which stand side by side; the last is not."""

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


class Constants(NamedTuple):
    """What frames say of the constants.

    Attributes
    ----------
    columns : Columns
        Where the constants stand.
    solved : ndarray, shape (n_limbs, 22)
        Turns that are minimised out; see `posing.take_axis`.
    coupling : ndarray, shape (9, n_constants)
        T and F of one frame, and three rows for a turn that is minimised out.
    total : ndarray, shape (n_constants, n_constants)
        S, of which the upper half is added to.
    basis : ndarray, shape (n_markers, 3, n_displacements)
        Displacements of each limb's markers, in the order of the table, that stand for their offsets; none if these
        are constants themselves.
    """

    columns: Columns
    solved: Floats
    coupling: Floats
    total: Floats
    basis: Floats


def constants_in(columns: Columns, room: Room, basis: Floats) -> Constants:
    """Return constants of which nothing is known yet.

    Parameters
    ----------
    columns : Columns
        Where they stand.
    room : Room
        Where frames are worked in.
    basis : ndarray, shape (n_markers, 3, n_displacements)
        See `Constants`.
    """
    size = columns.limbs[:, LAST].max()
    return Constants(columns, room.solved, np.zeros((ROWS + 3, size)), np.zeros((size, size)), basis)


@kernel_part
def add_offsets(table: ChainTable, place: Place, limb: int, constants: Constants) -> None:
    """Let the offsets of a limb's markers come in.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where limbs and markers are in one frame.
    limb : int
        Its index.
    constants : Constants
        What is added to.
    """
    column = _first_of_markers(limb, constants.columns)
    axes = transposed(matrix(place.limbs, limb, ROTATION))
    for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
        weight = place.markers[own, WEIGHT]
        for axis in range(3):
            force = times(weight, axes[axis])
            torque = cross(vector(place.markers, own, ARM), force) if weight > 0.0 else force
            _set_column(constants.coupling, FORCES, column, force)
            _set_column(constants.coupling, TORQUES, column, torque)
            constants.total[column, column] += weight
            column += 1


@kernel_part
def add_displacements(table: ChainTable, place: Place, limb: int, constants: Constants) -> None:
    """Let displacements of a limb's markers come in, which stand for their offsets.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where limbs and markers are in one frame.
    limb : int
        Its index.
    constants : Constants
        What is added to.
    """
    first, basis, total = _first_of_markers(limb, constants.columns), constants.basis, constants.total
    rotation = matrix(place.limbs, limb, ROTATION)
    for one in range(basis.shape[2]):
        force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
            weight = place.markers[own, WEIGHT]
            if weight > 0.0:
                pull = times(weight, turned(rotation, (basis[own, 0, one], basis[own, 1, one], basis[own, 2, one])))
                force = plus(force, pull)
                torque = plus(torque, cross(vector(place.markers, own, ARM), pull))
                for other in range(one, basis.shape[2]):
                    for axis in range(3):
                        total[first + one, first + other] += weight * basis[own, axis, one] * basis[own, axis, other]
        _set_column(constants.coupling, FORCES, first + one, force)
        _set_column(constants.coupling, TORQUES, first + one, torque)


@kernel_part
def _first_of_markers(limb: int, columns: Columns) -> int:
    """Return the column of the first constant of a limb's markers, behind those of its joint."""
    return int(columns.limbs[limb, FIRST] + columns.limbs[limb, N_TILTS] + (3 if limb > 0 else 0))


@kernel_part
def add_tilts(table: ChainTable, place: Place, forms: Floats, limb: int, constants: Constants) -> None:
    """Let the constants of the axis of a limb's joint come in: they turn it.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where limbs and markers are in one frame.
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms in turn and shift of each limb with all beyond it; see `quadratic_forms`.
    limb : int
        Its index.
    constants : Constants
        What is added to.
    """
    columns = constants.columns
    mixed = matrix(forms, limb, MIXED)
    for tilt in range(columns.limbs[limb, N_TILTS] - 1, -1, -1):
        change = tilted(table, columns, place, limb, tilt)
        column = columns.limbs[limb, FIRST] + 3 + tilt
        _set_column(constants.coupling, TORQUES, column, by_symmetric(symmetric(forms, limb, TURN), change))
        _set_column(constants.coupling, FORCES, column, turned(mixed, change))
        add_rows(constants, column, change, TORQUES, columns.limbs[limb, LAST])


@kernel_part
def tilted(table: ChainTable, columns: Columns, place: Place, limb: int, tilt: int) -> Vector:
    """Return how a constant of the axis of a limb's joint turns the limb; see `Articulation.axes_of`.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    columns : Columns
        Where the constants stand.
    place : Place
        Where the chain is.
    limb : int
        The limb.
    tilt : int
        Which of the constants of its axis.
    """
    if tilt < 2:
        return turned(
            matrix(place.limbs, table.limbs[limb, PARENT], ROTATION), vector(columns.across, 2 * limb + tilt, ROOT)
        )
    normal = cross(world_axis(table, place, limb, FIRST_AXIS), world_axis(table, place, limb, SECOND_AXIS))
    size = math.sqrt(dot(normal, normal))
    return times(1.0 / size if size > PARALLEL else 0.0, normal)


@kernel_part
def add_joint(table: ChainTable, place: Place, forms: Floats, limb: int, constants: Constants) -> None:
    """Let the joint above a limb come in: it shifts the origin.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where limbs and markers are in one frame.
    forms : ndarray, shape (n_limbs, 27)
        Quadratic forms in turn and shift of each limb with all beyond it; see `quadratic_forms`.
    limb : int
        Its index.
    constants : Constants
        What is added to.
    """
    columns = constants.columns
    by_shift = transposed(matrix(forms, limb, MIXED))
    axes = transposed(matrix(place.limbs, table.limbs[limb, PARENT], ROTATION))
    for axis in range(2, -1, -1):
        column, shift = columns.limbs[limb, FIRST] + axis, axes[axis]
        _set_column(constants.coupling, FORCES, column, by_symmetric(symmetric(forms, limb, SHIFT), shift))
        _set_column(constants.coupling, TORQUES, column, turned(by_shift, shift))
        add_rows(constants, column, shift, FORCES, columns.limbs[limb, LAST])


@kernel_part
def add_rows(constants: Constants, row: int, factors: Vector, top: int, last: int) -> None:
    """Add three rows of the coupling times factors to a row of S, from its diagonal on.

    Parameters
    ----------
    constants : Constants
        What is added to.
    row : int
        Row of S.
    factors : tuple of float
        One for each of the three rows.
    top : int
        First of these: `TORQUES`, `FORCES` or `ROWS`.
    last : int
        Column before which they end.
    """
    a, b, c = factors
    out, rows = constants.total[row, row:last], constants.coupling
    x, y, z = rows[top, row:last], rows[top + 1, row:last], rows[top + 2, row:last]
    for place in range(len(out)):
        out[place] = out[place] + a * x[place] + b * y[place] + c * z[place]


@kernel_part
def _set_column(work: Floats, top: int, column: int, value: Vector) -> None:
    """Write three numbers one below the other."""
    work[top, column], work[top + 1, column], work[top + 2, column] = value


FORCE, MOMENT = fixed(0, 3)
"""Columns of the sums over a limb and all beyond it."""


@kernel
def add_gradient(
    table: ChainTable, columns: Columns, measured: Measured, poses: FramePoses, total: Floats, room: Room
) -> None:
    """Add the gradient of some frames; forces and torques are summed from the leaves to the root.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    columns : Columns
        Where the constants stand.
    measured : tuple
        Markers and weights.
    poses : tuple
        Where the root's origin is, and the limbs' rotations.
    total : ndarray, shape (n_constants,)
        What is added to.
    room : Room
        Where to work.
    """
    positions, weights = measured
    roots, rotations = poses
    place, sums = room.here, room.spare
    n_limbs, n_markers = len(table.joints), len(table.markers)
    for frame in range(len(roots)):
        first = frame * n_markers
        set_vector(place.limbs, ROOT, ORIGIN, vector(roots, frame, ROOT))
        copy_rotations(rotations, frame * n_limbs, place.limbs)
        for limb in range(n_limbs):
            for column in range(6):
                sums[limb, column] = 0.0
        forward_kinematics(table, positions, weights, first, place)
        for limb in range(n_limbs - 1, -1, -1):
            _add_offset_gradient(table, columns, place, limb, sums, total)
            if limb > 0:
                _add_joint_gradient(table, columns, place, limb, sums, total)


@kernel_part
def _add_offset_gradient(
    table: ChainTable, columns: Columns, place: Place, limb: int, sums: Floats, total: Floats
) -> None:
    """Add the gradient at the offsets of a limb's markers, and what their residuals do to the limb."""
    column = _first_of_markers(limb, columns)
    axes = transposed(matrix(place.limbs, limb, ROTATION))
    force, torque = vector(sums, limb, FORCE), vector(sums, limb, MOMENT)
    for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
        weight = place.markers[own, WEIGHT]
        if weight > 0.0:
            own_force = times(weight, vector(place.markers, own, ERROR))
            _add_to(total, column, turned(axes, own_force))
            force, torque = plus(force, own_force), plus(torque, cross(vector(place.markers, own, ARM), own_force))
        column += 3
    set_vector(sums, limb, FORCE, force)
    set_vector(sums, limb, MOMENT, torque)


@kernel_part
def _add_joint_gradient(
    table: ChainTable, columns: Columns, place: Place, limb: int, sums: Floats, total: Floats
) -> None:
    """Add the gradient at a limb's joint and axes, and what it does to the parent."""
    parent, force, torque = table.limbs[limb, PARENT], vector(sums, limb, FORCE), vector(sums, limb, MOMENT)
    _add_to(total, columns.limbs[limb, FIRST], turned(transposed(matrix(place.limbs, parent, ROTATION)), force))
    for tilt in range(columns.limbs[limb, N_TILTS]):
        total[columns.limbs[limb, FIRST] + 3 + tilt] += dot(tilted(table, columns, place, limb, tilt), torque)
    add_vector(sums, parent, FORCE, force)
    add_vector(sums, parent, MOMENT, cross(vector(place.limbs, limb, LINK), force))
    if table.limbs[limb, FREEDOMS] < FREE:
        add_vector(sums, parent, MOMENT, torque)


@kernel_part
def _add_to(total: Floats, first: int, value: Vector) -> None:
    """Add three numbers to those in a row."""
    for axis in range(3):
        total[first + axis] += value[axis]
