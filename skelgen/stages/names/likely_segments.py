"""Which segment of a person each limb is, by how far limbs are from each other and which of them are joined.

The distance between the middles of two limbs in statures, and how much it changes, are those of a thigh and a shank, or
of a hand and a foot: normal distributions of their logarithms, learned from simulated people in all marker sets by
``tests/benchmarks/learn_names.py``. The segments of all limbs are those that make all pairs together likeliest, found
by beam searches in each of some statures: limb by limb outward from the one with most markers, as a limb is told best
by those that it is joined to, and by their numbers of markers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from skelgen.files import read_table
from skelgen.geometry.statistics import pair_lengths
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.names.moving_tree import MovingTree

TRUNK = ("pelvis", "chest", "head")
CHAINS = (("upper arm", "forearm", "hand"), ("thigh", "shank", "foot", "toes"))
STIFF_ARM = "arm"  # a limb with markers at elbow and wrist, without another on the upper arm
_ON_SIDES = (*(segment for chain in CHAINS for segment in chain), STIFF_ARM)
LABELS = (*((segment, -1) for segment in TRUNK), *((segment, side) for side in (0, 1) for segment in _ON_SIDES))
"""What a limb may be: a segment, and its side, 0 or 1, or -1 of those in the middle."""

NOISE, SMALLEST = 8.0, 5.0  # mm: what is added to ranges of distances, and to sizes, before their logarithms
_OUTLIERS = 0.04  # of the pairs are as any pair, and of the sizes as any size
_LEAST_JOINED = 0.005
_JOINED = {"neighbours": 0.75, "pieces": 0.7, "feet": 0.15, "beyond": 0.06}
"""How often limbs are joined in the trees that are found; the rest as `_LEAST_JOINED`."""

_PIECE = 1.5  # log odds against another limb of the same segment
_GAP, _UNEVEN = 1.0, 1.5
"""Against a segment whose neighbour towards the trunk has no limb, and against one that is on one side alone."""

_STATURES = np.geomspace(0.7, 1.45, 13)  # times the one that the median distance tells
_MEDIAN_DISTANCE = 0.38  # statures
_FEW, _MANY = 40, 200  # states of the beam, to find the stature and then the segments


class OfSet(NamedTuple):
    """What a limb is by the marker set whose shape its markers have.

    Attributes
    ----------
    segment : str
        Without its side.
    side : int
        0 or 1, of which nobody knows which is left, or -1 of segments in the middle.
    odds : float
        Log odds for it.
    """

    segment: str
    side: int
    odds: float


@dataclass(frozen=True, eq=False)
class Likely:
    """The likeliest segments of limbs.

    Attributes
    ----------
    labels : tuple of int, length n_limbs
        Indices into `LABELS`.
    odds : float
        Log odds of a pair, in the mean, to be those of a person rather than any two limbs.
    """

    labels: tuple[int, ...]
    odds: float


def pair_features(centres: Floats) -> Floats:
    """Return logarithms of the distances of limbs and of their ranges, shape (n_limbs, n_limbs, 2).

    Parameters
    ----------
    centres : ndarray, shape (n_frames, n_limbs, 3), mm
        Middles of the limbs' markers.
    """
    n_limbs = centres.shape[1]
    one, other = np.triu_indices(n_limbs)
    low, middle, high = np.percentile(pair_lengths(centres, one, other), [5.0, 50.0, 95.0], axis=1)
    features = np.empty((n_limbs, n_limbs, 2))
    features[one, other] = np.log(np.stack([np.maximum(middle, 1.0), (high - low) / 2 + NOISE], axis=-1))
    features[other, one] = features[one, other]
    return features


def size_of(markers: Floats) -> float:
    """Return the root mean square distance of a limb's markers from their middle [mm].

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        All of the limb.
    """
    apart = markers - markers.mean(axis=1, keepdims=True)
    return float(np.sqrt(np.median((apart**2).sum(axis=2).mean(axis=1))))


def relation(first: int, second: int) -> str:
    """Return what two labels are to each other, the key of the table: ``foot, shank, same``.

    Parameters
    ----------
    first, second : int
        Indices into `LABELS`.
    """
    (one, side), (other, other_side) = LABELS[first], LABELS[second]
    how = [] if min(side, other_side) < 0 else ["same" if side == other_side else "other"]
    return ", ".join([*sorted((one, other)), *how])


def likely_segments(tree: MovingTree, worn: Mapping[int, OfSet] | None = None, tables: Tables | None = None) -> Likely:
    """Return the segments of a person that the limbs of a tree are most likely.

    Parameters
    ----------
    tree : MovingTree
        With two limbs and more.
    worn : mapping of int to OfSet, optional
        What limbs are by the marker set whose shape their markers have, which pairs of limbs may outweigh.
    tables : Tables, optional
        What is learned of people; that of the package, if none is given.
    """
    centres = np.stack([tree.centres[limb] for limb in tree.limbs], axis=1)
    features = pair_features(centres)
    sizes = [size_of(tree.markers[limb]) if tree.markers[limb].shape[1] > 1 else np.nan for limb in tree.limbs]
    joined = np.array([[other in tree.neighbours[limb] for other in tree.limbs] for limb in tree.limbs])
    n_markers = np.array([tree.markers[limb].shape[1] for limb in tree.limbs])
    orders = _outward(joined, n_markers), np.argsort(-n_markers, kind="stable")
    n_limbs = len(tree.limbs)
    stature = np.exp(np.median(features[..., 0][np.triu_indices(n_limbs, 1)])) / _MEDIAN_DISTANCE
    tables = tables or learned_tables()
    of_set = np.array([[_odds_by_set(label, (worn or {}).get(limb)) for label in LABELS] for limb in tree.limbs])
    one, other = np.triu_indices(n_limbs, 1)
    pairs = np.zeros((n_limbs, n_limbs, len(LABELS), len(LABELS)))

    def searched(size: int, width: int) -> tuple[float, Ints]:
        tall = stature * _STATURES[size]
        pairs[one, other] = tables.pairs(features[one, other] - np.log(tall), joined[one, other])
        pairs[other, one] = pairs[one, other]  # which limb is which label of a pair makes no difference
        of_limbs = tables.limbs(sizes, tall) + of_set
        return max((_search(pairs, of_limbs, order, width) for order in orders), key=itemgetter(0))

    rough = {size: searched(size, _FEW)[0] for size in range(0, len(_STATURES), 2)}
    best = max(rough, key=rough.__getitem__)
    rough |= {size: searched(size, _FEW)[0] for size in (best - 1, best + 1) if 0 <= size < len(_STATURES)}
    score, labels = searched(max(rough, key=rough.__getitem__), _MANY)
    return Likely(tuple(labels.tolist()), score / max(n_limbs * (n_limbs - 1) / 2, 1))


def _outward(joined: Bools, n_markers: Ints) -> Ints:
    """Order limbs from that with most markers to its neighbours, to theirs, and so on; those that none reaches last."""
    order = [int(n_markers.argmax())]
    for limb in order:
        order += [near for near in np.flatnonzero(joined[limb]).tolist() if near not in order]
    return np.array(order + [limb for limb in range(len(n_markers)) if limb not in order], dtype=np.intp)


def _odds_by_set(label: tuple[str, int], of_set: OfSet | None) -> float:
    """Log odds of a label by a marker set; a stiff arm is called a forearm."""
    segment = CHAINS[0][1] if label[0] == STIFF_ARM else label[0]
    return of_set.odds if of_set is not None and (segment, label[1]) == (of_set.segment, of_set.side) else 0.0


def _search(pairs: Floats, limbs: Floats, order: Ints, width: int) -> tuple[float, Ints]:
    """The best labels of all limbs, shape (n_limbs,), and their log odds, by a beam search limb by limb."""
    states, scores = np.zeros((1, 0), dtype=np.intp), np.zeros(1)
    for done, limb in enumerate(order):
        gain = limbs[limb] + pairs[order[:done], limb][np.arange(done), states].sum(axis=1)
        total = (scores[:, np.newaxis] + gain).ravel()
        kept = _largest(total, width)
        states = np.column_stack([states[kept // len(LABELS)], kept % len(LABELS)])
        scores = total[kept]
    scores = scores - _odd(states)
    best = int(np.argmax(scores))
    labels = np.empty(len(order), dtype=np.intp)
    labels[order] = states[best]
    return float(scores[best]), labels


def _largest(values: Floats, n_wanted: int) -> Ints:
    """Indices of the largest values, falling; the first of equal ones."""
    if len(values) > n_wanted:
        enough = np.flatnonzero(values >= np.partition(values, -n_wanted)[-n_wanted])
        return np.asarray(enough[np.argsort(-values[enough], kind="stable")[:n_wanted]])
    return np.argsort(-values, kind="stable")


def _odd(states: Ints) -> Floats:
    """Log odds against segments beyond one that has no limb, and against those on one side alone, shape (n_states,)."""
    present = (states[:, :, np.newaxis] == np.arange(len(LABELS))).any(axis=1)
    found = np.zeros(len(states))
    for side in (0, 1):
        arm, *whole = (LABELS.index((segment, side)) for segment in (STIFF_ARM, *CHAINS[0][:2]))
        found += _GAP * (present[:, arm] & present[:, whole].any(axis=1))
        present[:, whole] |= present[:, [arm]]
    for chain in CHAINS:
        first, second = (present[:, [LABELS.index((segment, side)) for segment in chain]] for side in (0, 1))
        found += _UNEVEN * (first != second).sum(axis=1)
        for has in (first, second):
            found += _GAP * (has[:, 1:] & ~has[:, :-1]).sum(axis=1)
    return found


@dataclass(frozen=True, eq=False)
class Tables:
    """What pairs of limbs of each relation, and limbs of each label, are like.

    Attributes
    ----------
    relation_of_pair : ndarray of intp, shape (n_labels, n_labels)
        Relation of each pair of labels, see `relation`; the same in either order.
    means : ndarray, shape (n_relations, 2)
        Of the features of a pair.
    precisions : ndarray, shape (n_relations, 2, 2)
        Inverse covariances.
    log_volumes : ndarray, shape (n_relations,)
        Logarithms of the roots of the determinants of the covariances.
    joined : ndarray, shape (n_relations,)
        How often two limbs are joined.
    alike : ndarray, shape (n_relations,)
        Log odds against two limbs of one label.
    any_pair : ndarray, shape (2, 2)
        Means and deviations of the features of any pair.
    of_segments : ndarray, shape (n_labels, 3)
        Mean and deviation of the size, logarithm of how many limbs are one.
    """

    relation_of_pair: Ints
    means: Floats
    precisions: Floats
    log_volumes: Floats
    joined: Floats
    alike: Floats
    any_pair: Floats
    of_segments: Floats

    def pairs(self, features: Floats, joined: Bools) -> Floats:
        """Log odds of pairs of limbs to be each pair of labels, shape (n_pairs, n_labels, n_labels).

        Parameters
        ----------
        features : ndarray, shape (n_pairs, 2)
            See `pair_features`; the logarithm of the stature is subtracted.
        joined : ndarray of bool, shape (n_pairs,)
            Whether there is a joint between both limbs.
        """
        far, ranges = np.moveaxis(features[:, np.newaxis] - self.means, -1, 0)
        squares = self.precisions[:, 0, 0] * far**2 + self.precisions[:, 1, 1] * ranges**2
        squares += 2.0 * self.precisions[:, 0, 1] * far * ranges
        of_any = -0.5 * (((features - self.any_pair[0]) / self.any_pair[1]) ** 2).sum(axis=-1)
        of_any = (of_any - np.log(self.any_pair[1]).sum())[:, np.newaxis]
        odds = np.logaddexp(-0.5 * squares - self.log_volumes, of_any + np.log(_OUTLIERS)) - of_any
        odds += np.where(joined[:, np.newaxis], np.log(self.joined), np.log(1.0 - self.joined))
        return np.asarray((odds - self.alike)[:, self.relation_of_pair])

    def limbs(self, sizes: Sequence[float], stature: float) -> Floats:
        """Return the log likelihood of each limb by its size and by how often there is one, shape (n_limbs, n_labels).

        Parameters
        ----------
        sizes : sequence of float, mm
            How far the markers of each limb are apart; NaN for one marker.
        stature : float, mm
            What lengths are compared with.
        """
        mean, deviation, often = self.of_segments.T
        size = np.array(sizes)[:, np.newaxis]
        off = np.nan_to_num((np.log((size + SMALLEST) / stature) - mean) / deviation)
        likely = np.logaddexp(-0.5 * off**2, np.log(_OUTLIERS)) - np.log(deviation)
        return np.asarray(np.where(np.isnan(size), 0.0, likely) + often)


@cache
def learned_tables() -> Tables:
    """Return the package's table."""
    return tables_of(read_table(__file__, "distances"))


