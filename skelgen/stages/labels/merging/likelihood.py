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

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.distance_statistics import sums_of_distances
from skelgen._kernels.marker_exchanges import EXACT, EXISTENCE, LEAST_DEVIATION, explained
from skelgen._kernels.tracklet_evidence import (
    WITNESSES,
    DistanceTables,
    UsualDeviations,
    evidence_of_one,
    witness_weights,
)
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, median_of_known
from skelgen.model.arrays import Bools, Floats, Ints

STALE = 0.5
"""nats that evidence may have lost since it was computed; with more it is computed anew."""

SAMPLE_SECONDS = 0.25
"""Distances that are this far apart in time count as independent: limbs turn back and forth about once a second."""

EVIDENCE = 3.0
"""nats; tracklets are merged if one marker is this much more likely than two."""

LEAST_WITNESSES = 3
"""Fewer distances do not fix a place."""

SEEN_ENOUGH = 4
"""Samples of a distance from which its deviation is known."""


class DistanceRecord:
    """What is known of the distances between tracklets; mutable, as mergers change it.

    Parameters
    ----------
    sums : ndarray, shape (3, n, n)
        Number of samples of each distance, their sum [mm] and their sum of squares [mm^2]; symmetric. They change.
    apart : ndarray of bool, shape (n, n)
        Tracklets that cannot be one marker.
    spacing : float, mm
        How far apart markers are.
    prior : ndarray, shape (n, n), nats, optional
        Other evidence that two tracklets are one marker; symmetric.
    decides : bool
        Whether other evidence counts where distances are too few.
    """

    def __init__(
        self, sums: Floats, apart: Bools, spacing: float, prior: Floats | None = None, *, decides: bool = True
    ) -> None:
        self.count, self.total, self.squares = sums
        count = self.count
        self.apart = apart | np.eye(len(count), dtype=bool)
        self.prior = np.zeros(count.shape) if prior is None else prior
        self._decides = decides
        self.mean, self.scatter = self._moments(slice(None))
        self.deviations = _usual_deviations(self.scatter, count, spacing)
        self.witness = witness_weights(count, self.scatter, self.deviations)
        np.fill_diagonal(self.witness, 0.0)
        self._is_witness = (self.witness > 0.0).astype(np.float32)  # of which products count quickly

    def evidence(
        self, one: int, others: Ints | None = None, *, counts_loose: bool = True, is_slow: bool = False
    ) -> Floats:
        """Evidence [nats] that one tracklet is the same marker as others, shape (n_others,); -inf where it cannot be.

        Parameters
        ----------
        one : int
            The tracklet.
        others : ndarray of intp, shape (n_others,), optional
            Which others; all by default.
        counts_loose : bool
            Whether distances that are not rigid count.
        is_slow : bool
            Whether a tracklet may have been seen in one slow pose alone: what its distances did not vary by may then
            still be the error of their mean, and far distances are less surprising.
        """
        others = np.arange(len(self.count)) if others is None else others
        result = np.full(len(others), -np.inf)
        places = np.flatnonzero(~self.apart[one, others])
        if not len(places):
            return result
        prior, n_shared = self.prior[one, others], self._is_witness @ self._is_witness[one]
        speaks = self._decides & (prior != 0.0)
        places = places[(n_shared[others[places]] >= LEAST_WITNESSES) | speaks[places]]
        if not len(places):
            return result
        tables = DistanceTables(self.count, self.mean, self.scatter, self.witness)
        gain, n_distances = evidence_of_one(
            one, others[places], tables, self.deviations, counts_loose=counts_loose, is_slow=is_slow
        )
        known = (n_distances > LEAST_WITNESSES - 0.5) | speaks[places]
        result[places[known]] = (prior[places] + gain)[known]
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
        weight = witness_weights(self.count[one], scatter, self.deviations)
        weight[one] = 0.0
        for table, row in ((self.mean, mean), (self.scatter, scatter), (self.witness, weight)):
            table[one] = table[:, one] = row
        self.witness[other] = self.witness[:, other] = 0.0
        self._is_witness[one] = self._is_witness[:, one] = weight > 0.0
        self._is_witness[other] = self._is_witness[:, other] = 0.0

    def _moments(self, rows: int | slice) -> tuple[Floats, Floats]:
        """Mean distance [mm] and scatter about it [mm^2]; 0 where never seen."""
        count = np.maximum(self.count[rows], 1.0)
        mean = self.total[rows] / count
        return mean, np.maximum(self.squares[rows] - count * mean**2, 0.0)


