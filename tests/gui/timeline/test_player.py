"""Playing follows the clock: no drift, no slowing down, ranges and loops kept."""

from __future__ import annotations

import statistics
import time

import pytest
from skelgen_gui.timeline.player import Player

RATE = 100.0  # Hz, of `walked`
LATE = 5.0  # frames that pass at most between the player's look at the clock and the test's, unless the machine is busy


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now = 5.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def player(session, clock):
    return Player(session, clock=clock)


def after(player, clock, seconds):
    """The frame that a player shows some seconds later, when it ticks only then."""
    clock.now += seconds
    player._timer.timeout.emit()
    return player._session.frame


def test_at_every_moment_the_frame_is_that_of_the_clock(session, qtbot):
    player, told = Player(session), []
    started = time.monotonic()
    session.frame_changed.connect(lambda frame: told.append(frame - RATE * (time.monotonic() - started)))
    player.play()
    qtbot.waitUntil(lambda: session.frame >= RATE, timeout=5000)
    assert statistics.median(abs(difference) for difference in told) <= LATE


def test_late_ticks_leave_out_frames_and_do_not_slow_down(player, clock, session):
    player.play()
    assert [after(player, clock, seconds) for seconds in (0.3, 0.004, 0.006, 1.5)] == [30, 30, 31, 181]


def test_a_thousand_ticks_do_not_drift(player, clock):
    player.play()
    frames = [after(player, clock, 0.0035) for _ in range(1000)]
    assert frames[-1] == 350


def test_speeds_multiply_and_a_change_does_not_jump(player, clock):
    player.play()
    after(player, clock, 1.0)
    player.set_speed(0.1)
    assert after(player, clock, 1.0) == 110
    player.set_speed(4.0)
    assert after(player, clock, 0.1) == 150


def test_speeds_beyond_the_bounds_are_the_bounds(player):
    player.set_speed(100.0)
    assert player.speed == 4.0
    player.set_speed(0.0)
    assert player.speed == 0.1


def test_without_loop_it_stops_at_the_end_of_the_range(player, clock, session, qtbot):
    player.set_range(50, 60)
    player.play()
    with qtbot.waitSignal(player.playing_changed):
        assert after(player, clock, 9.0) == 60
    assert not player.is_playing


def test_a_loop_begins_again_at_the_first_frame_of_the_range(player, clock):
    player.set_range(50, 59)
    player.set_loop(True)
    player.play()
    assert [after(player, clock, seconds) for seconds in (0.09, 0.01, 0.25)] == [59, 50, 55]
    assert player.is_playing


def test_outside_the_range_playing_starts_at_its_first_frame(player, session):
    player.set_range(50, 60)
    session.show_frame(300)
    player.play()
    assert session.frame == 50


def test_a_frame_chosen_while_playing_is_where_it_goes_on(player, clock, session):
    player.play()
    after(player, clock, 0.5)
    session.show_frame(200)
    assert after(player, clock, 0.1) == 210


def test_stepping_pauses_and_stays_in_the_take(player, session):
    player.play()
    player.step(-1)
    assert (player.is_playing, session.frame) == (False, 0)
    player.step(10_000)
    assert session.frame == session.n_frames - 1


def test_ranges_are_sorted_and_brought_into_the_take(player, session):
    player.set_range(10_000, -5)
    assert player.range == (0, session.n_frames - 1)
    player.set_range(70, 30)
    assert player.range == (30, 70)


def test_another_take_is_stopped_and_played_whole(player, session, small_project):
    player.set_range(50, 60)
    player.play()
    session.open(small_project)
    assert (player.is_playing, player.range) == (False, (0, small_project.take.n_frames - 1))


def test_another_result_of_the_same_take_keeps_the_range(player, session, walked):
    player.set_range(50, 60)
    session.change(walked[0])
    assert player.range == (50, 60)


def test_nothing_is_played_without_a_take(qtbot):
    from skelgen_gui.project.session import Session

    player = Player(Session())
    player.play()
    assert not player.is_playing
