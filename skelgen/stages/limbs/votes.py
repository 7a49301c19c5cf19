"""What several groupings of the same markers agree on."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Ints


def majority(groupings: list[Ints]) -> Ints:
    """Group markers that more than half of the groupings put together, directly or through others.

    Parameters
    ----------
    groupings : list of ndarray of intp, shape (n_markers,)
        Group of each marker, by several samplings (Kirk, O'Brien and Forsyth 2005 keep the tightest one).

    Returns
    -------
    ndarray of intp, shape (n_markers,)
    """
    together = np.mean([groups[:, np.newaxis] == groups for groups in groupings], axis=0) > 1 / 2
    result = np.full(len(together), -1, dtype=np.intp)
    for marker in range(len(together)):
        if result[marker] < 0:
            reached = together[marker]
            while (wider := together[reached].any(axis=0)).sum() > reached.sum():
                reached = wider
            result[reached] = marker
    return result
