"""The joints of a fitted chain: their types, their places along hinge axes, and their uncertainty."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.chain import variances_across
from skelgen.kinematics.calibration.calibrate import Calibration, FittedChain
from skelgen.kinematics.calibration.limb_errors import HingeShifts, LimbErrors, limb_errors
from skelgen.kinematics.calibration.uncertainty import frame_covariances, inverse_root
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ObservedChain, observed, residuals, residuals_in_limbs
from skelgen.kinematics.chain.schur_complement import effective_frames
from skelgen.kinematics.inverse.poses import pose_covariances
from skelgen.kinematics.joints.joint_type import JointType, TypeLimits, find_joint_type
from skelgen.kinematics.joints.observability import open_directions
from skelgen.kinematics.joints.relative_poses import MIN_FRAMES
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames

NEIGHBOUR_WEIGHT = 0.1
"""Weight of a limb's other joints beside its markers for the place of a hinge along its axis. It is small: near the
markers an axis is known best, and an error of its direction grows with the distance along it."""

HARMLESS = 1.2
"""Shifts along hinges may make the sum of squared residuals larger by this factor at most."""

NUMBERS_OF_POSE = 6
"""Coordinates of a position and a rotation."""

SHARED_FRAMES = 60
"""Frames over which the skeleton's part is averaged."""

EXACT_FRAMES = 2000
"""Frames whose part is computed; the others of a long take have that of the nearest one."""


_ANY_TURN = 1e6
"""Variance [rad^2] of a turn that nothing determines."""


def find_joint_types(
    fit: Calibration, fixed: Bools, stated: dict[int, str], limits: TypeLimits, are_poses: bool = False
) -> list[JointType]:
    """Find the type of the joint above each limb but the root.

    Parameters
    ----------
    fit : Calibration
        A fit with free joints.
    fixed : ndarray of bool, shape (n_frames, n_limbs)
        Whether points of the frame fix the limb's rotation. Frames in which both limbs of a joint are fixed count, all
        if there are none.
    stated : dict of int to str
        Types that the user states, by limb.
    limits : TypeLimits
        Where one type ends and the next begins.
    are_poses : bool
        Whether the markers stand for bodies with orientation.
    """
    chain, poses, positions = fit.chain, fit.poses, fit.positions
    covariances = pose_covariances(observed(chain, Articulation.free(chain.n_limbs), poses, positions), fit.noise).turns
    unknown = ~(np.abs(covariances).max(axis=(2, 3)) < _ANY_TURN)  # rad^2; not finite, where nothing shows the limb
    covariances = np.where(unknown[:, :, np.newaxis, np.newaxis], _ANY_TURN * np.eye(3), covariances)
    n_seen = float((~np.isnan(positions[:, :, 0])).sum() / len(positions))
    n_numbers = NUMBERS_OF_POSE * chain.n_limbs if are_poses else 3 * n_seen
    freedoms_of_pair = 2 * max(n_numbers - 3 - 3 * chain.n_limbs, 0.0) / chain.n_limbs
    types = []
    for limb in range(1, chain.n_limbs):
        parent = chain.parents[limb]
        both = fixed[:, limb] & fixed[:, parent]
        use = both if both.sum() >= MIN_FRAMES else np.ones_like(both)
        relative = (poses.rotations[:, parent].swapaxes(1, 2) @ poses.rotations[:, limb])[use]
        types.append(find_joint_type(relative, covariances[use, limb], freedoms_of_pair, limits, stated.get(limb)))
    return types


def articulation_of(types: list[JointType], stated: set[int]) -> Articulation:
    """Return what the joints allow: a joint is held to its type if noise alone explains the residual rotations.

    Parameters
    ----------
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    stated : set of int
        Limbs for which the user states the type: they are held to it in any case.
    """
    free = Articulation.free(len(types) + 1)
    held, between = ["ball"], np.zeros(len(types) + 1)
    in_parent, in_child = free.in_parent.copy(), free.in_child.copy()
    for limb, kind in enumerate(types, start=1):
        left = kind.type_fits.get(kind.kind)
        holds = left is not None and (limb in stated or left.ratio <= left.limit)
        held.append(kind.kind if holds else "ball")
        in_parent[limb], in_child[limb] = kind.axis_in_parent, kind.axis_in_child
        if left is not None:
            between[limb] = left.rotation.between
    return Articulation(tuple(held), in_parent, in_child, between)


