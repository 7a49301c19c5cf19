"""Fixtures of the whole window's tests: a window, and a person who uses it."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QFileDialog, QMessageBox
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.widgets.errors import ErrorDialog
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.window import Window

import skelgen
from skelgen.model import Trajectories
from skelgen.simulation import simulate

WAIT = 180_000  # ms; all stages of a small take need a few seconds, and a minute where their loops must be compiled


class Person:
    """Uses a window: wishes, and waits until it is done."""

    def __init__(self, qtbot, window, monkeypatch):
        self._qtbot, self._window, self._monkeypatch = qtbot, window, monkeypatch

    def waits(self, is_done=lambda: True):
        """Until nothing is computed and derived, and something holds."""

        def is_idle():  # pages are made when they are first shown, with what they derive
            return not self._window.jobs.is_busy and not any(one.is_busy for one in self._window.findChildren(Deriver))

        self._qtbot.waitUntil(lambda: is_done() and is_idle(), timeout=WAIT)

    def does(self, command):
        """Choose a command from the menu."""
        self._window.actions_by_id[command].trigger()

    def opens(self, path):
        with self._qtbot.waitSignal(self._window.files.opened, timeout=WAIT):
            self._window.open(path)
        self.waits()

    def runs_all(self):
        self.does("run_all")
        self.waits(lambda: self._window.session.project.has("skeleton"))

    def chooses(self, path):
        """Say where to, when asked for a file."""
        self._monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args: (str(path), ""))

    def saves_as(self, path):
        self.chooses(path)
        self.does("save_as")
        self.waits(lambda: not self._window.session.is_dirty)

    def answers(self, button):
        """Say something to the next questions."""
        self._monkeypatch.setattr(QMessageBox, "question", lambda *args, **kwargs: button)

    def is_told(self):
        """Wait for an error, close its dialog, and return its sentence."""
        self._qtbot.waitUntil(lambda: self._window.findChild(ErrorDialog) is not None, timeout=WAIT)
        dialog = self._window.findChild(ErrorDialog)
        sentence = dialog.sentence.text()
        dialog.reject()
        return sentence


@pytest.fixture
def window(qtbot, tmp_path):
    """A window with preferences of its own, shown; no thread is left when it has closed."""
    before = threads()
    preferences = Preferences(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))
    window = Window(preferences, recovery=tmp_path / "recovery")
    qtbot.addWidget(window, before_close_func=_end)
    with qtbot.waitExposed(window):
        window.show()
    yield window
    qtbot.waitUntil(lambda: threads() <= before, timeout=WAIT)


def threads():
    """Python's threads; those of Qt, which `Jobs` ends, are known to Python under this type only."""
    return {thread for thread in threading.enumerate() if not isinstance(thread, threading._DummyThread)}


def _end(window):
    """Close without a question, which nobody is there to answer."""
    assert window.jobs.stop()
    if window.session.project is not None:
        window.session.saved(Path("nowhere.skelgen"), window.session.project)


@pytest.fixture
def person(qtbot, window, monkeypatch):
    return Person(qtbot, window, monkeypatch)


@pytest.fixture
def active(qtbot, window):
    """The window, and the keys going to it."""
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    return window


@pytest.fixture
def computed(window, person, rods):
    """The project of three rods in the window: all stages have run, and nothing of it is saved."""
    person.opens(rods)
    person.runs_all()
    return window.session.project


@pytest.fixture
def rods(tmp_path):
    """A labelled recording of three rods."""
    path = tmp_path / "rods.c3d"
    skelgen.write(simulate("rods", n_frames=120, noise=0.2).take, path)
    return path


@pytest.fixture(scope="session")
def gapped():
    """A human with five markers on the head, one of which has a gap of 40 frames."""
    take = simulate("human", n_frames=400, noise=0.3).take
    first, second, third = (take.positions[:, take.names.index(f"head {number}")] for number in (1, 2, 3))
    more = [(first + second) / 2 + weight * (third - first) for weight in (0.3, 0.7)]
    positions = np.concatenate([take.positions, np.stack(more, axis=1)], axis=1)
    positions[150:190, take.names.index("head 1")] = np.nan
    return skelgen.reconstruct(Trajectories(positions, (*take.names, "head 4", "head 5"), take.rate))
