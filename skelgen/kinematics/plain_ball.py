"""Two bodies and a point of both, over all frames: the NumPy twin of `compiled_ball`."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


def fixed_point_sums(first: Floats, second: Floats, weights: Floats) -> tuple[Floats, Floats, Floats, float, int]:
    """Return what frames say of a point that is fixed in two bodies.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        world_from_body of both; NaN where unknown.
    weights : ndarray, shape (n_frames,)
        Of the frames, not negative.

    Returns
    -------
    tuple
        Weighted means over the frames that show both: of the rotations first from second, shape (3, 3), of the way
        between the origins in both bodies [mm], shape (3,), and of its square [mm^2]; and how many frames these are.
    """
    both = ~np.isnan(first[:, 0, 0]) & ~np.isnan(second[:, 0, 0])
    share = weights[both] / weights[both].sum()
    of_first, of_second = first[both, :3, :3], second[both, :3, :3]
    between = second[both, :3, 3] - first[both, :3, 3]
    weighted = share[:, np.newaxis, np.newaxis] * of_first
    relative = np.tensordot(weighted, of_second, ((0, 1), (0, 1)))
    seen_from_first = np.tensordot(weighted, between, ((0, 1), (0, 1)))
    seen_from_second = np.einsum("f,fji,fj->i", share, of_second, between)
    return relative, seen_from_first, seen_from_second, float(share @ (between**2).sum(axis=1)), int(both.sum())


def both_images(first: Floats, second: Floats, in_first: Floats, in_second: Floats) -> tuple[Floats, Floats]:
    """Return where a point of two bodies is in the world.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        world_from_body of both; NaN where unknown.
    in_first, in_second : ndarray, shape (3,), mm
        The point in both.

    Returns
    -------
    tuple of ndarray, shapes (n_frames, 3) [mm] and (n_frames,) [mm^2]
        The middle of both images, or the one that is known, and the square of their distance; NaN where unknown.
    """
    one, other = (
        poses[:, :3, :3] @ point + poses[:, :3, 3] for poses, point in ((first, in_first), (second, in_second))
    )
    known = np.where(np.isnan(one), other, np.where(np.isnan(other), one, (one + other) / 2))
    return known, ((one - other) ** 2).sum(axis=1)


def mean_distances(joint: Floats, markers: Floats) -> tuple[Floats, Floats]:
    """Return mean and standard deviation over frames of each marker's distance [mm] to a joint, shapes (n_markers,).

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Where it is.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    distance = np.linalg.norm(joint[:, np.newaxis] - markers, axis=2)
    seen = ~np.isnan(distance)
    count = np.maximum(seen.sum(axis=0), 1)
    mean = np.where(seen, distance, 0.0).sum(axis=0) / count
    spread = np.where(seen, distance - mean, 0.0)
    return mean, np.sqrt((spread**2).sum(axis=0) / count)