def tables_of(rows: Mapping[str, Mapping[str, Sequence[float]]]) -> Tables:
    """Return the distributions of all labels from the rows of the table: of `pairs`, of `segments`, of `any` pair.

    Parameters
    ----------
    rows : mapping
        For each relation the means of both features, their variances and their covariance; for each segment the mean
        and the deviation of its size, and the logarithm of how many limbs are one; for any pair means and deviations.
    """
    numbers = range(len(LABELS))
    relations = sorted({relation(one, other) for one in numbers for other in numbers})
    same = {relation(one, one) for one in numbers}
    values = np.array([rows["pairs"][pair] for pair in relations], dtype=np.float64)
    covariances = values[:, [2, 4, 4, 3]].reshape(-1, 2, 2)
    return Tables(
        np.array([[relations.index(relation(one, other)) for other in numbers] for one in numbers]),
        values[:, :2],
        np.asarray(np.linalg.inv(covariances)),
        0.5 * np.log(np.linalg.det(covariances)),
        np.array([_joined(pair) for pair in relations]),
        np.array([_PIECE if pair in same else 0.0 for pair in relations]),
        np.array([rows["any"]["mean"], rows["any"]["deviation"]]),
        np.array([rows["segments"][segment] for segment, _ in LABELS]),
    )


def _joined(pair: str) -> float:
    """How often limbs of two labels are joined."""
    one, other, *side = pair.split(", ")
    lines = [TRUNK, ("chest", *CHAINS[0]), ("chest", STIFF_ARM, "hand"), ("pelvis", *CHAINS[1])]
    if side == ["other"]:
        return {("foot", "foot"): _JOINED["feet"]}.get((one, other), _LEAST_JOINED)
    if one == other:
        return _JOINED["pieces"]
    steps = [abs(line.index(one) - line.index(other)) for line in lines if one in line and other in line]
    return {1: _JOINED["neighbours"], 2: _JOINED["beyond"]}.get(min(steps, default=0), _LEAST_JOINED)
