r"""Errors of the limbs and joints of a calibrated chain, whatever frames its limbs were given.

The inverse information of the constants leaves the rotation of each limb's frame open. What counts is how the points of
a limb lie to each other. So the rigid motion of the limb's markers is taken off the change :math:`d_i` of each point:

.. math::
    d_i' = d_i - \bar d - \theta \times (p_i - c),

with the mean change :math:`\bar d` and the centroid c of the markers, and the rotation :math:`\theta` that fits their
changes best. Where the markers of a limb lie on one line, its joints take part in that fit. The same rotation is taken
off axes and off the limbs' rotations. So joints, axes, offsets, lengths and angles all count against the markers
(Gaschler 2011, 6.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed
from skelgen.kinematics.chain.normal_equations import frame_blocks
from skelgen.kinematics.inverse.poses import LEAST_NOISE
from skelgen.kinematics.rigid_bodies import determines_pose
from skelgen.model.arrays import Floats

FAINT = 1e-4
"""Weight of points that only fix a rotation which the others leave open."""

FRAME_ONLY = 0.05
"""Part of a limb's size: undetermined changes that deform limbs by less only rotate their frames."""

_WITH_AXES = ("hinge", "universal")


@dataclass(frozen=True, eq=False)
class HingeShifts:
    """Shifts of hinges along their axes, which the data do not determine.

    Attributes
    ----------
    axes : ndarray, shape (2, n_limbs, 3)
        Unit axes of the shifted hinges in the parents' frames and in the limbs' own; 0 for other joints.
    distances : ndarray, shape (n_limbs,), mm
        How far each hinge was shifted along its axis after the calibration.
    open_changes : ndarray, shape (3 (n_markers + n_limbs - 1), n), mm
        Changes of offsets and joints by further shifts of standard size, which nothing determines.
    """

    axes: Floats
    distances: Floats
    open_changes: Floats


