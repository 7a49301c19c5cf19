r"""The unknowns of a frame, eliminated limb by limb from the leaves of the tree to its root.

What a limb's markers and all limbs beyond it say is a quadratic form in the limb's turn :math:`\omega` and the shift
:math:`\delta` of its origin,

.. math::
    \tfrac12 \omega^T A \omega + \omega^T B \delta + \tfrac12 \delta^T C \delta
    - \omega^T g_\omega - \delta^T g_\delta .

The turns that the joint allows are minimised out, and what is left is carried to the parent, of which the joint is a
point: its cost is linear in limbs, as that of the articulated body algorithm (Featherstone 1983). On the way back, from
the root outward, every limb's step follows from that of its parent; so does its covariance.

All arrays hold frames last, so that each operation runs over many frames in the order of memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.frames_last import (
    along,
    cross,
    cross_matrix,
    dot,
    inverse_of_symmetric,
    outer,
    product,
    transposed_product,
    turned,
)
from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.model.arrays import Floats, Ints


class Tree:
    """A chain with its joints and what is measured of it in some frames, sorted by limb.

    Parameters
    ----------
    chain, articulation
        The limbs, and what their joints allow.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers; any number where the weight is 0.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances.
    """

    def __init__(self, chain: Chain, articulation: Articulation, positions: Floats, weights: Floats) -> None:
        self.chain, self.articulation = chain, articulation
        own = [np.flatnonzero(chain.limb_of_marker == limb) for limb in range(chain.n_limbs)]
        clean = np.where(weights[..., np.newaxis] > 0, positions, 0.0)
        self._offsets = [chain.offsets[markers] for markers in own]
        self._places = [np.ascontiguousarray(clean[:, markers].transpose(1, 2, 0)) for markers in own]
        self._weights = [np.ascontiguousarray(weights[:, markers].T) for markers in own]

    @property
    def total_weight(self) -> Floats:
        """Sum of all weights of each frame, shape (n_frames,)."""
        return np.asarray(sum(weight.sum(axis=0) for weight in self._weights))

    def of(self, frames: Ints) -> Tree:
        """Return the tree in some of its frames only."""
        part = object.__new__(Tree)
        part.chain, part.articulation, part._offsets = self.chain, self.articulation, self._offsets
        part._places = [np.take(one, frames, axis=2) for one in self._places]
        part._weights = [np.take(one, frames, axis=1) for one in self._weights]
        return part

    def view(self, root: Floats, rotations: Floats) -> View:
        """Place the limbs, and compare their markers with what is measured.

        Parameters
        ----------
        root : ndarray, shape (3, n_frames), mm
            World position of the root's origin.
        rotations : ndarray, shape (n_limbs, 3, 3, n_frames)
            World from limb.
        """
        chain = self.chain
        links = np.empty((chain.n_limbs, 3, root.shape[1]))
        origins = np.empty_like(links)
        links[0], origins[0] = 0.0, root
        forces, arms, squares = [], [], np.zeros(root.shape[1])
        for limb in range(chain.n_limbs):
            if limb:
                parent = int(chain.parents[limb])
                links[limb] = turned(rotations[parent], chain.joints[limb])
                origins[limb] = origins[parent] + links[limb]
            arm = np.einsum("ijf,mj->mif", rotations[limb], self._offsets[limb])
            error = self._places[limb] - arm
            error -= origins[limb]
            force = error * self._weights[limb][:, np.newaxis]
            squares += np.einsum("mif,mif->f", error, force)
            arms.append(arm)
            forces.append(force)
        return View(root, rotations, links, arms, forces, squares)

    def forms(self, view: View) -> list[Form]:
        """What the markers of each limb say by themselves."""
        return [
            _form_of_markers(arm, force, weight)
            for arm, force, weight in zip(view.arms, view.forces, self._weights, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class View:
    """A tree's poses in some frames, and how they fit.

    Attributes
    ----------
    root, rotations
        The poses, see `Tree.view`.
    links : ndarray, shape (n_limbs, 3, n_frames), mm
        From the parent's origin to the limb's, in the world.
    arms, forces : list of ndarray, shape (n_own_markers, 3, n_frames)
        Of each limb: markers from its origin [mm], and weighted residuals.
    squares : ndarray, shape (n_frames,)
        Weighted sums of squares.
    """

    root: Floats
    rotations: Floats
    links: Floats
    arms: list[Floats]
    forces: list[Floats]
    squares: Floats


@dataclass(eq=False)
class Form:
    """A quadratic form in the turn of a limb and the shift of its origin; see the module.

    Attributes
    ----------
    turn, mixed, shift : ndarray, shape (3, 3, n_frames)
        A, B and C.
    torque, pull : ndarray, shape (3, n_frames)
        The slopes.
    """

    turn: Floats
    mixed: Floats
    shift: Floats
    torque: Floats
    pull: Floats

    def carry(self, beyond: Form, link: Floats) -> None:
        """Add what is said of a child, whose origin is at `link` and whose turn counts as the limb's own."""
        lever = cross_matrix(link)
        mixed = beyond.mixed + product(lever, beyond.shift)
        self.turn += beyond.turn - product(mixed, lever) + product(lever, beyond.mixed.swapaxes(0, 1))
        self.mixed += mixed
        self.shift += beyond.shift
        self.torque += beyond.torque + cross(link, beyond.pull)
        self.pull += beyond.pull

    def carry_point(self, shift: Floats, pull: Floats, link: Floats) -> None:
        """Add what is said of a point of the limb at `link` only."""
        lever = cross_matrix(link)
        mixed = product(lever, shift)
        self.turn -= product(mixed, lever)
        self.mixed += mixed
        self.shift += shift
        self.torque += cross(link, pull)
        self.pull += pull


