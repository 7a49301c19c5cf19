"""Links between chains of tracks over short gaps: how likely each is, and which of them are sure; see `bridges`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen._kernels.carried_points import carried
from skelgen.geometry.statistics import lengths_of
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints, numbers_between
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.continuity import (
    FASTEST,
    FREEDOM,
    LONGEST,
    PER_MISFIT,
    STEADY,
    evidence_of_missed,
)
from skelgen.stages.labels.merging.followed import FollowedCloud

SPEED_SECONDS = 0.015
"""Over which speeds are measured."""

FARTHEST = 3.0
"""Spacings between the ends of a gap beyond what `FASTEST` allows."""

BESIDE = 6
"""Ends beside one that speak of it, the nearest."""

BESIDE_SECONDS, BESIDE_SPACINGS = 0.1, 4.0
"""How far apart in time and space two ends may be to speak of each other."""

MOST_SPOKEN = 4.0
"""nats that a link says of one beside it, at most."""

DISTANCE_FREEDOM = 3.0
"""Of Student's distribution of changes of distances."""

TURNS = 6
"""Of the mean field."""

UNLIKELY, LEAST_SEEMING = 8.0, -3.0
"""Links are left out of it that have so many nats less than the best one of their end, or less than these."""

SURE = 3.0
"""nats of evidence for a link, and more than for any other one of its end or its beginning: then it is made."""

CARRIER_SECONDS = 0.05
"""Chains that last so long carry others along."""

CARRIED_AT_ONCE = 1000
"""Links whose neighbours are held at once."""

MOST_FOLLOWING, MOST_LIKELY = 100, 10
"""Links of an end that are looked at, the first in time, and of these in the mean field, the likeliest: most takes have
some 25 and 5, but a volume full of reflections must not fill the memory."""


class Laws(NamedTuple):
    """How badly predictions fail, by the length of gaps.

    Attributes
    ----------
    seconds : ndarray, shape (n_gaps,), s
        Rising lengths.
    least : ndarray, shape (n_gaps,), mm
        a above.
    part : ndarray, shape (n_gaps,)
        b above.
    stretch : ndarray, shape (n_gaps,), mm
        Deviation of the distances of neighbours from what they were before.
    """

    seconds: Floats
    least: Floats
    part: Floats
    stretch: Floats

    def of_speeds(self, seconds: Floats, turned: Floats) -> Floats:
        """Return the deviation [mm] of a coordinate that speeds predict.

        Parameters
        ----------
        seconds : ndarray, shape (n,), s
            Lengths of gaps.
        turned : ndarray, shape (n,), mm
            How much the ways differ that both speeds lead in that time.
        """
        least, part = (np.interp(seconds, self.seconds, law) for law in (self.least, self.part))
        return np.hypot(least, part * turned)

    def of_distances(self, seconds: Floats) -> Floats:
        """Return the deviation of distances from what they were before gaps of these lengths [mm]."""
        return np.asarray(np.interp(seconds, self.seconds, self.stretch))


class Links(NamedTuple):
    """Chains that may go on as others, link by link, and the evidence [nats] that they do."""

    ends: Ints
    begins: Ints
    evidence: Floats

    def of(self, chosen: Bools | Ints) -> Links:
        """Return some of them."""
        return Links(self.ends[chosen], self.begins[chosen], self.evidence[chosen])


def points_of_chains(cloud: PointCloud, chain_of_point: Ints, frames: Ints) -> tuple[Ints, Ints]:
    """Return the chains that are seen in some frames, and the point of each in each frame, -1 where it is unseen.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    chain_of_point : ndarray of intp, shape (n_points,)
        Chain of each point, -1 for none.
    frames : ndarray of intp
        Rising frames.
    """
    row, point = point_labels.points_in_frames(cloud, frames)
    owned = chain_of_point[point] >= 0
    chains, column = np.unique(chain_of_point[point[owned]], return_inverse=True)
    table = np.full((len(frames), len(chains)), -1, dtype=np.intp)
    table[row[owned], column] = point[owned]
    return chains, table


def speed_frames(rate: float) -> int:
    """Return the number of frames over which speeds are measured."""
    return max(1, round(SPEED_SECONDS * rate))


