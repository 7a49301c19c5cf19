r"""Sensors as they come: poses by any invertible matrix, lengths in the sensors' own unit (O'Brien et al. 2000, 3, 4).

Matrices need not be rotations. Where a sensor's axes are of another length, skewed or left-handed, its matrix is
:math:`M = R A` with a constant A, and :math:`M^T M = A^T A` is the same in all frames; where those of the world are, it
is :math:`M = W R`, and :math:`M M^T` is. In both cases the rotation R is left when the constant root is taken off.

Two sensors that are fixed to one limb keep their distance. If it is known, it tells the unit of all lengths.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import nearest_rotation, transform_from, vector_from_matrix
from skelgen.model import Poses
from skelgen.model.arrays import Bools, Floats, as_floats

CONSTANT = 0.01
"""Of a matrix; what varies less is no more than the digits of a file."""

LEAST_DETERMINANT = 1e-9
"""Of a matrix scaled to its largest entry: below it, it cannot be inverted."""

STILL_TURN = np.radians(5.0)
"""rad; two sensors that turn by more against each other are not on one limb."""

STILL_PART = 0.05
"""Largest deviation of the distance of two sensors on one limb, as a part of it."""


def poses_from_matrices(matrices: Floats, names: Sequence[str], rate: float, name: str = "") -> Poses:
    """Return bodies with orientation from any invertible matrices.

    Parameters
    ----------
    matrices : ndarray, shape (n_frames, n_bodies, 4, 4) or (n_frames, n_bodies, 3, 4), translations in mm
        World from body; NaN or masked where unseen. The left three columns are any invertible matrix: scaled, skewed or
        left-handed.
    names : sequence of str, length n_bodies
        Of the bodies.
    rate : float, Hz
        Frame rate.
    name : str
        Where it comes from.

    Returns
    -------
    Poses
        Proper rotations. Joints are at the same places in the world; in a sensor whose axes were not those of a
        rotation they are in its straightened frame. The notices say what was taken off.

    Raises
    ------
    InputError
        If the shape is another, or a matrix cannot be inverted.

    Examples
    --------
    >>> mirrored = np.tile(np.diag([2.0, 2.0, -2.0, 1.0]), (5, 1, 1, 1))  # left-handed, in half millimetres
    >>> poses_from_matrices(mirrored, ["sensor"], 100.0).notices
    ('the matrices of sensor are no rotations: axes are 2 times as long and left-handed; they are straightened',)
    """
    given = as_floats(matrices, "matrices", "4 axes")
    if given.ndim != 4 or given.shape[2:] not in ((4, 4), (3, 4)):
        raise InputError(f"matrices have shape {given.shape}; it must be (n_frames, n_bodies, 4, 4) or (.., .., 3, 4)")
    linear, places = given[..., :3, :3].copy(), given[..., :3, 3].copy()
    seen: Bools = np.asarray(np.isfinite(given[..., :3, :]).all(axis=(2, 3)))
    _check_invertible(linear, seen, names)
    inner, outer = _variation(linear, seen, of_body=True), _variation(linear, seen, of_body=False)
    notices = []
    if outer < min(inner, CONSTANT):  # the world's axes are skewed
        root = _root((linear[seen] @ linear[seen].swapaxes(1, 2)).mean(axis=0))
        if np.abs(root - np.eye(3)).max() > CONSTANT:
            notices.append(f"the world of the matrices is {_words(root, 1.0)}; it is straightened")
        straight = np.linalg.inv(root)
        linear[seen], places[seen] = straight @ linear[seen], places[seen] @ straight.T
    for body, title in enumerate(names):
        own = seen[:, body]
        if own.any():
            linear[own, body], notice = _straightened(linear[own, body], title)
            notices += notice
    transforms = np.full((*given.shape[:2], 4, 4), np.nan)
    transforms[seen] = transform_from(nearest_rotation(linear[seen]), places[seen])
    return Poses(transforms, tuple(names), rate, name, tuple(notices))


def scaled_by_fixed_sensors(poses: Poses, distance: float, pair: tuple[str, str] | None = None) -> Poses:
    """Return bodies in millimetres, by two sensors that are fixed to one limb at a known distance.

    Parameters
    ----------
    poses : Poses
        Lengths in any unit.
    distance : float, mm
        Between the origins of both sensors.
    pair : tuple of str, optional
        Names of both; by default the two that move least against each other.

    Returns
    -------
    Poses
        With a notice that says the factor, and how constant the distance is.

    Raises
    ------
    InputError
        If the distance is not above 0, a name is unknown, or no two sensors keep their distance.

    Examples
    --------
    >>> import skelgen
    >>> poses = np.tile(np.eye(4), (50, 3, 1, 1))
    >>> poses[:, 1, :3, 3] = [60.0, 0.0, 0.0]  # in a unit of 0.94 cm, 56.4 cm from the first one
    >>> poses[:, 2, :3, 3] = np.random.default_rng(0).normal(size=(50, 3)) * 30
    >>> scaled_by_fixed_sensors(skelgen.Poses(poses, ("a", "b", "c"), 60.0), 564.0).notices
    ('lengths are 9.4 times those of the sensors: a and b, 564 mm apart, keep their distance within 0 mm',)
    """
    if not 0.0 < distance < np.inf:
        raise InputError(f"two sensors cannot be {distance:g} mm apart; give a distance above 0")
    for known in pair or ():
        if known not in poses.names:
            raise InputError(f"there is no sensor {known!r}; there are {', '.join(poses.names)}")
    wanted = None if pair is None else (poses.names.index(pair[0]), poses.names.index(pair[1]))
    first, second, mean, std = _fixed_pair(poses, wanted)
    factor = distance / mean
    world = poses.world_from_body.copy()
    world[..., :3, 3] *= factor
    notice = (
        f"lengths are {factor:.4g} times those of the sensors: {poses.names[first]} and {poses.names[second]}, "
        f"{distance:g} mm apart, keep their distance within {factor * std:.2g} mm"
    )
    return Poses(world, poses.names, poses.rate, poses.name, (*poses.notices, notice))


def _fixed_pair(poses: Poses, wanted: tuple[int, int] | None) -> tuple[int, int, float, float]:
    """Two bodies that are fixed to each other, the mean of their distance and its deviation."""
    found = []
    for first, second in combinations(range(poses.n_bodies), 2) if wanted is None else [wanted]:
        one, other = poses.world_from_body[:, first], poses.world_from_body[:, second]
        known = ~np.isnan(one[:, 0, 3] + other[:, 0, 3])
        if known.sum() < 2:
            continue
        apart = np.linalg.norm(one[known, :3, 3] - other[known, :3, 3], axis=1)
        turns = one[known, :3, :3].swapaxes(1, 2) @ other[known, :3, :3]
        strays = vector_from_matrix(nearest_rotation(turns.mean(axis=0)).T @ turns)
        turn = float(np.sqrt((strays**2).sum(axis=1).mean()))
        if apart.mean() > 0 and turn <= STILL_TURN and apart.std() <= STILL_PART * apart.mean():
            found.append((float(apart.std() / apart.mean()), first, second, float(apart.mean()), float(apart.std())))
    if not found:
        who = "no two sensors keep" if wanted is None else "these two sensors do not keep"
        raise InputError(f"{who} their distance and turn; fix two of them to one stiff thing")
    _, first, second, mean, std = min(found)
    return first, second, mean, std


def _check_invertible(linear: Floats, seen: Bools, names: Sequence[str]) -> None:
    size = np.abs(linear).max(axis=(2, 3), initial=0.0, where=np.isfinite(linear))
    with np.errstate(invalid="ignore", divide="ignore"):
        flat = seen & ~(np.abs(np.linalg.det(np.nan_to_num(linear))) > LEAST_DETERMINANT * size**3)
    if flat.any():
        frame, body = np.argwhere(flat)[0]
        raise InputError(f"the matrix of {names[body]} in frame {frame} cannot be inverted")


def _variation(linear: Floats, seen: Bools, *, of_body: bool) -> float:
    """How much the squares of matrices vary over the frames, as a part of them: on the body's side, or the world's."""
    squares = linear.swapaxes(2, 3) @ linear if of_body else linear @ linear.swapaxes(2, 3)
    groups = [squares[seen[:, body], body] for body in range(seen.shape[1])] if of_body else [squares[seen]]
    strays = [np.abs(group - group.mean(axis=0)).max() / np.abs(group).max() for group in groups if len(group)]
    return float(max(strays, default=0.0))


def _straightened(linear: Floats, name: str) -> tuple[Floats, list[str]]:
    """The matrices of a body, shape (n, 3, 3), without what is constant beside their rotation; perhaps a notice."""
    sign = float(np.sign(np.median(np.linalg.det(linear))))
    root = _root((linear.swapaxes(1, 2) @ linear).mean(axis=0))
    turns = sign * linear @ np.linalg.inv(root)
    left = float(np.abs(turns.swapaxes(1, 2) @ turns - np.eye(3)).max())
    if left > 2 * CONSTANT:
        vary = f"and vary by {100 * left:.2g} %; the nearest ones are taken"
        return turns, [f"the matrices of {name} are no rotations, {vary}"]
    if sign > 0 and np.abs(root - np.eye(3)).max() <= CONSTANT:
        return linear, []
    return turns, [f"the matrices of {name} are no rotations: axes are {_words(root, sign)}; they are straightened"]


def _root(square: Floats) -> Floats:
    """The symmetric root of a positive matrix."""
    values, vectors = np.linalg.eigh(square)
    return np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def _words(root: Floats, sign: float) -> str:
    """What a constant matrix does to axes, in words."""
    lengths = np.linalg.eigvalsh(root)
    hand = " and left-handed" if sign < 0 else ""
    if np.ptp(lengths) <= CONSTANT * lengths.max():
        return f"{lengths.mean():.4g} times as long{hand}"
    return f"{lengths.min():.4g} to {lengths.max():.4g} times as long, skewed{hand}"
