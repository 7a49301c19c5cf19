"""What a job hands over to the window, and how images carry what was found in them."""

from __future__ import annotations

import threading
import time

import numpy as np

from skelgen.app.capture_jobs.images import CameraImage
from skelgen.app.capture_jobs.messages import INTERVAL, Feed
from skelgen.capture.values import Balls, FoundBody

BLACK = np.zeros((480, 640), np.uint8)


def test_only_the_newest_result_is_handed_over_and_no_notice_is_lost():
    announced = []
    feed = Feed(lambda: announced.append(True))
    for number in range(50):
        feed.put(number)
        feed.notice(str(number))
    newest, notices = feed.take()
    assert announced == [True]
    assert newest == 49
    assert notices == tuple(map(str, range(50)))
    assert feed.take() == (None, ())


def test_results_of_another_thread_are_announced_once_until_they_are_taken():
    announced = []
    feed = Feed(lambda: announced.append(True))
    thread = threading.Thread(target=lambda: [feed.put(number) for number in range(10_000)])
    thread.start()
    thread.join()
    assert len(announced) == 1


def test_a_feed_waits_again_after_its_interval():
    feed = Feed(lambda: None)
    assert feed.is_waiting
    before = time.monotonic()
    feed.put(1)
    feed.take()
    assert not feed.is_waiting or time.monotonic() - before >= INTERVAL
    time.sleep(INTERVAL)
    assert feed.is_waiting


def test_balls_of_a_body_are_in_its_group_and_named():
    balls = Balls(np.array([(10.0, 20), (30, 40), (50, 60)]), *(np.ones(3) for _ in range(3)), np.zeros(3, bool))
    body = FoundBody("wand", np.eye(4), np.eye(6), np.array([1, -1, 0]), 0.1)
    image = CameraImage.of_balls(BLACK, balls, {2: body}, np.array([2, 0]))
    assert image.groups.tolist() == [2, -1, 2]
    assert image.labels[0].text == "wand"
    assert (image.labels[0].x, image.labels[0].y) == (30.0, 20.0)
