"""Lines of the 3-D view: bones, trails of markers, frustums of cameras; and how far a place is from lines."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints

N_AGES = 4
"""Steps in which a trail fades."""


def trail_lines(places: Floats, limb_of_marker: Ints) -> list[tuple[int, int, Floats]]:
    """Cut trails into lines that share a colour.

    Parameters
    ----------
    places : ndarray, shape (n_steps, n_markers, 2), px
        Where each marker was, the present last; NaN breaks the line.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.

    Returns
    -------
    list of (int, int, ndarray of shape (n_lines, 2, 2))
        Limb, age from 0 = old to `N_AGES` - 1 = fresh, and the lines.
    """
    n_lines = len(places) - 1
    if n_lines < 1 or not len(limb_of_marker):
        return []
    order = np.argsort(limb_of_marker, kind="stable")
    lines = np.stack([places[:-1, order], places[1:, order]], axis=2).swapaxes(0, 1)
    limbs, starts = np.unique(limb_of_marker[order], return_index=True)
    stops = [*starts[1:].tolist(), len(order)]
    ages = np.linspace(0, n_lines, N_AGES + 1).round().astype(np.intp).tolist()
    return [
        (int(limb), age, _known(lines[start:stop, ages[age] : ages[age + 1]].reshape(-1, 2, 2)))
        for limb, start, stop in zip(limbs, starts, stops, strict=True)
        for age in range(N_AGES)
    ]


def _known(lines: Floats) -> Floats:
    return lines[~np.isnan(lines).any(axis=(1, 2))]


def frustum(
    world_from_camera: Floats, size: tuple[float, float], focal: tuple[float, float], depth: float = 400.0
) -> Floats:
    """Return the edges of a camera's pyramid of sight.

    Parameters
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Pose of the camera, which looks along its z with x to the right and y down in its image.
    size : tuple of float, px
        Width and height of its image; the principal point is taken for the middle.
    focal : tuple of float, px
        Focal lengths along x and y.
    depth : float, mm
        How far before the camera the pyramid ends.

    Returns
    -------
    ndarray, shape (9, 2, 3), mm
        Both ends of: four edges from the camera's centre, four around the image, and a tick at its upper side.
    """
    half = np.array(size) / 2 / np.array(focal) * depth
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = np.column_stack([signs * half, np.full(4, depth)])
    centre = np.zeros((4, 3))
    above = np.array([[0.0, -half[1], depth], [0.0, -1.25 * half[1], depth]])
    lines = np.concatenate(
        [np.stack([centre, corners], axis=1), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), above[None]]
    )
    return np.asarray(lines @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])


def distances_to_lines(lines: Floats, place: Floats) -> Floats:
    """Return the distance [px] of a place from each line between two ends, shape (n_lines,).

    Parameters
    ----------
    lines : ndarray, shape (n_lines, 2, 2), px
        Both ends of each; NaN gives NaN.
    place : ndarray, shape (2,), px
        The place.
    """
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    parts = np.clip(((place - start) * along).sum(axis=1) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + parts[:, np.newaxis] * along - place, axis=1))