@dataclass(frozen=True, eq=False)
class FreeTurn:
    """The turn of a limb about a ball joint, minimised out: rest - follow @ shift.

    Attributes
    ----------
    covariance, follow : ndarray, shape (3, 3, n_frames)
        Of the turn where the origin is known, and how the turn follows the origin.
    rest : ndarray, shape (3, n_frames)
        The turn if the origin stays.
    """

    covariance: Floats
    follow: Floats
    rest: Floats


@dataclass(frozen=True, eq=False)
class AxisTurn:
    """A turn about one axis, minimised out: rest - by_turn . turn - by_shift . shift.

    Attributes
    ----------
    axis, by_turn, by_shift : ndarray, shape (3, n_frames)
        World axis; how the angle follows what lies before it: turn and shift.
    variance, rest : ndarray, shape (n_frames,)
        Of the angle if all before is known, and the angle if all before stays.
    """

    axis: Floats
    by_turn: Floats
    by_shift: Floats
    variance: Floats
    rest: Floats


@dataclass(frozen=True, eq=False)
class Eliminated:
    """A tree whose turns are all expressed by what lies nearer to the root.

    Attributes
    ----------
    root_covariance : ndarray, shape (3, 3, n_frames)
        Of the root's origin.
    root_shift : ndarray, shape (3, n_frames)
        Its step.
    root_turn : FreeTurn
        The root's.
    turns : dict
        Of the other limbs: a `FreeTurn`, or an `AxisTurn` for each axis in order outward from the parent.
    """

    root_covariance: Floats
    root_shift: Floats
    root_turn: FreeTurn
    turns: dict[int, FreeTurn | tuple[AxisTurn, ...]]


