"""Rings of limbs in the fit of a body: which are closed, and how far their ends were apart before and are now."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.calibration.calibrate import Calibration
from skelgen.kinematics.calibration.closed_loops import ClosedCalibration, close_loops
from skelgen.kinematics.calibration.limb_errors import LimbErrors
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals
from skelgen.kinematics.chain.observed_chain import observed
from skelgen.kinematics.inverse.loop_closure import KinematicLoops, fit_closed_poses
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.kinematics.joints.joint_type import JointKind
from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints import limb_pairs

FOUND = "found"
"""Wish for all rings that the stage before found."""

LARGEST_GAP = 4.0
"""Times the noise of a coordinate: rings that were found and whose ends are usually farther apart are none."""


@dataclass(frozen=True, eq=False)
class BodyRings:
    """The rings of a body that were closed.

    Attributes
    ----------
    rings : KinematicLoops
        Their joints.
    before, after : ndarray, shape (n_rings,), mm
        Root mean square gap of their ends in the fit of the tree, and in that of the rings.
    missed_before, missed : float, mm
        Root mean square by which a coordinate of a marker is missed without and with closed rings.
    left_open : dict of pair to float
        Rings that are none, and the root mean square gap of their ends [mm].
    covariances : ndarray, shape (n_rings, 2, 3, 3), mm^2
        Of the rings' places in both limbs, against their markers.
    """

    rings: KinematicLoops
    before: Floats
    after: Floats
    missed_before: float
    missed: float
    left_open: dict[tuple[int, int], float]
    covariances: Floats

    def shifted(self, kinds: list[JointKind], shifts: dict[int, float]) -> BodyRings:
        """Return the rings for limbs whose frames were moved along hinges."""
        places = self.rings.places.copy()
        for limb, shift in shifts.items():
            places[self.rings.limbs == limb] -= shift * kinds[limb - 1].axis_in_child
        return replace(self, rings=replace(self.rings, places=places))

    def turned(self, turn: Floats) -> BodyRings:
        """Return the rings for limbs whose frames were turned: new from old, shape (n_limbs, 3, 3)."""
        turns = turn[self.rings.limbs]
        places = np.einsum("rsij,rsj->rsi", turns, self.rings.places)
        covariances = turns @ self.covariances @ turns.swapaxes(2, 3)
        return replace(self, rings=replace(self.rings, places=places), covariances=covariances)

    def with_errors(self, errors: LimbErrors, closed: ClosedCalibration, deviation: float) -> BodyRings:
        """Return the rings with covariances: what chain and frames leave open for noise of `deviation` [mm]."""
        n_own = 6 * closed.loops.n_loops
        whole = closed.whole_information
        corner = closed.loop_information
        follow = -np.linalg.solve(corner, whole[-n_own:, :-n_own]) @ errors.root
        own = deviation * np.linalg.inv(np.linalg.cholesky(corner)).T
        changes = np.concatenate([follow, own], axis=1).reshape(*closed.loops.places.shape, -1)
        wide = replace(errors, root=np.pad(errors.root, ((0, 0), (0, n_own))))
        covariances = np.zeros((*closed.loops.places.shape, 3))
        for ring, limbs in enumerate(closed.loops.limbs.tolist()):
            for side, limb in enumerate(limbs):
                change = wide.point(limb, closed.loops.places[ring, side], changes[ring, side])
                covariances[ring, side] = change @ change.T
        return replace(self, covariances=covariances)


def wanted_rings(
    wish: str, topology: Topology, trajectories: Trajectories, limbs: Limbs
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of limbs that close rings, as the user wishes.

    Raises
    ------
    InputError
        If the wish names no pairs of limbs, limbs that the tree joins already, or limbs of separate bodies.
    """
    pairs = topology.loops if wish.strip() == FOUND else limb_pairs(wish, trajectories.names, limbs)
    for first, second in pairs:
        if topology.parents[first] == second or topology.parents[second] == first:
            raise InputError(f"limb {first} and limb {second} are joined by the tree already: they close no ring")
        if second not in topology.limbs_of_tree(first):
            raise InputError(f"limb {first} and limb {second} are on separate bodies: they close no ring")
    return pairs


def closed_body(
    last: Calibration, poses: ChainPoses, used: Ints, limbs: Ints, are_stated: bool
) -> tuple[Calibration, ChainPoses, BodyRings]:
    """Close the rings of a fitted body; poses of all frames start from there.

    Parameters
    ----------
    last : Calibration
        Fitted as a tree.
    poses : ChainPoses
        All frames.
    used : ndarray of intp
        Frames of the fit.
    limbs : ndarray of intp, shape (n_rings, 2)
        Limbs that meet, by position in the body.
    are_stated : bool
        Whether the user states the rings; others stay open where noise does not explain their gap.
    """
    rings = KinematicLoops.of_poses(limbs, last.chain, last.poses)
    usual = np.median(np.linalg.norm(rings.gaps(last.chain, last.poses), axis=2), axis=0)
    closes = np.ones(len(limbs), dtype=bool) if are_stated else usual <= LARGEST_GAP * last.noise
    before = rings.gap(last.chain, last.poses)
    left_open = {(int(a), int(b)): float(gap) for (a, b), gap in zip(limbs[~closes], before[~closes], strict=True)}
    kept = replace(rings, limbs=limbs[closes], places=rings.places[closes])
    nothing = np.zeros((*kept.places.shape, 3))
    if not closes.any():
        missed = _missed(last)
        return last, poses, BodyRings(kept, before[closes], before[closes], missed, missed, left_open, nothing)
    closed = close_loops(last, limbs[closes])
    after = closed.loops.gap(closed.chain, closed.poses)
    rotations = closed.articulation.projected(closed.chain.parents, poses.rotations)
    root = poses.root.copy()
    root[used], rotations[used] = closed.poses.root, closed.poses.rotations
    found = BodyRings(closed.loops, before[closes], after, _missed(last), _missed(closed), left_open, nothing)
    return closed, ChainPoses(root, rotations), found


def _missed(last: Calibration) -> float:
    """Root mean square [mm] by which coordinates of markers are missed."""
    error = residuals(last.chain, last.poses, last.positions)
    squares = float(np.einsum("fmi,fmi,fm->", error, error, last.weights))
    return float(np.sqrt(squares / max(3 * float(last.weights.sum()), 1.0)))


def all_poses(
    chain: Chain, rings: BodyRings | None, start: ChainPoses, positions: Floats, articulation: Articulation
) -> ChainPoses:
    """Pose a chain in all frames, its rings closed."""
    if rings is None or not rings.rings.n_loops:
        return fit_poses(chain, start, positions, articulation)
    return fit_closed_poses(observed(chain, articulation, start, positions), rings.rings)


def ring_sentences(rings: BodyRings, limbs: Ints) -> Iterator[str]:
    """Say how far the ends of rings were apart, and what closing them costs; limbs are those of the take."""
    for pair, before, after in zip(rings.rings.limbs.tolist(), rings.before, rings.after, strict=True):
        first, second = limbs[pair].tolist()
        yield (
            f"the ring through limb {first} and limb {second} is closed: its ends were {before:.3g} mm apart, now "
            f"{after:.1g} mm; markers are missed by {rings.missed:.3g} mm, with open rings by "
            f"{rings.missed_before:.3g} mm"
        )
    for pair, gap in rings.left_open.items():
        first, second = limbs[list(pair)].tolist()
        yield (
            f"limb {first} and limb {second} form no ring: the joint between them would be {gap:.3g} mm apart, more "
            "than noise explains; it stays open"
        )
