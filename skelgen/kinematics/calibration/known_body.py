r"""A body of known build: how its markers and joints lie to each other on a usual person of its size.

Of a limb that is a segment of the known body, points x (its markers, and the joints to its neighbours) are expected to
be those of the segment, y, in any pose. The misfit is

.. math::
    \min_{R, t} \sum_i |x_i - (s R y_i + t)|^2 / \sigma_i^2

with the size s of the whole body. The deviations hold how far markers miss their places, and how people differ, which
is more the farther a point is from the middle of its segment.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.geometry.rotations import cross_matrix, nearest_rotation
from skelgen.kinematics.calibration.joint_places import places
from skelgen.kinematics.chain.chain import Chain, ObservedChain
from skelgen.model.arrays import Floats, Ints

MISPLACED = 10.0
"""mm; standard deviation of a coordinate of a marker, or of a joint, from its place."""

UNLIKE = 0.06
"""The same, as a part of the distance to the middle of the segment, as proportions of people differ."""

TAIL = 3.0
"""Standard deviations from which on a point counts less and less: some markers are stuck elsewhere."""

FLAT = 0.05
"""Part of the largest spread: markers with less across their line do not tell how their segment is turned."""

ON_LINE = 1e-10
"""Of the largest inertia: segments with less have points on one line, and no turn about it."""


@dataclass(frozen=True, eq=False)
class KnownBody:
    """A body of known build.

    Attributes
    ----------
    segments : ndarray of intp, shape (n_markers,)
        Segment of each marker, -1 where it is not known.
    offsets : ndarray, shape (n_markers, 3), mm
        The markers in the frames of their segments, in the size of the body.
    parents : ndarray of intp, shape (n_segments,)
        Of the segments, -1 for the root.
    joints : ndarray, shape (n_segments, 3), mm
        Origins of the segments, which are their joints to their parents, in the parents' frames.
    misplaced : float, mm
        Standard deviation of a coordinate of a marker from its place.
    marker_set : str
        Name of the marker set that is worn; empty where markers are at usual places of a body, of no set that is known.
    """

    segments: Ints
    offsets: Floats
    parents: Ints
    joints: Floats
    misplaced: float = MISPLACED
    marker_set: str = ""


@dataclass(frozen=True, eq=False)
class KnownLimb:
    """A limb of a chain that is a segment.

    Attributes
    ----------
    limb : int
        Place in the chain.
    rows : ndarray of intp, shape (n_points,)
        Its points among `places` of the chain; -1 for its origin.
    expected : ndarray, shape (n_points, 3), mm
        The same points in the segment's frame.
    n_markers : int
        How many of them, the first, are markers.
    misplaced : float, mm
        Standard deviation of a coordinate of a marker from its place.
    """

    limb: int
    rows: Ints
    expected: Floats
    n_markers: int
    misplaced: float

    @cached_property
    def deviations(self) -> Floats:
        """Standard deviations of the points [mm]."""
        away = np.linalg.norm(self.expected - self.expected.mean(axis=0), axis=1)
        misplaced = np.where(np.arange(len(away)) < self.n_markers, self.misplaced, MISPLACED)
        return np.asarray(np.hypot(misplaced, UNLIKE * away))

    @property
    def fixes_turn(self) -> bool:
        """Whether its markers, without its joints, tell how it is turned."""
        markers = self.expected[: self.n_markers]
        spread = np.linalg.svd(markers - markers.mean(axis=0), compute_uv=False)
        return self.n_markers > 2 and bool(spread[1] > FLAT * spread[0])

    def at(self, chain: Chain) -> Floats:
        """Return its points in the limb's frame [mm], shape (n_points, 3)."""
        every = np.vstack([places(chain), np.zeros(3)])
        return np.asarray(every[self.rows])


