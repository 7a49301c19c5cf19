"""An error is one sentence; where it came from is behind a button and can be copied."""

from __future__ import annotations

import sys
import threading

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QWidget
from skelgen_gui.widgets.errors import ErrorDialog, ErrorReporter, details_of, sentence_of, show_error

from skelgen.errors import WriteError


def raised(error):
    try:
        raise error
    except type(error) as caught:
        return caught


@pytest.fixture
def dialog(qtbot):
    dialog = ErrorDialog(raised(WriteError("walk.bvh: cannot be written: No space left on device")))
    qtbot.addWidget(dialog)
    dialog.show()
    return dialog


@pytest.fixture
def reporter(qtbot, monkeypatch):
    """A reporter that is installed over hooks which stay silent, and its window."""
    monkeypatch.setattr(sys, "excepthook", lambda *facts: None)
    monkeypatch.setattr(threading, "excepthook", lambda facts: None)
    window = QWidget()
    qtbot.addWidget(window)
    reporter = ErrorReporter(window)
    reporter.install()
    yield reporter
    reporter.uninstall()


def open_dialogs(window):
    return [dialog for dialog in window.findChildren(ErrorDialog) if dialog.isVisible()]


def test_the_sentence_of_a_users_error_is_its_own():
    assert sentence_of(WriteError("a: no rights")) == "a: no rights"


def test_a_fault_of_the_program_is_said_in_one_line():
    sentence = sentence_of(ValueError("shapes (3,)\nand (4,)"))
    assert sentence.startswith("The program has a fault (ValueError: shapes (3,) and (4,)). ")
    assert "\n" not in sentence


def test_details_name_the_place_and_the_versions():
    text = details_of(raised(WriteError("a: no rights")))
    assert all(
        word in text for word in ("a: no rights", "test_errors.py", "skelgen ", "Python 3", "PySide6 6", "numpy")
    )


def test_the_sentence_is_shown_and_the_details_wait(qtbot, dialog):
    assert dialog.sentence.text() == "walk.bvh: cannot be written: No space left on device"
    assert not dialog.details.isVisible()
    qtbot.mouseClick(dialog.toggle, Qt.MouseButton.LeftButton)
    assert dialog.details.isVisible()
    assert "Traceback" in dialog.details.toPlainText()


def test_details_are_copied(qtbot, dialog):
    qtbot.mouseClick(dialog.copy, Qt.MouseButton.LeftButton)
    assert QApplication.clipboard().text() == dialog.details.toPlainText()


def test_a_sentence_with_markup_is_shown_as_it_is(qtbot):
    dialog = show_error(None, WriteError("<b>walk</b>: no rights"))
    qtbot.addWidget(dialog)
    assert dialog.sentence.textFormat() == Qt.TextFormat.PlainText


def test_an_exception_that_nobody_caught_is_shown(qtbot, reporter):
    error = raised(ZeroDivisionError("division by zero"))
    sys.excepthook(type(error), error, error.__traceback__)
    qtbot.waitUntil(lambda: len(open_dialogs(reporter.parent())) == 1)
    assert "division by zero" in open_dialogs(reporter.parent())[0].sentence.text()


def test_an_exception_of_another_thread_is_shown(qtbot, reporter):
    thread = threading.Thread(target=lambda: 1 / 0)
    thread.start()
    thread.join()
    qtbot.waitUntil(lambda: len(open_dialogs(reporter.parent())) == 1)


def test_more_exceptions_are_counted_and_not_piled_up(qtbot, reporter):
    for _ in range(3):
        reporter.report(raised(ValueError("again")))
    (dialog,) = open_dialogs(reporter.parent())
    assert dialog.more.text() == "More errors since then: 2"
    dialog.close()
    reporter.report(raised(ValueError("later")))
    qtbot.waitUntil(lambda: len(open_dialogs(reporter.parent())) == 1)


def test_an_interruption_is_no_error(qtbot, reporter):
    sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    QApplication.processEvents()
    assert open_dialogs(reporter.parent()) == []
