"""What several samplings of a take say together of its limbs: the markers that most of them put on one."""

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints


def majority(groupings: list[Ints]) -> Ints:
    """Group markers that more than half of the groupings put together.

    Where that is contradictory, because a is with b and b with c but a not with c, the markers that hang together are
    grouped as in the grouping that agrees best with the others about them. Kirk et al. (2005) keep the tightest of
    several groupings.

    Parameters
    ----------
    groupings : list of ndarray of intp, shape (n_markers,)
        Group of each marker, by several samplings.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
    """
    together: Floats = np.mean([groups[:, np.newaxis] == groups for groups in groupings], axis=0)
    result = np.full(len(together), -1, dtype=np.intp)
    for marker in range(len(together)):
        if result[marker] < 0:
            reached = np.flatnonzero(_reached(together > 1 / 2, marker))
            result[reached] = reached[_agreed(together[np.ix_(reached, reached)], [one[reached] for one in groupings])]
    return result


def _reached(linked: Bools, marker: int) -> Bools:
    """Markers that are linked to one, directly or through others."""
    reached = np.zeros(len(linked), dtype=np.bool_)
    reached[marker] = True
    while (wider := np.asarray(linked[reached].any(axis=0))).sum() > reached.sum():
        reached = wider
    return reached


def _agreed(together: Floats, groupings: list[Ints]) -> Ints:
    """For each of some markers that hang together, the first of its group."""
    if (together > 1 / 2).all():
        return np.zeros(len(together), dtype=np.intp)
    same = [groups[:, np.newaxis] == groups for groups in groupings]
    best = min(same, key=lambda pairs: float(np.abs(pairs - together).sum()))
    return np.asarray(best.argmax(axis=1), dtype=np.intp)
