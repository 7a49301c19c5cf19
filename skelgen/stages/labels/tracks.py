"""What both twins of the tracker share: the layout of a track's state, and the rules it is followed by.

A track's motion is a level (where it is) and a slope (its step per frame). With the innovation e = point - (level +
slope), the update ``level = expected + g e`` and ``slope = slope + h e`` is

* no prediction for g = 1, h = 0 (the slope stays 0),
* constant velocity for g = 1, h = 1,
* double exponential smoothing (LaViola 2003) for g = 1 - (1 - a)^2, h = a^2: Brown's form of the same recursion, which
  equals LaViola's with level = 2 S - S' and slope = a / (1 - a) (S - S').
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats, Ints

# Columns of a track's counters.
AGE = 0  # frames in which it was seen
MISSED = 1  # frames since it was last seen
MUTED = 2  # frames for which its points are still ignored
IDENTITY = 3  # number of the track
N_COUNTERS = 4

N_MOTION = 2  # level, slope

# A track that was seen once has only a neighbour's slope, so its next point may lie this much farther off.
NEWBORN_REACH = 2.0


class Rules(NamedTuple):
    """How tracks are followed.

    Attributes
    ----------
    reach : float, mm
        Farthest that a point may lie from where it was expected.
    mute : int
        Frames for which a track that began with a jump is ignored.
    max_gap : int
        Frames for which a track is followed unseen.
    level_gain, slope_gain : float
        Share of an innovation that goes into level and slope.
    optimal : bool
        Match for the least sum of squared distances rather than smallest distance first.
    """

    reach: float
    mute: int
    max_gap: int
    level_gain: float
    slope_gain: float
    optimal: bool


class Tracks:
    """State of the tracks that are alive; mutable, as it is carried from chunk to chunk.

    Attributes
    ----------
    motion : ndarray, shape (capacity, 2, 3), mm
        Level and slope of each track.
    counters : ndarray of intp, shape (capacity, 4)
        Age, missed and muted frames, identity of each track.
    totals : ndarray of intp, shape (2,)
        Number of tracks alive, and number of identities given out.
    """

    def __init__(self, capacity: int) -> None:
        self.motion: Floats = np.zeros((capacity, N_MOTION, 3))
        self.counters: Ints = np.zeros((capacity, N_COUNTERS), dtype=np.intp)
        self.totals: Ints = np.zeros(2, dtype=np.intp)