def missed_by_speeds(places: Floats, moved: Floats, ratio: float | Floats) -> tuple[Floats, Floats]:
    """Return how far the speeds at both ends of gaps miss the displacement [mm], and how much their ways differ [mm].

    Parameters
    ----------
    places : ndarray, shape (2, n, 3), mm
        Before and behind gaps.
    moved : ndarray, shape (2, n, 3), mm
        Movement there in some time.
    ratio : float or ndarray of shape (n,)
        Length of the gaps in this time.
    """
    way = np.asarray(ratio)[..., np.newaxis] * moved
    return lengths_of(places[1] - places[0] - (way[0] + way[1]) / 2), lengths_of(way[1] - way[0])


class BridgeWindow:
    """Chains in some seconds of a take: the point of each in each frame, and where each begins and ends.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    chain_of_point : ndarray of intp, shape (n_points,)
        Chain of each point, -1 for none.
    ends : tuple of ndarray of intp, shape (n_chains,)
        First and last frame of each chain.
    span : tuple of int
        First frame of the window, and the one behind its last: gaps that begin in it are looked at.
    """

    def __init__(
        self, take: FollowedCloud, chain_of_point: Ints, ends: tuple[Ints, Ints], span: tuple[int, int]
    ) -> None:
        self._rate, self._spacing, self._points, self._span = take.rate, take.spacing, take.cloud.points, span
        self._longest, self._beside_frames = int(LONGEST * take.rate), int(BESIDE_SECONDS * take.rate)
        margin = max(speed_frames(take.rate), self._beside_frames)
        self._start = max(span[0] - margin, 0)
        behind = min(span[1] + self._longest + margin, take.cloud.n_frames)
        self.chains, self._table = points_of_chains(take.cloud, chain_of_point, np.arange(self._start, behind))
        self.first, self.last = (frames[self.chains] for frames in ends)
        self._carriers = np.flatnonzero(self.last - self.first >= CARRIER_SECONDS * take.rate)

    def sure_links(self, laws: Laws, goes_on_as: Ints) -> Links:
        """Return links that are far more likely than all others of their ends and beginnings.

        Parameters
        ----------
        laws : Laws
            How badly predictions fail.
        goes_on_as : ndarray of intp, shape (n_chains,)
            The chain of the take that each one is linked to already, or itself.
        """
        links = self._possible(goes_on_as[self.chains] == self.chains)
        links = links._replace(evidence=self._seeming(links, laws))
        best = np.full(len(self.chains), -np.inf)
        np.maximum.at(best, links.ends, links.evidence)
        links = links.of(links.evidence > np.maximum(best[links.ends] - UNLIKELY, LEAST_SEEMING))
        links = links.of(np.sort(_foremost(links.ends, -links.evidence, MOST_LIKELY)))
        return links.of(_sure(links._replace(evidence=self._supported(links, laws))))

    def _possible(self, is_free: Bools) -> Links:
        """All links whose gaps begin within the window."""
        ends = np.flatnonzero((self.last >= self._span[0]) & (self.last < self._span[1]))
        order = np.flatnonzero(is_free & (self.first > self._span[0]))
        order = order[np.argsort(self.first[order], kind="stable")]
        low = np.searchsorted(self.first[order], self.last[ends], side="right")
        high = np.searchsorted(self.first[order], self.last[ends] + self._longest, side="right")
        which, begins = numbers_between(low, np.minimum(high, low + MOST_FOLLOWING))
        ends, begins = ends[which], order[begins]
        away = lengths_of(self._at(begins, self.first[begins]) - self._at(ends, self.last[ends]))
        near = away < FASTEST * self._seconds(ends, begins) + FARTHEST * self._spacing
        return Links(ends[near], begins[near], np.zeros(int(near.sum())))

    def _seconds(self, ends: Ints, begins: Ints) -> Floats:
        return np.asarray((self.first[begins] - self.last[ends]) / self._rate)

    def _index(self, chain: Ints, frame: Ints) -> Ints:
        """Point of chains in frames of the take, -1 where they are unseen."""
        row = frame - self._start
        inside = (row >= 0) & (row < len(self._table))
        return np.where(inside, self._table[np.clip(row, 0, len(self._table) - 1), chain], -1)

    def _at(self, chain: Ints, frame: Ints) -> Floats:
        """Places of chains in frames of the take [mm], NaN where they are unseen."""
        point = self._index(chain, frame)
        return np.where((point >= 0)[:, np.newaxis], self._points[point], np.nan)

    def _speeds(self, chain: Ints, frame: Ints, direction: int) -> Floats:
        """How far chains move in a frame [mm], measured from a frame on in a direction, NaN where that is not seen."""
        here, speed = self._at(chain, frame), np.full((len(chain), 3), np.nan)
        for n_frames in range(speed_frames(self._rate), 0, -1):
            unknown = np.flatnonzero(np.isnan(speed[:, 0]))
            there = self._at(chain[unknown], frame[unknown] + direction * n_frames)
            speed[unknown] = (there - here[unknown]) / (direction * n_frames)
        return speed

    def _seeming(self, links: Links, laws: Laws) -> Floats:
        """Evidence of each link by the speeds, and by what is carried along; either may be the right prediction."""
        ends, begins = links.ends, links.begins
        places = np.stack([self._at(ends, self.last[ends]), self._at(begins, self.first[begins])])
        known = np.arange(len(self.chains))
        leaving, coming = self._speeds(known, self.last, -1)[ends], self._speeds(known, self.first, 1)[begins]
        moved = np.stack([np.where(np.isnan(leaving), coming, leaving), np.where(np.isnan(coming), leaving, coming)])
        seconds = self._seconds(ends, begins)
        off, turned = missed_by_speeds(places, moved, seconds * self._rate)
        is_seen = ~(np.isnan(leaving) | np.isnan(coming))[:, 0]
        by_speed = np.where(is_seen, self._said(off, laws.of_speeds(seconds, turned)), 0.0)
        off, deviation = self._carried(links)
        is_carried = ~np.isnan(off)
        by_others = np.nan_to_num(self._said(off, deviation))
        both = np.logaddexp(by_speed, by_others) - np.log(2.0)
        return np.where(is_seen & is_carried, both, by_speed + by_others)

    def _said(self, off: Floats, deviation: Floats) -> Floats:
        return evidence_of_missed(off, deviation, self._spacing, FREEDOM)

    def _carried(self, links: Links) -> tuple[Floats, Floats]:
        """How far chains begin from where their neighbours carry those that end, and the deviation of that, mm."""
        off, misfit = np.full((2, len(links.ends)), np.nan)
        for start in range(0, len(off), CARRIED_AT_ONCE):
            part = np.arange(start, min(start + CARRIED_AT_ONCE, len(off)))
            ends, begins = links.ends[part], links.begins[part]
            frames = self.last[ends], self.first[begins]
            source, target = (self._table[np.ix_(frame - self._start, self._carriers)] for frame in frames)
            for own in (ends, begins):
                source[self._carriers == own[:, np.newaxis]] = -1
            expected, misfit[part] = carried(self._points, self._index(ends, frames[0]), source, target)
            off[part] = lengths_of(self._at(begins, frames[1]) - expected)
        return off, PER_MISFIT * np.sqrt(misfit**2 + (STEADY * self._spacing) ** 2)

    def _supported(self, links: Links, laws: Laws) -> Floats:
        """Evidence of links with that of likely ones beside them."""
        one, other, spoken = self._spoken(links, laws)
        total = links.evidence
        for _ in range(TURNS):
            likely = _likely(links._replace(evidence=total))
            support = np.bincount(one, likely[other] * spoken, minlength=len(total))
            total = (total + links.evidence + support) / 2
        return np.asarray(total)

    def _spoken(self, links: Links, laws: Laws) -> tuple[Ints, Ints, Floats]:
        """Pairs of links beside each other, and what the second says of the first if it is right [nats]."""
        order = np.argsort(links.ends, kind="stable")
        ends, counts = np.unique(links.ends, return_counts=True)
        starts = np.cumsum(counts) - counts
        first, second = self._beside(ends)
        pair, index = numbers_between(np.zeros(len(first), dtype=np.intp), counts[first] * counts[second])
        row, column = np.divmod(index, counts[second][pair])
        one, other = order[starts[first][pair] + row], order[starts[second][pair] + column]
        begins = links.begins[one], links.begins[other]
        apart = np.abs(self.first[begins[0]] - self.first[begins[1]])
        near = (begins[0] != begins[1]) & (apart <= self._beside_frames)
        one, other = one[near], other[near]
        distances, frames = [], []
        for chains, latest in ((links.ends, False), (links.begins, True)):
            distance, frame = self._distances(chains[one], chains[other], latest=latest)
            distances.append(distance)
            frames.append(frame)
        deviation = laws.of_distances((frames[1] - frames[0]) / self._rate)
        change = distances[1] - distances[0]
        narrow, wide = (_log_density(change, width) for width in (deviation, np.hypot(deviation, self._spacing)))
        return one, other, np.nan_to_num(np.clip(narrow - wide, -MOST_SPOKEN, MOST_SPOKEN))

    def _distances(self, one: Ints, other: Ints, *, latest: bool) -> tuple[Floats, Ints]:
        """Distances [mm] of chains when the first of two ends, or the later one begins, and the frames."""
        ends = self.first if latest else self.last
        frame = (np.maximum if latest else np.minimum)(ends[one], ends[other])
        return lengths_of(self._at(one, frame) - self._at(other, frame)), frame

    def _beside(self, ends: Ints) -> tuple[Ints, Ints]:
        """Pairs of chains that end at about the same time and place: indices in `ends`, the nearest of each first."""
        last = self.last[ends]
        order = np.argsort(last, kind="stable")
        low = np.searchsorted(last[order], last - self._beside_frames)
        high = np.searchsorted(last[order], last + self._beside_frames, side="right")
        one, place = numbers_between(low, high)
        other = order[place]
        distance, _ = self._distances(ends[one], ends[other], latest=False)
        near = np.flatnonzero((one != other) & (distance < BESIDE_SPACINGS * self._spacing))
        near = near[_foremost(one[near], distance[near], BESIDE)]
        return one[near], other[near]