def known_limbs(chain: Chain, body: KnownBody) -> list[KnownLimb]:
    """Return the limbs of a chain that are segments, with their points.

    Parameters
    ----------
    chain : Chain
        The limbs.
    body : KnownBody
        What is known.
    """
    segment = [_most(body.segments[chain.limb_of_marker == limb]) for limb in range(chain.n_limbs)]
    found = []
    for limb, own in enumerate(segment):
        if own < 0:
            continue
        markers = np.flatnonzero((chain.limb_of_marker == limb) & (body.segments == own))
        rows, expected = markers.tolist(), list(body.offsets[markers])
        ends = [
            (chain.n_markers + child - 1, segment[child]) for child in np.flatnonzero(chain.parents == limb).tolist()
        ]
        ends += [(-1, segment[chain.parents[limb]])] if limb else []
        for row, other in ends:
            if other >= 0 and body.parents[other] == own:
                rows.append(row)
                expected.append(body.joints[other])
            elif other >= 0 and body.parents[own] == other:
                rows.append(row)
                expected.append(np.zeros(3))
        found.append(KnownLimb(limb, np.array(rows), np.array(expected), len(markers), body.misplaced))
    return found


def _most(segments: Ints) -> int:
    """Return the segment of more than half of the markers that have one; -1 if there is none."""
    known = segments[segments >= 0]
    if not len(known):
        return -1
    count = np.bincount(known)
    return int(count.argmax()) if 2 * count.max() > len(segments) else -1


def joints_of_limbs(chain: Chain, limbs: list[KnownLimb]) -> set[int]:
    """Return the limbs below joints that are known from a limb whose markers tell how it is turned.

    Parameters
    ----------
    chain : Chain
        The limbs.
    limbs : list of KnownLimb
        What is known of them.
    """
    rows = [(one.limb, row) for one in limbs if one.fixes_turn for row in one.rows[one.n_markers :].tolist()]
    return {limb if row < 0 else row - chain.n_markers + 1 for limb, row in rows}


def body_residuals(chain: Chain, limbs: list[KnownLimb]) -> tuple[Floats, Floats]:
    """Return how far each point is off its expected place, in standard deviations, and the derivatives by `places`.

    Parameters
    ----------
    chain : Chain
        The limbs.
    limbs : list of KnownLimb
        What is known of them.

    Returns
    -------
    tuple of ndarray, shapes (n_residuals, 3 (n_markers + n_limbs - 1)) and (n_residuals,)
    """
    several = [one for one in limbs if len(one.rows) > 1]
    n_places = chain.n_markers + chain.n_limbs - 1
    if not several:
        return np.zeros((0, 3 * n_places)), np.zeros(0)
    sizes = np.array([len(one.rows) for one in several])
    limb, starts = np.repeat(np.arange(len(several)), sizes), np.cumsum(sizes) - sizes
    turned, off, weights = _laid_on_limbs(chain, several, limb, starts)
    first, second = np.nonzero(limb[:, np.newaxis] == limb)
    # Points of a limb follow each other: its middle is moved by each, and so is its turn
    arms = weights[:, np.newaxis, np.newaxis] * cross_matrix(turned)
    turns = _turns_by_moments(turned, weights, starts)[limb[first]]
    shares = weights / np.add.reduceat(weights**2, starts)[limb]
    follow = arms[first] @ turns @ arms[second].swapaxes(1, 2)
    follow += (weights[first] * shares[second])[:, np.newaxis, np.newaxis] * np.eye(3)
    slope = np.zeros((len(limb), 3, n_places + 1, 3))
    columns = np.concatenate([one.rows for one in several])
    slope[first, :, columns[second]] = ((first == second)[:, np.newaxis, np.newaxis] * np.eye(3) - follow) * weights[
        second, np.newaxis, np.newaxis
    ]
    return slope[:, :, :n_places].reshape(3 * len(limb), -1), (weights[:, np.newaxis] * off).ravel()


def _turns_by_moments(turned: Floats, weights: Floats, starts: Ints) -> Floats:
    """Return how segments turn by the moments of their points, shape (n_segments, 3, 3)."""
    squares = (weights**2)[:, np.newaxis, np.newaxis] * turned[:, :, np.newaxis] * turned[:, np.newaxis]
    spread = np.add.reduceat(squares, starts)
    inertia = np.trace(spread, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3) - spread
    return np.asarray(np.linalg.pinv(inertia, rcond=ON_LINE, hermitian=True))


