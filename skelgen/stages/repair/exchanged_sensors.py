"""Bodies with orientation that change their names within a take: each jumps to where the other was."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from skelgen.model.arrays import Floats, Ints

NEARER = 0.2
"""Part of its jump at which a body must be from where the other was."""

LEAST_JUMPS = 10.0
"""How many times its usual step a body must jump."""


def exchanged_back(poses: Floats) -> tuple[Floats, tuple[tuple[int, int, int], ...]]:
    """Exchange bodies back that changed their names.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, n_bodies, 4, 4), translations in mm
        world_from_body; NaN where unseen.

    Returns
    -------
    poses : ndarray, shape (n_frames, n_bodies, 4, 4)
        Those given where nothing was exchanged.
    found : tuple of (int, int, int)
        Two bodies and the first frame in which they are exchanged, in the order of time.
    """
    found: list[tuple[int, int, int]] = []
    places = poses[:, :, :3, 3].copy()
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    known = steps[~np.isnan(steps)]
    least = LEAST_JUMPS * float(np.median(known)) if len(known) else np.inf
    back = poses
    for one, other in combinations(range(poses.shape[1]), 2):
        for frame in _exchanges(places[:, one], places[:, other], least):
            back = back.copy() if back is poses else back
            back[frame:, [one, other]] = back[frame:, [other, one]]
            places[frame:, [one, other]] = places[frame:, [other, one]]
            found.append((one, other, frame))
    return back, tuple(sorted(found, key=lambda exchange: exchange[2]))


def _exchanges(one: Floats, other: Floats, least: float) -> Iterator[int]:
    """Frames in which two bodies [mm], shape (n_frames, 3), change places, of those that show both."""
    seen: Ints = np.flatnonzero(~np.isnan(one[:, 0] + other[:, 0]))
    if len(seen) < 2:
        return
    before, after = seen[:-1], seen[1:]
    stays = np.minimum(_apart(one[after], one[before]), _apart(other[after], other[before]))
    changes = np.maximum(_apart(one[after], other[before]), _apart(other[after], one[before]))
    for index in np.flatnonzero((changes < NEARER * stays) & (stays > least)):
        yield int(after[index])


def _apart(one: Floats, other: Floats) -> Floats:
    return np.asarray(np.linalg.norm(one - other, axis=1))
