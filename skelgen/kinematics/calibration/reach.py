r"""Joints that a fit has placed beyond what the bodies around them reach: drawn back by what is known of any body.

Limbs that turn about one axis and hardly about a second one say little of where along the first their joint is, and
soft tissue that slides as they turn says it wrongly: the joint may come out a metre away. But a joint lies near its
limbs, and rather near a marker of the limb that is nearer to the root, as people mark joints there. Of a joint that
lies farther from the line between both limbs' nearest markers than 1.5 times the distance between the limbs, two
distances are held small, to that marker m and to the mean c of the child's markers:

.. math::
    \sum \|residuals\|^2 + \lambda \sum_j \left(\frac{|p_j - m_j|^2}{s_j^2} + \frac{|p_j - c_j|^2}{(3 s_j)^2}\right).

Joints that motion determines stay where they are: limbs that turn about two axes by more than `LEAST_TURN`, and hinges,
which are moved along their axes elsewhere.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix, nearest_rotation, vector_from_matrix
from skelgen.kinematics.calibration.calibrate import (
    FREE_SHARE,
    POSE_STEPS,
    STEP_FRAMES,
    Calibration,
    FittedChain,
    information_of,
    level_of_tilts,
)
from skelgen.kinematics.chain.chain import Chain, ObservedChain
from skelgen.kinematics.chain.normal_equations import constant_gradient
from skelgen.model.arrays import Floats

REACH = 1.5
"""Of the distance between both limbs' markers; of 33 joints of three people that an expert placed, none lies farther
from the line between their nearest markers than 0.39."""

NEAR_MARKER = 0.13
"""Of the same distance: standard deviation of a coordinate of a joint about the parent's marker; of these joints."""

NEAR_CHILD = 3.0
"""Times as far from the child's markers."""

LEAST_TURN = 0.05
"""rad; limbs that turn more than this about a second axis tell where their joint is."""

ROUNDS = 30
DAMPINGS = 6
"""Dampings (Levenberg and Marquardt), each ten times the one before, that are tried for a step."""

LEAST_DAMPING, FIRST_DAMPING = 1e-9, 1e-3

LEAST_GAIN = 0.02
"""Rounds stop when the sum falls by less than this part of the weight."""


@dataclass(frozen=True, eq=False)
class JointReach:
    """Where a joint is expected.

    Attributes
    ----------
    limb : int
        Limb below the joint.
    marker : int
        Marker of the parent that is nearest to the limb's markers.
    distance : float, mm
        Mean distance between the markers of both limbs.
    excess : float
        Distance of the joint from the line between both limbs' nearest markers, in units of `distance`.
    turn : float, rad
        Root mean square of how far the limbs turn against each other about their second axis.
    """

    limb: int
    marker: int
    distance: float
    excess: float
    turn: float


def joint_reaches(fit: ObservedChain) -> list[JointReach]:
    """Return where each joint between limbs with markers is expected, from all poses of a fit."""
    chain, markers, origins = fit.chain, fit.poses.markers(fit.chain), fit.poses.origins(fit.chain)
    own = [np.flatnonzero(chain.limb_of_marker == limb) for limb in range(chain.n_limbs)]
    found = []
    for limb in range(1, chain.n_limbs):
        above, below = own[chain.parents[limb]], own[limb]
        if not (len(above) and len(below)):
            continue
        centres = markers[:, above].mean(axis=1), markers[:, below].mean(axis=1)
        distance = max(float(np.linalg.norm(centres[1] - centres[0], axis=1).mean()), 1.0)
        ends = [
            group[np.linalg.norm(markers[:, group] - centre[:, np.newaxis], axis=2).mean(axis=0).argmin()]
            for group, centre in ((above, centres[1]), (below, centres[0]))
        ]
        first, last = markers[:, ends[0]], markers[:, ends[1]]
        way, off = last - first, origins[:, limb] - first
        part = np.clip((way * off).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0), 0.0, 1.0)
        excess = np.linalg.norm(off - part[:, np.newaxis] * way, axis=1).mean() / distance
        relative = fit.poses.rotations[:, chain.parents[limb]].swapaxes(1, 2) @ fit.poses.rotations[:, limb]
        mean = nearest_rotation(relative.mean(axis=0))
        turns = vector_from_matrix(relative @ mean.T)
        squares = np.linalg.eigvalsh(turns.T @ turns / len(turns))
        found.append(JointReach(limb, int(ends[0]), distance, float(excess), float(np.sqrt(max(squares[1], 0.0)))))
    return found


