"""Gradient of the squared residuals with respect to a chain's constants, frame by frame."""

from __future__ import annotations

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
)
from skelgen._kernels.chain_constants import FIRST, N_TILTS, Columns, tilted
from skelgen._kernels.joint_models import PARENT
from skelgen._kernels.posing import Room
from skelgen._kernels.small_matrices import (
    Vector,
    add_vector,
    cross,
    dot,
    matrix,
    plus,
    set_vector,
    times,
    transposed,
    turned,
    vector,
)
from skelgen.model.arrays import Floats

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
    column = columns.limbs[limb, FIRST] + columns.limbs[limb, N_TILTS] + (3 if limb > 0 else 0)
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
