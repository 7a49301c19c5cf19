"""Markers get their names in the labelling pane by keys and clicks, and open questions are answered there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication, QDialog
from skelgen_gui.model.labelling import answers, marker_rows, names_left, naming, with_point_named
from skelgen_gui.model.selection import Marked, Selection

import skelgen
from skelgen.app.advice import open_questions
from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Trajectories
from skelgen.model.labelling import Doubt, Tracklets
from skelgen.model.questions import Question
from skelgen.stages.names import marker_names

Key = Qt.Key
N_MARKERS, N_FRAMES = 53, 60


@pytest.fixture(scope="module")
def unnamed():
    """53 stiff markers, called m0 .. m52; m3 has two gaps, and m5 is perhaps m6 in frames 20 to 39."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 1000, (N_MARKERS, 3)) + 50 * np.sin(np.arange(N_FRAMES) / 9)[:, np.newaxis, np.newaxis]
    places[10:15, 3] = places[30:40, 3] = np.nan
    take = Trajectories(places, tuple(f"m{number}" for number in range(N_MARKERS)), 100.0)
    project = skelgen.reconstruct(take, until="labels")
    seen = project.trajectories.seen
    confidence = np.where(seen, 0.99, np.nan)
    confidence[20:40, 5] = 0.2
    doubt = Doubt(5, 20, 39, "rival", 6, 0.2, "m6 fits as well")
    nothing = np.zeros(N_FRAMES, dtype=int)
    return replace(project, _labelling=Labelling(confidence, (doubt,), (), nothing))


@pytest.fixture
def pane(qtbot, active, window, person, unnamed):
    window.document.open(unnamed)
    window.runner.computes_at_once = False
    qtbot.keyClick(window.view3d, Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(window.labelling.isVisible)
    person.waits(lambda: window.labelling.table.filtered.rowCount() == N_MARKERS)
    return window.labelling


def test_a_name_that_is_written_otherwise_is_not_offered_again(unnamed):
    """A take has ``r.ASIS`` where the table of the marker set has ``R.ASIS``."""
    names = marker_names("plug-in-gait")
    given = (names[0].lower(), f"me:{names[1]}", *unnamed.trajectories.names[2:])
    project = replace(unnamed, _trajectories=replace(unnamed.trajectories, names=given))
    assert set(names) - set(names_left(project, "plug-in-gait")) == {names[0], names[1]}


def test_names_and_markers_share_a_low_pane(window, pane, person):
    window.resize(1024, 700)
    person.waits()
    assert pane.table.viewport().height() > pane.names.height() >= 2 * pane.fontMetrics().height()


def presses(qtbot, *keys):
    for key in keys:
        qtbot.keyClick(QApplication.focusWidget(), key)


def shown(pane, column=0):
    model = pane.table.filtered
    return [model.index(row, column).data() for row in range(model.rowCount())]


def test_rows_are_sorted_by_what_needs_work_and_count_gaps(unnamed):
    first, second, *_ = marker_rows(unnamed)
    assert (first.name, first.doubts, round(first.work)) == ("m5", 1, 16)
    assert (second.name, second.gaps, second.seen) == ("m3", 2, 0.75)


def test_a_take_of_53_markers_is_labelled_by_keys_alone(qtbot, window, pane, person):
    presses(qtbot, Key.Key_Home, Key.Key_Return)
    order = shown(pane)
    names = tuple(f"N{number}" for number in range(N_MARKERS))
    for name in names:
        qtbot.keyClicks(QApplication.focusWidget(), name)
        presses(qtbot, Key.Key_Return)
    person.waits(lambda: set(window.session.project.trajectories.names) == set(names))
    given = dict(zip(order, names, strict=True))
    assert window.session.project.trajectories.names == tuple(given[f"m{number}"] for number in range(N_MARKERS))
    assert window.findChild(QDialog) is None


def test_a_marker_that_was_clicked_is_named_by_typing_or_by_a_click(qtbot, window, pane, person):
    window.view3d.grab()
    place = window.view3d.place_of_marker(7)
    qtbot.mouseClick(window.view3d, Qt.MouseButton.LeftButton, pos=place.toPoint())
    (clicked,) = window.session.selection.markers
    assert QApplication.focusWidget() is pane.name
    qtbot.keyClicks(pane.name, "LKNE")
    presses(qtbot, Key.Key_Return)
    person.waits(lambda: window.session.project.trajectories.names[clicked] == "LKNE")
    pane.sets.setCurrentIndex(pane.sets.findData("plug-in-gait"))
    pane.sets.activated.emit(pane.sets.currentIndex())
    window.session.select(Selection(frozenset({9})))
    assert "LKNE" not in pane._left.stringList()
    row = pane._left.stringList().index("LFHD")
    place = pane.names.visualRect(pane._left.index(row)).center()
    qtbot.mouseClick(pane.names.viewport(), Qt.MouseButton.LeftButton, pos=place)
    person.waits(lambda: window.session.project.trajectories.names[9] == "LFHD")


def test_search_sort_and_the_next_doubt_by_one_key(qtbot, window, pane):
    qtbot.keyClicks(pane.search, "m1")
    assert set(shown(pane)) == {"m1", *(f"m1{number}" for number in range(10))}
    pane.search.clear()
    header = pane.table.horizontalHeader()
    qtbot.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(header.sectionPosition(2) + 5, 5))
    qtbot.mouseClick(header.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(header.sectionPosition(2) + 5, 5))
    assert shown(pane)[0] == "m3"
    window.session.select(Selection(frozenset({2})))
    pane.name.setFocus()
    presses(qtbot, Key.Key_F3)
    assert (window.session.frame, window.session.selection.markers) == (20, {5})
    assert pane.name.text() == "m5"
    assert pane.name.selectedText() == "m5"
    presses(qtbot, Key.Key_Space)
    assert window.timeline.player.is_playing


