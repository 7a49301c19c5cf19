"""Whether a tree hangs together by limbs that never move, which shows nothing: two people who stand side by side.

All that stands still keeps its distances, so that still limbs fit each other with any joint between them, or are taken
for one limb. Joints of limbs that move are evidence; what still limbs alone connect may be several bodies.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from skelgen.geometry.standing import STILL, variance_in_room
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import listed

LEAST_MARKERS = 5
"""Markers that move on what may be a body of its own; as many as bodies have that are found by distances."""


def still_limb_notices(markers: Sequence[Floats], edges: Ints) -> Iterator[str]:
    """Yield the doubt whether a tree is one body, where still limbs alone join parts of it that move.

    Parameters
    ----------
    markers : sequence of ndarray, shape (n_frames, n_markers, 3), mm
        World positions of the markers of each limb; NaN where unseen.
    edges : ndarray of intp, shape (n_edges, 2)
        Limbs that are joined, by the tree and by loops.
    """
    is_still, sizes = still_limbs(markers), np.array([limb.shape[1] for limb in markers])
    if not is_still.any():
        return
    n_limbs = len(markers)
    with_still = _connected(edges[~is_still[edges].all(axis=1)], n_limbs)
    without = _connected(edges[~is_still[edges].any(axis=1)], n_limbs)
    least = max(LEAST_MARKERS, int(sizes[is_still].max()) + 1)
    is_joining = is_still & (np.bincount(edges.ravel(), minlength=n_limbs) > 1)
    whole = _connected(edges, n_limbs)
    for tree in np.unique(whole[is_joining]).tolist():
        moving = np.where(is_still | (whole != tree), 0, sizes)
        limbs = max(_of_parts(with_still, moving, LEAST_MARKERS), _of_parts(without, moving, least), key=len)
        if len(limbs) > 1:
            joining = np.flatnonzero(is_joining & (whole == tree))
            yield (
                f"{_limbs(limbs)} may belong to {len(limbs)} bodies: only limbs that never move in the room join the "
                f"parts of the tree that they are in ({_limbs(joining)}); if so, try --n-bodies {len(limbs)}, or take "
                "them where they step apart"
            )


def still_limbs(markers: Sequence[Floats]) -> Bools:
    """Return which limbs stand still in the room, shape (n_limbs,); `markers` as for `still_limb_notices`."""
    moved = np.array([variance_in_room(limb) for limb in markers])
    usual = np.median(moved[np.isfinite(moved)]) if np.isfinite(moved).any() else 0.0
    return np.asarray(moved < STILL**2 * usual)


def n_moving_parts(markers: Sequence[Floats], edges: Ints) -> int:
    """Return into how many parts with `LEAST_MARKERS` markers the moving limbs fall without those that stand still.

    Parameters
    ----------
    markers, edges
        As for `still_limb_notices`.
    """
    is_still, sizes = still_limbs(markers), np.array([limb.shape[1] for limb in markers])
    part = _connected(edges[~is_still[edges].any(axis=1)], len(markers))
    return len(_of_parts(part, np.where(is_still, 0, sizes), LEAST_MARKERS))


def _of_parts(part: Ints, moving: Ints, least: int) -> list[int]:
    """Of each part of a tree with so many moving markers, the limb that has most of them."""
    found = np.flatnonzero(np.bincount(part, moving) >= least)
    return [int(np.where(part == one, moving, 0).argmax()) for one in found.tolist()]


def _connected(edges: Ints, n_limbs: int) -> Ints:
    """Which part of a graph each limb is in, shape (n_limbs,)."""
    from scipy.sparse import coo_array  # noqa: PLC0415 - heavy
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - heavy

    graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(n_limbs, n_limbs))
    return np.asarray(connected_components(graph, directed=False)[1])


def _limbs(limbs: Iterable[int]) -> str:
    """What limbs are called in a sentence: ``limb 3``, ``limbs 3 and 4`` or ``limbs 3, 4 and 5``."""
    numbers = [str(limb) for limb in sorted(limbs)]
    return f"{'limb' if len(numbers) == 1 else 'limbs'} {listed(numbers)}"