@dataclass(frozen=True, eq=False)
class LimbErrors:
    """Errors of a chain's constants, linear in independent numbers of variance 1.

    Attributes
    ----------
    chain : Chain
        Calibrated limbs.
    articulation : Articulation
        What its joints allow.
    root : ndarray, shape (n_constants, n)
        Changes of marker offsets, joints and axes: their covariance is root @ root.T.
    shifts : HingeShifts
        Shifts of hinges along their axes.
    """

    chain: Chain
    articulation: Articulation
    root: Floats
    shifts: HingeShifts

    @cached_property
    def _points(self) -> list[_Points]:
        """Points of every limb."""
        return [_Points.of(self, limb) for limb in range(self.chain.n_limbs)]

    def offsets(self, limb: int) -> Floats:
        """Return the changes [mm] of a limb's markers against each other, shape (n_markers, 3, n)."""
        points = self._points[limb]
        return np.asarray(points.against(points.rigid_motion)[: points.n_markers])

    def joint(self, child: int, limb: int) -> Floats:
        """Return the change [mm] of the joint above `child` against the markers of one of its limbs, shape (3, n).

        Parameters
        ----------
        child : int
            Limb below the joint.
        limb : int
            The child, or its parent.
        """
        points = self._points[limb]
        row = points.row_of(child)
        motion = points.motion(row)
        return np.asarray(points.against(motion)[row] + self._change_of_shift(child, limb, motion[2]))

    def point(self, limb: int, place: Floats, change: Floats) -> Floats:
        """Return the change [mm] of a point against a limb's markers, shape (3, n).

        Parameters
        ----------
        limb : int
            The limb.
        place : ndarray, shape (3,), mm
            The point in its frame.
        change : ndarray, shape (3, n), mm
            How the point follows the errors.
        """
        centre, shift, turn = self._points[limb].rigid_motion
        return np.asarray(change - shift + cross_matrix(place - centre) @ turn)

    def _change_of_shift(self, child: int, limb: int, turn: Floats) -> Floats:
        """How a joint that was shifted along its axis follows the errors of the axis [mm], shape (3, n)."""
        if self.articulation.types[child] != "hinge":
            return np.zeros_like(turn)
        moved = -turn if limb == child else self.tilt(child) - turn
        return np.asarray(-cross_matrix(self._shift(child, limb)) @ moved)

    def _shift(self, child: int, limb: int) -> Floats:
        """Shift of a hinge along its axis in one of its limbs [mm], shape (3,)."""
        return np.asarray(self.shifts.distances[child] * self.shifts.axes[int(limb == child), child])

    def axis(self, child: int, limb: int) -> Floats:
        """Return the change of a joint's axis that is fixed in a limb, shape (3, n).

        Parameters
        ----------
        child : int
            Limb below the joint.
        limb : int
            The child, or its parent.
        """
        _, _, turn = self._points[limb].rigid_motion
        if limb == child:
            axis, moved = self.articulation.in_child[child], -turn
        else:
            axis, moved = self.articulation.in_parent[child], self.tilt(child) - turn
        return np.asarray(-cross_matrix(axis) @ moved)

    def length(self, first: int, second: int, limb: int) -> Floats:
        """Return the change [mm] of the distance between two joints of a limb, shape (n,).

        The position of a hinge along its axis is a choice, and no error of the length.

        Parameters
        ----------
        first, second : int
            Limbs below the joints.
        limb : int
            The limb that both are joints of.
        """
        points = self._points[limb]
        motion = points.rigid_motion
        places, changes = [], []
        for child in (first, second):
            row = points.row_of(child)
            places.append(points.place[row] + self._shift(child, limb))
            changes.append(points.against(motion)[row] + self._change_of_shift(child, limb, motion[2]))
        way = places[0] - places[1]
        unit = way / max(float(np.linalg.norm(way)), np.finfo(np.float64).tiny)
        axes = [self.shifts.axes[int(limb == child), child] for child in (first, second)]
        ends = [(unit - (unit @ axis) * axis) @ change for axis, change in zip(axes, changes, strict=True)]
        return np.asarray(ends[0] - ends[1])

    def turns(self, poses: ChainPoses, positions: Floats) -> Floats:
        """Return the mean covariance [rad^2] of each limb's rotation against its parent that these errors cause.

        Parameters
        ----------
        poses : ChainPoses
            Some frames.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            Measured markers: how the poses follow the constants depends on which are seen.

        Returns
        -------
        ndarray, shape (n_limbs, 3, 3)
            In the parents' axes; 0 for the root.
        """
        chain = self.chain
        frames = frame_blocks(observed(chain, self.articulation, poses, positions), poses_only=True)
        n_places = len(self.root) - self.articulation.n_constants
        follow = np.linalg.solve(frames.own, frames.coupling)  # how poses follow the constants
        own = frames.tilts @ self.root[n_places:] - frames.turns @ (follow @ self.root)
        own = own[:, 3:].reshape(len(positions), chain.n_limbs, 3, -1)
        frame_turns = np.stack([self._points[limb].rigid_motion[2] for limb in range(chain.n_limbs)])
        own = own + poses.rotations @ frame_turns
        above = np.maximum(chain.parents, 0)
        relative = poses.rotations[:, above].swapaxes(2, 3) @ (own - own[:, above])
        return np.asarray((relative @ relative.swapaxes(2, 3)).mean(axis=0))

    def tilt(self, child: int) -> Floats:
        """Return the tilt [rad] of the axis above `child` in its parent's frame, shape (3, n); 0 without axes."""
        n_places = 3 * (self.chain.n_markers + self.chain.n_limbs - 1)
        columns = self.articulation.constant_columns[child]
        rows = self.root[n_places + columns.start : n_places + columns.stop]
        if not len(rows):
            return np.zeros((3, self.root.shape[1]))
        return np.asarray(self.articulation.across_axes[child] @ rows[:2])