def test_a_question_shows_what_is_meant_and_is_answered_by_a_key(qtbot, window, pane, person):
    listed = pane.questions.list
    listed.setFocus()
    presses(qtbot, Key.Key_Home)
    assert window.session.selection.markers == {5, 6}
    assert window.session.frame == 20
    assert [button.text() for button in pane.questions.buttons] == ["1  It is m5", "2  It is m6"]
    presses(qtbot, Key.Key_1)
    person.waits(lambda: bool(window.session.project.corrections))
    (stated,) = window.session.project.corrections
    assert (stated.kind, stated.names, stated.first_frame, stated.last_frame) == ("confirm", ("m5",), 20, 39)
    person.waits(lambda: pane.questions.current is None)
    person.does("undo")
    person.waits(lambda: not listed.isHidden())
    qtbot.mouseClick(
        listed.viewport(), Qt.MouseButton.LeftButton, pos=listed.visualRect(listed.model().index(0, 0)).center()
    )
    qtbot.mouseClick(pane.questions.buttons[1], Qt.MouseButton.LeftButton)
    person.waits(lambda: [one.kind for one in window.session.project.corrections] == ["swap"])


def test_an_answer_holds_for_all_spans_that_were_asked_about(unnamed):
    """m5 is perhaps m6 in two spans; the answer that it is settles both, and the question is gone."""
    confidence = unnamed.labelling.confidence.copy()
    confidence[45:58, 5] = 0.2
    doubts = tuple(Doubt(5, *span, "rival", 6, 0.2, "m6 fits as well") for span in ((20, 39), (45, 57)))
    project = replace(unnamed, _labelling=replace(unnamed.labelling, confidence=confidence, doubts=doubts))
    (question,) = open_questions(project)
    own, other = answers(project, question)
    for answer, kind in ((own, "confirm"), (other, "swap")):
        assert [(one.kind, one.first_frame, one.last_frame) for one in answer.corrections] == [
            (kind, 20, 39),
            (kind, 45, 57),
        ]


