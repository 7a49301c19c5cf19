"""Covariances of poses, frame by frame, carried from the root outward.

`posing.eliminate` says how each limb's turn follows its parent and how sure it is then; so covariances of turn and
place follow from those of the parent, at a cost that is linear in limbs.
"""

from __future__ import annotations

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.chain import (
    FREE,
    FREEDOMS,
    LINK,
    ROOT,
    ROTATION,
    ChainTable,
    Measured,
    Place,
    copy_rotations,
    forward_kinematics,
)
from skelgen._kernels.joint_models import PARENT
from skelgen._kernels.posing import Room, eliminate
from skelgen._kernels.quadratic_forms import (
    AXIS,
    BY_SHIFT,
    BY_TURN,
    COVARIANCE,
    FOLLOW,
    LEAST_LEVEL,
    N_AXIS,
    SHIFT,
    VARIANCE,
    find_forms,
)
from skelgen._kernels.small_matrices import (
    Matrix,
    Vector,
    added,
    cross_matrix,
    dot,
    inverse,
    matrix,
    negative,
    outer,
    plus,
    product,
    set_matrix,
    symmetric,
    taken,
    times,
    transposed,
    turned,
    vector,
    whole,
)
from skelgen.model.arrays import Floats

OF_TURN, OF_BOTH, OF_ORIGIN = fixed(0, 9, 18)
"""Where a limb's covariances begin: of its turn, of turn and origin, and of its origin."""


@kernel
def propagate_covariances(
    table: ChainTable,
    rotations: Floats,
    measured: Measured,
    levels: tuple[float, float],
    out: tuple[Floats, Floats],
    room: Room,
) -> None:
    """Write the covariances of some frames for noise 1.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    rotations : ndarray, shape (n_frames * n_limbs, 9)
        World from limb by its rows, frame by frame.
    measured : tuple
        Markers and weights, of which only the weights count.
    levels : tuple of float
        Information on turns and on the root's place that is there without any marker.
    out : tuple of ndarray, shapes (n_frames * n_limbs, 9)
        Receive the covariances of the limbs' origins in the world, and of their turns against the parents, in the
        parents' axes; of the root, in the world.
    room : Room
        Where to work.
    """
    positions, weights = measured
    places, turns = out
    place, _, forms, known, solved = room
    n_limbs, n_markers = len(table.joints), len(table.markers)
    for root in range(0, len(rotations), n_limbs):
        first = root // n_limbs * n_markers
        copy_rotations(rotations, root, place.limbs)
        forward_kinematics(table, positions, weights, first, place)
        find_forms(table, place, forms)
        eliminate(table, place, forms, levels[0], solved)
        shift = symmetric(forms, ROOT, SHIFT)
        level = max(levels[1], LEAST_LEVEL * (shift[0] + shift[3] + shift[5]))
        set_matrix(places, root, ROTATION, whole(inverse(shift, level)))
        set_matrix(known, ROOT, OF_ORIGIN, matrix(places, root, ROTATION))
        _keep_free_turn(solved, ROOT, known)
        set_matrix(turns, root, ROTATION, matrix(known, ROOT, OF_TURN))
        for limb in range(1, n_limbs):
            relative = _limb_outward(table, place, solved, limb, known)
            set_matrix(places, root + limb, ROTATION, matrix(known, limb, OF_ORIGIN))
            parent = matrix(place.limbs, table.limbs[limb, PARENT], ROTATION)
            set_matrix(turns, root + limb, ROTATION, product(transposed(parent), product(relative, parent)))


@kernel_part
def _limb_outward(table: ChainTable, place: Place, solved: Floats, limb: int, known: Floats) -> Matrix:
    """Carry covariances from a parent to a limb; return that of the turn between them, in the world."""
    parent, lever = table.limbs[limb, PARENT], cross_matrix(vector(place.limbs, limb, LINK))
    before, mixed = matrix(known, parent, OF_TURN), matrix(known, parent, OF_BOTH)
    at_link = added(mixed, product(before, lever))
    origin = added(matrix(known, parent, OF_ORIGIN), product(transposed(mixed), lever))
    origin = taken(origin, product(lever, at_link))
    set_matrix(known, limb, OF_ORIGIN, origin)
    if table.limbs[limb, FREEDOMS] == FREE:
        _keep_free_turn(solved, limb, known)
        with_parent = negative(product(_follow_of(solved, limb), transposed(at_link)))
    else:
        with_parent = _keep_axis_turns(table, solved, limb, before, at_link, known)
    both = added(with_parent, transposed(with_parent))
    return taken(added(matrix(known, limb, OF_TURN), before), both)


@kernel_part
def _keep_free_turn(solved: Floats, limb: int, known: Floats) -> None:
    """Keep the covariances of a free turn, given that of the limb's origin."""
    follow, origin = _follow_of(solved, limb), matrix(known, limb, OF_ORIGIN)
    mixed = negative(product(follow, origin))
    turn = taken(whole(symmetric(solved, limb, COVARIANCE)), product(mixed, transposed(follow)))
    set_matrix(known, limb, OF_TURN, turn)
    set_matrix(known, limb, OF_BOTH, mixed)


@kernel_part
def _keep_axis_turns(
    table: ChainTable, solved: Floats, limb: int, before: Matrix, at_link: Matrix, known: Floats
) -> Matrix:
    """Keep the covariances of a turn about axes, given that of the origin; return that with the parent's turn."""
    turn, mixed, with_parent, origin = before, at_link, before, matrix(known, limb, OF_ORIGIN)
    for first in range(0, table.limbs[limb, FREEDOMS] * N_AXIS, N_AXIS):
        axis = vector(solved, limb, first + AXIS)
        by_turn, by_shift = vector(solved, limb, first + BY_TURN), vector(solved, limb, first + BY_SHIFT)
        parent = _follows(transposed(with_parent), by_turn, at_link, by_shift)
        own = _follows(turn, by_turn, mixed, by_shift)
        place = _follows(transposed(mixed), by_turn, origin, by_shift)
        variance = solved[limb, first + VARIANCE] - dot(by_turn, own) - dot(by_shift, place)
        side = outer(axis, own)
        turn = added(added(turn, outer(times(variance, axis), axis)), added(side, transposed(side)))
        mixed, with_parent = added(mixed, outer(axis, place)), added(with_parent, outer(axis, parent))
    set_matrix(known, limb, OF_TURN, turn)
    set_matrix(known, limb, OF_BOTH, mixed)
    return with_parent


@kernel_part
def _follow_of(solved: Floats, limb: int) -> Matrix:
    """How a free turn follows the limb's origin."""
    return transposed(matrix(solved, limb, FOLLOW))


@kernel_part
def _follows(by: Matrix, turn: Vector, beside: Matrix, shift: Vector) -> Vector:
    """Covariance of an angle that follows turn and shift with what these covariances are those of."""
    return times(-1.0, plus(turned(by, turn), turned(beside, shift)))
