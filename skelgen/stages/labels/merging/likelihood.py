r"""Which Marker Sets are the same marker: the likelihood of the distances between them.

Sets i and j that are never seen together are one marker if they keep the same distances to others. Let set i have been
seen together with a third set k at some independent moments, and j with k at others. With the deviation :math:`\tau` of
the distance between the two markers, both means follow the same normal distribution if i and j are one, and else differ
by as much as markers lie apart, the spacing w:

.. math::
    E_{ijk} = \log \frac{\sum_\tau p_\tau\, t(\bar d_{jk} - \bar d_{ik};\; \tau^2 (1/n_{ik} + 1/n_{jk}))}
                        {\sum_\tau p_\tau\, t(\bar d_{jk} - \bar d_{ik};\; \tau^2 (1/n_{ik} + 1/n_{jk}) + w^2)} .

Whether a pair is rigid is not known, so :math:`\tau` is a mixture of two inverse-gamma priors, the take's own usual
deviations on one limb and anywhere, weighted by what the scatter of the distances says of them; t is Student's
distribution that remains when :math:`\tau` is integrated out. The evidence for one marker is the sum over the few sets
k that are most surely rigid with both. Sets are joined as long as any pair has evidence, the largest first; every join
lengthens the distances' record and so sharpens what comes after. It maximises the likelihood of all distances greedily.

Distances that are not rigid are alike in whatever the body does slowly, and all those to one far part of it repeat each
other. So they say nothing at first: under both hypotheses the loose component has the wide density, and three rigid
distances are needed. Only what these leave open is decided by all distances.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from skelgen.model.arrays import Bools, Floats, Ints

STALE = 0.5
"""nats that evidence may have lost since it was looked at; with more it is compared anew."""

SAMPLE_SECONDS = 0.25
"""Distances that are this far apart in time count as independent: limbs turn back and forth about once a second."""

EVIDENCE = 3.0
"""nats; sets are joined if one marker is this much more likely than two."""

WITNESSES = 6
"""Sets to which distances are compared: a place has three coordinates, more only repeat what these say."""

LEAST_WITNESSES = 3
"""Fewer distances leave a place open."""

RIGID_PRIOR = 0.2
"""Part of all pairs that are believed to be rigid before anything is seen of them."""

PRIOR_SAMPLES = 4.0
"""Weight of the usual deviation of distances, in samples."""

SEEN_ENOUGH = 4
"""Samples of a distance that tell its deviation."""

TRUSTED_SAMPLES = 8
"""More samples make no better witness: one that is surely rigid counts before one that was seen for long."""

EXACT = 1e-6
"""mm; keeps the deviation of exact takes above zero."""


class _Usual(NamedTuple):
    """Usual deviations of a distance [mm]: on one limb, and between any two markers; and the markers' spacing."""

    rigid: float
    loose: float
    spacing: float


