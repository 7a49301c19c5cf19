"""Corrections are steps that are undone and redone; what was computed since comes back with them."""

from __future__ import annotations

import pytest
from skelgen_gui.project.session import Document

from skelgen.app.pipeline import run_stages
from skelgen.errors import InputError
from skelgen.model.corrections import Correction


@pytest.fixture
def document(session):
    return Document(session)


def test_a_correction_is_undone_and_redone(document, session):
    before = session.project
    document.correct(Correction("rename", ("head 1",), value="crown"))
    assert "crown" in session.project.trajectories.names
    document.undo_stack.undo()
    assert session.project is before
    document.undo_stack.redo()
    assert "crown" in session.project.trajectories.names


def test_redoing_brings_back_what_was_computed_after_the_correction(document, session):
    document.correct(Correction("part", ("head 1", "chest 1")))
    assert not session.project.has("joints")
    document.computed(run_stages(session.project, None, "joints"))
    document.undo_stack.undo()
    assert session.project.has("skeleton")
    document.undo_stack.redo()
    assert session.project.has("joints")


def test_a_correction_that_cannot_be_made_changes_nothing(document, session):
    before = session.project
    with pytest.raises(InputError):
        document.correct(Correction("delete", ("nobody here",)))
    assert session.project is before
    assert not document.undo_stack.canUndo()


def test_taking_a_correction_back_can_be_undone(document, session):
    document.correct(Correction("apart", ("head 1", "head 2")))
    document.take_back(0)
    assert session.project.corrections == ()
    document.undo_stack.undo()
    assert len(session.project.corrections) == 1


def test_markers_are_remembered_by_a_place(document, session):
    session.show_frame(50)
    document.correct(Correction("delete", ("head 1",), 0, 9))
    (place,) = session.project.corrections[0].places
    assert abs(place.frame - 50) < 50


def test_another_project_begins_without_steps(document, session):
    document.correct(Correction("apart", ("head 1", "head 2")))
    document.open(session.project)
    assert not document.undo_stack.canUndo()