def out_of_reach(fit: ObservedChain) -> list[int]:
    """Return the limbs below joints that lie out of reach, and that the limbs turn about too little to be trusted."""
    free = [one for one in joint_reaches(fit) if fit.articulation.types[one.limb] != "hinge"]
    return [one.limb for one in free if one.excess > REACH and one.turn < LEAST_TURN]


def hold_in_reach(last: Calibration, limbs: list[int], weight: float) -> Calibration:
    """Return the fit with some joints drawn back to where they are expected.

    Parameters
    ----------
    last : Calibration
        The fit.
    limbs : list of int
        Limbs below the joints, from `out_of_reach`.
    weight : float, mm^2
        Sum of squared residuals that counts as much as a joint one standard deviation from where it is expected.
    """
    state, damping = FittedChain.of(last), FIRST_DAMPING
    for _ in range(ROUNDS):
        found = _improved(state, _pulls(state.fit, limbs), weight, damping)
        if found is None:
            break
        state, damping, gain = found
        if gain < LEAST_GAIN * weight:
            break
    return replace(last, chain=state.fit.chain, articulation=state.fit.articulation, poses=state.fit.poses)


def _improved(
    state: FittedChain, pulls: Floats, weight: float, damping: float
) -> tuple[FittedChain, float, float] | None:
    """Take a damped step that lowers the sum; also return the next damping, and by how much; None if none does."""
    fit, chain = state.fit, state.fit.chain
    n_places = 3 * (chain.n_markers + chain.n_limbs - 1)
    information = information_of(fit, STEP_FRAMES)
    usual = float(np.diag(information)[:n_places].mean())
    free = np.full(len(information), FREE_SHARE * usual)
    free[n_places:] *= level_of_tilts(chain)
    # Directions that no frame determines are filtered out of the residuals' gradient: it is not exactly 0 there
    gradient = information @ np.linalg.solve(information + np.diag(free), constant_gradient(fit))
    gradient[:n_places] -= weight * (pulls.T @ (pulls @ _places(chain))).ravel()
    matrix = information + np.diag(free)
    matrix[:n_places, :n_places] += weight * np.kron(pulls.T @ pulls, np.eye(3)) + usual * _rotations_of_frames(chain)
    before = state.squares + weight * _squares(pulls, chain)
    for _ in range(DAMPINGS):
        step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
        offsets, joints, tilts = np.split(step, [3 * chain.n_markers, n_places])
        better = FittedChain.of(fit.stepped(offsets, joints, tilts), POSE_STEPS)
        gain = before - better.squares - weight * _squares(pulls, better.fit.chain)
        if gain > 0:
            return better, max(damping / 10, LEAST_DAMPING), gain
        damping *= 10
    return None


def _pulls(fit: ObservedChain, limbs: list[int]) -> Floats:
    """How far each joint is from where it is expected, over its spread, by marker offsets and joints."""
    chain, rows = fit.chain, []
    for joint in joint_reaches(fit):
        if joint.limb in limbs:
            spread = NEAR_MARKER * joint.distance
            to_marker, to_child = np.zeros((2, chain.n_markers + chain.n_limbs - 1))
            to_marker[[chain.n_markers + joint.limb - 1, joint.marker]] = 1 / spread, -1 / spread
            below = np.flatnonzero(chain.limb_of_marker == joint.limb)
            to_child[below] = -1 / (len(below) * NEAR_CHILD * spread)
            rows += [to_marker, to_child]
    return np.array(rows)


def _places(chain: Chain) -> Floats:
    return np.concatenate([chain.offsets, chain.joints[1:]])


def _squares(pulls: Floats, chain: Chain) -> float:
    return float(((pulls @ _places(chain)) ** 2).sum())


def _rotations_of_frames(chain: Chain) -> Floats:
    """Matrix that holds the frames of limbs: how far places rotate together, squared, relative to how far they lie."""
    n_places, result = chain.n_markers + chain.n_limbs - 1, []
    for limb in range(chain.n_limbs):
        columns = np.flatnonzero(chain.limb_of_marker == limb)
        points = chain.offsets[columns]
        if len(columns) < 3:  # then the joints take part
            children = np.flatnonzero(chain.parents == limb)
            points = np.concatenate([points, chain.joints[children], np.zeros((int(limb > 0), 3))])
            columns = np.concatenate([columns, chain.n_markers + children - 1])
        arms = points - points.mean(axis=0)
        size = float(np.linalg.norm(arms))
        if size > 1.0:
            rotation = np.zeros((3, n_places, 3))
            rotation[:, columns] = cross_matrix(arms[: len(columns)] / size).swapaxes(0, 1)
            result.append(rotation.reshape(3, -1))
    every = np.concatenate(result) if result else np.zeros((1, 3 * n_places))
    return np.asarray(every.T @ every)
