"""Where joints are expected from the markers of their limbs, on any body; see `joint_prior`."""

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix, nearest_rotation, vector_from_matrix
from skelgen.geometry.statistics import lengths_of
from skelgen.kinematics.chain.chain import Chain, ObservedChain
from skelgen.model.arrays import Floats

ENOUGH_MARKERS = 3
"""With so many markers or more, these alone hold the frame of a limb."""

REACH = 1.5
"""Of D: joints farther from the line between both limbs' nearest markers are out of reach; of 33 joints of three people
that an expert placed, none lies farther than 0.39."""

LEAST_TURN = 0.05
"""rad; limbs that turn more than this about a second axis tell where their joint is."""

FAR_OUT = 3.0
"""Of D: joints farther than this are out of reach unless the limbs turn so much that their place is determined."""

NEAR_MARKER = 0.15
"""Of D: standard deviation of a coordinate of a joint about the expected place."""

DETERMINED = 0.2
"""rad; larger turns across a direction determine where along it the joint is: no other knowledge is used."""

TOWARDS_CHILD = 0.17
"""Part of the way from the parent's nearest marker to the child's where a joint is expected."""

ALONG = 1.5
"""Factor on `NEAR_MARKER` along the axis of a joint that turns about one axis above all."""

ONE_AXIS = 0.3
"""Of the largest turn: limbs whose second largest turn is less turn about one axis above all."""

LEAST_TURN = 0.14
"""rad; limbs that turn less show no axis."""

OFF_MIDDLE = 0.3
"""Of D: standard deviation of a joint along such an axis about the middle of either limb's markers."""

TO_JOINT_BELOW, TO_JOINT_ABOVE = 0.1, 0.2
"""Of D: standard deviation of a joint in a row of limbs, along such an axis, about the next joint below or above."""

RIGID = 1e-6
"""rad; limbs that turn less are one rigid body."""

ROW_TURN = 0.35
"""rad; limbs that turn less do not show their axis well enough to be measured across it."""

TAIL, NO_TAIL = 3.0, 1e3
"""Standard deviations from which on what is known counts less and less, as with Cauchy's distribution: bodies differ,
and trees may be wrong. Of joints that are out of reach it counts in full."""


@dataclass(frozen=True, eq=False)
class JointPlace:
    """What is known of a joint from the markers of its limbs.

    Attributes
    ----------
    limb : int
        Limb below the joint.
    nearest : tuple of int
        Markers of the parent and of the limb that are nearest to the other's.
    distance : float, mm
        Mean distance between the middles of both limbs' markers.
    axes_in_parent, axes_in_child : ndarray, shape (3, 3)
        Axes of the turns between the limbs, one a row, from the largest turn to the smallest.
    turns : ndarray, shape (3,), rad
        Root mean square turns about them.
    tail : float
        Standard deviations from which on what is known of it counts less and less.
    weight : float
        Factor on its weight; 1 for other joints.
    is_astray : bool
        Whether motion alone places it out of reach.
    """

    limb: int
    nearest: tuple[int, int]
    distance: float
    axes_in_parent: Floats
    axes_in_child: Floats
    turns: Floats
    tail: float = TAIL
    weight: float = 1.0
    is_astray: bool = False

    @property
    def has_one_axis(self) -> bool:
        """Whether the limbs turn about one axis above all."""
        return bool(self.turns[0] > LEAST_TURN and self.turns[1] < ONE_AXIS * self.turns[0])


def joint_places(fit: ObservedChain) -> list[JointPlace]:
    """Return what is known of each joint between limbs with markers, from all poses of a fit."""
    chain, markers = fit.chain, fit.poses.markers(fit.chain)
    own = {limb: np.flatnonzero(chain.limb_of_marker == limb) for limb in set(chain.limb_of_marker.tolist())}
    shown = {limb: markers[:, group] for limb, group in own.items()}
    middles = {limb: places.mean(axis=1) for limb, places in shown.items()}
    found = []
    for limb in range(1, chain.n_limbs):
        parent = int(chain.parents[limb])
        if not {parent, limb} <= own.keys():
            continue
        distance = max(float(lengths_of(middles[limb] - middles[parent]).mean()), 1.0)
        above, below = (
            int(own[one][lengths_of(shown[one] - middles[other][:, np.newaxis]).mean(axis=0).argmin()])
            for one, other in ((parent, limb), (limb, parent))
        )
        in_parent, in_child, turns = _turns(fit, limb)
        if min(len(own[parent]), len(own[limb])) == 1:  # what turns is not known
            turns = np.zeros(3)
        found.append(JointPlace(limb, (above, below), distance, in_parent, in_child, turns))
    return found


