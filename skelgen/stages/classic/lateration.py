r"""A joint's distances to four markers from all frames together: where a descent starts again when it is stuck.

Four distances r place a point: with the fourth marker as origin, p the others and :math:`z_i = r_4^2 - r_i^2`,

.. math::
    y = \tfrac12 P^{-1} (|p|^2 + z), \qquad |y|^2 = r_4^2.

Schönauer (2007, 3.5.2) tried this for each frame. The second equation holds in every frame for the same four distances;
times the volume of the markers it is linear in eleven products of them, so that all frames shrink to a triangle of 11 x
11 numbers and many starts cost nothing.
"""

from itertools import combinations

import numpy as np

from skelgen.model.arrays import Floats, Ints

N_STARTS = 40
"""Starts by chance; of 120 joints with two markers on each limb at least a third of them led to the best distances."""

STEPS = 60
DAMPING = 1e-3
DAMPING_RANGE = (1e-12, 1e8)
LEAST_FRAMES = 20
MOST_OF_LIMB = 4
"""Markers of a limb among which four are chosen."""

SAME = 0.01
"""Of their size: distances that differ by less are the same."""

_ROWS, _COLUMNS = np.triu_indices(3)
_TWICE = np.where(_ROWS == _COLUMNS, 1.0, 2.0)
_PLANE = 1e-9


def common_distances(first: Floats, second: Floats, n_wanted: int, seed: int) -> tuple[Ints, Floats]:
    """Find distances that a joint could have to four markers in all frames.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    n_wanted : int
        Most sets of distances.
    seed : int
        Of the starts.

    Returns
    -------
    markers : ndarray of intp, shape (4,)
        Which of both limbs' markers, those of the first limb first; empty if there are too few.
    distances : ndarray, shape (n_found, 4), mm
        The best sets, the best first.
    """
    four = _spread_markers(first, second)
    markers = np.concatenate([first, second], axis=1)[:, four]
    markers = markers[~np.isnan(markers).any(axis=(1, 2))]
    if len(four) < 4 or len(markers) < LEAST_FRAMES:
        return np.zeros(0, dtype=np.intp), np.zeros((0, 4))
    size = float(np.sqrt(((markers - markers.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean()))
    squares, misfit = _solutions(markers / size, seed)
    possible = np.flatnonzero((squares > 0).all(axis=1))
    distances = np.sqrt(squares[possible[np.argsort(misfit[possible], kind="stable")]])
    kept: list[Floats] = []
    for one in distances:
        if len(kept) < n_wanted and all(np.abs(one - other).max() > SAME for other in kept):
            kept.append(one)
    return four, size * np.array(kept).reshape(-1, 4)


def _spread_markers(first: Floats, second: Floats) -> Ints:
    """Two markers of each limb, or three and one, that span the largest volume."""
    counts = [~np.isnan(limb[:, :, 0]) for limb in (first, second)]
    often = [np.argsort(-seen.sum(axis=0), kind="stable")[:MOST_OF_LIMB] for seen in counts]
    n_first = min(max(2, 4 - len(often[1])), len(often[0]))
    if len(often[1]) < 4 - n_first:
        return np.zeros(0, dtype=np.intp)
    markers = np.nan_to_num(np.concatenate([first, second], axis=1))
    seen = np.concatenate(counts, axis=1)
    choices = np.array(
        [
            (*one, *(first.shape[1] + other for other in two))
            for one in combinations(often[0].tolist(), n_first)
            for two in combinations(often[1].tolist(), 4 - n_first)
        ],
        dtype=np.intp,
    )
    edges = markers[:, choices[:, :3]] - markers[:, choices[:, 3:]]
    volumes = np.linalg.det(edges) ** 2 * seen[:, choices].all(axis=2)
    return np.asarray(choices[volumes.sum(axis=0).argmax()])


def _solutions(markers: Floats, seed: int) -> tuple[Floats, Floats]:
    """Squared distances, shape (n_starts, 4), and how badly they fit, shape (n_starts,); damped Gauss-Newton steps."""
    triangle = _equations(markers)
    random = np.random.default_rng(seed)
    frames = random.integers(0, len(markers), N_STARTS)
    point = markers[frames].mean(axis=1) + random.normal(size=(N_STARTS, 3))
    square = ((point[:, np.newaxis] - markers[frames]) ** 2).sum(axis=2)
    unknown = np.column_stack([square[:, 3:] - square[:, :3], square[:, 3]])
    error, damping = _products(unknown) @ triangle.T, np.full(N_STARTS, DAMPING)
    for _ in range(STEPS):
        slope = triangle @ _slopes(unknown)
        normal = slope.swapaxes(1, 2) @ slope
        steep = np.diagonal(normal, axis1=1, axis2=2)
        normal = normal + ((damping[:, np.newaxis] * steep + _PLANE**2)[:, :, np.newaxis]) * np.eye(4)
        step = -np.linalg.solve(normal, slope.swapaxes(1, 2) @ error[..., np.newaxis])[..., 0]
        new_error = _products(unknown + step) @ triangle.T
        better = (new_error**2).sum(axis=1) <= (error**2).sum(axis=1)
        unknown = np.where(better[:, np.newaxis], unknown + step, unknown)
        error = np.where(better[:, np.newaxis], new_error, error)
        damping = np.clip(np.where(better, damping / 5, damping * 8), *DAMPING_RANGE)
    squares = np.column_stack([unknown[:, 3:] - unknown[:, :3], unknown[:, 3]])
    return squares, (error**2).sum(axis=1)


def _equations(markers: Floats) -> Floats:
    """The triangle of the equations of all frames in the eleven products, shape (11, 11)."""
    edges = markers[:, :3] - markers[:, 3:]
    # P^-1 times the volume: its columns are the cross products of the edges
    adjoint = np.cross(edges[:, [1, 2, 0]], edges[:, [2, 0, 1]]).swapaxes(1, 2)
    volume = (adjoint[:, :, 0] * edges[:, 0]).sum(axis=1)
    half = adjoint / 2
    constant = np.einsum("fij,fj->fi", half, (edges**2).sum(axis=2))
    quadratic = half.swapaxes(1, 2) @ half
    rows = np.column_stack(
        [
            (constant**2).sum(axis=1),
            2 * np.einsum("fki,fk->fi", half, constant),
            quadratic[:, _ROWS, _COLUMNS] * _TWICE,
            volume**2,
        ]
    )
    rows /= np.linalg.norm(half, axis=(1, 2))[:, np.newaxis] + _PLANE
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _products(unknown: Floats) -> Floats:
    """1, z, the products of z, and -r4^2, shape (n_starts, 11)."""
    z = unknown[:, :3]
    return np.column_stack([np.ones(len(z)), z, z[:, _ROWS] * z[:, _COLUMNS], -unknown[:, 3]])


def _slopes(unknown: Floats) -> Floats:
    """Derivatives of the products by z and r4^2, shape (n_starts, 11, 4)."""
    slopes = np.zeros((len(unknown), 11, 4))
    slopes[:, 1:4, :3] = np.eye(3)
    for product, (row, column) in enumerate(zip(_ROWS, _COLUMNS, strict=True), start=4):
        slopes[:, product, row] += unknown[:, column]
        slopes[:, product, column] += unknown[:, row]
    slopes[:, 10, 3] = -1.0
    return slopes