def sample_frames(rate: float, first: int, last: int, how_often: int = 1) -> Ints:
    """Return frames from `first` to before `last`: moments far enough apart to be independent, or several for each.

    Parameters
    ----------
    rate : float, Hz
        Frame rate.
    first, last : int
        Frames.
    how_often : int
        At most so many frames for each independent moment.
    """
    step = -(-max(1, int(SAMPLE_SECONDS * rate)) // how_often)
    return np.arange(first + min(step, last - first) // 2, last, step)


def distance_sums(positions: Floats, weights: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """Number, sum [mm] and sum of squares [mm^2] of the distances between markers, each of shape (n, n).

    Parameters
    ----------
    positions : ndarray, shape (n_moments, n, 3), mm
        Markers or tracklets at independent moments, NaN where unseen.
    weights : ndarray, shape (n_moments,), optional
        How much each moment counts; 1 if left out.
    """
    moment, marker = np.nonzero(~np.isnan(positions[:, :, 0]))
    starts = np.searchsorted(moment, np.arange(len(positions) + 1))
    weights = np.ones(len(positions)) if weights is None else weights
    sums = sums_of_distances(positions.shape[1], *contiguous(positions[moment, marker], marker, starts, weights))
    return sums[0], sums[1], sums[2]


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


def evidence_of_places(places: Floats, weights: Floats, spacing: float) -> float:
    """How well markers explain the points [nats], by where they are; those that are never seen do not count.

    Parameters
    ----------
    places : ndarray, shape (n_moments, n_markers, 3), mm
        Markers at independent moments, NaN where unseen.
    weights : ndarray, shape (n_moments,)
        How much each moment counts.
    spacing : float, mm
        How far apart markers are.
    """
    seen = ~np.isnan(places[..., 0]).all(axis=0)
    return evidence_of_labels(np.stack(distance_sums(places[:, seen], weights)), spacing)[0]


def robust_laws(lengths: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Return usual distances and their deviations, which a short exchange of markers does not change [mm].

    Parameters
    ----------
    lengths : ndarray, shape (n_pairs, n_moments), mm
        Distances, NaN where unseen; those of pairs that are never seen together have no usual value (NaN).
    spacing : float, mm
        How far apart markers are.
    """
    usual = median_of_known(lengths.T)
    spread = median_of_known(np.abs(lengths - usual[:, np.newaxis]).T)
    return usual, np.maximum(SIGMA_OF_MEDIAN * spread, LEAST_DEVIATION * spacing)


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
    link = _links(record, counts_loose)
    while len(group):
        one, other = sorted(int(index) for index in np.unravel_index(int(np.argmax(link)), link.shape))
        if link[one, other] < EVIDENCE:
            break
        now = float(record.evidence(one, np.array([other]), counts_loose=counts_loose)[0])
        if now >= link[one, other] - STALE:  # else their witnesses have changed since
            record.merge(one, other)
            group[group == other] = one
            link[other] = link[:, other] = -np.inf
        link[one] = link[:, one] = record.evidence(one, counts_loose=counts_loose)


def _links(record: DistanceRecord, counts_loose: bool) -> Floats:
    """Evidence [nats] that each two tracklets are one marker, shape (n, n); symmetric."""
    n_tracklets = len(record.count)
    link = np.full((n_tracklets, n_tracklets), -np.inf)
    for one in range(n_tracklets):
        later = np.arange(one + 1, n_tracklets)
        link[one, later] = link[later, one] = record.evidence(one, later, counts_loose=counts_loose)
    return link


def _usual_deviations(scatter: Floats, count: Floats, spacing: float) -> UsualDeviations:
    """The take's own deviations: about one rigid partner for each tracklet, and the median of all pairs."""
    pairs = np.triu(count >= SEEN_ENOUGH, 1)
    deviation = np.sort(np.sqrt(scatter[pairs] / (count[pairs] - 1.0)))
    if not len(deviation):
        return UsualDeviations(max(0.1 * spacing, EXACT), max(spacing, EXACT), max(spacing, EXACT))
    rigid = max(float(deviation[min(len(deviation) - 1, len(count))]), EXACT)
    return UsualDeviations(rigid, max(float(np.median(deviation)), rigid), max(spacing, EXACT))
