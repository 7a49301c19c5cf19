r"""How surely the parts of a calibrated chain are known, whatever frames its limbs were given.

The inverse information of the constants leaves open how each limb's frame is turned. What counts is how points of a
limb lie to each other: of the change :math:`d_i` of each point the rigid motion of the limb's markers is taken off,

.. math::
    d_i' = d_i - \bar d - \theta \times (p_i - c),

with the mean change :math:`\bar d` and the centroid c of the markers, and the turn :math:`\theta` that fits their
changes best. Limbs whose markers lie on one line are turned by their joints as well. The same turn is taken off axes
and off the limbs' rotations, so that joints, axes, offsets, lengths and angles all count against the markers (Gaschler
2011, 6.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.bodies.shape import determines_pose
from skelgen.kinematics.chain.articulation import Articulation, across
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.normal_equations import linearised
from skelgen.kinematics.inverse.poses import LEAST_NOISE
from skelgen.model.arrays import Floats

FAINT = 1e-4
"""Weight of points that only take up a turn which the others leave open."""

FRAME_ONLY = 0.05
"""Of a limb's size: free changes that move points of limbs against each other by less do nothing but turn frames."""

_WITH_AXES = ("hinge", "universal")

RANK_TOLERANCE = 1e-8
"""Of the largest: information below this part is none."""


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
    hinges : ndarray, shape (2, n_limbs, 3)
        Unit axes of hinges, held or not, in the parents' frames and in the limbs' own; 0 for other joints.
    slides : ndarray, shape (n_limbs,), mm
        How far hinges were moved along their axes since.
    """

    chain: Chain
    articulation: Articulation
    root: Floats
    hinges: Floats
    slides: Floats

    @cached_property
    def _points(self) -> list[_Points]:
        """Points of every limb."""
        return [_Points.of(self, limb) for limb in range(self.chain.n_limbs)]

    def offsets(self, limb: int) -> Floats:
        """Changes [mm] of a limb's markers against each other, shape (n_markers, 3, n)."""
        points = self._points[limb]
        return np.asarray(points.against(points.still)[: points.n_markers])

    def joint(self, child: int, limb: int) -> Floats:
        """Change [mm] of the joint above a limb against the markers of one of its limbs, shape (3, n)."""
        points = self._points[limb]
        row = points.row_of(child)
        motion = points.motion(row)
        return np.asarray(points.against(motion)[row] + self._change_of_way(child, limb, motion[2]))

    def point(self, limb: int, place: Floats, change: Floats) -> Floats:
        """Change [mm] against a limb's markers of a point that follows the errors by `change`, shape (3, n)."""
        centre, shift, turn = self._points[limb].still
        return np.asarray(change - shift + cross_matrix(place - centre) @ turn)

    def _change_of_way(self, child: int, limb: int, turn: Floats) -> Floats:
        """How a joint that was moved along its axis follows the errors of the axis [mm], shape (3, n)."""
        if self.articulation.kinds[child] != "hinge":
            return np.zeros_like(turn)
        moved = -turn if limb == child else self.tilt(child) - turn
        return np.asarray(-cross_matrix(self._way(child, limb)) @ moved)

    def _way(self, child: int, limb: int) -> Floats:
        """How far a hinge was moved along its axis [mm], shape (3,)."""
        return np.asarray(self.slides[child] * self.hinges[int(limb == child), child])

    def axis(self, child: int, limb: int) -> Floats:
        """Change of the axis of the joint above `child` that is fixed in one of its limbs, shape (3, n)."""
        _, _, turn = self._points[limb].still
        if limb == child:
            axis, moved = self.articulation.in_child[child], -turn
        else:
            axis, moved = self.articulation.in_parent[child], self.tilt(child) - turn
        return np.asarray(-cross_matrix(axis) @ moved)

    def length(self, first: int, second: int, limb: int) -> Floats:
        """Change [mm] of the distance between the joints above two limbs, both of them joints of `limb`, shape (n,).

        Where a hinge is along its axis is a choice, and no error of the length.
        """
        points = self._points[limb]
        motion = points.still
        places, changes = [], []
        for child in (first, second):
            row = points.row_of(child)
            places.append(points.place[row] + self._way(child, limb))
            changes.append(points.against(motion)[row] + self._change_of_way(child, limb, motion[2]))
        way = places[0] - places[1]
        unit = way / max(float(np.linalg.norm(way)), np.finfo(np.float64).tiny)
        axes = [self.hinges[int(limb == child), child] for child in (first, second)]
        ends = [(unit - (unit @ axis) * axis) @ change for axis, change in zip(axes, changes, strict=True)]
        return np.asarray(ends[0] - ends[1])

    def turns(self, poses: ChainPoses, positions: Floats, weights: Floats | None = None) -> Floats:
        """Mean covariance [rad^2] of the turn of each limb against its parent that these errors make.

        Parameters
        ----------
        poses : ChainPoses
            Some frames.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            Measured markers: which are seen says how the poses follow the constants.
        weights : ndarray, shape (n_frames, n_markers), optional
            Of the squared distances.

        Returns
        -------
        ndarray, shape (n_limbs, 3, 3)
            In the parents' axes; 0 for the root.
        """
        chain = self.chain
        frames = linearised(chain, self.articulation, poses, positions, weights, poses_only=True)
        n_places = len(self.root) - self.articulation.n_constants
        own = frames.tilts @ self.root[n_places:] - frames.turns @ (frames.follow() @ self.root)
        own = own[:, 3:].reshape(len(positions), chain.n_limbs, 3, -1)
        frame_turns = np.stack([self._points[limb].still[2] for limb in range(chain.n_limbs)])
        own = own + poses.rotations @ frame_turns
        above = np.maximum(chain.parents, 0)
        relative = poses.rotations[:, above].swapaxes(2, 3) @ (own - own[:, above])
        return np.asarray((relative @ relative.swapaxes(2, 3)).mean(axis=0))

    def tilt(self, child: int) -> Floats:
        """Turn [rad] of the axis of the joint above `child` in its parent's frame, shape (3, n); 0 without axes."""
        n_places = 3 * (self.chain.n_markers + self.chain.n_limbs - 1)
        columns = self.articulation.constant_columns[child]
        rows = self.root[n_places + columns.start : n_places + columns.stop]
        if not len(rows):
            return np.zeros((3, self.root.shape[1]))
        return np.asarray(across(self.articulation.in_parent[child]) @ rows[:2])


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
        joints = ([limb] if chain.parents[limb] >= 0 else []) + np.flatnonzero(chain.parents == limb).tolist()
        places = [chain.offsets[markers]]
        changes = [errors.root[: 3 * chain.n_markers].reshape(-1, 3, n)[markers]]
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
        """Changes of all points without a rigid motion, shape (n_points, 3, n), mm."""
        centre, shift, turn = motion
        return self.change - shift + cross_matrix(self.place - centre) @ turn

    @cached_property
    def still(self) -> tuple[Floats, Floats, Floats]:
        """Rigid motion of all points."""
        return self.motion(None)

    @cached_property
    def is_fixed(self) -> bool:
        """Whether the markers are not on one line."""
        anchor = self.place[: self.n_markers or None]
        return bool(determines_pose(anchor, np.ones((1, len(anchor)), dtype=bool))[0])

    def motion(self, apart: int | None) -> tuple[Floats, Floats, Floats]:
        """Rigid motion of the markers: centre (3,), mean change and turn (3, n); the row `apart` hardly counts."""
        anchor = slice(0, self.n_markers or None)
        centre, shift = self.place[anchor].mean(axis=0), self.change[anchor].mean(axis=0)
        weights = np.full(len(self.place), FAINT)
        weights[anchor if self.is_fixed else slice(None)] = 1.0
        if apart is not None:
            weights[apart] = FAINT
        arms = -cross_matrix(self.place - centre) * weights[:, np.newaxis, np.newaxis]
        gaps = (self.change - shift) * weights[:, np.newaxis, np.newaxis]
        turn = np.linalg.pinv(arms.reshape(-1, 3), rcond=FAINT / 100) @ gaps.reshape(3 * len(gaps), -1)
        return centre, shift, turn


