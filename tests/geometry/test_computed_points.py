"""Points that a model computed are known by their names, and nothing else is taken for one."""

import pytest

from skelgen.geometry.computed_points import are_computed

MARKERS = ("LASI", "RASI", "SACR", "LKNE", "RKNE", "LANK", "RANK", "LHIP", "R_Hip", "Com1", "RWJ", "JC", "LeftAnkle")


@pytest.mark.parametrize(
    "name",
    [
        *("LHJC", "R.KJC", "L_AJC", "HJC_R", "RKneeJC", "R_HJC_reg", "left hip joint centre", "Anna:RSJC", "RWristJC"),
        *("COM", "CentreOfMass", "CenterOfMassFloor", "LeftFemurCOM", "PelvisCOM"),
    ],
)
def test_centres_of_joints_and_of_mass_are_computed(name):
    assert are_computed((*MARKERS, name)).tolist() == [False] * len(MARKERS) + [True]


def test_axes_of_a_segment_are_computed_where_all_four_points_are_there():
    axes = ("PELO", "PELA", "PELL", "PELP")
    assert are_computed((*MARKERS, *axes)).sum() == len(axes)
    assert not are_computed((*MARKERS, *axes[:3], "LHUO", "RFEA")).any()


def test_points_are_markers_where_nearly_all_seem_computed():
    assert not are_computed(("LHJC", "RHJC", "LKJC", "RKJC", "head", "neck")).any()
    assert not are_computed(("LHJC", "RHJC")).any()