def test_what_a_name_means(unnamed):
    apart = skelgen.correct(
        skelgen.correct(unnamed, "delete", ["m1"], frames=(30, None)), "delete", ["m2"], frames=(0, 29)
    )
    merged = naming(apart, 2, "m1", 40)
    assert (merged.kind, merged.names) == ("merge", ("m1", "m2"))
    swapped = naming(unnamed, 3, "m8", 20)
    assert (swapped.kind, swapped.first_frame, swapped.last_frame) == ("swap", 15, 29)
    assert naming(unnamed, 5, "m6", 25).first_frame == 20
    assert naming(unnamed, 3, "m8", 20, (3, 50)).last_frame == 50
    assert naming(unnamed, 3, "new", 20).kind == "rename"
    assert naming(unnamed, 5, "m5", 25).kind == "confirm"
    assert naming(unnamed, 5, "  ", 25) is None


def test_a_track_that_was_left_out_is_named_by_its_place():
    case = skelgen.simulate("rods", n_frames=60, labelled=False)
    project = skelgen.reconstruct(case.take, until="labels")
    ghost = np.array([5e3, 5e3, 5e3])
    frames = [np.vstack([case.take.frame(frame), ghost][: 2 if frame >= 20 else 1]) for frame in range(60)]
    starts = np.concatenate([[0], np.cumsum([len(rows) for rows in frames])])
    cloud = PointCloud(np.concatenate(frames), starts, case.take.times)
    named = with_point_named(replace(project, take=cloud), Question("whose", (), 20, 59, 20.0), "GHOST")
    (entry,) = named.identities.entries
    assert (entry.name, entry.frame, entry.position) == ("GHOST", 20, (5e3, 5e3, 5e3))
    assert not named.has("labels")


@pytest.fixture(scope="module")
def haunted():
    """Markers of rods, and in frames 20 to 59 two points that stand far from them, and are left out."""
    case = skelgen.simulate("rods", n_frames=60, labelled=False)
    ghosts = np.array([[5e3, 5e3, 5e3], [-5e3, 5e3, 5e3]])
    frames = [np.vstack([case.take.frame(frame), ghosts[: 2 * (frame >= 20)]]) for frame in range(60)]
    starts = np.concatenate([[0], np.cumsum([len(rows) for rows in frames])])
    cloud = PointCloud(np.concatenate(frames), starts, case.take.times)
    index = len(case.take.frame(20))
    lost = Tracklets([0, 1], [-1, -1], [20, 20], [59, 59], [40, 40], index + np.arange(2), ghosts)
    project = skelgen.reconstruct(case.take, until="labels")
    return replace(project, take=cloud, _labelling=replace(project.labelling, tracklets=lost, doubts=()))


def test_of_several_points_that_which_is_asked_for_is_named(haunted):
    for question, place in zip(open_questions(haunted), ((5e3, 5e3, 5e3), (-5e3, 5e3, 5e3)), strict=True):
        (entry,) = with_point_named(haunted, question, "GHOST").identities.entries
        assert (entry.frame, entry.position, entry.last_frame) == (20, place, 59)


def test_in_an_older_project_no_point_is_guessed(haunted):
    with pytest.raises(InputError, match="2 points of frame 20 are left out"):
        with_point_named(haunted, Question("whose", (), 20, 59, 20.0), "GHOST")


def test_a_question_about_a_point_marks_it_in_the_view(window, person, haunted):
    window.document.open(haunted)
    second = open_questions(haunted)[1]
    person.does("labelling")
    person.waits(lambda: window.labelling.questions.list.model().rowCount() == 2)
    listed = window.labelling.questions.list
    listed.setCurrentIndex(listed.model().index(1, 0))
    assert (window.session.frame, window.session.selection.point) == (20, (20, second.point))
    assert Marked(window.session.selection).points(20) == {second.point}
    assert Marked(window.session.selection).points(21) == set()


def test_a_point_that_is_called_as_a_marker_goes_on_with_that_marker(haunted):
    """Names that the program gives come anew with the labels: a point of the marker says which one is meant."""
    (first, *_), name = open_questions(haunted), haunted.trajectories.names[2]
    followed = Tracklets([0, 1, 2], [-1, -1, 2], [20, 20, 0], [59, 59, 59], [40, 40, 60])
    tracked = replace(haunted, _labelling=replace(haunted.labelling, tracklets=followed))
    own, point = with_point_named(tracked, first, name).identities.entries
    assert (own.name, own.position) == (name, tuple(haunted.trajectories.positions[own.frame, 2]))
    assert (point.name, point.frame) == (name, 20)
