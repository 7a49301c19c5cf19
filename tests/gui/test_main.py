"""The real process, as `skelgen gui FILE` and `skelgen-gui` start it: opens, tells of broken files, ends cleanly."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings
from skelgen_gui import main as start
from skelgen_gui.project.recovery import find_recovery_entries
from skelgen_gui.widgets.preferences import Preferences

import skelgen
from skelgen._kernels import sources_digest
from skelgen.simulation import simulate

ROOT = Path(__file__).parents[2]
WAIT = 120  # s; a loaded machine starts a window in a few
WATCHED = """
    import sys
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication, QMessageBox
    from skelgen_gui import main
    from skelgen_gui.widgets.errors import ErrorDialog
    from skelgen_gui.window import Window

    COMMAND = sys.argv.pop(1)

    class Watched(QApplication):
        def exec(self):
            self.timer = QTimer(self, interval=20)
            self.timer.timeout.connect(self.look)
            self.timer.start()
            return super().exec()

        def look(self):
            (window,) = (one for one in self.topLevelWidgets() if isinstance(one, Window))
            dialog, project = window.findChild(ErrorDialog), window.session.project
            if window.jobs.is_busy:
                return
            if dialog is not None:
                print("told:", dialog.sentence.text(), flush=True)
                dialog.reject()
            elif project is not None and COMMAND == "run" and not project.has("skeleton"):
                window.commands.run_all()
                return
            elif project is not None:
                window.autosave.save()
                window.autosave.wait()
                print("opened:", project.take.n_frames, *project.reports, flush=True)
            elif COMMAND != "empty":
                return
            else:
                print("shown:", window.isVisible(), flush=True)
            self.timer.stop()
            if COMMAND == "restore":
                print("asked:", *asked, flush=True)
                QMessageBox.question = lambda *_: QMessageBox.StandardButton.Discard
            if COMMAND != "run":
                window.close()

    asked = []
    QMessageBox.question = lambda parent, title, text, *_: asked.append(text) or QMessageBox.StandardButton.Yes
    main.QApplication = Watched
    sys.exit(main.main(sys.argv[1:]))
"""


@pytest.fixture
def environment(tmp_path):
    """That of a user who has never started the window, without a display."""
    home = {name: str(tmp_path / "home") for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME")}
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "QT_QPA_PLATFORM": "offscreen"}
    return {name: value for name, value in os.environ.items() if name != "DISPLAY"} | home | paths


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "rods.c3d"
    skelgen.write(simulate("rods", n_frames=60, noise=0.2).take, path)
    return path


@pytest.fixture
def watched(environment):
    """Start the window, let it be looked at, and return what was seen, its code, and what it complained of."""

    def run(command, *files):
        arguments = [sys.executable, "-c", textwrap.dedent(WATCHED), command, *map(str, files)]
        done = subprocess.run(arguments, capture_output=True, text=True, env=environment, timeout=WAIT, check=False)
        return done.stdout.strip(), done.returncode, done.stderr

    return run


def complaints(errors):
    """What a process complains of, besides what Qt says of every offscreen window."""
    return [line for line in errors.splitlines() if "propagateSizeHints" not in line]


@pytest.mark.parametrize("named", [{"DISPLAY": ":98761"}, {"QT_QPA_PLATFORM": "xcb"}, {"DISPLAY": "somewhere:"}])
def test_a_display_that_does_not_answer_is_none(environment, named):
    """Qt would end the program with a signal."""
    bare = {name: value for name, value in environment.items() if name not in ("QT_QPA_PLATFORM", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "skelgen", "gui"]
    done = subprocess.run(command, capture_output=True, text=True, env=bare | named, timeout=WAIT, check=False)
    assert done.returncode == 2
    assert "there is no display" in done.stderr


def test_the_window_starts_without_a_file_and_ends_cleanly(watched):
    seen, code, errors = watched("empty")
    assert (seen, code, complaints(errors)) == ("shown: True", 0, [])


def test_a_recording_on_the_command_line_is_opened(watched, recording):
    seen, code, errors = watched("open", recording)
    assert (seen, code, complaints(errors)) == ("opened: 60", 0, [])


def test_a_broken_file_on_the_command_line_is_one_sentence(watched, recording):
    recording.write_bytes(recording.read_bytes()[:700])
    seen, code, errors = watched("open", recording)
    assert seen.startswith(f"told: {recording}")
    assert (code, complaints(errors)) == (0, [])


def test_a_file_that_is_not_there_is_one_sentence(watched, tmp_path):
    seen, code, _ = watched("open", tmp_path / "nowhere.c3d")
    assert seen.startswith(f"told: {tmp_path / 'nowhere.c3d'}")
    assert code == 0


def test_the_command_starts_it_and_the_system_may_end_it(environment, recording, tmp_path):
    arguments = [sys.executable, "-m", "skelgen", "gui", str(recording)]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, env=environment) as child:
        settings = tmp_path / "home" / "skelgen" / "skelgen.conf"
        end = time.monotonic() + WAIT
        while time.monotonic() < end and not (settings.exists() and recording.name in settings.read_text()):
            time.sleep(0.05)
        child.send_signal(signal.SIGTERM)
        assert child.wait(WAIT) == 0
        assert complaints(child.stderr.read()) == []
    assert recording.name in settings.read_text()
    assert not list((tmp_path / "home").rglob("project.skelgen"))


def test_work_that_is_not_saved_is_left_to_the_next_window_when_the_system_ends_it(environment, recording, tmp_path):
    arguments = [sys.executable, "-c", textwrap.dedent(WATCHED), "run", str(recording)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stdout.readline() == "opened: 60 labels limbs joints skeleton\n"
        child.send_signal(signal.SIGTERM)
        assert child.wait(WAIT) == 0
    (folder,) = (tmp_path / "home").rglob("recovery")
    (remains,) = find_recovery_entries(folder)
    assert remains.project().has("skeleton")


def test_work_of_a_window_that_was_killed_is_offered_and_restored_by_the_next(
    watched, environment, recording, tmp_path
):
    arguments = [sys.executable, "-c", textwrap.dedent(WATCHED), "run", str(recording)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stdout.readline() == "opened: 60 labels limbs joints skeleton\n"
        child.kill()
    seen, code, errors = watched("restore")
    restored, asked = seen.splitlines()
    assert restored == "opened: 60 labels limbs joints skeleton"
    assert "rods.c3d" in asked
    assert (code, complaints(errors)) == (0, [])
    assert not list((tmp_path / "home").rglob("project.skelgen"))  # nobody is asked again


def test_the_installed_command_is_this_function():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["gui-scripts"]
    assert EntryPoint("skelgen-gui", declared["skelgen-gui"], "gui_scripts").load() is start.main


def test_the_window_starts_without_what_only_stages_need():
    code = "import sys, skelgen_gui.window; print([name for name in %r if name in sys.modules])"
    heavy = ["scipy.special", "scipy.optimize", "sklearn", "numba", "networkx", "cv2"]
    run = subprocess.run([sys.executable, "-c", code % heavy], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_nothing_is_compiled_ahead_twice(tmp_path):
    preferences = Preferences(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))
    process = start.compile_in_background(preferences)
    process.terminate()
    process.wait()
    preferences.compiled = sources_digest()
    assert start.compile_in_background(preferences) is None
