"""Resection: a camera of which nothing is known, from points in space and where it sees them."""

from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats

SAMPLES, OF_A_SAMPLE, TRIMMED = 30, 12, 3
"""Samples and their points of which the one with the least median places a camera, then rounds with the points that fit
better than three times the middle one: balls that are none may not drag it along."""


class Resected(NamedTuple):
    """A camera without a lens.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3), px
        The camera matrix.
    turn : ndarray, shape (3, 3)
        Orthogonal; a reflection if the images are mirrored.
    shift : ndarray, shape (3,), mm
        With `turn` the camera in the points' world.
    off : float, px
        How far off it sees the middle one of all points.
    """

    matrix: Floats
    turn: Floats
    shift: Floats
    off: float


def resected(points: Floats, pixels: Floats, size: tuple[int, int]) -> Resected:
    """Return the camera that sees known points, from most of them (Hartley and Zisserman 2004, 7.1).

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        The points.
    pixels : ndarray, shape (n, 2), px
        Where it sees them.
    size : (int, int), px
        Width and height of its images.
    """
    rng, flat = np.random.default_rng(0), np.column_stack([points, np.ones(len(points))])

    def off_of(projection: Floats) -> Floats:
        seen = flat @ projection.T
        return np.asarray(np.linalg.norm(seen[:, :2] / seen[:, 2:] - pixels, axis=1))

    samples = [rng.choice(len(points), OF_A_SAMPLE, replace=False) for _ in range(SAMPLES)]
    tried = [off_of(_linear(points[sample], pixels[sample], size)) for sample in samples]
    off = min(tried, key=lambda one: float(np.median(one)))
    for _ in range(TRIMMED):
        kept = off <= 3.0 * np.median(off)
        projection = _linear(points[kept], pixels[kept], size)
        off = off_of(projection)
    flat = flat @ projection.T
    if np.median(flat[:, 2]) < 0:
        projection = -projection
    # RQ decomposition by QR of the reversed matrix
    q, r = np.linalg.qr(np.flipud(projection[:, :3]).T)
    matrix, turn = np.fliplr(np.flipud(r.T)), np.flipud(q.T)
    signs = np.diag(np.sign(np.diag(matrix)))
    matrix, turn = matrix @ signs, signs @ turn
    shift = np.linalg.solve(matrix, projection[:, 3])
    return Resected(matrix / matrix[2, 2], turn, shift, float(np.median(off)))


def _linear(points: Floats, pixels: Floats, size: tuple[int, int]) -> Floats:
    """The projection that sees points at pixels, shape (3, 4), by the direct linear transform."""
    middle, scale = points.mean(axis=0), points.std()
    world = np.column_stack([(points - middle) / scale, np.ones(len(points))])
    image = (pixels - np.array(size) / 2) / size[0]
    zeros = np.zeros_like(world)
    rows = np.concatenate(
        [np.hstack([world, zeros, -image[:, :1] * world]), np.hstack([zeros, world, -image[:, 1:] * world])]
    )
    solution = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 4)
    to_world = np.eye(4) / scale
    to_world[:3, 3], to_world[3, 3] = -middle / scale, 1.0
    to_pixels = np.array([[size[0], 0, size[0] / 2], [0, size[0], size[1] / 2], [0, 0, 1.0]])
    return np.asarray(to_pixels @ solution @ to_world)
