"""What tells where an unseen marker of a limb is: the limb's other markers, its joints, and how it is bent.

Everything here is linear in the errors, i.e. how far points are off their places on the limb in the limb's frame. The
part that a small motion of the whole limb explains is taken out, so that it does not matter whether the marker itself
took part when the limb was posed: results are the same in frames with the marker and in frames without.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.bridging import without_outliers
from skelgen.kinematics.shape import determines_pose
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints

_OWN_POSE_SHARE = 0.5  # of all frames in which a neighbour must be posed by its markers to place a joint by itself
_SMALLEST_MOTION = 0.01  # of the largest: motions of a limb that its points tell less of are left alone
_FOLDS = 4  # stretches of the take on which a regression is tried
_RIDGES = (0.03, 0.3, 3.0)  # of the mean variance of what is regressed on
_STILL = 1e-9  # standard deviation of a rotation's entry below which it does not turn


@dataclass(frozen=True, eq=False)
class Helpers:
    """The points of one limb: its markers, then its joints.

    Attributes
    ----------
    places : ndarray, shape (n_points, 3), mm
        In the limb's frame.
    errors : ndarray, shape (n_frames, n_points, 3), mm
        How far each is off its place, in the limb's frame; 0 where not `usable`.
    usable : ndarray of bool, shape (n_frames, n_points)
        Which can be relied on.
    bends : ndarray, shape (n_frames, n_bends)
        Rotation against the neighbouring limbs, each entry standardised.
    n_markers : int
        How many of the points are markers.
    """

    places: Floats
    errors: Floats
    usable: Bools
    bends: Floats
    n_markers: int

    def posed_by(self, usable: Bools) -> Bools:
        """Frames in which usable markers alone pose the limb; `usable` has shape (n_frames, n_points)."""
        return determines_pose(self.places[: self.n_markers], usable[:, : self.n_markers])


def find_helpers(trajectories: Trajectories, skeleton: Skeleton, motion: Motion, limb: int) -> Helpers:
    """Gather the points of a limb.

    A joint's error is where the neighbouring limb, posed by its own markers, would have it. Where the neighbour rarely
    has the markers for that, the joint counts as being where the motion has it.

    Parameters
    ----------
    trajectories : Trajectories
        Measured markers.
    skeleton, motion : Skeleton, Motion
        Fitted to them.
    limb : int
        Its index.
    """
    markers = _markers_as_helpers(trajectories, skeleton, motion, limb)
    rotations = motion.rotations[:, limb]
    places, errors, usable = [markers.places], [markers.errors], [markers.usable]
    for joint, place in skeleton.joints_of(limb):
        neighbour = _neighbour(skeleton, joint, limb)
        error, known = _joint_by_neighbour(
            _markers_as_helpers(trajectories, skeleton, motion, neighbour), dict(skeleton.joints_of(neighbour))[joint]
        )
        if known.mean() <= _OWN_POSE_SHARE:
            error, known = np.zeros_like(error), motion.limb_seen[:, neighbour]
        turned = np.einsum("fji,fjk,fk->fi", rotations, motion.rotations[:, neighbour], error)
        places.append(place[np.newaxis])
        errors.append(turned[:, np.newaxis])
        usable.append(known[:, np.newaxis])
    return Helpers(
        np.concatenate(places),
        np.concatenate(errors, axis=1),
        np.concatenate(usable, axis=1),
        _bends(skeleton, motion, limb),
        markers.n_markers,
    )


def rigid_lead(helpers: Helpers, place: Floats, chosen: Ints) -> Floats:
    """Matrix that gives the error at a place from those of chosen points if the limb is rigid.

    Parameters
    ----------
    helpers : Helpers
        Of the limb.
    place : ndarray, shape (3,), mm
        In the limb's frame.
    chosen : ndarray of intp, shape (n_chosen,)
        Points that are relied on.

    Returns
    -------
    ndarray, shape (3, 3 n_chosen)
    """
    if len(chosen) == 0:
        return np.zeros((3, 0))
    places, centre, size = _normal(helpers, chosen)
    return _jacobian(place[np.newaxis], centre, size) @ np.linalg.pinv(
        _jacobian(places, centre, size), rcond=_SMALLEST_MOTION
    )


def shape_of(helpers: Helpers, chosen: Ints) -> Floats:
    """What of the errors of chosen points no motion of the limb explains [mm], shape (n_frames, 3 n_chosen)."""
    errors = helpers.errors[:, chosen].reshape(len(helpers.errors), -1)
    if len(chosen) == 0:
        return errors
    jacobian = _jacobian(*_normal(helpers, chosen))
    return np.asarray(errors - errors @ (jacobian @ np.linalg.pinv(jacobian, rcond=_SMALLEST_MOTION)).T)


def explained_part(helpers: Helpers, chosen: Ints, series: Floats, known: Bools) -> tuple[Floats, float]:
    """Explain a marker's way by the shape of the other points and by how the limb is bent.

    Skin moves together, and with the joints under it. Ridge regression, whose features and strength are those that
    explain stretches of the take best that were kept from it; none if nothing does.

    Parameters
    ----------
    helpers : Helpers
        Of the limb.
    chosen : ndarray of intp
        Points that are relied on.
    series : ndarray, shape (n_frames, 3), mm
        The marker's way.
    known : ndarray of bool, shape (n_frames,)
        Where it is known.

    Returns
    -------
    tuple of ndarray, shape (n_frames, 3), mm, and float
        What is explained, and the factor by which the rest is larger in frames that were not learnt from.
    """
    shape = shape_of(helpers, chosen)
    level = float(shape[known].std()) if shape.size else 0.0
    bent = np.hstack([shape, helpers.bends * (level if level > 0 else 1.0)])
    tried = [_regress(features, series, known) for features in (shape, bent) if features.shape[1]]
    best = min(tried, key=lambda each: each[1], default=None)
    unexplained = float(((series[known] - series[known].mean(axis=0)) ** 2).sum())
    if best is None or best[1] >= unexplained:
        return np.zeros_like(series), 1.0
    rest = (series - best[0])[known]
    within = float(((rest - rest.mean(axis=0)) ** 2).sum())
    return best[0], float(np.sqrt(best[1] / within)) if within > 0 else 1.0


def _markers_as_helpers(trajectories: Trajectories, skeleton: Skeleton, motion: Motion, limb: int) -> Helpers:
    markers = skeleton.markers_of(limb)
    off = trajectories.positions[:, markers] - motion.marker_positions[:, markers]
    errors = np.einsum("fji,fmj->fmi", motion.rotations[:, limb], off)
    usable = np.zeros(errors.shape[:2], dtype=bool)
    for index in range(len(markers)):
        usable[:, index] = without_outliers(errors[:, index], ~np.isnan(errors[:, index, 0]))
    errors = np.where(usable[..., np.newaxis], errors, 0.0)
    return Helpers(skeleton.marker_offsets[markers], errors, usable, np.zeros((len(errors), 0)), len(markers))


def _joint_by_neighbour(markers: Helpers, place: Floats) -> tuple[Floats, Bools]:
    """Error of a joint in the neighbour's frame, from the neighbour's markers alone, and where these suffice."""
    error = np.zeros((len(markers.errors), 3))
    known = markers.posed_by(markers.usable)
    patterns, which = np.unique(markers.usable, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        frames = np.flatnonzero((which.ravel() == number) & known)
        chosen = np.flatnonzero(pattern)
        if len(frames):
            own = markers.errors[np.ix_(frames, chosen)].reshape(len(frames), -1)
            error[frames] = own @ rigid_lead(markers, place, chosen).T
    return error, known


def _bends(skeleton: Skeleton, motion: Motion, limb: int) -> Floats:
    n_frames, turns = motion.n_frames, motion.rotations
    parts = [
        np.einsum("fji,fjk->fik", turns[:, limb], turns[:, _neighbour(skeleton, joint, limb)]).reshape(n_frames, -1)
        for joint, _ in skeleton.joints_of(limb)
    ]
    entries = np.hstack([np.zeros((n_frames, 0)), *parts])
    spread = entries.std(axis=0)
    return np.asarray((entries - entries.mean(axis=0)) / np.where(spread > _STILL, spread, 1.0))


def _neighbour(skeleton: Skeleton, joint: int, limb: int) -> int:
    parent, child = skeleton.joints[joint].parent, skeleton.joints[joint].child
    return child if parent == limb else parent


def _normal(helpers: Helpers, chosen: Ints) -> tuple[Floats, Floats, float]:
    """Chosen places, their centre, and a length that makes turns comparable with shifts."""
    places = helpers.places[chosen]
    centre = places.mean(axis=0)
    return places, centre, max(float(np.abs(places - centre).max()), 1.0)


def _jacobian(places: Floats, centre: Floats, size: float) -> Floats:
    """How points move with a small motion of their limb, shape (3 n_points, 6)."""
    turns = -cross_matrix((places - centre) / size)
    shifts = np.broadcast_to(np.eye(3), turns.shape)
    return np.concatenate([shifts, turns], axis=2).reshape(-1, 6)


def _regress(features: Floats, series: Floats, known: Bools) -> tuple[Floats, float]:
    """Return the best ridge regression of a series, and its sum of squares in stretches kept from it."""
    centre, wanted = features[known].mean(axis=0), series[known] - series[known].mean(axis=0)
    stretches = np.array_split(features[known] - centre, _FOLDS)
    targets = np.array_split(wanted, _FOLDS)
    squares = np.array([stretch.T @ stretch for stretch in stretches])
    products = np.array([stretch.T @ target for stretch, target in zip(stretches, targets, strict=True)])
    square, product = squares.sum(axis=0), products.sum(axis=0)
    level = float(np.trace(square)) / len(square)
    if level == 0.0:
        return np.zeros_like(series), np.inf
    best, least = np.zeros_like(product), np.inf
    for ridge in _RIDGES:
        held = ridge * level * np.eye(len(square))
        uses = np.linalg.solve(square - squares + held, product - products)
        left = [target - stretch @ use for target, stretch, use in zip(targets, stretches, uses, strict=True)]
        total = float(sum((part**2).sum() for part in left))
        if total < least:
            best, least = np.linalg.solve(square + held, product), total
    return (features - centre) @ best, least