class DistanceRecord:
    """What is known of the distances between sets; mutable, as joins change it.

    Parameters
    ----------
    count, total, squares : ndarray, shape (n, n)
        Number of samples of each distance, their sum [mm] and their sum of squares [mm^2]; symmetric.
    apart : ndarray of bool, shape (n, n)
        Sets that cannot be one marker.
    spacing : float, mm
        How far apart markers are.
    prior : ndarray, shape (n, n), nats, optional
        What else speaks for each two sets being one marker; symmetric.
    """

    def __init__(
        self,
        count: Floats,
        total: Floats,
        squares: Floats,
        apart: Bools,
        spacing: float,
        prior: Floats | None = None,
    ) -> None:
        self.count, self.total, self.squares = count, total, squares
        self.apart = apart | np.eye(len(count), dtype=bool)
        self.prior = np.zeros(count.shape) if prior is None else prior
        self.usual = _usual_deviations(*self._moments(slice(None)), count, spacing)
        self.mean, self.scatter = self._moments(slice(None))
        self.witness = _witness(count, self.scatter, self.usual)

    def evidence(self, one: int, does_loose_tell: bool = True) -> Floats:
        """Evidence [nats] that set `one` is the same marker as each other set, shape (n,); -inf where it cannot be.

        Parameters
        ----------
        one : int
            The set.
        does_loose_tell : bool
            Whether distances that are not rigid tell something.
        """
        result = np.full(len(self.count), -np.inf)
        others = np.flatnonzero(~self.apart[one])
        if not len(others):
            return result
        rank = self.witness[one] * self.witness[others]
        chosen = np.argpartition(-rank, min(WITNESSES, rank.shape[1]) - 1, axis=1)[:, :WITNESSES]
        heard = np.take_along_axis(rank, chosen, axis=1) > 0.0
        rows = others[:, np.newaxis]
        first, second = (np.where(heard, table, 1.0) for table in (self.count[one][chosen], self.count[rows, chosen]))
        difference = self.mean[rows, chosen] - self.mean[one][chosen]
        scatter = self.scatter[one][chosen] + self.scatter[rows, chosen]
        gain, rigid = _log_ratio(difference, first, second, scatter, self.usual, does_loose_tell)
        n_heard = np.where(heard, 1.0 if does_loose_tell else rigid, 0.0).sum(axis=1)
        told = (n_heard > LEAST_WITNESSES - 0.5) | (self.prior[one, others] != 0.0)
        result[others[told]] = self.prior[one, others[told]] + np.where(heard, gain, 0.0).sum(axis=1)[told]
        return result

    def join(self, one: int, other: int) -> None:
        """Make `other` a part of set `one`; its own row says nothing any more."""
        for table in (self.count, self.total, self.squares, self.prior):
            table[one] += table[other]
            table[:, one] += table[:, other]
            table[other] = table[:, other] = 0.0
        self.apart[one] |= self.apart[other]
        self.apart[:, one] = self.apart[one]
        self.apart[other] = self.apart[:, other] = True
        mean, scatter = self._moments(one)
        weight = _witness(self.count[one], scatter, self.usual)
        weight[one] = 0.0
        for table, row in ((self.mean, mean), (self.scatter, scatter), (self.witness, weight)):
            table[one] = table[:, one] = row
        self.witness[other] = self.witness[:, other] = 0.0

    def _moments(self, rows: int | slice) -> tuple[Floats, Floats]:
        """Mean distance [mm] and scatter about it [mm^2]; 0 where never seen."""
        count = np.maximum(self.count[rows], 1.0)
        mean = self.total[rows] / count
        return mean, np.maximum(self.squares[rows] - count * mean**2, 0.0)