@dataclass(frozen=True, eq=False)
class _Points:
    """Points of one limb: its markers, the joint to its parent, the joints to its children.

    Attributes
    ----------
    place : ndarray, shape (n_points, 3), mm
        In the limb's frame.
    change : ndarray, shape (n_points, 3, n), mm
        How they follow the errors.
    joints : list of int
        Limbs below the joints, in the order of the points behind the markers.
    n_markers : int
        Number of markers, which come first.
    """

    place: Floats
    change: Floats
    joints: list[int]
    n_markers: int

    @classmethod
    def of(cls, errors: LimbErrors, limb: int) -> _Points:
        chain, n = errors.chain, errors.root.shape[1]
        markers = np.flatnonzero(chain.limb_of_marker == limb)
        joints = chain.joints_of(limb)
        places = [chain.offsets[markers]]
        changes = [errors.root[: 3 * chain.n_markers].reshape(chain.n_markers, 3, n)[markers]]
        for joint in joints:  # the joint to the parent is the origin of the frame
            row = 3 * (chain.n_markers + joint - 1)
            is_origin = joint == limb
            places.append(np.zeros((1, 3)) if is_origin else chain.joints[joint][np.newaxis])
            changes.append(np.zeros((1, 3, n)) if is_origin else errors.root[row : row + 3][np.newaxis])
        return cls(np.concatenate(places), np.concatenate(changes), joints, len(markers))

    def row_of(self, child: int) -> int:
        """Row of the joint above a limb."""
        return self.n_markers + self.joints.index(child)

    def against(self, motion: tuple[Floats, Floats, Floats]) -> Floats:
        """Changes of all points with a rigid motion taken off, shape (n_points, 3, n), mm."""
        centre, shift, turn = motion
        return self.change - shift + cross_matrix(self.place - centre) @ turn

    @cached_property
    def rigid_motion(self) -> tuple[Floats, Floats, Floats]:
        """Rigid motion of the markers."""
        return self.motion(None)

    def motion(self, apart: int | None) -> tuple[Floats, Floats, Floats]:
        """Rigid motion of the markers: centre (3,), mean change, rotation (3, n); point `apart` hardly counts."""
        anchor = slice(0, self.n_markers or None)
        centre, shift = self.place[anchor].mean(axis=0), self.change[anchor].mean(axis=0)
        weights = np.full(len(self.place), FAINT)
        markers = self.place[anchor]
        is_fixed = determines_pose(markers, np.ones((1, len(markers)), dtype=bool))[0]  # they are not on one line
        weights[anchor if is_fixed else slice(None)] = 1.0
        if apart is not None:
            weights[apart] = FAINT
        arms = -cross_matrix(self.place - centre) * weights[:, np.newaxis, np.newaxis]
        gaps = (self.change - shift) * weights[:, np.newaxis, np.newaxis]
        turn = np.linalg.pinv(arms.reshape(-1, 3), rcond=FAINT / 100) @ gaps.reshape(3 * len(gaps), -1)
        return centre, shift, turn


def limb_errors(last: Calibration, shifts: HingeShifts, growth: float) -> LimbErrors:
    """Return the errors of a calibrated chain's constants.

    Directions that the information does not determine are uncertain by the size of a limb, axes by 1 rad.

    Parameters
    ----------
    last : Calibration
        The calibrated chain.
    shifts : HingeShifts
        Shifts of hinges along their axes after the calibration.
    growth : float
        How many frames determine as much as one independent frame.
    """
    chain, articulation = last.chain, last.articulation
    values, vectors, scale, determined = last.spectrum
    deviation = max(last.noise, LEAST_NOISE) * np.sqrt(growth)
    n_places = 3 * (chain.n_markers + chain.n_limbs - 1)
    sizes = np.ones(len(scale))
    sizes[:n_places] = max(float((chain.offsets**2).sum(axis=1).mean()), 1.0)
    prior = deviation**2 / sizes / scale**2
    clear, free = vectors[:, determined], vectors[:, ~determined]
    level = np.einsum("cq,c,cq->q", clear, prior, clear)
    root = deviation * clear / np.sqrt(values[determined] + level) / scale[:, np.newaxis]
    held = np.linalg.cholesky(free.T @ (prior[:, np.newaxis] * free))
    open_root = deviation * np.linalg.solve(held, free.T).T / scale[:, np.newaxis]
    open_root = _without_frames(LimbErrors(chain, articulation, open_root, shifts))
    shifted = np.pad(shifts.open_changes, ((0, len(root) - n_places), (0, 0)))
    return LimbErrors(chain, articulation, np.concatenate([root, open_root, shifted], axis=1), shifts)


def _without_frames(errors: LimbErrors) -> Floats:
    """Root of errors without those that only rotate the limbs' frames, shape (n_constants, n_open)."""
    chain, types = errors.chain, errors.articulation.types
    size = max(float(np.sqrt((chain.offsets**2).sum(axis=1).mean())), 1.0)
    rows = [size * errors.axis(limb, chain.parents[limb]) for limb, kind in enumerate(types) if kind in _WITH_AXES]
    for limb in range(chain.n_limbs):
        points = _Points.of(errors, limb)
        rows.append(points.against(points.rigid_motion).reshape(3 * len(points.place), errors.root.shape[1]))
    _, sizes, directions = np.linalg.svd(np.concatenate(rows), full_matrices=False)
    return np.asarray(errors.root @ directions[: int((sizes > FRAME_ONLY * size).sum())].T)


def deviations(change: Floats) -> Floats:
    """Return standard deviations of what follows errors of variance 1: root sums of squares over the last axis.

    Parameters
    ----------
    change : ndarray, shape (..., n_errors)
        By how much each value changes with each error.

    Returns
    -------
    ndarray, shape (...)
        In the unit of the change.
    """
    return np.asarray(np.sqrt((change**2).sum(axis=-1)))