def limb_errors(
    chain: Chain,
    articulation: Articulation,
    information: Floats,
    noise: float,
    *,
    growth: float = 1.0,
    loose: Floats | None = None,
    hinges: Floats | None = None,
    slides: Floats | None = None,
    tolerance: float = RANK_TOLERANCE,
) -> LimbErrors:
    """Return the errors of a calibrated chain's constants.

    Directions that the information does not determine are uncertain by the size of a limb, axes by 1 rad.

    Parameters
    ----------
    chain, articulation
        Calibrated.
    information : ndarray, shape (n_constants, n_constants)
        Of the constants, for noise 1.
    noise : float, mm
        Standard deviation of a coordinate.
    growth : float
        How much less than independent ones the frames tell.
    loose : ndarray, shape (3 (n_markers + n_limbs - 1), n), mm, optional
        More errors: changes of offsets and joints that nothing determines, such as shifts along hinges.
    hinges : ndarray, shape (2, n_limbs, 3), optional
        Unit axes of hinges in the parents' frames and in the limbs' own; 0 for other joints.
    slides : ndarray, shape (n_limbs,), mm, optional
        How far hinges were moved along them since.
    tolerance : float
        Information below this part of the largest is none.
    """
    hinges = np.zeros((2, chain.n_limbs, 3)) if hinges is None else hinges
    slides = np.zeros(chain.n_limbs) if slides is None else slides
    deviation = max(noise, LEAST_NOISE) * np.sqrt(growth)
    n_places = 3 * (chain.n_markers + chain.n_limbs - 1)
    known = np.ones(len(information))
    known[:n_places] = max(float((chain.offsets**2).sum(axis=1).mean()), 1.0)
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(np.float64).tiny))
    prior = deviation**2 / known / scale**2
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    told = values > tolerance * max(float(values[-1]), np.finfo(np.float64).tiny)
    level = np.einsum("cq,c,cq->q", vectors[:, told], prior, vectors[:, told])
    root = deviation * vectors[:, told] / np.sqrt(values[told] + level) / scale[:, np.newaxis]
    free = vectors[:, ~told]
    held = np.linalg.cholesky(free.T @ (prior[:, np.newaxis] * free))
    open_root = deviation * np.linalg.solve(held, free.T).T / scale[:, np.newaxis]
    root = np.concatenate([root, _without_frames(LimbErrors(chain, articulation, open_root, hinges, slides))], axis=1)
    if loose is not None:
        root = np.concatenate([root, np.pad(loose, ((0, len(root) - n_places), (0, 0)))], axis=1)
    return LimbErrors(chain, articulation, root, hinges, slides)


def _without_frames(errors: LimbErrors) -> Floats:
    """Root of errors without those that do nothing but turn the limbs' frames, shape (n_constants, n_open)."""
    chain, kinds = errors.chain, errors.articulation.kinds
    size = max(float(np.sqrt((chain.offsets**2).sum(axis=1).mean())), 1.0)
    rows = [size * errors.axis(limb, chain.parents[limb]) for limb, kind in enumerate(kinds) if kind in _WITH_AXES]
    for limb in range(chain.n_limbs):
        points = _Points.of(errors, limb)
        rows.append(points.against(points.still).reshape(-1, errors.root.shape[1]))
    _, sizes, directions = np.linalg.svd(np.concatenate(rows), full_matrices=False)
    return np.asarray(errors.root @ directions[: int((sizes > FRAME_ONLY * size).sum())].T)


def deviations(change: Floats) -> Floats:
    """Standard deviations of what follows errors of variance 1: root mean squares over the last axis."""
    return np.asarray(np.sqrt((change**2).sum(axis=-1)))
