"""What an exchange of two markers gains: the evidence of all distances, computed anew with the markers exchanged."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skelgen._kernels.marker_exchanges import (
    EXISTENCE,
    LEAST_DEVIATION,
    MarkerDistances,
    explained,
    of_witnesses,
    weigh_exchanges,
)
from skelgen._kernels.marker_pauses import MOST_PAUSES, NO_LINKS, Links, Pauses
from skelgen._kernels.tracklet_evidence import WITNESSES

SPACING, N_MARKERS, STEP = 60.0, 9, 10  # mm; frames between two moments
ROUNDING = 1e-6  # nats; sums of squares of distances of this size


def lengths_of(places):
    """Distances at each moment, shape (n_moments, n_markers, n_markers); NaN where unseen."""
    return np.linalg.norm(places[:, :, np.newaxis] - places[:, np.newaxis], axis=3)


def evidence_of(places):
    """What the best witnesses of all markers tell, less what they cost [nats]: the formulas, written with NumPy."""
    lengths = lengths_of(places)
    count = (~np.isnan(lengths)).sum(axis=0)
    scatter = np.nan_to_num(np.nanvar(np.where(count > 0, lengths, 0.0), axis=0)) * count
    variance = (2 * (LEAST_DEVIATION * SPACING) ** 2 + scatter) / (2 + np.maximum(count - 1, 0))
    gain = count * np.maximum(0.5 * np.log(SPACING**2 / variance), 0.0)
    np.fill_diagonal(gain, 0.0)
    told = np.sort(gain, axis=1)[:, -WITNESSES:].sum()
    return told - EXISTENCE * (count.diagonal() > 0).sum()


def distances_of(places, misfits):
    lengths = lengths_of(places)
    samples = np.moveaxis(np.stack([~np.isnan(lengths), *np.nan_to_num([lengths, lengths**2])]), (0, 1), (2, 3))
    before = np.concatenate([np.zeros((*samples.shape[:3], 1)), samples.cumsum(axis=3)], axis=3)
    gains = explained(np.moveaxis(before[..., -1], 2, 0), SPACING)
    return MarkerDistances(before, misfits, gains, of_witnesses(gains), SPACING)


def pauses_of(pauses, n_moments):
    """From pairs of each marker's last frames and first ones after them."""
    n_frames = n_moments * STEP
    parts = [np.array([(-1, 0), *own, (n_frames - 1, n_frames)]) for own in pauses]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    last, following = np.concatenate(parts).T.copy()
    part = np.full(len(last), -1)  # no gap says anything
    return Pauses(starts, last, following, np.arange(n_moments) * STEP + STEP // 2, part, NO_LINKS)


@pytest.fixture(params=range(4))
def case(request):
    """Markers of a limb with noise, two of which are another one's for a while, others unseen at times."""
    rng = np.random.default_rng(request.param)
    places = rng.uniform(0, 150, (N_MARKERS, 3)) + rng.normal(0, 0.8, (24, N_MARKERS, 3))
    places[8:16, [1, 4]] = places[8:16, [4, 1]]
    places[rng.uniform(size=(24, N_MARKERS)) < 0.15] = np.nan
    return places, rng.normal(0, 2, (N_MARKERS, N_MARKERS, 24))


def test_the_gain_is_how_much_the_evidence_of_the_take_grows(case):
    places, misfits = case
    common = [(75, 80), (120, 130), (155, 160)]
    pairs = np.stack(np.triu_indices(N_MARKERS, 1), axis=1)
    pauses = pauses_of([common] * N_MARKERS, 24)
    gain, spans = weigh_exchanges(pairs, distances_of(places, misfits), pauses, np.zeros((len(pairs), 24)))
    assert np.isfinite(gain).sum() > 5
    for row in np.flatnonzero(np.isfinite(gain)):
        first, end, begin, behind = spans[row]
        changed = places.copy()
        changed[first:end, pairs[row]] = changed[first:end, pairs[row][::-1]]
        assert gain[row] == pytest.approx(evidence_of(changed) - evidence_of(places), abs=ROUNDING)
        assert (begin, behind) in {(80, 130), (80, 160), (130, 160), (80, 240), (130, 240), (160, 240)}
        assert (first, end) == tuple(np.searchsorted(np.arange(24) * STEP + STEP // 2, (begin, behind)))


def linked(pauses, rng):
    """The pauses with parts between them, and what gaps say of any two parts, by a table."""
    is_last = np.zeros(len(pauses.last), dtype=bool)
    is_last[pauses.starts[1:] - 1] = True
    begin, end = pauses.following[~is_last], pauses.last[np.flatnonzero(~is_last) + 1]
    part = np.where(is_last, -1, np.cumsum(~is_last) - 1)
    order = np.argsort(begin, kind="stable")
    low = np.searchsorted(begin[order], end, side="right")
    behind = np.concatenate([[0], np.cumsum(len(begin) - low)])
    evidence = rng.normal(0.0, 6.0, behind[-1])
    table = np.zeros((len(begin), len(begin)))
    for one in range(len(begin)):
        table[one, order[low[one] :]] = evidence[behind[one] : behind[one + 1]]
    links = Links(begin, np.argsort(order, kind="stable"), np.stack([low, behind[:-1], behind[1:]]), evidence)
    return pauses._replace(part=part, links=links), table, begin


def gaps_of(parts, table):
    """What the gaps of some markers say [nats]."""
    return sum(table[before, after] for own in parts for before, after in itertools.pairwise(own))


def test_links_between_parts_add_what_they_tell(case):
    """Some markers are not seen between two pauses of others, so that they are linked over several of these."""
    places, misfits = case
    common = [(75, 80), (120, 130), (155, 160)]
    own = [common if marker % 3 else [(75, 130), (155, 160)] for marker in range(N_MARKERS)]
    places[8:13, ::3] = np.nan
    pairs = np.stack(np.triu_indices(N_MARKERS, 1), axis=1)
    pauses, table, begin = linked(pauses_of(own, 24), np.random.default_rng(5))
    distances, sides = distances_of(places, misfits), np.zeros((len(pairs), 24))
    gain, spans = weigh_exchanges(pairs, distances, pauses, sides)
    n_parts = [len(pauses.part[slice(*ends)]) - 1 for ends in itertools.pairwise(pauses.starts)]
    parts = np.split(np.arange(len(begin)), np.cumsum(n_parts)[:-1])
    assert np.isfinite(gain).sum() > 5
    for row in np.flatnonzero(np.isfinite(gain)):
        first, end, *frames = spans[row]
        changed = places.copy()
        changed[first:end, pairs[row]] = changed[first:end, pairs[row][::-1]]
        one, other = (parts[marker] for marker in pairs[row])
        moved = [(begin[own] >= frames[0]) & (begin[own] < frames[1]) for own in (one, other)]
        new = [
            np.sort(np.append(own[~out], their[come]))
            for own, out, their, come in ((one, moved[0], other, moved[1]), (other, moved[1], one, moved[0]))
        ]
        new = [own[np.argsort(begin[own], kind="stable")] for own in new]
        expected = evidence_of(changed) - evidence_of(places) + gaps_of(new, table) - gaps_of([one, other], table)
        assert gain[row] == pytest.approx(expected, abs=ROUNDING)


def test_markers_that_were_exchanged_are_found_between_their_pauses(case):
    places, misfits = case
    misfits[:] = 0.0
    for marker in (1, 4):
        misfits[marker, marker, 8:16] = 5.0
    pauses = pauses_of([[(79, 80), (159, 160)] if marker in (1, 4) else [] for marker in range(N_MARKERS)], 24)
    gain, spans = weigh_exchanges(np.array([[1, 4], [1, 5]]), distances_of(places, misfits), pauses, np.zeros((2, 24)))
    np.testing.assert_array_equal(spans[0], (8, 16, 80, 160))
    assert gain[0] > 50.0
    assert gain[1] == -np.inf


@pytest.mark.parametrize("most", [0, 1], ids=["inside", "outside"])
def test_sides_that_speak_for_an_exchange_add_what_they_tell(case, most):
    """Where most of the take is exchanged, what lies outside is what changes."""
    places, misfits = case
    misfits[:] = 0.0
    pauses = pauses_of([[(79, 80), (159, 160)] for _ in range(N_MARKERS)], 24)
    inside = (np.arange(24) // 8 == 1) != most
    sides = np.where(inside, 5.0, -5.0)[np.newaxis]
    pair, distances = np.array([[1, 4]]), distances_of(places, misfits)
    gain, spans = weigh_exchanges(pair, distances, pauses, sides)
    surer, _ = weigh_exchanges(pair, distances, pauses, 3.0 * sides)
    np.testing.assert_array_equal(spans[0], (8, 16, 80, 160))
    assert surer[0] - gain[0] == pytest.approx(2.0 * sides[:, inside].sum())


def test_a_marker_that_takes_up_where_another_one_ends_is_one_fewer():
    places = np.random.default_rng(0).uniform(0, 150, (6, 3)) + np.zeros((24, 6, 3))
    places[:, 5] = places[:, 0]
    places[10:, 0] = places[:10, 5] = np.nan
    misfits = np.zeros((6, 6, 24))
    misfits[5, 5] = 10.0
    pauses = pauses_of([[(95, 240)], [], [], [], [], [(-1, 100)]], 24)
    gain, spans = weigh_exchanges(np.array([[0, 5]]), distances_of(places, misfits), pauses, np.zeros((1, 24)))
    np.testing.assert_array_equal(spans[0], (10, 24, 100, 240))
    assert gain[0] > EXISTENCE


def test_of_more_pauses_the_longest_ones_count():
    n_moments = 4 * MOST_PAUSES
    rng = np.random.default_rng(0)
    places = np.array([[0, 0, 0], [60, 0, 0], [10, 90, 0], [0, 30, 50]]) + rng.normal(0, 0.5, (n_moments, 4, 3))
    half = n_moments // 2
    places[half:, [0, 1]] = places[half:, [1, 0]]
    frames = np.arange(1, n_moments) * STEP
    common = [(frame - 2 - 5 * (frame == half * STEP), frame) for frame in frames.tolist()]
    distances, pauses = distances_of(places, np.zeros((4, 4, n_moments))), pauses_of([common] * 4, n_moments)
    gain, spans = weigh_exchanges(np.array([[0, 1]]), distances, pauses, np.zeros((1, n_moments)))
    assert spans[0, 0] == half
    assert gain[0] > 50.0


def test_distances_that_vary_as_much_as_markers_are_apart_explain_nothing():
    sums = np.array([[5.0, 0.0, 5.0], [500.0, 0.0, 500.0], [50_000.0, 0.0, 50_000.0 + 4 * SPACING**2 * 2]])
    assert explained(sums, SPACING)[0] > 0.0
    np.testing.assert_array_equal(explained(sums, SPACING)[1:], 0.0)
