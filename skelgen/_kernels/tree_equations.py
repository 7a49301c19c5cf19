r"""Normal equations of bodies in a tree, each with six unknowns.

Only bodies with a joint in common have a block of the normal matrix in common, so that the tree is eliminated from its
leaves inward. With the block :math:`D = L L^T` of a body whose children are eliminated, its gradient :math:`g`, and
:math:`C` that it shares with its parent,

.. math::
    U = L^{-1} C, \quad D_p \leftarrow D_p - U^T U, \quad g_p \leftarrow g_p - U^T L^{-1} g, \quad
    x = L^{-T} (L^{-1} g - U x_p), \quad S = L^{-T} (1 + U S_p U^T) L^{-1}

are what remains for the parent, the body's unknowns, and its block of the inverse (Takahashi, Fagan and Chin 1973): the
time grows with the number of bodies, not with its cube.
"""

from __future__ import annotations

from typing import NamedTuple

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.least_squares import write_inverse_root
from skelgen.model.arrays import Floats, Ints

N_FREEDOMS = 6


class Tree(NamedTuple):
    """One or several trees of bodies.

    Attributes
    ----------
    roots : ndarray of intp, shape (n_roots,)
        Bodies without a parent.
    joints : ndarray of intp, shape (n_joints, 2)
        Parent and child, from the roots outward; each body is the child of one joint at most.
    """

    roots: Ints
    joints: Ints


class NormalEquations(NamedTuple):
    """Normal equations of all bodies, by blocks.

    Attributes
    ----------
    bodies : ndarray, shape (n_bodies, 6, 6)
        Block of each body; lost when they are solved.
    joints : ndarray, shape (n_joints, 6, 6)
        Blocks that bodies share, rows of the child and columns of the parent; when they are solved, U.
    gradient : ndarray, shape (n_bodies, 6)
        Right-hand side; when they are solved, the unknowns.
    inverse_roots : ndarray, shape (n_bodies, 6, 6)
        When they are solved, the inverse lower root of each body's block.
    """

    bodies: Floats
    joints: Floats
    gradient: Floats
    inverse_roots: Floats


@kernel_part
def clear(block: Floats) -> None:
    """Write zeros.

    Parameters
    ----------
    block : ndarray, shape (6, 6)
        Receives them.
    """
    for i in range(N_FREEDOMS):
        for j in range(N_FREEDOMS):
            block[i, j] = 0.0


@kernel
def solve(tree: Tree, equations: NormalEquations) -> None:
    """Solve the normal equations.

    Parameters
    ----------
    tree : Tree
        Which of them have a joint in common.
    equations : NormalEquations
        Receive the solution, and the factors.
    """
    for joint in range(len(tree.joints) - 1, -1, -1):
        _eliminate(tree.joints[joint, 1], tree.joints[joint, 0], equations.joints[joint], equations)
    for root in tree.roots:
        write_inverse_root(equations.bodies[root], equations.inverse_roots[root])
        _by_lower(equations.inverse_roots[root], equations.gradient[root])
        _by_upper(equations.inverse_roots[root], equations.gradient[root])
    for joint in range(len(tree.joints)):
        parent, child = tree.joints[joint, 0], tree.joints[joint, 1]
        for i in range(N_FREEDOMS):
            for k in range(N_FREEDOMS):
                equations.gradient[child, i] -= equations.joints[joint, i, k] * equations.gradient[parent, k]
        _by_upper(equations.inverse_roots[child], equations.gradient[child])


@kernel_part
def _eliminate(child: int, parent: int, shared: Floats, equations: NormalEquations) -> None:
    """Take a body out of the equations of its parent."""
    root, gradient = equations.inverse_roots[child], equations.gradient[child]
    write_inverse_root(equations.bodies[child], root)
    _by_lower(root, gradient)
    for i in range(N_FREEDOMS - 1, -1, -1):
        for j in range(N_FREEDOMS):
            total = 0.0
            for k in range(i + 1):
                total += root[i, k] * shared[k, j]
            shared[i, j] = total
    for k in range(N_FREEDOMS):
        for i in range(N_FREEDOMS):
            equations.gradient[parent, i] -= shared[k, i] * gradient[k]
    _add_product(shared, shared, -1.0, equations.bodies[parent])


@kernel_part
def _by_lower(root: Floats, values: Floats) -> None:
    """Multiply a vector by a lower triangle."""
    for i in range(N_FREEDOMS - 1, -1, -1):
        total = 0.0
        for k in range(i + 1):
            total += root[i, k] * values[k]
        values[i] = total


@kernel_part
def _by_upper(root: Floats, values: Floats) -> None:
    """Multiply a vector by a transposed lower triangle."""
    for i in range(N_FREEDOMS):
        total = 0.0
        for k in range(i, N_FREEDOMS):
            total += root[k, i] * values[k]
        values[i] = total


@kernel
def invert(tree: Tree, equations: NormalEquations, inverse: Floats) -> None:
    """Write each body's block of the inverse normal matrix.

    Parameters
    ----------
    tree : Tree
        Which of them have a joint in common.
    equations : NormalEquations
        As `solve` leaves them; the bodies' blocks serve as room.
    inverse : ndarray, shape (n_bodies, 6, 6)
        Receives the blocks.
    """
    for root in tree.roots:
        clear(inverse[root])
        _add_product(equations.inverse_roots[root], equations.inverse_roots[root], 1.0, inverse[root])
    for joint in range(len(tree.joints)):
        parent, child = tree.joints[joint, 0], tree.joints[joint, 1]
        root, along, moved = equations.inverse_roots[child], equations.bodies[child], equations.bodies[parent]
        clear(along)
        clear(moved)
        clear(inverse[child])
        _add_product(equations.joints[joint], root, 1.0, along)
        _add_product(inverse[parent], along, 1.0, moved)
        _add_product(root, root, 1.0, inverse[child])
        _add_product(along, moved, 1.0, inverse[child])


@kernel_part
def _add_product(first: Floats, second: Floats, factor: float, out: Floats) -> None:
    """Add first^T second."""
    for i in range(N_FREEDOMS):
        for j in range(N_FREEDOMS):
            for k in range(N_FREEDOMS):
                out[i, j] += factor * first[k, i] * second[k, j]
