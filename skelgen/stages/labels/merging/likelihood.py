r"""Which tracklets are the same marker: the likelihood of the distances between them.

Tracklets i and j that are never seen together are one marker if they keep the same distances to others. Let i have been
seen together with a third tracklet k at some independent moments, and j with k at others. With the deviation
:math:`\tau` of the distance between the two markers, both means follow the same normal distribution if i and j are one,
and else differ by as much as markers lie apart, the spacing w:

.. math::
    E_{ijk} = \log \frac{\sum_\tau p_\tau\, t(\bar d_{jk} - \bar d_{ik};\; \tau^2 (1/n_{ik} + 1/n_{jk}))}
                        {\sum_\tau p_\tau\, t(\bar d_{jk} - \bar d_{ik};\; \tau^2 (1/n_{ik} + 1/n_{jk}) + w^2)} .

Whether a pair is rigid is not known, so :math:`\tau` is a mixture of two inverse-gamma priors, the take's own usual
deviations on one limb and anywhere, weighted by how well they explain the scatter of the distances; t is Student's
distribution that remains when :math:`\tau` is integrated out. The evidence for one marker is the sum over the few
tracklets k that are most surely rigid with both. Tracklets are merged as long as any pair has evidence, the largest
first. Every merger lengthens the record of distances and so sharpens the evidence of later ones. This maximises the
likelihood of all distances greedily.

Distances that are not rigid change with the pose and not with the marker, and those to one far part of the body repeat
each other. So they do not count at first: under both hypotheses the loose component has the wide density, and three
rigid distances are needed. All distances count only for the pairs that are still open then.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from skelgen.model.arrays import Bools, Floats, Ints

STALE = 0.5
"""nats that evidence may have lost since it was computed; with more it is computed anew."""

SAMPLE_SECONDS = 0.25
"""Distances that are this far apart in time count as independent: limbs turn back and forth about once a second."""

EVIDENCE = 3.0
"""nats; tracklets are merged if one marker is this much more likely than two."""

WITNESSES = 6
"""Tracklets to which distances are compared: a place has three coordinates, so more would repeat these."""

LEAST_WITNESSES = 3
"""Fewer distances do not fix a place."""

RIGID_PRIOR = 0.2
"""Prior probability that a pair is rigid."""

PRIOR_SAMPLES = 4.0
"""Weight of the usual deviation of distances, in samples."""

SEEN_ENOUGH = 4
"""Samples of a distance from which its deviation is known."""

TRUSTED_SAMPLES = 8
"""More samples do not make a better witness, so that rigidity counts before duration."""

SLOW_FREEDOM = 4.0
"""Of Student's distribution for means that may rest on one pose each: heavy tails."""

EXACT = 1e-6
"""mm; keeps the deviation of exact takes above zero."""

EXISTENCE = 8.0
"""nats that a marker more costs."""

LEAST_DEVIATION = 0.02
"""Deviation of a distance on a limb that is expected beforehand, in spacings."""


class _Deviations(NamedTuple):
    """Usual deviations of a distance [mm]: on one limb, and between any two markers; and the markers' spacing."""

    rigid: float
    loose: float
    spacing: float


class _Compared(NamedTuple):
    """Differences of mean distances [mm]; samples and scatters [mm^2] of both; whether poses may have been slow."""

    difference: Floats
    counts: tuple[Floats, Floats]
    scatters: tuple[Floats, Floats]
    is_slow: bool


