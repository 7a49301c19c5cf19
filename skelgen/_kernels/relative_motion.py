"""Groups of markers in frames of their own: aligned to one shape, and how they vary along given coordinates.

Frames of all groups stand one after the other, in rows of which each group has a span.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels import contiguous, kernel, kernel_part
from skelgen.model.arrays import Floats, Ints


@kernel_part
def _is_seen(positions: Floats, row: int, marker: int) -> bool:
    return bool(positions[row, marker, 0] == positions[row, marker, 0])


def residuals_of_groups(places: Floats, poses: Floats, spans: Ints) -> tuple[Floats, Floats]:
    """Return how markers deviate from the mean shape of their group, in the frame of the group, and the shapes.

    Parameters
    ----------
    places : ndarray, shape (n_rows, n_markers, 3), mm
        The markers of each row's group in the world, NaN where unseen.
    poses : ndarray, shape (n_rows, 4, 4)
        world_from_group.
    spans : ndarray of intp, shape (n_groups, 3)
        Where the rows of each group begin and end, and how many of them count (here all do).

    Returns
    -------
    tuple of ndarray, shapes (n_rows, n_markers, 3) and (n_groups, n_markers, 3), mm
        Residuals, NaN where unseen, and shapes.
    """
    residuals, shapes = np.full(places.shape, np.nan), np.zeros((len(spans), *places.shape[1:]))
    places, poses = contiguous(places, poses)
    _write_residuals(places, poses, spans, residuals, shapes)
    return residuals, shapes


@kernel
def _write_residuals(places: Floats, poses: Floats, spans: Ints, residuals: Floats, shapes: Floats) -> None:
    for group in range(len(spans)):
        first, last = spans[group, 0], spans[group, 1]
        for marker in range(places.shape[1]):
            count = 0.0
            for row in range(first, last):
                if _is_seen(places, row, marker):
                    count += 1.0
                    for i in range(3):
                        moved = 0.0
                        for j in range(3):
                            moved += (places[row, marker, j] - poses[row, j, 3]) * poses[row, j, i]
                        residuals[row, marker, i] = moved
                        shapes[group, marker, i] += moved
            for i in range(3):
                shapes[group, marker, i] /= max(count, 1.0)
                for row in range(first, last):
                    residuals[row, marker, i] -= shapes[group, marker, i]


def displacements_of(shapes: Floats) -> tuple[Floats, Floats]:
    """Return three translations and three small rotations of points, all of like size, and how far the points reach.

    Parameters
    ----------
    shapes : ndarray, shape (n_groups, n_points, 3), mm
        The points.

    Returns
    -------
    tuple of ndarray, shapes (n_groups, 3 n_points, 6) and (n_groups,)
        Displacements in columns, and root mean square distances of the points from their middle [mm].
    """
    away = shapes - shapes.mean(axis=1, keepdims=True)
    radii = np.sqrt((away**2).sum(axis=2).mean(axis=1))
    away /= np.where(radii > 0.0, radii, 1.0)[:, np.newaxis, np.newaxis]
    columns = np.zeros((*shapes.shape, 6))
    for i, (one, other) in enumerate(((1, 2), (2, 0), (0, 1))):
        columns[:, :, i, i] = 1.0
        columns[:, :, one, 3 + other], columns[:, :, other, 3 + one] = away[:, :, i], -away[:, :, i]
    return columns.reshape(len(shapes), -1, 6), radii


def covariances_along(residuals: Floats, spans: Ints, bases: Floats) -> Floats:
    """Return the covariances of some coordinates of groups over the frames in which these are smallest.

    Parameters
    ----------
    residuals : ndarray, shape (n_rows, n_markers, 3), mm
        From `residuals_of_groups`.
    spans : ndarray of intp, shape (n_groups, 3)
        Where the rows of each group begin and end, and how many of them count.
    bases : ndarray, shape (n_groups, 3 n_markers, k)
        Coordinates of each.

    Returns
    -------
    ndarray, shape (n_groups, k, k), mm^2
    """
    (bases,) = contiguous(bases)
    n_groups, width, size = bases.shape
    longest, n_markers = int((spans[:, 1] - spans[:, 0]).max(initial=0)), residuals.shape[1]
    room = _Room(np.empty(longest), np.empty(width), np.empty(size), np.empty((n_markers, n_markers)))
    products = np.zeros((n_groups, width, width))
    _write_products(residuals, spans, bases, room, products)
    return np.asarray(bases.swapaxes(1, 2) @ products @ bases)


class _Room(NamedTuple):
    """Where products are made.

    Attributes
    ----------
    sizes : ndarray, shape (n_frames,), mm^2
        Squared lengths of the coordinates in each frame, negative where they do not count.
    row : ndarray, shape (3 n_markers,), mm
        Residuals of one frame, 0 where unseen.
    along : ndarray, shape (k,), mm
        Coordinates of one frame.
    counts : ndarray, shape (n_markers, n_markers)
        Frames that count and show both.
    """

    sizes: Floats
    row: Floats
    along: Floats
    counts: Floats


@kernel
def _write_products(residuals: Floats, spans: Ints, bases: Floats, room: _Room, products: Floats) -> None:
    """Write the mean products of residuals over the frames with the smallest coordinates that show both markers."""
    for group in range(len(bases)):
        first, last = spans[group, 0], spans[group, 1]
        _write_sizes(residuals, first, last, bases[group], room)
        for _ in range(last - first - spans[group, 2]):
            _drop_largest(room.sizes, last - first)
        _add_products(residuals, first, last, room, products[group])


@kernel_part
def _add_multiple(factor: float, values: Floats, total: Floats) -> None:
    for place in range(len(total)):
        total[place] += factor * values[place]


@kernel_part
def _read_row(residuals: Floats, row: int, values: Floats) -> None:
    """Write the residuals of a row, 0 where unseen."""
    for marker in range(residuals.shape[1]):
        for i in range(3):
            values[3 * marker + i] = residuals[row, marker, i] if _is_seen(residuals, row, marker) else 0.0


@kernel_part
def _write_sizes(residuals: Floats, first: int, last: int, basis: Floats, room: _Room) -> None:
    """Write the squared length of the coordinates in each frame."""
    for row in range(first, last):
        _read_row(residuals, row, room.row)
        room.along[:] = 0.0
        for i in range(len(basis)):
            _add_multiple(room.row[i], basis[i], room.along)
        size = 0.0
        for k in range(basis.shape[1]):
            size += room.along[k] * room.along[k]
        room.sizes[row - first] = size


@kernel_part
def _drop_largest(sizes: Floats, n_rows: int) -> None:
    """Make the largest size, the last of equal ones, negative: its frame does not count."""
    worst = 0
    for row in range(n_rows):
        if sizes[row] >= sizes[worst]:
            worst = row
    sizes[worst] = -1.0


@kernel_part
def _add_products(residuals: Floats, first: int, last: int, room: _Room, products: Floats) -> None:
    """Add up the products of the frames that count, and divide them by how many show both markers."""
    n_markers = residuals.shape[1]
    room.counts[:] = 0.0
    for row in range(first, last):
        if room.sizes[row - first] >= 0.0:
            _read_row(residuals, row, room.row)
            for i in range(len(products)):
                _add_multiple(room.row[i], room.row, products[i])
            for one in range(n_markers):
                for other in range(n_markers):
                    if _is_seen(residuals, row, one) and _is_seen(residuals, row, other):
                        room.counts[one, other] += 1.0
    for i in range(len(products)):
        for j in range(len(products)):
            products[i, j] /= max(room.counts[i // 3, j // 3], 1.0)
