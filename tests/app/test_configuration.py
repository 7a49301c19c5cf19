"""Parameters from mappings, assignments and config.xml."""

from __future__ import annotations

import pytest

from skelgen.app.configuration import (
    FileParameters,
    Settings,
    all_parameter_classes,
    parameter_rows,
    settings_with,
    write_defaults,
)
from skelgen.errors import ParameterError
from skelgen.stages.joints import JointParameters
from skelgen.stages.limbs import LimbParameters


def test_unmentioned_stages_have_their_defaults():
    assert Settings().joints.alpha == JointParameters().alpha


def test_mapping_changes_one_value():
    assert Settings({"joints": {"alpha": 0.3}}).of("joints").alpha == 0.3


def test_parameters_object_is_taken_as_it_is():
    mine = JointParameters(alpha=0.7)
    assert Settings({"joints": mine}).of("joints") is mine


def test_parameters_of_another_stage_are_refused():
    with pytest.raises(ParameterError, match="takes JointParameters"):
        Settings({"joints": LimbParameters()})


def test_assignments_apply_in_order():
    settings = settings_with(Settings(), ["joints.alpha=0.3", "limbs.method=spectral", "joints.alpha=0.4"])
    assert (settings.of("joints").alpha, settings.of("limbs").method) == (0.4, "spectral")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("alpha=0.3", "stage.name=value"),
        ("joints.alpha", "stage.name=value"),
        ("legs.alpha=1", "no stage 'legs'; stages are labels, limbs, joints, skeleton, files"),
        ("joints.beta=1", "no parameter 'beta'; it has .*alpha"),
        ("joints.alpha=-2", "must lie in 0 .. "),
        ("joints.alpha=big", "it must be a number"),
    ],
)
def test_wrong_assignment_says_what_is_possible(text, sentence):
    with pytest.raises(ParameterError, match=sentence):
        settings_with(Settings(), [text])


def test_file_names_of_table_4_13_are_declared():
    assert [entry.config_name for entry in FileParameters.declarations()] == [
        "tempCorFileName",
        "specCluFileName",
        "jointFinderFileName",
        "skelFitFileName",
        "saveFileName",
    ]


def test_defaults_are_written_and_read_back(tmp_path):
    pytest.importorskip("skelgen_formats.config_xml")
    write_defaults(tmp_path / "config.xml")
    settings = Settings(tmp_path / "config.xml")
    assert settings.joints == JointParameters()
    assert settings.of("files") == FileParameters()


def test_rows_cover_every_parameter():
    rows = parameter_rows(Settings({"limbs": {"method": "spectral"}}))
    declared = [(cls.stage, entry.name) for cls in all_parameter_classes() for entry in cls.declarations()]
    assert [(row["stage"], row["name"]) for row in rows] == declared
    assert [row["value"] for row in rows if (row["stage"], row["name"]) == ("limbs", "method")] == ["spectral"]
