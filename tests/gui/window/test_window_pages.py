"""The list of steps and the pages: what is done is ticked, nothing jumps, nothing is cut off."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QScrollArea
from skelgen_gui.page_stack import SIZE
from skelgen_gui.pages.steps import StagePage

import skelgen
from skelgen.model.corrections import Correction
from skelgen.simulation import simulate

STAGES = ("labels", "limbs", "joints", "skeleton")


def done(window):
    """Keys of the steps that are ticked, and what is read aloud of them."""
    rows = enumerate(window.pages.entries)
    texts = {entry.key: window.pages.list.item(row).data(Qt.ItemDataRole.AccessibleTextRole) for row, entry in rows}
    return {key for key, text in texts.items() if text.endswith(": done")}


def test_steps_are_ticked_once_their_results_are_there(window, person, tmp_path):
    path = tmp_path / "rods.c3d"
    skelgen.write(simulate("rods", n_frames=240, noise=0.2).take, path)  # long enough to tell the types of both joints
    assert done(window) == set()
    person.opens(path)
    window.runner.run("limbs")
    person.waits(lambda: window.session.project.has("limbs"))
    assert done(window) == {"labels", "limbs"}
    person.runs_all()
    assert done(window) == set(STAGES)


def test_a_skeleton_with_a_joint_of_undetermined_type_has_no_plain_tick(window, person, rods):
    person.opens(rods)
    person.runs_all()
    assert "undetermined" in {joint.kind for joint in window.session.project.skeleton.joints}
    assert done(window) == {*STAGES} - {"skeleton"}


def test_a_tick_is_seen(window, person, rods):
    row = [entry.key for entry in window.pages.entries].index("labels")

    def icon():
        return window.pages.list.item(row).icon().pixmap(round(SIZE)).toImage()

    before = icon()
    person.opens(rods)
    person.runs_all()
    assert icon() != before
    places = ((x, y) for x in range(icon().width()) for y in range(icon().height()))
    colours = [icon().pixelColor(x, y) for x, y in places]
    assert any(colour.green() > colour.red() + 50 for colour in colours)  # the green disc


def test_a_step_with_doubtful_results_has_no_plain_tick(window, person, rods):
    person.opens(rods)
    person.runs_all()
    project = window.session.project
    row = [entry.key for entry in window.pages.entries].index("joints")
    plain = window.pages.list.item(row).icon().pixmap(round(SIZE)).toImage()
    window.session.open(replace(project, _topology=replace(project.topology, edge_probability=[0.99, 0.6])))
    item = window.pages.list.item(row)
    assert item.data(Qt.ItemDataRole.AccessibleTextRole).endswith(": done, with doubtful results")
    assert item.icon().pixmap(round(SIZE)).toImage() != plain
    assert "joints" not in done(window)


def test_the_views_keep_their_place_when_another_page_is_shown(window, person, rods):
    person.opens(rods)
    person.runs_all()
    widths = set()
    for entry in window.pages.entries:
        window.pages.page(entry.key)
        person.waits()
        widths.add(window.pages.width())
    assert len(widths) == 1


def test_forms_of_the_stages_fit_beside_their_bars(qtbot, window, person, rods):
    person.opens(rods)
    person.runs_all()
    for stage in STAGES:
        page = window.pages.page(stage)
        person.waits()
        area = page.findChild(QScrollArea)
        qtbot.waitUntil(lambda area=area: area.viewport().width() > 0)
        assert area.horizontalScrollBar().maximum() == 0, stage


def test_options_of_every_export_fit_into_the_narrowest_window(qtbot, window, person, rods):
    person.opens(rods)
    page = window.pages.page("export")
    window.pages.resize(window.pages.minimumWidth(), window.pages.height())
    area = page.findChild(QScrollArea)
    qtbot.waitUntil(lambda: area.viewport().width() > 0)
    room = area.width() - area.verticalScrollBar().sizeHint().width()
    for number, entry in enumerate(page.formats):
        page.choice.setCurrentIndex(number)
        person.waits()
        assert area.widget().minimumSizeHint().width() <= room, entry.name


def test_a_step_with_nothing_to_look_at_shows_no_empty_list(window, person, rods):
    person.opens(rods)
    person.runs_all()
    for page in window.pages.findChildren(StagePage):
        assert page.warnings.isHidden() == (page.warnings.count() == 0)


def test_the_empty_list_of_corrections_says_how_to_make_one(window, person, rods):
    listed = window.findChild(type(window.pages.parent()), "corrections").widget()
    person.opens(rods)
    person.runs_all()
    assert not listed.hint.isHidden()
    window.document.correct(Correction("root", window.session.project.trajectories.names[:1]))
    assert listed.hint.isHidden()


def test_the_button_that_exports_is_seen_without_scrolling(window, person, rods):
    window.resize(1280, 800)
    person.opens(rods)
    person.runs_all()
    button = window.pages.page("export").export
    person.waits(lambda: button.visibleRegion().boundingRect() == button.rect())


def test_what_is_to_be_looked_at_stands_line_below_line_and_no_line_is_cut(window, qtbot):
    listed = window.pages.page("skeleton").warnings
    listed.show()
    listed.addItems(["no frame shows enough of the right toes to tell"[:length] + " how" * 9 for length in range(47)])
    qtbot.wait(150)  # Qt lays lists out some time after they have changed
    rows = [listed.visualItemRect(listed.item(row)) for row in range(listed.count())]
    assert {below.top() - above.bottom() for above, below in pairwise(rows)} == {1}