def _turns(fit: ObservedChain, limb: int) -> tuple[Floats, Floats, Floats]:
    """Axes of the turns of a limb in its parent and in itself, from the largest turn on, and these turns [rad]."""
    relative = fit.poses.rotations[:, fit.chain.parents[limb]].swapaxes(1, 2) @ fit.poses.rotations[:, limb]
    mean = nearest_rotation(relative.mean(axis=0))
    turns = vector_from_matrix(relative @ mean.T)
    squares, axes = np.linalg.eigh(turns.T @ turns / len(turns))
    if squares[-1] < RIGID**2:  # rounding alone turns them: the axes are those of the markers' spread
        own = np.isin(fit.chain.limb_of_marker, [limb, fit.chain.parents[limb]])
        markers = fit.poses.markers(fit.chain)[:, own] - fit.poses.origins(fit.chain)[:, np.newaxis, limb]
        shape = (markers @ fit.poses.rotations[:, fit.chain.parents[limb]]).mean(axis=0)
        axes = np.linalg.eigh((shape - shape.mean(axis=0)).T @ (shape - shape.mean(axis=0)))[1]
    axes = axes.T[::-1]
    return axes, axes @ mean, np.sqrt(np.maximum(squares[::-1], 0.0))


def out_of_reach(fit: ObservedChain) -> list[int]:
    """Return the limbs below joints that lie out of reach, and whose limbs turn too little to place them there."""
    markers, origins, found = fit.poses.markers(fit.chain), fit.poses.origins(fit.chain), []
    for joint in joint_places(fit):
        first, last = (markers[:, marker] for marker in joint.nearest)
        way, off = last - first, origins[:, joint.limb] - first
        part = np.clip((way * off).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0), 0.0, 1.0)
        excess = np.linalg.norm(off - part[:, np.newaxis] * way, axis=1).mean() / joint.distance
        is_hinge = fit.articulation.types[joint.limb] == "hinge"
        least = DETERMINED if excess > FAR_OUT else LEAST_TURN
        if excess > REACH and joint.turns[1] < least and not is_hinge:
            found.append(joint.limb)
    return found


def place_residuals(chain: Chain, known: list[JointPlace]) -> tuple[Floats, Floats]:
    """Return how residuals of joints from their expected places, in deviations, depend on `places`; and their tails.

    Parameters
    ----------
    chain : Chain
        The limbs.
    known : list of JointPlace
        What is known of the joints.

    Returns
    -------
    tuple of ndarray, shapes (n_residuals, 3 (n_markers + n_limbs - 1)), 1 / mm, and (n_residuals,)
    """
    rows: list[Floats] = []
    tails: list[float] = []
    weights: list[float] = []
    n_children = np.bincount(chain.parents[1:], minlength=chain.n_limbs)
    for joint in known:
        n_before = len(rows)
        limb, parent = joint.limb, int(chain.parents[joint.limb])
        for axis, (in_parent, in_child) in enumerate(zip(joint.axes_in_parent, joint.axes_in_child, strict=True)):
            if joint.turns[0 if axis else 1] > DETERMINED and not joint.is_astray:
                continue  # turns across a direction show the place along it
            row = np.zeros((chain.n_markers + chain.n_limbs - 1, 3))
            row[chain.n_markers + limb - 1] = (1 - TOWARDS_CHILD) * in_parent
            row[joint.nearest[0]] -= (1 - TOWARDS_CHILD) * in_parent
            row[joint.nearest[1]] -= TOWARDS_CHILD * in_child
            wide = ALONG if axis == 0 and joint.has_one_axis else 1.0
            rows.append(row / (wide * NEAR_MARKER * joint.distance))
        if joint.has_one_axis:
            rows += _middle_residuals(chain, joint)
            if parent and n_children[parent] == 1 and joint.turns[0] > ROW_TURN:
                rows += _row_residuals(chain, joint)
        tails += [joint.tail] * (len(rows) - n_before)
        weights += [joint.weight] * (len(rows) - n_before)
    slopes = np.array(rows).reshape(len(rows), 3 * (chain.n_markers + chain.n_limbs - 1))
    return np.sqrt(weights)[:, np.newaxis] * slopes, np.array(tails)


