r"""Relative poses of two bodies, with the covariance of each: what a joint between them is fitted to.

The world's motion of the pair cancels. With small errors (shift, turn) of both bodies in their own frames, the relative
pose parent from child errs by (shift, turn) in the parent's frame

.. math::
    e = \begin{pmatrix} -I & [t]_\times \\ 0 & -I \end{pmatrix} e_p
        + \begin{pmatrix} R & 0 \\ 0 & R \end{pmatrix} e_c .

Fitting a joint to these six numbers per frame, weighted with their covariance, is the maximum likelihood fit of both
bodies' poses. Where nothing is known of the poses' errors, each body is represented by the tips of its axes, on both
sides of its origin: then the fit minimises the symmetric reprojection error (Gaschler 2011, eq. 5.5).
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.least_squares import whitened
from skelgen.errors import InputError
from skelgen.geometry.rotations import cross_matrix, transform_from, vector_from_matrix
from skelgen.model import Poses
from skelgen.model.arrays import Floats, Ints, check_floats
from skelgen.progress import counted

BODY_SIZE = 100.0
"""mm from a body's origin to the points that represent it, where frames do not show it: the size of marker targets."""

SIZES = (20.0, 2000.0)
"""mm; no tracker's errors of position and rotation have another ratio."""

FEWEST_DIFFERENCES = 20
"""Third differences from which the ratio is computed at least."""

MIN_FRAMES = 3
"""Fewer common frames than this determine no joint."""

_SINGULAR_RIDGE = 1e-12  # of the mean variance, in units of its own kind


@dataclass(frozen=True, eq=False)
class RelativePoses:
    """Relative poses of two bodies in the frames that show both.

    Attributes
    ----------
    transforms : ndarray, shape (n, 4, 4)
        parent_from_child, translations in mm.
    covariances : ndarray, shape (n, 6, 6)
        Of translation [mm] and rotation [rad], in the parent's axes.
    frames : ndarray of intp, shape (n,)
        Their frames in the take.
    n_frames : int
        Frames of the take.
    is_scaled : bool
        Whether the covariances are in mm and rad; otherwise only up to a common factor.
    """

    transforms: Floats
    covariances: Floats
    frames: Ints
    n_frames: int
    is_scaled: bool

    @property
    def rotations(self) -> Floats:
        """Rotations parent from child, shape (n, 3, 3)."""
        return np.asarray(self.transforms[:, :3, :3])

    @property
    def shifts(self) -> Floats:
        """Positions of the child's origin in the parent [mm], shape (n, 3)."""
        return np.asarray(self.transforms[:, :3, 3])

    def errors(self, rotations: Floats, shifts: Floats) -> Floats:
        """Return translation [mm] and rotation [rad] from modelled to measured relative poses, shape (n, 6).

        Parameters
        ----------
        rotations : ndarray, shape (n, 3, 3)
            Modelled, parent from child.
        shifts : ndarray, shape (n, 3), mm
            Modelled positions of the child's origin in the parent.
        """
        turns = vector_from_matrix(self.rotations @ rotations.swapaxes(1, 2))
        return np.concatenate([self.shifts - shifts, turns], axis=1)


def relative_poses(
    poses: Poses, parent: int | str, child: int | str, covariances: Floats | None = None, size: float | None = None
) -> RelativePoses:
    """Return the poses of one body relative to another, in the frames that show both.

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    parent, child : int or str
        Two of them, by index or name.
    covariances : ndarray, shape (n_bodies, 6, 6) or (n_frames, n_bodies, 6, 6), optional
        Of translation [mm] and rotation [rad] of every body in its own frame, e.g. from `pose_covariance`.
    size : float, mm, optional
        Without covariances: distance of the points that represent a body, which says how an error of its rotation
        weighs beside one of its position; by default from `noise_size`.

    Raises
    ------
    InputError
        If there is no such body, both are the same, the covariances do not fit, or fewer than `MIN_FRAMES` frames show
        both bodies.
    """
    first, second = body_index(poses, parent), body_index(poses, child)
    if first == second:
        raise InputError(f"{poses.names[first]!r} cannot be joined to itself; name two bodies")
    world = poses.world_from_body
    seen = ~np.isnan(world[:, first, 0, 0]) & ~np.isnan(world[:, second, 0, 0])
    if seen.sum() < MIN_FRAMES:
        raise InputError(
            f"{poses.names[first]!r} and {poses.names[second]!r} are seen together in "
            f"{counted(int(seen.sum()), 'frame')}; a joint needs {MIN_FRAMES}"
        )
    own = _body_covariances(poses, covariances, noise_size(poses) if size is None else size)[:, [first, second]]
    frames = np.flatnonzero(seen)
    own = own[frames] if len(own) > 1 else own
    related = related_poses(world[frames, first], world[frames, second], own[:, 0], own[:, 1], frames, poses.n_frames)
    return replace(related, is_scaled=covariances is not None)