def _log_density(change: Floats, deviation: Floats) -> Floats:
    """Logarithm of Student's density but for a constant."""
    freedom = DISTANCE_FREEDOM
    return np.asarray(-(freedom + 1.0) / 2 * np.log1p((change / deviation) ** 2 / freedom) - np.log(deviation))


def _foremost(group: Ints, value: Floats, most: int) -> Ints:
    """Indices of the least values of each group, at most so many, group by group and rising."""
    order = np.lexsort((value, group))
    counts = np.bincount(group, minlength=1)
    return order[np.arange(len(order)) - np.repeat(np.cumsum(counts) - counts, counts) < most]


def _likely(links: Links) -> Floats:
    """Probability of each link among those of its end, and none, or of its beginning if that is less."""
    found = np.ones(len(links.evidence))
    for chain in (links.ends, links.begins):
        most = np.zeros(int(chain.max(initial=-1)) + 1)
        np.maximum.at(most, chain, links.evidence)
        weight = np.exp(links.evidence - most[chain])
        total = np.exp(-most) + np.bincount(chain, weight, minlength=len(most))
        found = np.minimum(found, weight / total[chain])
    return found


def _sure(links: Links) -> Ints:
    """Which links have more evidence than none, and any other one of their end or beginning, by `SURE`.

    What is sure takes its end and its beginning from the others, of which more may be sure then.
    """
    chosen, left = np.zeros(0, dtype=np.intp), np.arange(len(links.evidence))
    while len(left):
        some = links.of(left)
        rival = np.maximum(_rivals(some.ends, some.evidence), _rivals(some.begins, some.evidence))
        sure = some.evidence - np.maximum(rival, 0.0) >= SURE
        if not sure.any():
            break
        chosen = np.append(chosen, left[sure])
        left = left[~(np.isin(some.ends, some.ends[sure]) | np.isin(some.begins, some.begins[sure]))]
    return chosen


def _rivals(chain: Ints, evidence: Floats) -> Floats:
    """The most evidence of any other link of the same chain, -inf if there is none."""
    order = np.lexsort((-evidence, chain))
    is_first = np.append(True, np.diff(chain[order]) > 0)
    first = np.flatnonzero(is_first)[np.cumsum(is_first) - 1]
    second = np.minimum(first + 1, len(order) - 1)
    next_best = np.where(chain[order][second] == chain[order], evidence[order][second], -np.inf)
    next_best[(second == first) & is_first] = -np.inf
    rival = np.empty(len(order))
    rival[order] = np.where(is_first, next_best, evidence[order][first])
    return rival
