"""Pairs of a simulated rig when they are due, as cameras would send them."""

from __future__ import annotations

import time
from collections.abc import Iterator


def due_pairs(n_frames: int, rate: float, paced: bool) -> Iterator[tuple[int, int]]:
    """Deliver the index of each pair, and how many were lost before it.

    Parameters
    ----------
    n_frames : int
        Number of pairs.
    rate : float, Hz
        How many are due in a second.
    paced : bool
        Whether to wait until a pair is due, and to leave out those that nobody took in time.
    """
    begin, index = time.monotonic(), 0
    while index < n_frames:
        lost = 0
        if paced:
            ahead = begin + index / rate - time.monotonic()
            time.sleep(max(ahead, 0.0))
            lost = min(int(max(-ahead, 0.0) * rate), n_frames - 1 - index)
            index += lost
        yield index, lost
        index += 1