def sample_frames(rate: float, first: int, last: int) -> Ints:
    """Frames from `first` to before `last` that are far enough apart to be independent moments."""
    step = max(1, int(SAMPLE_SECONDS * rate))
    return np.arange(first + min(step, last - first) // 2, last, step)


def distance_sums(positions: Floats) -> tuple[Floats, Floats, Floats]:
    """Number, sum [mm] and sum of squares [mm^2] of the distances between markers, each of shape (n, n).

    Parameters
    ----------
    positions : ndarray, shape (n_moments, n, 3), mm
        Markers or sets at independent moments, NaN where unseen.
    """
    n = positions.shape[1]
    count, total, squares = (np.zeros((n, n)) for _ in range(3))
    for pose in positions:
        seen = np.flatnonzero(~np.isnan(pose[:, 0]))
        distance = np.linalg.norm(pose[seen, np.newaxis] - pose[seen], axis=2)
        block = np.ix_(seen, seen)
        count[block] += 1.0
        total[block] += distance
        squares[block] += distance**2
    return count, total, squares


def join_likely(record: DistanceRecord) -> Ints:
    """Join the sets of a record while there is evidence; returns the set that each became part of, shape (n,).

    First by rigid distances alone, then by all.
    """
    n_sets = len(record.count)
    group = np.arange(n_sets)
    for does_loose_tell in (False, True):
        _join(record, group, does_loose_tell)
    return group


def _join(record: DistanceRecord, group: Ints, does_loose_tell: bool) -> None:
    """Join while there is evidence; `group` is changed in place."""
    link = np.array([record.evidence(one, does_loose_tell) for one in range(len(group))]).reshape(len(group), -1)
    while len(group):
        one, other = np.unravel_index(int(np.argmax(link)), link.shape)
        if link[one, other] < EVIDENCE:
            break
        one, other = min(one, other), max(one, other)
        now = record.evidence(int(one), does_loose_tell)
        if now[other] < link[one, other] - STALE:  # what is known of their witnesses has changed since
            link[one] = link[:, one] = now
            continue
        record.join(int(one), int(other))
        group[group == other] = one
        link[other] = link[:, other] = -np.inf
        link[one] = link[:, one] = record.evidence(int(one), does_loose_tell)


def _usual_deviations(mean: Floats, scatter: Floats, count: Floats, spacing: float) -> _Usual:
    """The take's own deviations: about one rigid partner for each set, and the median of all pairs."""
    pairs = np.triu(count >= SEEN_ENOUGH, 1)
    deviation = np.sort(np.sqrt(scatter[pairs] / (count[pairs] - 1.0)))
    if not len(deviation):
        return _Usual(max(0.1 * spacing, EXACT), max(spacing, EXACT), max(spacing, EXACT))
    rigid = max(float(deviation[min(len(deviation) - 1, len(count))]), EXACT)
    return _Usual(rigid, max(float(np.median(deviation)), rigid), max(spacing, EXACT))


def _witness(count: Floats, scatter: Floats, usual: _Usual) -> Floats:
    """How good a witness each set is for another's place: probability of being rigid with it, times samples."""
    freedom = np.maximum(count - 1.0, 0.0)
    rigid, loose = (_log_weight(freedom, scatter, tau, prior)[0] for tau, prior in _components(usual))
    probability = 1.0 / (1.0 + np.exp(np.clip(loose - rigid, -50.0, 50.0)))
    weight = np.where(count > 0.0, probability, 0.0) * np.minimum(count, TRUSTED_SAMPLES)
    if weight.ndim == 2:
        np.fill_diagonal(weight, 0.0)
    return np.asarray(weight)


def _components(usual: _Usual) -> tuple[tuple[float, float], tuple[float, float]]:
    """Both usual deviations [mm] with their prior probabilities."""
    return (usual.rigid, RIGID_PRIOR), (usual.loose, 1.0 - RIGID_PRIOR)


def _log_weight(freedom: Floats, scatter: Floats, tau: float, prior: float) -> tuple[Floats, Floats, Floats]:
    """Log probability of a scatter if the usual deviation is tau, and Student's freedom and variance after it."""
    after = PRIOR_SAMPLES + freedom
    variance = (PRIOR_SAMPLES * tau**2 + scatter) / after
    weight = (
        np.log(prior)
        + gammaln(after / 2)
        - gammaln(PRIOR_SAMPLES / 2)
        + PRIOR_SAMPLES / 2 * np.log(PRIOR_SAMPLES * tau**2)
        - after / 2 * np.log(after * variance)
    )
    return weight, after, variance


def _log_ratio(
    difference: Floats, first: Floats, second: Floats, scatter: Floats, usual: _Usual, does_loose_tell: bool
) -> tuple[Floats, Floats]:
    """Evidence of each distance: log likelihood of one marker over two; and the probability that it is rigid."""
    spread, found = 1.0 / first + 1.0 / second, []
    for tau, prior in _components(usual):
        weight, freedom, variance = _log_weight(first + second - 2.0, scatter, tau, prior)
        narrow, wide = variance * spread, variance * spread + usual.spacing**2
        near, far = (weight + _log_student(difference, freedom, width) for width in (narrow, wide))
        found.append((weight, near, far))
    (rigid, near, far), (loose, loosely_near, loosely_far) = found
    same = np.logaddexp(near, loosely_near if does_loose_tell else loosely_far)
    probability = 1.0 / (1.0 + np.exp(np.clip(loose - rigid, -50.0, 50.0)))
    return np.asarray(same - np.logaddexp(far, loosely_far)), probability


def _log_student(value: Floats, freedom: Floats, variance: Floats) -> Floats:
    """Log density of Student's distribution, without the part that both hypotheses share."""
    return np.asarray(-0.5 * np.log(variance) - (freedom + 1.0) / 2 * np.log1p(value**2 / (freedom * variance)))
