"""Closed kinematic chains in the fit of a body: which loops are closed, and how far apart their ends were and are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.calibration.closed_loops import ClosedCalibration, close_loops
from skelgen.kinematics.calibration.limb_errors import LimbErrors
from skelgen.kinematics.chain.chain import ChainPoses, residuals
from skelgen.kinematics.inverse.loop_closure import KinematicLoops
from skelgen.kinematics.joints.joint_type import JointType
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints import limb_pairs
from skelgen.stages.skeleton.assembly import StructuredTake

FOUND = "found"
"""What the user writes to close all loops that the stage before found."""

LARGEST_GAP = 4.0
"""Times the noise of a coordinate: a found loop stays open if its ends are farther apart in half of the frames."""


@dataclass(frozen=True, eq=False)
class ClosedLoops:
    """The loops of a body that were closed.

    Attributes
    ----------
    joints : KinematicLoops
        The joints that close them.
    before, after : ndarray, shape (n_loops,), mm
        Root mean square gap of their ends in the fit of the tree, and in that of the loops.
    residual_before, residual : float, mm
        Root mean square residual of a coordinate of a marker with open and with closed loops.
    left_open : dict of pair to float
        Pairs of limbs that form no loop, and the root mean square gap of their joint [mm].
    covariances : ndarray, shape (n_loops, 2, 3, 3), mm^2
        Of the joints' positions in both limbs, against their markers.
    """

    joints: KinematicLoops
    before: Floats
    after: Floats
    residual_before: float
    residual: float
    left_open: dict[tuple[int, int], float]
    covariances: Floats

    def shifted(self, types: list[JointType], shifts: dict[int, float]) -> ClosedLoops:
        """Return the loops for limbs whose frames were moved along hinges.

        Parameters
        ----------
        types : list of JointType
            Of the joints above limbs 1, 2, ...
        shifts : dict of int to float
            How far [mm] the frames of limbs were moved.
        """
        places = self.joints.places.copy()
        for limb, shift in shifts.items():
            places[self.joints.limbs == limb] -= shift * types[limb - 1].axis_in_child
        return replace(self, joints=replace(self.joints, places=places))

    def turned(self, turn: Floats) -> ClosedLoops:
        """Return the loops for limbs whose frames were rotated: new from old, shape (n_limbs, 3, 3)."""
        turns = turn[self.joints.limbs]
        places = np.einsum("rsij,rsj->rsi", turns, self.joints.places)
        covariances = turns @ self.covariances @ turns.swapaxes(2, 3)
        return replace(self, joints=replace(self.joints, places=places), covariances=covariances)

    def with_errors(self, errors: LimbErrors, closed: ClosedCalibration, deviation: float) -> ClosedLoops:
        """Return the loops with the covariances of their joints, by errors of the chain and noise of the frames.

        Parameters
        ----------
        errors : LimbErrors
            Errors of the chain.
        closed : ClosedCalibration
            The fit with closed loops.
        deviation : float, mm
            Noise of a coordinate of a marker.
        """
        n_own = 6 * closed.loops.n_loops
        whole = closed.whole_information
        corner = closed.loop_information
        follow = -np.linalg.solve(corner, whole[-n_own:, :-n_own]) @ errors.root
        own = deviation * np.linalg.inv(np.linalg.cholesky(corner)).T
        changes = np.concatenate([follow, own], axis=1).reshape(*closed.loops.places.shape, -1)
        wide = replace(errors, root=np.pad(errors.root, ((0, 0), (0, n_own))))
        covariances = np.zeros((*closed.loops.places.shape, 3))
        for loop, limbs in enumerate(closed.loops.limbs.tolist()):
            for side, limb in enumerate(limbs):
                change = wide.point(limb, closed.loops.places[loop, side], changes[loop, side])
                covariances[loop, side] = change @ change.T
        return replace(self, covariances=covariances)


def stated_loops(text: str, take: StructuredTake) -> tuple[tuple[int, int], ...]:
    """Return the pairs of limbs whose joints close loops, as the user states them.

    Parameters
    ----------
    text : str
        The parameter `loops`.
    take : StructuredTake
        With its trees.

    Raises
    ------
    InputError
        If the text names no pairs of limbs, limbs that the tree joins already, or limbs of separate bodies.
    """
    topology, names = take.topology, take.trajectories.names
    pairs = topology.loops if text.strip() == FOUND else limb_pairs(text, names, take.limbs)
    for first, second in pairs:
        if topology.parents[first] == second or topology.parents[second] == first:
            raise InputError(f"limb {first} and limb {second} are joined by the tree already: they close no loop")
        if second not in topology.limbs_of_tree(first):
            raise InputError(f"limb {first} and limb {second} are on separate bodies: they close no loop")
    return pairs


def closed_body(
    last: Calibration, poses: ChainPoses, used: Ints, limbs: Ints, are_stated: bool
) -> tuple[Calibration, ChainPoses, ClosedLoops]:
    """Close the loops of a fitted body; poses of all frames start from there.

    Parameters
    ----------
    last : Calibration
        Fitted as a tree.
    poses : ChainPoses
        All frames.
    used : ndarray of intp
        Frames of the fit.
    limbs : ndarray of intp, shape (n_loops, 2)
        Limbs that meet, by position in the body.
    are_stated : bool
        Whether the user states the loops; others stay open where noise does not explain their gap.
    """
    joints = KinematicLoops.of_poses(limbs, last.chain, last.poses)
    median_gap = np.median(np.linalg.norm(joints.gaps(last.chain, last.poses), axis=2), axis=0)
    closes = np.ones(len(limbs), dtype=bool) if are_stated else median_gap <= LARGEST_GAP * last.noise
    before = joints.gap(last.chain, last.poses)
    left_open = {(int(a), int(b)): float(gap) for (a, b), gap in zip(limbs[~closes], before[~closes], strict=True)}
    kept = replace(joints, limbs=limbs[closes], places=joints.places[closes])
    residual, nothing = _residual(last), np.zeros((*kept.places.shape, 3))
    if not closes.any():
        return last, poses, ClosedLoops(kept, before[closes], before[closes], residual, residual, left_open, nothing)
    closed = close_loops(last, limbs[closes])
    after = closed.loops.gap(closed.chain, closed.poses)
    rotations = closed.articulation.projected(closed.chain.parents, poses.rotations)
    root = poses.root.copy()
    root[used], rotations[used] = closed.poses.root, closed.poses.rotations
    found = ClosedLoops(closed.loops, before[closes], after, residual, _residual(closed), left_open, nothing)
    return closed, ChainPoses(root, rotations), found


def _residual(last: Calibration) -> float:
    """Root mean square residual of a coordinate of a marker [mm]."""
    error = residuals(last.chain, last.poses, last.positions)
    squares = float(np.einsum("fmi,fmi,fm->", error, error, last.weights))
    return float(np.sqrt(squares / max(3 * float(last.weights.sum()), 1.0)))


def loop_notices(loops: ClosedLoops, limbs: Ints) -> Iterator[str]:
    """Say how far the ends of loops were apart, and what closing them costs.

    Parameters
    ----------
    loops : ClosedLoops
        Loops of one body.
    limbs : ndarray of intp, shape (n_limbs,)
        The body's limbs, by their index in the take.
    """
    for pair, before, after in zip(loops.joints.limbs.tolist(), loops.before, loops.after, strict=True):
        first, second = limbs[pair].tolist()
        yield (
            f"the loop through limb {first} and limb {second} is closed: its ends were {before:.3g} mm apart, now "
            f"{after:.1g} mm; the residual of a coordinate is {loops.residual:.3g} mm, with open loops "
            f"{loops.residual_before:.3g} mm"
        )
    for pair, gap in loops.left_open.items():
        first, second = limbs[list(pair)].tolist()
        yield (
            f"limb {first} and limb {second} form no loop: the joint between them would be {gap:.3g} mm apart, more "
            "than noise explains; it stays open"
        )