def _laid_on_limbs(chain: Chain, limbs: list[KnownLimb], limb: Ints, starts: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the expected points of limbs about their middles, turned onto these, the residuals from them, and weights.

    Parameters
    ----------
    chain : Chain
        The limbs.
    limbs : list of KnownLimb
        What is known of them.
    limb : ndarray of intp, shape (n_points,)
        Which of `limbs` each point is on.
    starts : ndarray of intp, shape (n_known_limbs,)
        Where the points of each begin.
    """
    points, expected = (
        np.concatenate(parts) for parts in zip(*((one.at(chain), one.expected) for one in limbs), strict=True)
    )
    weights = np.concatenate([1 / one.deviations for one in limbs])
    turns, middles, there = _laid_on(points, expected, weights, starts)
    turned = (turns[limb] @ (expected - there[limb])[..., np.newaxis])[..., 0]
    return turned, points - middles[limb] - turned, weights


def _laid_on(points: Floats, expected: Floats, weights: Floats, starts: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the rotations that lay expected points on points, and the weighted middles of these and of those.

    Points stand limb by limb, which begin at `starts`.
    """
    limb = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(points)))
    shares = (weights**2 / np.add.reduceat(weights**2, starts)[limb])[:, np.newaxis]
    middles, there = (np.add.reduceat(shares * one, starts) for one in (points, expected))
    arms, lengths = shares * (points - middles[limb]), expected - there[limb]
    moments = np.add.reduceat(arms[:, :, np.newaxis] * lengths[:, np.newaxis], starts)
    return nearest_rotation(moments), middles, there


def joints_of_body(fit: ObservedChain, limbs: list[KnownLimb]) -> ObservedChain:
    """Move joints to where they are expected by the markers of limbs that show how they are turned.

    Parameters
    ----------
    fit : ObservedChain
        The chain.
    limbs : list of KnownLimb
        What is known of it.
    """
    chain = fit.chain
    for joint in range(1, chain.n_limbs):
        wanted = []
        for one in limbs:
            row = -1 if one.limb == joint else chain.n_markers + joint - 1
            where = np.flatnonzero(one.rows[one.n_markers :] == row)
            if one.limb not in (joint, chain.parents[joint]) or not len(where) or not one.fixes_turn:
                continue
            own = slice(0, one.n_markers)
            laid = _laid_on(one.at(chain)[own], one.expected[own], 1 / one.deviations[own], np.zeros(1, dtype=np.intp))
            turn, middle, there = (found[0] for found in laid)
            place = middle + turn @ (one.expected[one.n_markers + where[0]] - there)
            rotations = fit.poses.rotations[:, one.limb]
            wanted.append(fit.poses.origins(chain)[:, one.limb] + rotations @ place)
        if wanted:
            chain = with_joint_at(replace(fit, chain=chain), joint, np.mean(wanted, axis=0))
            fit = replace(fit, chain=chain)
    return fit


def with_joint_at(fit: ObservedChain, limb: int, wanted: Floats) -> Chain:
    """Move a joint as near as possible to wanted places in the world; all markers stay where they are.

    Parameters
    ----------
    fit : ObservedChain
        The chain in its poses.
    limb : int
        Below the joint.
    wanted : ndarray, shape (n_frames, 3), mm
        In the world.
    """
    chain, rotations = fit.chain, fit.poses.rotations
    joints, offsets = chain.joints.copy(), chain.offsets.copy()
    gap = wanted - fit.poses.origins(chain)[:, limb]
    ends = (rotations[:, chain.parents[limb]], rotations[:, limb])
    in_parent, in_child = (np.einsum("fji,fj->i", one, gap) / len(gap) for one in ends)
    joints[limb] += in_parent
    joints[chain.parents == limb] -= in_child
    offsets[chain.limb_of_marker == limb] -= in_child
    return chain.moved(joints, offsets)
