"""Unsaved work survives a window that dies, and is gone after a clean end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from datetime import datetime

import pytest
from PySide6.QtCore import QSettings
from skelgen_gui.project.recovery import Autosave, RecoveryEntry, find_recovery_entries
from skelgen_gui.widgets.preferences import Preferences

CHILD = """
    import sys, time
    from pathlib import Path
    from PySide6.QtCore import QCoreApplication, QSettings
    from skelgen.simulation import simulate
    from skelgen.model import Project
    from skelgen_gui.widgets.preferences import Preferences
    from skelgen_gui.project.recovery import Autosave
    from skelgen_gui.project.session import Session

    app = QCoreApplication([])
    session = Session()
    session.open(Project(simulate("rods", n_frames=30).take))
    autosave = Autosave(session, Preferences(QSettings(sys.argv[2], QSettings.Format.IniFormat)), Path(sys.argv[1]))
    autosave.save()
    autosave.wait()
    print("kept", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def preferences(tmp_path):
    return Preferences(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))


def test_work_of_a_killed_window_is_found_and_restored(tmp_path):
    arguments = [sys.executable, "-c", textwrap.dedent(CHILD), str(tmp_path / "kept"), str(tmp_path / "settings.ini")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stdout.readline() == "kept\n"
        assert find_recovery_entries(tmp_path / "kept") == ()  # it is alive
        child.send_signal(signal.SIGKILL)
    (remains,) = find_recovery_entries(tmp_path / "kept")
    assert remains.project().take.n_frames == 30
    remains.forget()
    assert find_recovery_entries(tmp_path / "kept") == ()


def test_a_clean_end_leaves_nothing(session, preferences, tmp_path):
    autosave = Autosave(session, preferences, tmp_path / "kept")
    autosave.save()
    autosave.end()
    assert not any((tmp_path / "kept").rglob("*.skelgen"))


def test_what_is_saved_is_not_kept_again(session, preferences, tmp_path):
    session.saved(tmp_path / "walk.skelgen", session.project)
    autosave = Autosave(session, preferences, tmp_path / "kept")
    autosave.save()
    autosave.wait()
    assert not (tmp_path / "kept").exists()
    autosave.end()


def test_a_broken_note_is_passed_over(tmp_path):
    folder = tmp_path / "kept" / "1-2"
    folder.mkdir(parents=True)
    for text in ("", "{}", json.dumps({"name": "a", "path": "", "time": "noon", "process": 1})):
        (folder / "note.json").write_text(text)
        assert find_recovery_entries(tmp_path / "kept") == ()


def test_what_was_restored_is_removed_once_it_is_kept_anew(qtbot, session, preferences, tmp_path):
    old = tmp_path / "kept" / "old"
    old.mkdir(parents=True)
    autosave = Autosave(session, preferences, tmp_path / "kept")
    autosave.take_over(RecoveryEntry(old, "walk", None, datetime.now()))
    autosave.wait()
    qtbot.waitUntil(lambda: not old.exists())
    assert len(list((tmp_path / "kept").rglob("*.skelgen"))) == 1


def test_what_was_restored_stays_while_it_cannot_be_kept(qtbot, session, preferences, tmp_path, full_disk):
    old = tmp_path / "kept" / "old"
    old.mkdir(parents=True)
    autosave = Autosave(session, preferences, tmp_path / "kept")
    with full_disk(5000), qtbot.waitSignal(autosave.failed):
        autosave.take_over(RecoveryEntry(old, "walk", None, datetime.now()))
    autosave.wait()
    assert old.exists()
    autosave.end()
    assert not old.exists()


def test_what_the_user_has_saved_is_not_kept_any_more(qtbot, session, preferences, tmp_path):
    autosave = Autosave(session, preferences, tmp_path / "kept")
    autosave.save()
    autosave.wait()
    qtbot.waitUntil(lambda: autosave._kept is not None)
    session.saved(tmp_path / "walk.skelgen", session.project)
    assert not any((tmp_path / "kept").rglob("*.skelgen"))


@pytest.mark.parametrize(
    "note",
    [
        {"process": 10**40},
        {"process": float("inf")},
        {"process": 0},
        {"process": -1},
        {"time": "0001-01-01T00:00:00"},
        {"time": "2026-01-01T00:00:00+14:00"},
        {"path": 5},
        {"name": [[1]] * 9},
    ],
)
def test_absurd_note_hinders_nothing(tmp_path, note):
    sound = {"name": "walk", "path": "", "time": "2026-01-01T00:00:00", "process": 2**22 + 1}  # above any process
    for folder, content in (("a", sound), ("b", sound | note)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "note.json").write_text(json.dumps(content))
        (tmp_path / folder / "project.skelgen").write_text("")
    assert "walk" in [entry.name for entry in find_recovery_entries(tmp_path)]
