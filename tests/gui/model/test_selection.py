"""What can be corrected follows from what is selected."""

from __future__ import annotations

import pytest
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import new_name, offers

from skelgen.app.corrections import with_correction
from skelgen.model import Project


@pytest.fixture
def project(walked):
    return walked[0]


def kinds(project, selection):
    return {offer.kind for offer in offers(project, selection)}


def test_nothing_is_offered_without_labels_or_selection(project):
    assert offers(None, Selection()) == ()
    assert offers(Project(project.take), Selection(frozenset({0}))) == ()
    assert offers(project, Selection()) == ()


def test_one_marker_can_be_split_renamed_deleted_and_moved(project):
    assert kinds(project, Selection(frozenset({0}))) == {"split", "rename", "delete", "move"}


def test_two_markers_of_different_limbs_can_be_joined_and_parted(project):
    names = project.trajectories.names
    pair = frozenset({names.index("head 1"), names.index("chest 1")})
    assert {"join", "part", "merge", "swap", "together", "apart"} <= kinds(project, Selection(pair))
    same = frozenset({names.index("head 1"), names.index("head 2")})
    assert not {"join", "part"} & kinds(project, Selection(same))


def test_joints_have_kinds_and_limbs_can_be_the_root(project):
    assert kinds(project, Selection(joint=0)) == {"part", "kind", "name-joint"}
    assert kinds(project, Selection(limb=2)) == {"root", "name"}


def test_everything_that_is_offered_can_be_done(project):
    for selection in (Selection(frozenset({0})), Selection(frozenset({0, 4})), Selection(joint=0), Selection(limb=0)):
        for offer in offers(project, selection):
            asks_name = offer.kind in {"split", "rename", "name", "name-joint"}
            correction = offer.correction("a new name" if asks_name else "")
            (stated,) = with_correction(project, correction).corrections
            assert (stated.kind, stated.names[: len(correction.names)]) == (correction.kind, correction.names)


def test_a_proposed_name_is_free(project):
    name = project.trajectories.names[0]
    assert new_name(project, name) == f"{name}_2"