def pose_covariance(points: Floats, noise: float) -> Floats:
    """Return the covariance of a pose that was fitted to points with independent noise.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        In the body's frame; three that are not on one line.
    noise : float, mm
        Standard deviation of each coordinate.

    Returns
    -------
    ndarray, shape (6, 6)
        Of translation [mm] and rotation [rad] in the body's frame.
    """
    points = check_floats(points, (None, 3), "points", finite=True)
    slopes = np.concatenate([np.tile(np.eye(3), (len(points), 1, 1)), -cross_matrix(points)], axis=2).reshape(-1, 6)
    information = slopes.T @ slopes
    if np.linalg.matrix_rank(information, hermitian=True) < len(information):
        raise InputError("points on one line fix no pose; three points off a line do")
    return np.asarray(noise**2 * np.linalg.inv(information))


def default_covariance(size: float = BODY_SIZE) -> Floats:
    """Return the covariance, for unit noise, of a body known by six points on its axes at a distance [mm]."""
    return pose_covariance(np.concatenate([np.eye(3), -np.eye(3)]) * size, 1.0)


def noise_size(poses: Poses) -> float:
    """Return the distance [mm] at which the bodies' errors of rotation weigh as much as those of position.

    Third differences over time separate errors from motion, as smooth motion hardly adds to them. Medians over frames
    and bodies are robust against the rest.
    """
    steps: list[Floats] = []
    turns: list[Floats] = []
    for body in range(poses.n_bodies):
        world = poses.world_from_body[:, body]
        step = np.diff(world[:, :3, 3], axis=0)
        turn = vector_from_matrix(np.nan_to_num(world[:-1, :3, :3].swapaxes(1, 2) @ world[1:, :3, :3]))
        turn[np.isnan(step[:, 0])] = np.nan
        for values, kept in ((step, steps), (turn, turns)):
            third = np.abs(np.diff(values, n=2, axis=0))
            kept.append(np.asarray(third[~np.isnan(third[:, 0])]))
    if sum(len(third) for third in turns) < FEWEST_DIFFERENCES:
        return BODY_SIZE
    shift, rotation = (float(np.median(np.concatenate(kept))) for kept in (steps, turns))
    if rotation == 0:
        return BODY_SIZE
    return float(np.clip(shift / rotation * np.sqrt(6) / 2, *SIZES))  # six points: see `default_covariance`


def related_poses(
    parent: Floats, child: Floats, parent_covariance: Floats, child_covariance: Floats, frames: Ints, n_frames: int
) -> RelativePoses:
    """Relate two series of poses.

    Parameters
    ----------
    parent, child : ndarray, shape (n, 4, 4)
        world_from_body, all known.
    parent_covariance, child_covariance : ndarray, shape (1 or n, 6, 6)
        Of both, in their own frames.
    frames, n_frames
        As in `RelativePoses`.
    """
    back = parent[:, :3, :3].swapaxes(1, 2)
    rotations = back @ child[:, :3, :3]
    shifts = (back @ (child[:, :3, 3] - parent[:, :3, 3])[..., np.newaxis])[..., 0]
    of_parent = np.tile(-np.eye(6), (len(parent), 1, 1))
    of_parent[:, :3, 3:] = cross_matrix(shifts)
    of_child = np.zeros_like(of_parent)
    of_child[:, :3, :3] = of_child[:, 3:, 3:] = rotations
    covariances = of_parent @ parent_covariance @ of_parent.swapaxes(1, 2)
    covariances += of_child @ child_covariance @ of_child.swapaxes(1, 2)
    return RelativePoses(transform_from(rotations, shifts), covariances, frames, n_frames, True)


def whitener(covariances: Floats) -> Floats:
    """Return matrices W with W^T W = covariance^-1, shape (n, k, k); a ridge makes singular ones invertible."""
    diagonal = np.einsum("fii->fi", covariances).mean(axis=0)
    ridge = np.maximum(_SINGULAR_RIDGE * diagonal, np.finfo(np.float64).tiny)
    return np.asarray(whitened(*contiguous(covariances + np.diag(ridge))))


def body_index(poses: Poses, body: int | str) -> int:
    """Return the index of a body.

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    body : int or str
        Index or name.

    Raises
    ------
    InputError
        If there is no such body.
    """
    names = ", ".join(poses.names)
    if isinstance(body, str):
        if body not in poses.names:
            raise InputError(f"there is no body {body!r}; bodies are {names}")
        return poses.names.index(body)
    if not 0 <= body < poses.n_bodies:
        raise InputError(f"there is no body {body}; there are {poses.n_bodies}: {names}")
    return int(body)


def _body_covariances(poses: Poses, covariances: Floats | None, size: float) -> Floats:
    """Covariances of all bodies, shape (1 or n_frames, n_bodies, 6, 6)."""
    if covariances is None:
        return np.tile(default_covariance(size), (1, poses.n_bodies, 1, 1))
    n_axes = np.ndim(covariances)
    shape = (poses.n_bodies, 6, 6) if n_axes == 3 else (poses.n_frames, poses.n_bodies, 6, 6)
    checked = check_floats(covariances, shape, "covariances of the bodies")
    return checked[np.newaxis] if n_axes == 3 else checked