def with_axes(types: list[JointType], articulation: Articulation) -> list[JointType]:
    """Return joint types with the axes of an articulation where it holds them.

    Parameters
    ----------
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    articulation : Articulation
        With axes that were fitted.
    """
    return [
        replace(kind, axis_in_parent=articulation.in_parent[limb], axis_in_child=articulation.in_child[limb])
        if articulation.types[limb] in {"hinge", "universal"}
        else kind
        for limb, kind in enumerate(types, start=1)
    ]


def with_noise_of_poses(fit: Calibration) -> Calibration:
    """Estimate the noise anew for markers that stand for bodies with orientation.

    Their shapes are known and exact: each body that is seen gives six numbers, not three for every marker.
    """
    chain = fit.chain
    seen = ~np.isnan(fit.positions[:, :, 0])
    n_bodies = sum(int(seen[:, chain.limb_of_marker == limb].any(axis=1).sum()) for limb in range(chain.n_limbs))
    free = len(fit.positions) * (3 + 3 * chain.n_limbs) + NUMBERS_OF_POSE * (chain.n_limbs - 1)
    squares = float((residuals(chain, fit.poses, fit.positions) ** 2).sum())
    return replace(fit, noise=float(np.sqrt(squares / max(NUMBERS_OF_POSE * n_bodies - free, 1))))


def shifts_along_axes(chain: Chain, types: list[JointType], freedom: Floats) -> dict[int, float]:
    """Return how far [mm] hinges are moved along their axes, where data leave the choice, by their child limbs.

    Each hinge is moved towards the centroids of its two limbs' markers and, with little weight, towards the other
    joints of these limbs.

    Parameters
    ----------
    chain : Chain
        The limbs.
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    freedom : ndarray, shape (n_limbs,)
        How free each joint is along its axis, see `axis_freedom`.
    """
    hinges = [index for index, kind in enumerate(types) if kind.kind == "hinge"]
    if not hinges:
        return {}
    column = {limb + 1: position for position, limb in enumerate(hinges)}
    rows: list[Floats] = []
    right: list[Floats] = []
    for limb in range(chain.n_limbs):
        places = _attachments(chain, types, limb, column)
        own = chain.limb_of_marker == limb
        centre = (chain.offsets[own].mean(axis=0), np.zeros((3, len(hinges))))
        near = [(1.0, place, centre) for place in places]
        near += [(NEIGHBOUR_WEIGHT, a, b) for i, a in enumerate(places) for b in places[i + 1 :]]
        for weight, first, second in near:
            rows.append(weight * (first[1] - second[1]))
            right.append(weight * (second[0] - first[0]))
    shifts = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    return {limb: float(freedom[limb] * shifts[position]) for limb, position in column.items()}


def harmless(shifts: dict[int, float], fit: Calibration, types: list[JointType]) -> dict[int, float]:
    """Return all shifts if the markers still fit after them, else only those of joints that are held to their axes.

    Parameters
    ----------
    shifts : dict of int to float
        How far [mm], by child limb.
    fit : Calibration
        The fit.
    types : list of JointType
        Of its joints.
    """
    held = {limb: shift for limb, shift in shifts.items() if fit.articulation.types[limb] == "hinge"}
    if len(held) == len(shifts):
        return shifts
    moved = FittedChain.of(replace(fit, chain=shifted(fit.chain, types, shifts)))
    return shifts if moved.squares <= HARMLESS * fit.squares else held


def axis_freedom(types: list[JointType], noise: float) -> Floats:
    """Return how free the joint above each limb is along its axis, 0 .. 1, shape (n_limbs,).

    Parameters
    ----------
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    noise : float, mm
        Standard deviation of a marker's coordinate.
    """
    return np.array([0.0] + [kind.freedom_along_axis(noise) for kind in types])


