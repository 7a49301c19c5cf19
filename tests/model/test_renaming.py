"""Sentences call markers as they are called now, and keep their other words."""

import pytest

from skelgen.model.labelling import Doubt
from skelgen.model.renaming import with_renamed_markers


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("M1 and M10 are one marker", "LASI and M10 are one marker"),
        ("left out, as of a marker: left (3 %), M1 (2 %)", "left out, as of a marker: LTHI (3 %), LASI (2 %)"),
        ("a is on left thigh, as is the left arm", "RASI is on left thigh, as is the left arm"),
        ("distances of a to others fit left at least as well", "distances of RASI to others fit LTHI at least as well"),
        ("turns about a direction of a limb are left open", "turns about a direction of a limb are left open"),
        ("head is on head, not on pelvis", "C7 is on head, not on pelvis"),
        ("M1 and a lie on head, beside pelvis", "LASI and RASI lie on head, beside pelvis"),
        ("M1 is near the middle of head", "LASI is near the middle of head"),
    ],
)  # fmt: skip
def test_words_that_are_names_too_stay_where_they_are_no_names(sentence, expected):
    renamed = {"M1": "LASI", "M10": "M10", "left": "LTHI", "a": "RASI", "head": "C7"}
    assert with_renamed_markers([sentence], renamed, ["head", "left thigh", "pelvis"]) == (expected,)


def test_names_are_exchanged_at_once():
    assert with_renamed_markers(["M1 was M2"], {"M1": "M2", "M2": "M1"}, ()) == ("M2 was M1",)


def test_what_the_file_called_a_marker_stays():
    doubt = Doubt(0, 3, 9, "repaired", 1, 0.5, "M1 was called M2 in the file: the label was given back")
    assert doubt.renamed(["M1", "M2"], ["LASI", "RASI"]).reason.startswith("LASI was called M2 in the file")
