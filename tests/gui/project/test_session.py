"""The session keeps frame and selection within the project, and tells of every change once."""

from __future__ import annotations

from skelgen_gui.model.selection import Selection


def test_frames_beyond_the_take_show_its_ends(session):
    session.show_frame(10_000)
    assert session.frame == session.n_frames - 1
    session.show_frame(-5)
    assert session.frame == 0


def test_what_the_project_lacks_is_not_selected(session):
    session.select(Selection(frozenset({0, 1000}), limb=99, joint=2))
    assert session.selection == Selection(frozenset({0}), None, 2)


def test_a_new_selection_is_told_once(session, qtbot):
    told = []
    session.selection_changed.connect(lambda: told.append(session.selection))
    for _ in range(2):
        session.select(Selection(frozenset({3})))
    assert told == [Selection(frozenset({3}))]


def test_a_recording_that_is_not_saved_is_dirty_until_it_is_saved(session, tmp_path):
    assert session.is_dirty
    session.saved(tmp_path / "walk.skelgen", session.project)
    assert not session.is_dirty