def _attachments(
    chain: Chain, types: list[JointType], limb: int, column: dict[int, int]
) -> list[tuple[Floats, Floats]]:
    """For each joint of a limb, its place before any shift and the derivatives by the shifts, shape (3, n_hinges)."""
    places = []
    for joint in chain.joints_of(limb):
        follows = np.zeros((3, len(column)))
        if joint in column:
            kind = types[joint - 1]
            follows[:, column[joint]] = kind.axis_in_child if joint == limb else kind.axis_in_parent
        places.append((np.zeros(3) if joint == limb else chain.joints[joint], follows))
    return places


def shifted(chain: Chain, types: list[JointType], shifts: dict[int, float]) -> Chain:
    """Return a chain whose joints are moved along their axes.

    Parameters
    ----------
    chain : Chain
        The limbs.
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    shifts : dict of int to float
        How far [mm], by child limb.
    """
    joints, offsets = chain.joints.copy(), chain.offsets.copy()
    for limb, shift in shifts.items():
        kind = types[limb - 1]
        joints[limb] += shift * kind.axis_in_parent
        offsets[chain.limb_of_marker == limb] -= shift * kind.axis_in_child
        joints[chain.parents == limb] -= shift * kind.axis_in_child
    return chain.moved(joints, offsets)


def errors_of_limbs(
    last: Calibration, types: list[JointType], shifts: dict[int, float], freedom: Floats, correlation_time: float
) -> LimbErrors:
    """Return the errors of a chain whose hinges were moved along their axes.

    Parameters
    ----------
    last : Calibration
        The fit.
    types, shifts, freedom
        The types of its joints, and how hinges were moved.
    correlation_time : float
        Frames of residuals that are worth one independent frame.
    """
    chain = last.chain
    axes, distances = np.zeros((2, chain.n_limbs, 3)), np.zeros(chain.n_limbs)
    for limb, shift in shifts.items():
        axes[:, limb], distances[limb] = (types[limb - 1].axis_in_parent, types[limb - 1].axis_in_child), shift
    along = HingeShifts(axes, distances, _along_hinges(chain, types, freedom))
    return limb_errors(last, along, correlation_time)


def places_left_open(
    errors: tuple[LimbErrors, LimbErrors], types: list[JointType], astray: Sequence[int], placed: set[int]
) -> tuple[Ints, tuple[int, ...]]:
    """Find in how many directions motion alone leaves each joint open, and which joints the marker set places instead.

    Parameters
    ----------
    errors : tuple of LimbErrors
        Of a fit with the information of the motion alone, and with what is known of joints.
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    astray : sequence of int
        Limbs below joints that motion places out of reach: it tells no direction but a hinge's axis.
    placed : set of int
        Limbs below joints whose places the marker set knows.

    Returns
    -------
    tuple of ndarray of intp, shape (n_limbs,), and tuple of int
        Directions; of joints that the marker set places, those that it leaves open. The limbs below these joints.
    """
    n_open, n_left = (_directions_left_open(one, types) for one in errors)
    along = np.array([0] + [int(kind.kind == "hinge") for kind in types])
    helped = set(np.flatnonzero((n_open > along) & (n_left <= along)).tolist())
    by_set = sorted(placed & helped.union(astray))
    n_open[list(astray)] = np.maximum(n_open, 1 + along)[list(astray)]
    n_open[by_set] = n_left[by_set]
    return n_open, tuple(by_set)


def _directions_left_open(errors: LimbErrors, types: list[JointType]) -> Ints:
    """In how many directions errors leave the joint above each limb open, shape (n_limbs,)."""
    chain = errors.chain
    n_open = np.zeros(chain.n_limbs, dtype=np.intp)
    for limb, kind in enumerate(types, start=1):
        root = errors.joint(limb, int(chain.parents[limb]))
        axis = kind.axis_in_parent if kind.kind == "hinge" else None
        n_open[limb] = open_directions(root @ root.T, limb_size(chain, limb), axis)
    return n_open


