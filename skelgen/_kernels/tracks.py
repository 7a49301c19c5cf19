"""The layout of a track's state, and the rules it is followed by.

A track's motion is a level (where it is) and a slope (its step per frame). With the innovation e = point - (level +
slope), the update ``level = expected + g e`` and ``slope = slope + h e`` is

* no prediction for g = 1, h = 0 (the slope stays 0),
* constant velocity for g = 1, h = 1,
* double exponential smoothing (LaViola 2003) for g = 1 - (1 - a)^2, h = a^2: Brown's form of the same recursion, which
  equals LaViola's with level = 2 S - S' and slope = a / (1 - a) (S - S').

A link of a track to a point is worth the logarithm of its odds [nats] against the track being lost and the point being
a new one, less the evidence that is asked for. Innovations follow Student's t in three dimensions, with a scale that
grows with the frames since the track was last seen and with the track's own recent innovations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Floats, Ints

# Columns of a track's counters.
AGE = 0  # frames in which it was seen
MISSED = 1  # steps of time since it was last seen
MUTED = 2  # frames for which its points are still ignored
IDENTITY = 3  # number of the track
N_COUNTERS = 4

# Rows of a track's motion.
LEVEL, SLOPE = 0, 1
# Fading sums of squared innovations in units of the scale, per coordinate, and of their number; 1 if it began LONE.
RECENT_ERROR = 2
N_MOTION = 3

# Places in a take's totals.
ALIVE = 0  # tracks that are followed
GIVEN = 1  # identities given out
CROWDED = 2  # frames left out, as they held too many pairs of tracks and points
N_TOTALS = 3

# Rows of the tables of `Rules`.
SETTLED, NEWBORN, LONE = 0, 1, 2

# A sum of a track's innovations keeps this part from frame to frame: it remembers some five frames, a twentieth of a
# second at 100 Hz, in which a limb's acceleration hardly changes.
FADE = 0.8
# Pairs of tracks and points within reach that a frame may hold: some tens of milliseconds of work.
MOST_PAIRS = 1_000_000
# Tracks that compete for the same points are matched optimally up to this number of pairs, and largest gain first
# beyond: only noise forms such crowds, and the optimum takes time with the cube of their size.
MOST_OPTIMAL_PAIRS = 40_000


class Rules(NamedTuple):
    """How tracks are followed.

    Tables hold a row for tracks that were seen at least twice, one for those that were seen once and took a
    neighbour's slope, and one for those that had no neighbour either; and a column for each number of steps of time
    since the track was last seen. Column 0 of `scales` is the take's usual scale, which `RECENT_ERROR` is measured in.

    Attributes
    ----------
    reach : float, mm
        Farthest that a point may lie from where a track that was just seen expected it.
    mute : int
        Frames for which a track that began with a jump is ignored.
    max_gap : int
        Frames for which a track is followed unseen.
    level_gain, slope_gain : float
        Share of an innovation that goes into level and slope.
    optimal : bool
        Match for the largest sum of gains rather than largest gain first.
    evidence : float, nats
        By how much a link must be more probable than any other explanation.
    tails : ndarray, shape (3,)
        Degrees of freedom of the innovations' t distribution, of each kind of tracks.
    exchange : float
        Two tracks exchange their points when one plus the squared change of the vector between them, in `relative`
        times their width, is not this many times as large as it is without.
    relative : float
        Mean squared innovation of a track relative to its neighbour, in its own.
    prior_weight : float
        Weight of the take's scale against a track's recent innovations, as a number of innovations.
    reaches : ndarray, shape (3, max_gap + 2), mm
        Farthest that a point may lie from where it was expected.
    scales : ndarray, shape (3, max_gap + 2), mm
        Scale of the innovations, per coordinate.
    gains : ndarray, shape (3, max_gap + 2), nats
        Gain of a point exactly where it was expected, in a track whose innovations are as usual.
    is_given : bool
        The user's reach decides which points are in reach, whatever their gain.
    duplicate : float, mm
        A point without a track that is nearer than this to one that has one is the same marker.
    """

    reach: float
    mute: int
    max_gap: int
    level_gain: float
    slope_gain: float
    optimal: bool
    evidence: float
    tails: Floats
    exchange: float
    relative: float
    prior_weight: float
    reaches: Floats
    scales: Floats
    gains: Floats
    is_given: bool
    duplicate: float


class TrackedPoints(NamedTuple):
    """Points with what is found of them.

    Attributes
    ----------
    positions : ndarray, shape (n_points, 3), mm
        All points, frame by frame.
    weights : ndarray, shape (n_points,)
        How far to believe each point, at most 1.
    identities : ndarray of intp, shape (n_points,)
        Receives the identity of each point's track; -1 while that is muted, for doubles, and in frames left out.
    surprise : ndarray, shape (n_points,), mm^2
        Receives the squared distance between each point and where it was expected; NaN where nothing was expected.
    states : ndarray, shape (n_points, 5) or (0, 5)
        Receives slope [mm] and recent error of each point's track after it, unless empty.
    """

    positions: Floats
    weights: Floats
    identities: Ints
    surprise: Floats
    states: Floats


class Tracks:
    """State of the tracks that are alive; mutable, as it is carried from chunk to chunk.

    Attributes
    ----------
    motion : ndarray, shape (capacity, 3, 3), mm
        Level, slope and recent error of each track.
    counters : ndarray of intp, shape (capacity, 4)
        Age, missed and muted frames, identity of each track.
    totals : ndarray of intp, shape (3,)
        Number of tracks alive, number of identities given out, and number of frames left out.
    """

    def __init__(self, capacity: int) -> None:
        self.motion: Floats = np.zeros((capacity, N_MOTION, 3))
        self.counters: Ints = np.zeros((capacity, N_COUNTERS), dtype=np.intp)
        self.totals: Ints = np.zeros(N_TOTALS, dtype=np.intp)