def _middle_residuals(chain: Chain, joint: JointPlace) -> list[Floats]:
    """Residuals of a joint along its axis from the middles of its limbs' markers."""
    above, below = (np.flatnonzero(chain.limb_of_marker == one) for one in (chain.parents[joint.limb], joint.limb))
    to_parent, to_child = np.zeros((2, chain.n_markers + chain.n_limbs - 1, 3))
    to_parent[chain.n_markers + joint.limb - 1] = joint.axes_in_parent[0]
    to_parent[above] -= joint.axes_in_parent[0] / len(above)
    to_child[below] -= joint.axes_in_child[0] / len(below)
    return [one / (OFF_MIDDLE * joint.distance) for one in (to_parent, to_child)]


def _row_residuals(chain: Chain, joint: JointPlace) -> list[Floats]:
    """Residuals of a joint along its axis from the next joints of a row of limbs, whose bones run across that axis."""
    children, found = np.flatnonzero(chain.parents == joint.limb), []
    ends = [(joint.limb, joint.axes_in_parent[0], TO_JOINT_ABOVE)]
    if len(children) == 1:
        ends.append((int(children[0]), joint.axes_in_child[0], TO_JOINT_BELOW))
    for end, axis, part in ends:
        row = np.zeros((chain.n_markers + chain.n_limbs - 1, 3))
        row[chain.n_markers + end - 1] = axis
        found.append(row / (part * joint.distance))
    return found


def places(chain: Chain) -> Floats:
    """Return marker offsets and joints below the root [mm], shape (n_markers + n_limbs - 1, 3)."""
    return np.concatenate([chain.offsets, chain.joints[1:]])


def turns_of_frames(chain: Chain) -> tuple[Floats, Floats]:
    """Return derivatives of `places` by turns of limbs' frames, and of the turns that fit displacements of places.

    Parameters
    ----------
    chain : Chain
        The limbs.

    Returns
    -------
    tuple of ndarray, shapes (3 (n_markers + n_limbs - 1), 3 n_limbs) and (3 n_limbs, 3 (n_markers + n_limbs - 1))
    """
    place = places(chain)
    limb_of_place = np.concatenate([chain.limb_of_marker, chain.parents[1:]])
    follow, pulls = np.zeros((len(place), 3, chain.n_limbs, 3)), np.zeros((chain.n_limbs, 3, len(place), 3))
    follow[np.arange(len(place)), :, limb_of_place] = -cross_matrix(place)
    inertia = np.zeros((chain.n_limbs, 3, 3))
    for limb in range(chain.n_limbs):
        own = np.flatnonzero(limb_of_place == limb)
        held = own[own < chain.n_markers]
        n_held = len(held)
        if n_held < ENOUGH_MARKERS:  # then the joints take part, that above at the origin
            held, n_held = own, len(own) + int(limb > 0)
        arms = place[held] - place[held].sum(axis=0) / n_held
        inertia[limb] = np.einsum("ni,ni->", arms, arms) * np.eye(3) - arms.T @ arms
        pulls[limb][:, held] = cross_matrix(arms).swapaxes(0, 1)
    seem = np.linalg.pinv(inertia, rcond=1e-6) @ pulls.reshape(chain.n_limbs, 3, -1)
    return follow.reshape(place.size, -1), seem.reshape(-1, place.size)
