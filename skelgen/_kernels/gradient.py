"""Gradient of the squared residuals with respect to a chain's constants, frame by frame."""

from __future__ import annotations

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.information import Columns, tilted
from skelgen._kernels.posing import ChainTable, Place, new_place, put
from skelgen._kernels.small_matrices import (
    Vector,
    add_vector,
    cross,
    dot,
    matrix,
    plus,
    set_matrix,
    set_vector,
    times,
    transposed,
    turned,
    vector,
)
from skelgen.model.arrays import Floats


@kernel
def add_pulls(
    table: ChainTable,
    columns: Columns,
    roots: Floats,
    rotations: Floats,
    positions: Floats,
    weights: Floats,
    total: Floats,
) -> None:
    """Add the pull of some frames; forces and torques are summed from the leaves to the root."""
    n_limbs = len(table.parents)
    place, sums = new_place(n_limbs, len(table.markers)), np.empty((n_limbs, 6))
    for frame in range(len(weights)):
        for axis in range(3):
            place.root[axis] = roots[frame, axis]
        for limb in range(n_limbs):
            set_matrix(place.rotations, limb, matrix(rotations[frame], limb))
            for column in range(6):
                sums[limb, column] = 0.0
        put(table, positions[frame], weights[frame], place)
        for limb in range(n_limbs - 1, -1, -1):
            pull_at_offsets(table, columns, weights[frame], place, limb, sums, total)
            if limb > 0:
                pull_at_joint(table, columns, place, limb, sums, total)


@kernel_part
def pull_at_offsets(
    table: ChainTable, columns: Columns, weights: Floats, place: Place, limb: int, sums: Floats, total: Floats
) -> None:
    """Add the pull at the offsets of a limb's markers, and what their residuals do to the limb."""
    column = columns.first[limb] + columns.n_tilts[limb] + (3 if limb > 0 else 0)
    axes = transposed(matrix(place.rotations, limb))
    force, torque = vector(sums, limb, 0), vector(sums, limb, 3)
    for own in range(table.starts[limb], table.starts[limb + 1]):
        weight = weights[table.markers[own]]
        if weight > 0.0:
            pull = times(weight, vector(place.errors, own, 0))
            add_to(total, column, turned(axes, pull))
            force, torque = plus(force, pull), plus(torque, cross(vector(place.arms, own, 0), pull))
        column += 3
    set_vector(sums, limb, 0, force)
    set_vector(sums, limb, 3, torque)


@kernel_part
def pull_at_joint(table: ChainTable, columns: Columns, place: Place, limb: int, sums: Floats, total: Floats) -> None:
    """Add the pull at a limb's joint and axes, and what it does to the parent."""
    parent, force, torque = table.parents[limb], vector(sums, limb, 0), vector(sums, limb, 3)
    add_to(total, columns.first[limb], turned(transposed(matrix(place.rotations, parent)), force))
    for tilt in range(columns.n_tilts[limb]):
        total[columns.first[limb] + 3 + tilt] += dot(tilted(table, columns, place, limb, tilt), torque)
    add_vector(sums, parent, 0, force)
    add_vector(sums, parent, 3, cross(vector(place.links, limb, 0), force))
    if table.freedoms[limb] < 3:
        add_vector(sums, parent, 3, torque)


@kernel_part
def add_to(total: Floats, first: int, value: Vector) -> None:
    """Add three numbers to those in a row."""
    for axis in range(3):
        total[first + axis] += value[axis]
