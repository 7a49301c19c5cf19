"""Where the limbs of a graph lie: as in the take, or as a tidy tree."""

from __future__ import annotations

import numpy as np

from skelgen.app.report.figure_pose import find_views
from skelgen.app.report.measures import reference_markers, tidy_places
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints

_SAMPLES = 200  # frames that tell which way is up
_ROUNDS = 60  # of pushing limbs apart; more than enough for 100 limbs
_WIDEST = 1.6  # factor
_APART = 1.1  # of the mean distance that limbs on a grid would have


def body_places(project: Project) -> Floats:
    """Place limbs as they are seen from the front in the reference pose, or in the frame that shows most markers.

    Parameters
    ----------
    project : Project
        With limbs.

    Returns
    -------
    ndarray, shape (n_limbs, 2)
        In a box of 0 .. 1, right and down, slender bodies a little wider, no two limbs upon each other.
    """
    markers = _typical_markers(project)
    limb_of_marker, n_limbs = project.limbs.limb_of_marker, project.limbs.n_limbs
    known = (limb_of_marker >= 0) & ~np.isnan(markers[:, 0])
    if not known.any():
        return np.full((n_limbs, 2), 0.5)
    counts = np.bincount(limb_of_marker[known], minlength=n_limbs)
    sums = np.zeros((n_limbs, 3))
    np.add.at(sums, limb_of_marker[known], markers[known])
    middle = markers[known].mean(axis=0)
    centres = np.where(counts[:, np.newaxis] > 0, sums / np.maximum(counts, 1)[:, np.newaxis], middle)
    positions = project.trajectories.positions
    sample = positions[:: max(len(positions) // _SAMPLES, 1)]
    view = find_views(markers[known], sample)[0]
    return _apart(_widened(_boxed(centres @ np.stack([view.across, -view.up], axis=1))))


def tree_places(parents: Ints) -> Floats:
    """Place limbs as a tree with its roots above, in a box of 0 .. 1, shape (n_limbs, 2)."""
    depths, rows = tidy_places(parents)
    places = np.stack([rows, depths.astype(np.float64)], axis=1)
    return np.asarray((places + 0.5) / (places.max(axis=0) + 1.0))


def _typical_markers(project: Project) -> Floats:
    if project.has("skeleton"):
        return reference_markers(project.skeleton)
    trajectories = project.trajectories
    return np.asarray(trajectories.positions[int(trajectories.seen.sum(axis=1).argmax())])


def _boxed(places: Floats) -> Floats:
    """Places in a box of 0 .. 1, with their proportions."""
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float((high - low).max()), np.finfo(np.float64).tiny)
    return np.asarray(0.5 + (places - (low + high) / 2) / size)


def _widened(places: Floats) -> Floats:
    """Draw slender bodies wider, as far as there is room: their limbs would hide each other."""
    width = max(float(np.ptp(places[:, 0])), np.finfo(np.float64).tiny)
    return np.asarray(0.5 + (places - 0.5) * [min(_WIDEST, max(1.0 / width, 1.0)), 1.0])


def _apart(places: Floats) -> Floats:
    """Push limbs apart that lie too near to be told."""
    n_limbs = len(places)
    least = _APART / np.sqrt(n_limbs) / 2
    turn = np.arange(n_limbs) * 2.4  # different directions for limbs on the same place
    places = places + 1e-6 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for _ in range(_ROUNDS):
        between = places[:, np.newaxis] - places
        distance = np.linalg.norm(between, axis=2)
        np.fill_diagonal(distance, np.inf)
        push = np.maximum(least - distance, 0.0) / 2
        places = places + (between / distance[..., np.newaxis] * push[..., np.newaxis]).sum(axis=1)
    return _boxed(places)