def _along_hinges(chain: Chain, types: list[JointType], freedom: Floats) -> Floats:
    """Changes of offsets and joints as each hinge moves along its axis; a free one moves by the size of its limb."""
    still = chain.moved(np.zeros_like(chain.joints), np.zeros_like(chain.offsets))
    columns = []
    for limb, kind in enumerate(types, start=1):
        if kind.kind == "hinge":
            moved = shifted(still, types, {limb: float(np.sqrt(freedom[limb])) * limb_size(chain, limb)})
            columns.append(np.concatenate([moved.offsets.ravel(), moved.joints[1:].ravel()]))
    return np.array(columns).reshape(len(columns), 3 * (chain.n_markers + chain.n_limbs - 1)).T


def limb_size(chain: Chain, limb: int) -> float:
    """Return the root mean square distance [mm] of a limb's markers from its joint; of all limbs' where it has none.

    Parameters
    ----------
    chain : Chain
        The limbs.
    limb : int
        Which.
    """
    own = chain.limb_of_marker == limb
    offsets = chain.offsets[own] if own.any() else chain.offsets
    return float(np.sqrt((offsets**2).sum(axis=1).mean()))


def correlation_time(fit: Calibration, positions: Floats) -> float:
    """Return how many successive frames of residuals are worth one independent frame, at least 1.

    Parameters
    ----------
    fit : Calibration
        The fit.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What it was fitted to, in the order of time.
    """
    if len(positions) == 0 or fit.noise == 0.0:
        return 1.0
    own = residuals_in_limbs(fit.chain, fit.poses, positions)
    return len(own) / effective_frames(own.reshape(len(own), -1))


def joint_deviations(
    last: Calibration, everywhere: ObservedChain, unseen: Bools, correlated: float, along: bool
) -> Floats:
    """Return standard deviations [mm] of joints along the world's axes, of hinges across theirs, by frame and limb.

    The frame's part rests on what it shows. The skeleton's part hardly changes with the pose when it is seen from the
    parent: it is averaged there over some frames. Errors that last, as soft tissue makes, average out over fewer frames
    than there are: the skeleton's part grows by as much.

    Parameters
    ----------
    last : Calibration
        The fit of the constants.
    everywhere : ObservedChain
        Its chain in all frames, hinges moved along their axes.
    unseen : ndarray of bool, shape (n_frames,)
        Frames that show too little of a limb.
    correlated : float
        Frames of residuals that are worth one independent frame.
    along : bool
        Whether hinges count along their axes, too, as their places there are known.

    Returns
    -------
    ndarray, shape (n_frames, n_limbs, 3), mm
    """
    even = spread_frames(len(unseen), EXACT_FRAMES)
    frames = np.unique(np.concatenate([even, np.flatnonzero(unseen)[:EXACT_FRAMES]]))
    some, parents = everywhere.at(frames), everywhere.chain.parents
    axes = some.articulation.hinge_axes(parents, some.poses.rotations) * (not along)
    covariances = pose_covariances(some, last.noise).origins
    shared = correlated * _shared(last, everywhere)
    held = contiguous(covariances, some.poses.rotations, parents, shared, axes)
    variances = variances_across(*held)
    deviations = np.sqrt(np.maximum(variances, 0.0))
    if len(frames) == len(unseen):
        return np.asarray(deviations)
    places = np.arange(len(unseen))
    after = np.minimum(np.searchsorted(frames, places), len(frames) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(frames[before] - places) < np.abs(frames[after] - places), before, after)
    return np.asarray(deviations[nearer])


def _shared(last: Calibration, everywhere: ObservedChain) -> Floats:
    """Covariances of the skeleton's part in the parents' axes, shape (n_limbs, 3, 3), mm^2."""
    some = everywhere.at(spread_frames(everywhere.n_frames, SHARED_FRAMES))
    found = frame_covariances(some, inverse_root(last.spectrum), last.noise)
    turn = some.poses.rotations[:, np.maximum(some.chain.parents, 0)]
    return np.asarray((turn.swapaxes(2, 3) @ found.constant_share @ turn).mean(axis=0))
