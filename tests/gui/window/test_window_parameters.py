from __future__ import annotations

import pytest
from PySide6.QtWidgets import QFileDialog

from skelgen.app.configuration import Settings


@pytest.fixture
def files(monkeypatch, tmp_path):
    """Answer every question for a file with the same config.xml."""
    path = tmp_path / "config.xml"
    for name in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QFileDialog, name, lambda *args: (str(path), ""))
    return path


def test_parameters_are_loaded_saved_and_set_back(window, person, rods, files):
    person.opens(rods)
    form = window.pages.page("joints").form
    files.write_text(
        '<Parameters><JointFinder><JC><ALPHA value="0.4" type="double"/></JC></JointFinder></Parameters>', "utf-8"
    )
    person.does("load_parameters")
    assert (form.values()["alpha"], form.values()["solver"]) == (0.4, "conjugate-gradient")
    person.does("save_parameters")
    assert Settings(files).joints.alpha == 0.4
    assert Settings(files).joints.solver == "conjugate-gradient"
    person.does("clear_parameters")
    assert (form.values()["alpha"], form.values()["solver"]) == (0.1, "closed-form")


def test_a_wrong_file_of_parameters_is_told(window, person, files):
    files.write_text("<Parameters><Legs/></Parameters>", "utf-8")
    person.does("load_parameters")
    assert "Legs is unknown" in person.is_told()
