"""Which pairs of balls are accepted: those whose tracks fit whenever both are there."""

from __future__ import annotations

import numpy as np

from skelgen.capture.markers.candidates import CandidateStore
from skelgen.capture.markers.correspondences import find_markers, track_pairs
from skelgen.capture.values import StereoPoints

NOISE, STEP = 0.1, 1 / 60


def candidates(frames):
    """A store of frames, each a list of (left track, right track, misfit)."""
    store = CandidateStore()
    for frame in frames:
        left, right = ([row[side] for row in frame] for side in (0, 1))
        n = len(frame)
        misfit = np.array([row[2] for row in frame], float)
        indices = np.arange(n)
        shared = np.zeros(n, dtype=bool)
        points = StereoPoints(np.ones((n, 3)), np.tile(np.eye(3), (n, 1, 1)), indices, indices, misfit, shared)
        store.add(points, np.array(left, dtype=int), np.array(right, dtype=int))
    return store.all()


def decided(found, left, right):
    return find_markers(found, track_pairs(found, left, right), NOISE, STEP)


def test_of_two_partners_the_one_that_fits_all_the_time_is_believed():
    frames = [[(0, 0, 0.05), *([(0, 1, 0.0)] if 4 <= frame < 8 else [])] for frame in range(12)]
    found = candidates(frames)
    kept = decided(found, ([0], [11]), ([0, 0], [11, 11]))
    assert (kept == (found.right == 0)).all()


def test_who_has_a_partner_gets_no_other_while_that_one_is_hidden():
    """Right ball 0 is hidden from frame 8 on; left ball 0 then fits right ball 1, which was there all the time."""
    frames = [[(0, 0, 0.05)] for _ in range(8)] + [[(0, 1, 0.05)] for _ in range(2)]
    found = candidates(frames)
    kept = decided(found, ([0], [9]), ([0, 0], [7, 9]))
    assert kept.tolist() == [True] * 8 + [False] * 2


def test_a_partner_that_was_lost_and_found_again_is_believed_in_both_parts():
    frames = [[(0, 0, 0.05)]] * 5 + [[]] * 2 + [[(0, 1, 0.05)]] * 5
    kept = decided(candidates(frames), ([0], [11]), ([0, 7], [4, 11]))
    assert kept.all()


def test_pairs_that_fit_seldom_are_not_believed():
    found = candidates([[(0, 0, 0.3)]] * 2 + [[]] * 18 + [[(1, 1, 0.1)]] * 10)
    kept = decided(found, ([0, 20], [19, 29]), ([0, 20], [19, 29]))
    assert kept.tolist() == [False] * 2 + [True] * 10


def test_a_calibration_that_is_off_counts_for_all_pairs_alike():
    frames = [[(0, 0, 0.5), (1, 1, 0.5), (0, 1, 0.05 * abs(frame - 30))] for frame in range(60)]
    found = candidates(frames)
    spans = ([0, 0], [59, 59])
    assert (decided(found, spans, spans) == (found.left == found.right)).all()


def test_without_pairs_nothing_is_chosen():
    assert decided(candidates([[], []]), ([], []), ([], [])).tolist() == []
