"""The first minute with the window: samples, and first steps whose links do what they say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import skelgen_gui
from PySide6.QtCore import QUrl
from skelgen_gui.page_stack import WIDTH
from skelgen_gui.project.file_actions import SampleMenu

from skelgen.app.configuration import parameters_class
from skelgen.app.samples import SAMPLES
from skelgen.model.project import STAGES

TUTORIAL = Path(skelgen_gui.__file__).with_name("tutorial.md")


def test_every_link_of_the_first_steps_is_known(window):
    links = re.findall(r"\]\((\w+):(\w+)\)", TUTORIAL.read_text(encoding="utf-8"))
    assert {name for kind, name in links if kind == "sample"} == {sample.key for sample in SAMPLES}
    assert {name for kind, name in links if kind == "do"} <= set(window.actions_by_id)
    assert {kind for kind, _ in links} == {"sample", "do"}


def test_a_sample_is_opened_run_and_saved_from_the_first_steps(window, person, tmp_path):
    person.does("tutorial")
    assert window.tutorial.isVisibleTo(window)
    window.tutorial.anchorClicked.emit(QUrl("sample:machine"))
    person.waits(lambda: window.session.project is not None)
    assert window.session.project.name == "A machine (sample)"
    window.tutorial.anchorClicked.emit(QUrl("do:run_all"))
    person.waits(lambda: window.session.project.has("skeleton"))
    assert window.session.project.limbs.n_limbs == 3
    person.saves_as(tmp_path / "machine.skelgen")
    assert (tmp_path / "machine.skelgen").exists()


def test_samples_are_offered_in_the_menu_and_on_the_first_page(window):
    menus = window.findChildren(SampleMenu)
    assert len(menus) == 2
    assert window.pages.page("open").samples.menu() in menus
    for menu in menus:
        assert [action.text() for action in menu.actions()] == [sample.title for sample in SAMPLES]


def test_forms_show_no_names_of_methods_at_once(window):
    for stage in STAGES:
        shown = [entry.name for entry in parameters_class(stage).declarations() if entry.basic]
        assert not {"method", "fit", "rotation", "solver", "alpha"} & set(shown)
    row = window.pages.page("skeleton").form.rows["rotation"]
    assert row.editor.currentText() == "quaternions (Horn)"
    assert row.value() == "horn"


@pytest.mark.parametrize("stage", STAGES)
def test_forms_fit_into_the_width_of_their_page(window, stage):
    form = window.pages.page(stage).form
    form._expander.setChecked(True)
    assert form.minimumSizeHint().width() <= WIDTH