def eliminate(tree: Tree, view: View, forms: list[Form], turn_level: Floats, shift_level: Floats) -> Eliminated:
    """Minimise all turns out, from the leaves to the root.

    Parameters
    ----------
    tree, view, forms
        The problem; the forms are used up.
    turn_level, shift_level : ndarray, shape (n_frames,)
        Information that is added to every turn and to the root's place: damping, or a prior. It must be above 0.
    """
    turns: dict[int, FreeTurn | tuple[AxisTurn, ...]] = {}
    for limb in range(tree.chain.n_limbs - 1, 0, -1):
        form, before = forms[limb], forms[int(tree.chain.parents[limb])]
        if FREEDOMS[tree.articulation.kinds[limb]] == 3:
            free, shift, pull = _without_turn(form, turn_level)
            turns[limb] = free
            before.carry_point(shift, pull, view.links[limb])
        else:
            axes = world_axes(tree.chain, tree.articulation, view.rotations, limb)
            turns[limb] = tuple(reversed([_take_out(form, axis, turn_level) for axis in reversed(axes)]))
            before.carry(form, view.links[limb])
    root_turn, shift, pull = _without_turn(forms[0], turn_level)
    covariance = inverse_of_symmetric(shift, shift_level)
    return Eliminated(covariance, along(covariance, pull), root_turn, turns)


def world_axes(chain: Chain, articulation: Articulation, rotations: Floats, limb: int) -> list[Floats]:
    """World axes of a limb's joint, outward, of shape (3, n_frames); none for rigid joints."""
    axes = []
    if articulation.kinds[limb] in {"hinge", "universal"}:
        axes.append(turned(rotations[int(chain.parents[limb])], articulation.in_parent[limb]))
    if articulation.kinds[limb] == "universal":
        axes.append(turned(rotations[limb], articulation.in_child[limb]))
    return axes


def torque_of(arms: Floats, forces: Floats) -> Floats:
    """Return the sum of arms x forces, shape (3, n_frames) from (n_markers, 3, n_frames)."""
    moment = np.einsum("mif,mjf->ijf", arms, forces)
    return np.stack([moment[i, j] - moment[j, i] for i, j in ((1, 2), (2, 0), (0, 1))])


def frames_last(poses: ChainPoses) -> tuple[Floats, Floats]:
    """Root, shape (3, n_frames), and rotations, shape (n_limbs, 3, 3, n_frames)."""
    return np.ascontiguousarray(poses.root.T), np.ascontiguousarray(poses.rotations.transpose(1, 2, 3, 0))


def _form_of_markers(arms: Floats, forces: Floats, weights: Floats) -> Form:
    weighted = arms * weights[:, np.newaxis]
    second = np.einsum("mif,mjf->ijf", weighted, arms)
    total, trace = weights.sum(axis=0), np.einsum("iif->f", second)
    turn, shift = -second, np.zeros_like(second)
    for axis in range(3):
        turn[axis, axis] += trace
        shift[axis, axis] = total
    return Form(turn, cross_matrix(weighted.sum(axis=0)), shift, torque_of(arms, forces), forces.sum(axis=0))


def _without_turn(form: Form, level: Floats) -> tuple[FreeTurn, Floats, Floats]:
    """Minimise a free turn out; also what is left of the shift: its matrix and its slope."""
    covariance = inverse_of_symmetric(form.turn, level)
    follow = product(covariance, form.mixed)
    left = form.shift - transposed_product(form.mixed, follow)
    pull = form.pull - np.einsum("jif,jf->if", follow, form.torque)
    return FreeTurn(covariance, follow, along(covariance, form.torque)), left, pull


def _take_out(form: Form, axis: Floats, level: Floats) -> AxisTurn:
    """Minimise a turn about an axis out of a form."""
    by_turn, by_shift = along(form.turn, axis), np.einsum("jif,jf->if", form.mixed, axis)
    variance = 1.0 / (np.maximum(dot(axis, by_turn), 0.0) + level)
    slope = dot(axis, form.torque)
    found = AxisTurn(axis, variance * by_turn, variance * by_shift, variance, variance * slope)
    form.turn -= outer(by_turn, found.by_turn)
    form.mixed -= outer(by_turn, found.by_shift)
    form.shift -= outer(by_shift, found.by_shift)
    form.torque -= by_turn * found.rest
    form.pull -= by_shift * found.rest
    return found
