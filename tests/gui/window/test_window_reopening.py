"""What the window showed comes back: from its project file, and from unsaved work after a kill."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.recovery import RecoveryEntry

from skelgen.app.project_file.archive import open_project
from skelgen.model.corrections import Correction


def turned(qtbot, window):
    """Turn the view by keys, hide the floor, and return where the viewer stands."""
    qtbot.keyClick(window.view3d, Qt.Key.Key_Left, Qt.KeyboardModifier.ControlModifier)
    window.view3d.commands.switches["floor"].trigger()
    return window.view3d.viewpoint


def test_camera_and_switches_are_saved_with_the_project(qtbot, window, person, computed, rods, tmp_path):
    viewpoint = turned(qtbot, window)
    person.saves_as(tmp_path / "rods.skelgen")
    person.opens(rods)
    window.view3d.commands.switches["floor"].setChecked(True)
    window.view3d.look_from_top()
    person.opens(tmp_path / "rods.skelgen")
    assert window.view3d.viewpoint == viewpoint
    assert not window.view3d.shown.floor


def test_unsaved_work_after_a_kill_knows_its_file_view_and_undo(qtbot, window, person, computed, rods, tmp_path):
    path = tmp_path / "rods.skelgen"
    person.saves_as(path)
    limb = int(np.flatnonzero(computed.topology.parents >= 0)[0])
    name = computed.trajectories.names[int(computed.limbs.markers_of(limb)[0])]
    window.corrections.apply(Correction("root", (name,)))
    person.waits(lambda: bool(window.session.project.corrections) and window.session.project.has("skeleton"))
    viewpoint = turned(qtbot, window)
    window.autosave.save()
    window.autosave.wait()
    (note,) = (tmp_path / "recovery").glob("*/note.json")
    kept = tmp_path / "kept"
    note.parent.rename(kept)  # as a killed window leaves it
    window.session.saved(path, window.session.project)
    person.opens(rods)
    window.files.restore(RecoveryEntry(kept, "rods", path, datetime(2026, 1, 1)))
    person.waits(lambda: window.session.path == path)
    assert window.session.is_dirty
    assert window.view3d.viewpoint == viewpoint
    person.does("undo")
    person.waits(lambda: window.session.project.has("skeleton"))
    assert window.session.project.corrections == ()
    np.testing.assert_array_equal(window.session.project.topology.parents, computed.topology.parents)
    person.does("save")
    person.waits(lambda: not window.session.is_dirty)
    assert open_project(path).corrections == ()


def test_saving_is_said_and_dialogs_begin_beside_the_project(window, person, computed, tmp_path, monkeypatch):
    person.saves_as(tmp_path / "rods.skelgen")
    assert window.status.currentMessage() == f"Saved: {tmp_path / 'rods.skelgen'}"
    places = []
    for name in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QFileDialog, name, lambda *args: (places.append(args[2]), ("", ""))[1])
    for command in ("open", "save_as", "load_parameters", "save_parameters"):
        person.does(command)
    assert len(places) == 4
    assert all(place.startswith(str(tmp_path)) for place in places)


def test_exports_turn_as_the_view_has_it(window, person, computed):
    page = window.pages.page("export")
    page.choice.setCurrentIndex(next(row for row, one in enumerate(page.formats) if one.name == "gltf"))

    def axes(up):
        window.view3d.set_shown(replace(window.view3d.shown, up=up))
        window.pages.page("open")
        window.pages.page("export")
        return page.form.values()["axes"]

    assert [axes(2), axes(1), axes(0)] == ["z-to-y", "as-recorded", "auto"]
    page.form.rows["axes"].show_value("y-to-z")  # by hand: stays
    assert axes(2) == "y-to-z"


def test_fit_finds_a_marker_that_is_unseen_and_the_whole_skeleton(qtbot, window, make_project):
    project = make_project(parents=(-1, 0, 1), n_frames=12)
    window.document.open(project)
    assert np.isnan(project.trajectories.positions[0, 0]).any()
    window.session.select(Selection(frozenset({0})))
    qtbot.keyClick(window.view3d, Qt.Key.Key_F)
    assert np.isfinite(window.view3d.viewpoint.target).all()
    window.session.select(Selection())
    qtbot.keyClick(window.view3d, Qt.Key.Key_F, Qt.KeyboardModifier.ShiftModifier)
    size = window.view3d.width(), window.view3d.height()
    for frame in range(12):
        places, _ = window.view3d.viewpoint.project(project.motion.joint_positions[frame], *size)
        assert ((places > 0) & (places < size)).all()
