"""What is derived in the background is handed over in the window's thread, the last wish only."""

from __future__ import annotations

import threading
import time

from PySide6.QtWidgets import QWidget
from shiboken6 import Shiboken
from skelgen_gui.project.deriving import Deriver


def test_the_result_is_handed_over_in_the_window_s_thread(qtbot):
    deriver, told = Deriver(), []
    with qtbot.waitSignal(deriver.finished):
        deriver.derive(threading.get_ident, lambda thread: told.append((thread, threading.get_ident())))
    assert told[0][0] != told[0][1] == threading.get_ident()
    assert not deriver.is_busy


def test_only_the_last_wish_is_handed_over(qtbot):
    deriver, told, gate = Deriver(), [], threading.Event()
    began = threading.Event()
    deriver.derive(lambda: (began.set(), gate.wait()), told.append)
    qtbot.waitUntil(began.is_set)
    deriver.derive(lambda: "second", told.append)
    with qtbot.waitSignal(deriver.finished):
        deriver.derive(lambda: "third", told.append)
        gate.set()
    deriver.wait()
    qtbot.wait(10)
    assert told == ["third"]


def test_nothing_begins_before_the_window_has_done_what_it_is_at(qtbot):
    deriver, began = Deriver(), threading.Event()
    deriver.derive(began.set, lambda _: None)
    assert not began.wait(0.05)
    qtbot.waitUntil(began.is_set)


def test_what_is_forgotten_is_not_handed_over(qtbot):
    deriver, told = Deriver(), []
    deriver.derive(lambda: 1, told.append)
    deriver.forget()
    deriver.wait()
    qtbot.wait(10)
    assert told == []
    assert not deriver.is_busy


def test_a_deriver_that_is_deleted_does_not_wait_and_hands_over_nothing(qtbot):
    deriver, told = Deriver(), []
    started, gate = threading.Event(), threading.Event()

    def slow() -> bool:
        started.set()
        return gate.wait()

    deriver.derive(slow, told.append)
    qtbot.waitUntil(started.is_set)
    Shiboken.delete(deriver)
    assert not gate.is_set()
    gate.set()
    qtbot.wait(10)
    assert told == []


def test_an_error_is_raised_in_the_window_s_thread(qtbot):
    deriver, told = Deriver(), []
    with qtbot.capture_exceptions() as errors:
        deriver.derive(lambda: 1 / 0, told.append)
        qtbot.waitUntil(lambda: not deriver.is_busy)
    assert [error[0] for error in errors] == [ZeroDivisionError]
    assert told == []


def test_a_widget_that_goes_while_its_result_is_handed_over_does_no_harm(qtbot):
    """Thirty times, as the moment has to be met: the program would end."""
    for number in range(30):
        widget = QWidget()
        deriver = Deriver(widget)
        started, may_end = threading.Event(), threading.Event()

        def work(started=started, may_end=may_end):
            started.set()
            may_end.wait(5)

        deriver.derive(work, lambda _: None)
        qtbot.waitUntil(started.is_set)
        may_end.set()
        if number % 2:
            time.sleep(0.0005)
        Shiboken.delete(widget)
        deriver.wait()
    qtbot.wait(20)
