"""Jobs run off the window's thread, tell of progress, are cancelled, and deliver on the window's thread."""

from __future__ import annotations

import threading
import time

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from skelgen_gui.project.jobs import Jobs, StatusLine

from skelgen.errors import InputError

WAIT = 5000  # ms


@pytest.fixture
def jobs(qtbot):
    jobs = Jobs()
    yield jobs
    assert jobs.stop()


def test_the_result_arrives_on_the_windows_thread(jobs, qtbot):
    arrived = []
    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        jobs.start(
            "work", lambda monitor: threading.get_ident(), lambda it: arrived.append((it, threading.get_ident()))
        )
    qtbot.waitUntil(lambda: bool(arrived), timeout=WAIT)
    worker, receiver = arrived[0]
    assert worker != receiver == threading.get_ident()


def test_progress_and_notices_are_told(jobs, qtbot):
    told = []
    jobs.progressed.connect(lambda name, share: told.append((name, share)))
    jobs.noticed.connect(told.append)

    def work(monitor):
        monitor.begin("counting")
        monitor.notice("mind the gap")
        monitor.advance(4, 4)

    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        jobs.start("work", work, lambda _: None)
    assert told == [("counting", 0.0), "mind the gap", ("counting", 1.0)]


def test_a_cancelled_job_delivers_nothing(jobs, qtbot):
    delivered, begun = [], threading.Event()

    def work(monitor):
        while True:
            monitor.advance(0, 1)
            begun.set()

    jobs.start("work", work, delivered.append, delivered.append)
    assert begun.wait(WAIT / 1000)
    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        jobs.cancel()
    assert delivered == []


def test_an_error_is_told_and_the_next_job_runs(jobs, qtbot):
    errors, results = [], []

    def fail(monitor):
        raise InputError("no markers")

    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        jobs.start("work", fail, results.append, errors.append)
    qtbot.waitUntil(lambda: bool(errors), timeout=WAIT)
    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        assert jobs.start("work", lambda monitor: 7, results.append)
    qtbot.waitUntil(lambda: results == [7], timeout=WAIT)
    assert str(errors[0]) == "no markers"


def test_a_second_job_is_refused_while_one_runs(jobs, qtbot):
    release = threading.Event()
    jobs.start("first", lambda monitor: release.wait(WAIT / 1000), lambda _: None)
    assert not jobs.start("second", lambda monitor: 1, lambda _: None)
    with qtbot.waitSignal(jobs.ended, timeout=WAIT):
        release.set()


def test_jobs_that_nobody_holds_any_more_end_after_their_work(qtbot):
    for _ in range(5):
        jobs = Jobs()
        jobs.start("work", lambda monitor: time.sleep(0.02), lambda _: None)
        qtbot.waitUntil(lambda jobs=jobs: not jobs.is_busy, timeout=WAIT)
        del jobs
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


def test_a_step_that_is_called_like_its_job_is_said_once(jobs, qtbot):
    line = StatusLine(jobs)
    qtbot.addWidget(line)
    jobs.begun.emit("Capturing")
    jobs.progressed.emit("Capturing", 0.0)
    assert line.currentMessage() == "Capturing"
    jobs.progressed.emit("Loading", 0.0)
    assert line.currentMessage() == "Capturing · Loading"
