"""Make the pictures of the window's page from the running window: ``python docs/make_pictures.py [recording]``.

Without a display: ``QT_QPA_PLATFORM=offscreen python docs/make_pictures.py``. The recording is a simulated human by
default, so that anybody gets the same pictures.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path

from PySide6.QtCore import QEvent, QSettings
from PySide6.QtWidgets import QApplication, QDockWidget
from skelgen_formats.capture_settings import write_settings
from skelgen_gui.capture.page import CapturePage
from skelgen_gui.model.selection import Selection
from skelgen_gui.widgets.painting import Theme, prepare_high_dpi
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.window import Window

import skelgen
from skelgen.capture.reference_rig import reference_rig
from skelgen.model.rig import CaptureSettings
from skelgen.simulation import simulate

FOLDER = Path(__file__).parent / "pictures"
SIZE = (1280, 800)
SETTLE_SECONDS = 1.0  # views derive lanes and curves on threads
MOST_SECONDS = 300.0
N_VIEWS = 15
FAULTS = {"n_frames": 1000, "noise": 0.5, "soft_tissue": 1.0, "n_cameras": 8, "ghosts": 0.2, "labelled": False}


def main() -> None:
    """Open a recording, run all, and save a picture of each view."""
    prepare_high_dpi()
    app = QApplication([])
    with tempfile.TemporaryDirectory() as folder:
        preferences = Preferences(QSettings(str(Path(folder) / "settings.ini"), QSettings.Format.IniFormat))
        theme = Theme(app, preferences)
        theme.apply()
        window = Window(preferences, recovery=Path(folder) / "recovery")
        window.resize(*SIZE)
        window.show()
        window.reset_layout()
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else recording(Path(folder))
        window.open(path)
        wait(app, lambda: window.session.project is not None and not window.jobs.is_busy)
        window.commands.run_all()
        wait(app, lambda: not window.jobs.is_busy and window.session.project.has("skeleton"))
        FOLDER.mkdir(exist_ok=True)
        take_pictures(app, window)
        take_capture_pictures(app, window)
        window.files.close = lambda then: then()
        window.close()
        settle(app)


def recording(folder: Path) -> Path:
    """Simulate a human whose points have no names."""
    path = folder / "human.mfml"
    skelgen.write(simulate("human", **FAULTS).take, path)
    return path


def take_pictures(app: QApplication, window: Window) -> None:
    """Save a picture of every view."""
    window.session.show_frame(window.session.n_frames // 3)
    window.session.select(Selection(joint=0))
    window.view3d.fit()
    for name, page, tab in (("window", "skeleton", 0), ("distances", "limbs", 1), ("joints", "joints", 2)):
        window.pages.page(page)
        window.tabs.setCurrentIndex(tab)
        save(app, window, name)
    window.tabs.setCurrentIndex(0)
    docks = {dock.objectName(): dock for dock in window.findChildren(QDockWidget)}
    window.pages.page("export").target.folder_line.setText("results")  # not this machine's folder
    docks["curves"].raise_()
    save(app, window, "export")
    docks["timeline"].raise_()
    window.view3d.commands.switches["four"].trigger()
    save(app, window, "four-views")
    window.view3d.commands.switches["four"].trigger()
    window.pages.page("labels")
    window.session.select(Selection(frozenset({0, 1})))
    save(app, window, "labels")
    window.actions_by_id["labelling"].trigger()
    window.session.select(Selection(frozenset({0})))
    save(app, window, "labelling")
    docks["marker_curves"].raise_()
    settle(app)
    window.marker_curves.tools.table.selectRow(5)
    window.marker_curves.tools.way.setCurrentIndex(2)
    save(app, window, "marker-curves")
    docks["timeline"].raise_()


def take_capture_pictures(app: QApplication, window: Window) -> None:
    """Save pictures of the Capture page: the simulated rig after two seconds, and each step of the calibration."""
    page = window.pages.page("capture")
    shots: list[object] = []
    page.live.shot.connect(shots.append)
    page.live.recorder.line.setText("take.mfml")
    page.live.choice.simulated.click()
    wait(app, lambda: len(shots) > 2 * 30)
    save(app, window, "capture")
    page.live.stop()
    wait(app, lambda: not window.jobs.is_busy)
    shots.clear()
    page.live.choice.room.click()
    wait(app, lambda: len(shots) > 2 * 30)
    save(app, window, "capture-room")
    page.live.stop()
    wait(app, lambda: not window.jobs.is_busy)
    page.tabs.setCurrentWidget(page.camera_step)
    page.camera_step.form.source.show_source(f"simulated:board?rate=4&frames={4 * N_VIEWS}")
    page.camera_step.start()
    wait(app, lambda: not window.jobs.is_busy)
    page.camera_step.run_calibration()
    wait(app, lambda: page.camera_step.found is not None)
    save(app, window, "calibration")
    with tempfile.TemporaryDirectory() as folder, chdir(folder):  # pictures show no folder of this machine
        take_target_pictures(app, window, page)


def take_target_pictures(app: QApplication, window: Window, page: CapturePage) -> None:
    """Save pictures of a target and of joints that are calibrated on the simulated rig."""
    path = Path("rig.xml")
    write_settings(CaptureSettings(reference_rig()), path)
    page.target.form.settings.show_path(str(path))
    page.tabs.setCurrentWidget(page.target)
    for name in ("torso", "upper arm", "lower arm"):
        page.target.form.name.setText(name)
        page.target.form.take_source(f"simulated:target?rate=15&frames=150&show={name}")
        wait(app, lambda: page.target.found is not None and not window.jobs.is_busy)
        if name == "upper arm":
            save(app, window, "target")
        page.target.add.click()
        wait(app, lambda: not window.jobs.is_busy)
    page.tabs.setCurrentWidget(page.joints)
    requests = page.joints.requests
    wait(app, lambda: requests.parent_box.count() == 3)
    for name, parent, child in (("shoulder", "torso", "upper arm"), ("elbow", "upper arm", "lower arm")):
        requests.name.setText(name)
        requests.parent_box.setCurrentText(parent)
        requests.child_box.setCurrentText(child)
        requests.more.click()
    page.joints.form.take_source("simulated:arm?rate=20&frames=300")
    wait(app, lambda: page.joints.found is not None and not window.jobs.is_busy)
    save(app, window, "joint-calibration")


def save(app: QApplication, window: Window, name: str) -> None:
    """Save one picture."""
    settle(app)
    window.grab().save(str(FOLDER / f"{name}.png"))


def settle(app: QApplication) -> None:
    """Let the views finish what they derive."""
    end = time.monotonic() + SETTLE_SECONDS
    wait(app, lambda: time.monotonic() > end)


def wait(app: QApplication, is_so: Callable[[], bool]) -> None:
    """Let the window live until something is so."""
    end = time.monotonic() + MOST_SECONDS
    while not is_so():
        if time.monotonic() > end:
            raise SystemExit("the window did not finish in time")
        app.processEvents()
        app.sendPostedEvents(None, QEvent.Type.DeferredDelete)  # only a loop of Qt's own takes away what is given up
        time.sleep(0.005)


if __name__ == "__main__":
    main()
