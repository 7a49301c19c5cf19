"""How sure labels are, as a value: checked, read-only, and with the numbers that follow from it."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model import Labelling
from skelgen.model.labelling import Doubt, Tracklets, seen_runs

# Track 0 went to marker 1 and then to marker 0, track 1 to marker 0, track 2 to nobody.
TRACKLETS = Tracklets([0, 0, 1, 2], [1, 0, 0, -1], [0, 4, 7, 2], [3, 5, 9, 3], [4, 2, 3, 2])
DOUBT = Doubt(1, 2, 5, "rival", 0, 0.4, "the places are alike")


def confidence():
    values = np.full((10, 2), 0.95)
    values[4:, 1] = np.nan
    return values


def test_tracks_are_counted_by_where_they_went():
    assert (TRACKLETS.n_tracklets, TRACKLETS.n_parts, TRACKLETS.n_left_out, TRACKLETS.n_divided) == (3, 4, 1, 1)


def test_span_of_a_track_covers_its_parts():
    first, last = TRACKLETS.spans
    assert first.tolist() == [0, 7, 2]
    assert last.tolist() == [5, 9, 3]


def test_no_track_is_fine():
    empty = Tracklets(*np.zeros((5, 0), dtype=int))
    assert (empty.n_tracklets, empty.n_left_out, empty.n_divided) == (0, 0, 0)
    assert len(empty.spans[0]) == 0


def test_doubtful_are_only_frames_in_which_the_marker_is_seen():
    labelling = Labelling(confidence(), (DOUBT,), (), np.zeros(10, dtype=int))
    assert np.argwhere(labelling.doubtful).tolist() == [[2, 1], [3, 1]]


def test_mean_confidence_is_over_the_frames_in_which_a_marker_is_seen():
    values = confidence()
    values[:, 1] = np.nan
    labelling = Labelling(values, (), (), np.zeros(10, dtype=int))
    np.testing.assert_allclose(labelling.marker_confidence, [0.95, np.nan])


def test_runs_are_the_stretches_without_a_gap():
    seen = np.array([[1, 0], [1, 1], [0, 1], [1, 1]], dtype=bool)
    assert np.transpose(seen_runs(seen)).tolist() == [[0, 0, 1], [0, 3, 3], [1, 1, 3]]


@pytest.mark.parametrize(
    "change",
    [
        {"confidence": np.full((10, 2), 1.5)},
        {"doubts": (Doubt(2, 0, 1, "rival", 0, 0.1, ""),)},
        {"doubts": (Doubt(0, 0, 10, "rival", 1, 0.1, ""),)},
        {"twins": ((0, 2),)},
        {"left_out": np.zeros(9, dtype=int)},
        {"left_out": np.full(10, -3)},
        {"tracklets": Tracklets([0], [2], [0], [1], [2])},
    ],
    ids=["confidence", "marker", "frame", "twins", "left_out", "below 0", "tracklets"],
)
def test_parts_that_do_not_fit_are_refused(change):
    parts = {"confidence": confidence(), "doubts": (DOUBT,), "twins": (), "left_out": np.zeros(10, dtype=int)}
    with pytest.raises(InputError):
        Labelling(**parts | change)


def test_tracks_with_holes_in_their_numbers_are_refused():
    with pytest.raises(InputError, match="without holes"):
        Tracklets([0, 2], [0, 0], [0, 1], [0, 1], [1, 1])


def test_unknown_kind_of_doubt_is_refused():
    with pytest.raises(InputError, match="kinds are piece"):
        Doubt(0, 0, 1, "whim", -1, 0.5, "")
