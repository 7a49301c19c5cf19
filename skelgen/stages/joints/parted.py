"""Bodies of a stated number: the tree of all limbs, parted where its joints fit worst.

No joint holds two bodies together, however near each other they stay. Limbs that stand still in the room are left out
where they alone join the others: any joint fits them.
"""

from typing import NamedTuple

import numpy as np

from skelgen.geometry.statistics import pair_distances
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import limbs_of_bodies

LEAST_MARKERS = 3
"""Markers of a body that is parted by joints: fewer have no pose."""


class PartedBodies(NamedTuple):
    """Body of each limb, and how many times the gap of all other joints those have that part the bodies.

    Limbs that are left out have -1.
    """

    body_of_limb: Ints
    gap_ratio: float

    @property
    def probability(self) -> float:
        """That these are the bodies: one half if other joints fit as badly, and nearly 1 if none does by far."""
        return 1.0 - 1.0 / (1.0 + self.gap_ratio)

    def of_markers(self, positions: Floats, limb_of_marker: Ints) -> Ints:
        """Return the body of each marker, shape (n_markers,): those of limbs that are left out go to what is nearest.

        Parameters
        ----------
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            NaN where unseen.
        limb_of_marker : ndarray of intp, shape (n_markers,)
            -1 for markers on no limb, which are on no body either.
        """
        body = np.where(limb_of_marker >= 0, self.body_of_limb[limb_of_marker], -1)
        left = np.flatnonzero((limb_of_marker >= 0) & (body < 0))
        first, second = np.triu_indices(len(limb_of_marker), 1)
        pairs = pair_distances(positions, first, second)
        far = np.full((len(body), len(body)), np.inf)
        far[first, second] = far[second, first] = np.where(pairs.is_known, pairs.largest, np.inf)
        while len(left):  # the one that is nearest to what has a body already
            known = np.flatnonzero(body >= 0)
            nearest = far[np.ix_(left, known)]
            row, column = np.unravel_index(int(nearest.argmin()), nearest.shape)
            body[left[row]] = body[known[column]]
            left = np.delete(left, row)
        return body


def parted_tree(parents: Ints, costs: Floats, sizes: Ints, n_bodies: int) -> PartedBodies | None:
    """Part a tree into a stated number of bodies where its joints cost most; None if that fails.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Of joints, comparable with each other.
    sizes : ndarray of intp, shape (n_limbs,)
        Number of markers; 0 for limbs that are left out, which nothing joins.
    n_bodies : int
        How many bodies there are; each has at least `LEAST_MARKERS` markers.
    """
    cost_of = costs[np.arange(len(parents)), parents]  # meaningless for roots
    parted, cut = parents.copy(), list[int]()

    def bodies(tree: Ints) -> list[Ints]:
        return [limbs for limbs in limbs_of_bodies(tree) if sizes[limbs].any()]

    for child in sorted(np.flatnonzero(parents >= 0).tolist(), key=lambda limb: -cost_of[limb]):
        if len(bodies(parted)) >= n_bodies:
            break
        tried = parted.copy()
        tried[child] = -1
        if min(sizes[limbs].sum() for limbs in bodies(tried)) >= LEAST_MARKERS:
            parted, cut = tried, [*cut, child]
    found = bodies(parted)
    if len(found) != n_bodies:
        return None
    kept = cost_of[parted >= 0].max(initial=0.0)
    body_of_limb = np.full(len(parents), -1, dtype=np.intp)
    for body, limbs in enumerate(found):
        body_of_limb[limbs] = body
    return PartedBodies(body_of_limb, float(np.sqrt(cost_of[cut].min(initial=np.inf) / kept)) if kept > 0 else np.inf)
