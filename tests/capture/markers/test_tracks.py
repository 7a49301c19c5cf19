"""Balls followed in one image: tracks hold one ball each, and end where that would be a guess."""

from __future__ import annotations

import numpy as np

from skelgen.capture.ball_tracks import BallTracks

SIZE = (640, 480)


def followed(places, times=None):
    """Tracks of balls at places of shape (n_frames, n_balls, 2), in a new order in every frame."""
    rng, tracks = np.random.default_rng(1), BallTracks(SIZE)
    found = np.empty(places.shape[:2], dtype=int)
    for frame, centres in enumerate(places):
        order = rng.permutation(len(centres))
        found[frame, order] = tracks.follow(centres[order], frame / 60 if times is None else times[frame])
    return found, tracks


def moving(n_frames, starts, speeds):
    """Balls in even motion; speeds in px a frame."""
    return np.array(starts, float) + np.arange(n_frames)[:, np.newaxis, np.newaxis] * np.array(speeds, float)


def test_balls_apart_are_followed_whatever_their_order():
    found, tracks = followed(moving(30, [[10, 10], [100, 50], [300, 200]], [[3, 1], [4, 0], [2, 2]]))
    assert (found == found[0]).all()
    assert tracks.first == [0, 0, 0] and tracks.last == [29, 29, 29]


def test_fast_balls_are_followed_once_their_speed_is_known():
    found, _ = followed(moving(20, [[10, 10], [10, 70]], [[18, 5], [18, 5]]))
    assert (found == found[0]).all()


def test_no_track_holds_two_balls_that_cross():
    places = moving(41, [[100, 100], [220, 101]], [[3, 0], [-3, 0]])
    found, _ = followed(places + np.random.default_rng(0).normal(size=places.shape))
    assert not set(found[:, 0]) & set(found[:, 1])


def test_nothing_is_followed_over_a_long_pause():
    places = moving(6, [[100, 100]], [[0, 0]])
    short, _ = followed(places, [0, 1, 2, 5, 6, 7])
    long, _ = followed(places, [0, 1, 2, 9, 10, 11])
    assert short[:, 0].tolist() == [0] * 6
    assert long[:, 0].tolist() == [0, 0, 0, 1, 1, 1]


def test_an_image_without_balls_ends_all_tracks():
    tracks = BallTracks(SIZE)
    places = np.array([[50.0, 60.0]])
    numbers = [tracks.follow(centres, time) for time, centres in enumerate([places, places[:0], places])]
    assert [found.tolist() for found in numbers] == [[0], [], [1]]
    assert (tracks.first, tracks.last) == ([0, 2], [0, 2])