class DistanceRecord:
    """What is known of the distances between tracklets; mutable, as mergers change it.

    Parameters
    ----------
    count, total, squares : ndarray, shape (n, n)
        Number of samples of each distance, their sum [mm] and their sum of squares [mm^2]; symmetric.
    apart : ndarray of bool, shape (n, n)
        Tracklets that cannot be one marker.
    spacing : float, mm
        How far apart markers are.
    prior : ndarray, shape (n, n), nats, optional
        Other evidence that two tracklets are one marker; symmetric.
    """

    def __init__(
        self, count: Floats, total: Floats, squares: Floats, apart: Bools, spacing: float, prior: Floats | None = None
    ) -> None:
        self.count, self.total, self.squares = count, total, squares
        self.apart = apart | np.eye(len(count), dtype=bool)
        self.prior = np.zeros(count.shape) if prior is None else prior
        self.deviations = _usual_deviations(*self._moments(slice(None)), count, spacing)
        self.mean, self.scatter = self._moments(slice(None))
        self.witness = _witness(count, self.scatter, self.deviations)

    def evidence(self, one: int, counts_loose: bool = True, is_slow: bool = False) -> Floats:
        """Evidence [nats] that one tracklet is the same marker as each other one, shape (n,); -inf where it cannot be.

        Parameters
        ----------
        one : int
            The tracklet.
        counts_loose : bool
            Whether distances that are not rigid count.
        is_slow : bool
            Whether a tracklet may have been seen in one slow pose alone: what its distances did not vary by may then
            still be the error of their mean, and far distances are less surprising.
        """
        result = np.full(len(self.count), -np.inf)
        others = np.flatnonzero(~self.apart[one])
        if not len(others):
            return result
        partners = np.flatnonzero(self.witness[one])  # few tracklets of a long take are ever seen together
        rank = self.witness[one, partners] * self.witness[np.ix_(others, partners)]
        comparable = ((rank > 0.0).sum(axis=1) >= LEAST_WITNESSES) | (self.prior[one, others] != 0.0)
        if not comparable.any():
            return result
        others, rank = others[comparable], rank[comparable]
        if len(partners) > WITNESSES:
            best = np.argpartition(-rank, WITNESSES - 1, axis=1)[:, :WITNESSES]
        else:
            best = np.broadcast_to(np.arange(len(partners)), rank.shape)
        chosen, valid = partners[best], np.take_along_axis(rank, best, axis=1) > 0.0
        rows = others[:, np.newaxis]
        first, second = (np.where(valid, table, 1.0) for table in (self.count[one][chosen], self.count[rows, chosen]))
        difference = self.mean[rows, chosen] - self.mean[one][chosen]
        scatters = self.scatter[one][chosen], self.scatter[rows, chosen]
        measured = _Compared(difference, (first, second), scatters, is_slow)
        gain, rigid = _log_ratio(measured, self.deviations, counts_loose)
        n_valid = np.where(valid, 1.0 if counts_loose else rigid, 0.0).sum(axis=1)
        known = (n_valid > LEAST_WITNESSES - 0.5) | (self.prior[one, others] != 0.0)
        result[others[known]] = self.prior[one, others[known]] + np.where(valid, gain, 0.0).sum(axis=1)[known]
        return result

    def merge(self, one: int, other: int) -> None:
        """Make a tracklet a part of another one; the rows of the part are emptied.

        Parameters
        ----------
        one : int
            The tracklet that stays.
        other : int
            The tracklet that becomes a part of it.
        """
        for table in (self.count, self.total, self.squares, self.prior):
            table[one] += table[other]
            table[:, one] += table[:, other]
            table[other] = table[:, other] = 0.0
        self.apart[one] |= self.apart[other]
        self.apart[:, one] = self.apart[one]
        self.apart[other] = self.apart[:, other] = True
        mean, scatter = self._moments(one)
        weight = _witness(self.count[one], scatter, self.deviations)
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
    """Return the frames from `first` to before `last` that are far enough apart to be independent moments.

    Parameters
    ----------
    rate : float, Hz
        Frame rate.
    first, last : int
        Frames.
    """
    step = max(1, int(SAMPLE_SECONDS * rate))
    return np.arange(first + min(step, last - first) // 2, last, step)


def distance_sums(positions: Floats) -> tuple[Floats, Floats, Floats]:
    """Number, sum [mm] and sum of squares [mm^2] of the distances between markers, each of shape (n, n).

    Parameters
    ----------
    positions : ndarray, shape (n_moments, n, 3), mm
        Markers or tracklets at independent moments, NaN where unseen.
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


def evidence_of_labels(sums: Floats, spacing: float) -> tuple[float, float]:
    """How well markers explain the points [nats], by the steadiest distances of each; and how far that may be chance.

    Labels that are wrong for a while make distances vary, points that are left out explain nothing, and a marker that
    is found twice costs. Only labels of one take can be compared.

    Parameters
    ----------
    sums : ndarray, shape (3, n_markers, n_markers)
        From `distance_sums`.
    spacing : float, mm
        How far apart markers are.
    """
    gain = explained(sums, spacing)
    chosen = np.argsort(gain, axis=1)[:, -WITNESSES:]
    evidence, n_distances = (float(np.take_along_axis(table, chosen, axis=1).sum()) for table in (gain, sums[0]))
    return evidence - EXISTENCE * len(gain), float(np.sqrt(n_distances))


def explained(sums: Floats, spacing: float) -> Floats:
    """How well distances are explained by two markers that keep them [nats], shape as the tables; 0 for a marker alone.

    Parameters
    ----------
    sums : ndarray, shape (3, ..., n_markers)
        Number, sum [mm] and sum of squares [mm^2] of distances.
    spacing : float, mm
        How far apart markers are.
    """
    count, total, squares = sums
    scatter = np.maximum(squares - total**2 / np.maximum(count, 1.0), 0.0)
    variance = (2.0 * (LEAST_DEVIATION * spacing) ** 2 + scatter) / (2.0 + np.maximum(count - 1.0, 0.0))
    gain = count * np.maximum(0.5 * np.log(spacing**2 / np.maximum(variance, EXACT**2)), 0.0)
    return np.asarray(np.where(total > 0.0, gain, 0.0))


def of_witnesses(gain: Floats) -> Floats:
    """Sum of what the best witnesses of each marker tell [nats], from `explained`, shape (..., n_markers)."""
    return np.asarray(np.sort(gain, axis=-1)[..., -WITNESSES:].sum(axis=-1))


def merge_likely(record: DistanceRecord) -> Ints:
    """Merge the tracklets of a record while there is evidence, first by rigid distances alone, then by all.

    Returns the tracklet that each one became part of, shape (n,). The record changes.
    """
    n_tracklets = len(record.count)
    group = np.arange(n_tracklets)
    for counts_loose in (False, True):
        _merge(record, group, counts_loose)
    return group


def _merge(record: DistanceRecord, group: Ints, counts_loose: bool) -> None:
    """Merge while there is evidence; `group` is changed in place."""
    link = np.array([record.evidence(one, counts_loose) for one in range(len(group))]).reshape(len(group), -1)
    while len(group):
        one, other = np.unravel_index(int(np.argmax(link)), link.shape)
        if link[one, other] < EVIDENCE:
            break
        one, other = min(one, other), max(one, other)
        now = record.evidence(int(one), counts_loose)
        if now[other] < link[one, other] - STALE:  # their witnesses have changed since
            link[one] = link[:, one] = now
            continue
        record.merge(int(one), int(other))
        group[group == other] = one
        link[other] = link[:, other] = -np.inf
        link[one] = link[:, one] = record.evidence(int(one), counts_loose)


def _usual_deviations(mean: Floats, scatter: Floats, count: Floats, spacing: float) -> _Deviations:
    """The take's own deviations: about one rigid partner for each tracklet, and the median of all pairs."""
    pairs = np.triu(count >= SEEN_ENOUGH, 1)
    deviation = np.sort(np.sqrt(scatter[pairs] / (count[pairs] - 1.0)))
    if not len(deviation):
        return _Deviations(max(0.1 * spacing, EXACT), max(spacing, EXACT), max(spacing, EXACT))
    rigid = max(float(deviation[min(len(deviation) - 1, len(count))]), EXACT)
    return _Deviations(rigid, max(float(np.median(deviation)), rigid), max(spacing, EXACT))


def _witness(count: Floats, scatter: Floats, deviations: _Deviations) -> Floats:
    """How much each tracklet tells of another one's place: probability of being rigid with it, samples, steadiness."""
    freedom = np.maximum(count - 1.0, 0.0)
    rigid, loose = (_log_weight(freedom, scatter, tau, prior)[0] for tau, prior in _components(deviations))
    probability = 1.0 / (1.0 + np.exp(np.clip(loose - rigid, -50.0, 50.0)))
    after = PRIOR_SAMPLES + freedom
    deviation = np.sqrt((PRIOR_SAMPLES * deviations.rigid**2 + scatter) / after)
    weight = np.where(count > 0.0, probability, 0.0) * np.minimum(count, TRUSTED_SAMPLES)
    weight *= deviations.rigid / deviation
    if weight.ndim == 2:
        np.fill_diagonal(weight, 0.0)
    return np.asarray(weight)


def _components(deviations: _Deviations) -> tuple[tuple[float, float], tuple[float, float]]:
    """Both usual deviations [mm] with their prior probabilities."""
    return (deviations.rigid, RIGID_PRIOR), (deviations.loose, 1.0 - RIGID_PRIOR)


def _log_weight(freedom: Floats, scatter: Floats, tau: float, prior: float) -> tuple[Floats, Floats, Floats]:
    """Log probability of a scatter if the usual deviation is tau, and Student's freedom and variance after it."""
    after = PRIOR_SAMPLES + freedom
    variance = (PRIOR_SAMPLES * tau**2 + scatter) / after
    weight = np.log(prior) + gammaln(after / 2) - gammaln(PRIOR_SAMPLES / 2)
    weight = weight + PRIOR_SAMPLES / 2 * np.log(PRIOR_SAMPLES * tau**2) - after / 2 * np.log(after * variance)
    return weight, after, variance


def _log_ratio(measured: _Compared, deviations: _Deviations, counts_loose: bool) -> tuple[Floats, Floats]:
    """Evidence of each distance: log likelihood of one marker over two; and the probability that it is rigid."""
    (first, second), found = measured.counts, []
    scatter = measured.scatters[0] + measured.scatters[1]
    for tau, prior in _components(deviations):
        weight, freedom, variance = _log_weight(first + second - 2.0, scatter, tau, prior)
        narrow = variance * (1.0 / first + 1.0 / second)
        if measured.is_slow:
            own, other = (
                variance - part / count for part, count in zip(measured.scatters, measured.counts, strict=True)
            )
            narrow = np.maximum(variance / first, own) + np.maximum(variance / second, other)
            freedom = np.minimum(freedom, SLOW_FREEDOM)
        near, far = (
            weight + (-0.5 * np.log(width) - (freedom + 1.0) / 2 * np.log1p(measured.difference**2 / (freedom * width)))
            for width in (narrow, narrow + deviations.spacing**2)
        )
        found.append((weight, near, far))
    (rigid, near, far), (loose, loosely_near, loosely_far) = found
    same = np.logaddexp(near, loosely_near if counts_loose else loosely_far)
    probability = 1.0 / (1.0 + np.exp(np.clip(loose - rigid, -50.0, 50.0)))
    return np.asarray(same - np.logaddexp(far, loosely_far)), probability
