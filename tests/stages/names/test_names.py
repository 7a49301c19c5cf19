"""Limbs are named by the names of their markers: sets that people wear, words of the field, shared beginnings."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skelgen
from skelgen.app.corrections import without_correction
from skelgen.errors import InputError, ParameterError
from skelgen.marker_sets import MARKER_SETS, worn_markers
from skelgen.model import Limbs
from skelgen.model.limbs import with_names_of_limbs
from skelgen.stages.names import (
    find_marker_set,
    marker_names,
    name_limbs,
    recognised_set,
    segments_of_markers,
    set_among_others,
)


def limbs_of(groups):
    """Limbs of groups of markers, and all names."""
    names = [name for group in groups for name in group]
    labels = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return Limbs(labels, np.zeros((len(names), len(names)))), names


@pytest.mark.parametrize("marker_set", MARKER_SETS)
def test_every_set_is_recognised_and_names_its_limbs_rightly(marker_set):
    worn = worn_markers(marker_set)
    segments = sorted({marker.limb for marker in worn})
    limbs, names = limbs_of([[f"Jane:{m.name}" for m in worn if m.limb == segment] for segment in segments])
    found = recognised_set(names)
    assert found is not None
    assert len(found.segments) == len(names)
    assert name_limbs(limbs, names, found) == tuple(segments)


def test_a_part_of_a_body_is_recognised_and_said():
    legs = [marker.name for marker in worn_markers("plug-in-gait") if marker.name[1:] in LEGS]
    assert recognised_set(legs).sentence == "marker set: Plug-in Gait full body (16 of 16 markers are of it; it has 39)"


LEGS = {"ASI", "PSI", "THI", "KNE", "TIB", "ANK", "HEE", "TOE"}


def test_a_set_that_is_only_known_by_name_names_its_limbs_rightly():
    sides = [f"{side}.{name}" for side in "LR" for name in ("Thigh.Upper", "Thigh.Front", "Thigh.Rear", "Knee.Lat")]
    sides += [f"{side}.{name}" for side in "LR" for name in ("Shank.Upper", "Shank.Front", "Shank.Rear", "Ankle.Lat")]
    sides += [f"{side}.{name}" for side in "LR" for name in ("Heel", "Midfoot.Sup", "Midfoot.Lat", "Toe.Tip")]
    found = recognised_set([*sides, "L.ASIS", "R.ASIS", "V.Sacral", "Sternum", "L.Acromion", "R.Acromion", "Top.Head"])
    assert found.name == "cleveland-clinic"
    assert found.segments["L.Knee.Lat"] == "left thigh"


def test_names_of_no_set_are_none():
    assert recognised_set([f"M{number:03d}" for number in range(40)]) is None
    with pytest.raises(ParameterError, match="there is no marker set 'mine'"):
        find_marker_set("mine", ["a"])


def test_set_that_is_worn_among_many_other_markers_is_told_with_what_to_do():
    names = [*marker_names("plug-in-gait")[:35], *(f"M{number:03d}" for number in range(26))]
    assert recognised_set(names) is None
    assert set_among_others(names).hint.startswith("35 of the 39 markers of Plug-in Gait full body are there, but 26")
    assert "`--marker-set plug-in-gait`" in set_among_others(names).hint
    assert set_among_others(names[15:]) is None


@pytest.mark.parametrize(
    ("names", "segments"),
    [
        (["L_knee", "r_knee", "r_thigh3", "r_5meta"], ["left thigh", "right thigh", "right thigh", "right foot"]),
        (["WaistLFront", "LUArmHigh", "RUArmHigh"], ["pelvis", "left upper arm", "right upper arm"]),
        (["ASISl", "ASISr", "LARMm", "STYLu"], ["pelvis", "pelvis", "forearm", "forearm"]),
        (["R.Thigh.Upper", "R.Shank.Front", "R.Heel"], ["right thigh", "right shank", "right foot"]),
        (["ELB_L", "ELB_M", "WRA"], ["upper arm", "upper arm", "forearm"]),
    ],
)
def test_segments_and_sides_are_read_from_names(names, segments):
    """A lateral epicondyle (ELB_L) is on no left arm: sides count only as a take writes them."""
    assert [segment for segment, _ in segments_of_markers(names).values()] == segments


def test_numbered_pieces_of_one_name_name_a_machine():
    limbs, names = limbs_of([["crane boom 1", "crane boom 2"], ["hook_1", "hook_2"], ["M001", "M002"]])
    assert name_limbs(limbs, names) == ("crane boom", "hook", "limb2")


def test_two_limbs_never_have_one_name():
    limbs, names = limbs_of([["LKNE"], ["LTHI", "LTHI2"], ["RTHI"], ["C7", "T10"], ["LANK", "LTIB"]])
    assert name_limbs(limbs, names) == ("left thigh 2", "left thigh", "right thigh", "chest", "left shank")


def test_bodies_whose_limbs_are_called_alike_have_their_number_before_each_name():
    limbs, names = limbs_of([["C7", "T10"], ["LTHI", "LTHI2"], ["LANK"], ["C7_b", "T10_b"], ["LTHI_b"], ["LFHD"]])
    apart = dataclasses.replace(limbs, body_of_limb=np.array([0, 0, 0, 1, 1, 2]), body_probability=np.ones(3))
    assert name_limbs(apart, names)[:3] == ("body1: chest", "body1: left thigh", "body1: left shank")
    assert name_limbs(apart, names)[3:] == ("body2: chest", "body2: left thigh", "head")


@pytest.mark.parametrize(
    ("subjects", "begins"), [(("Ben", "Anna"), ("Ben", "Anna")), (("subject 2", "subject 1"), ("body1", "body2"))]
)
def test_bodies_whose_markers_begin_with_a_name_have_it_and_numbers_are_none(subjects, begins):
    worn = (["C7", "T10"], ["LTHI"], ["LANK"])
    limbs, names = limbs_of([[f"{subject}:{marker}" for marker in one] for subject in subjects for one in worn])
    apart = dataclasses.replace(limbs, body_of_limb=np.repeat([0, 1], 3), body_probability=np.ones(2))
    segments = ("chest", "left thigh", "left shank")
    assert name_limbs(apart, names) == tuple(f"{begin}: {segment}" for begin in begins for segment in segments)


@pytest.fixture(scope="module")
def project():
    return skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)


def test_limbs_and_joints_have_names_in_tables_and_files(project, tmp_path):
    assert set(project.skeleton.limb_names) == {"front rod", "middle rod", "rear rod"}
    assert set(project.limb_poses()["limb"]) == set(project.skeleton.limb_names)
    skelgen.write(project, tmp_path / "rods.bvh")
    assert "middle_rod" in (tmp_path / "rods.bvh").read_text()


def test_what_the_user_calls_a_limb_stays_with_it(project, tmp_path):
    marker = project.trajectories.names[0]
    limb = int(project.limbs.limb_of_marker[0])
    named = skelgen.correct(project, "name", [marker], "handle")
    assert named.has("skeleton")
    assert named.skeleton.limb_names[limb] == "handle"
    again = skelgen.reconstruct(named)
    assert again.limbs.names[again.limbs.limb_of_marker[0]] == "handle"
    skelgen.write(again, tmp_path / "rods.skelgen")
    assert skelgen.load(tmp_path / "rods.skelgen").skeleton.limb_names == again.skeleton.limb_names
    assert without_correction(named, 0).skeleton.limb_names == project.skeleton.limb_names


def test_a_name_that_another_limb_has_moves(project):
    first, second = project.limbs.names[:2]
    marker = project.trajectories.names[int(project.limbs.markers_of(0)[0])]
    names = skelgen.correct(project, "name", [marker], second).limbs.names
    assert names[:2] == (second, "limb1")
    assert first not in names


def test_numbers_where_names_are_not_wanted(project):
    again = skelgen.reconstruct(project.take, parameters={"limbs": {"marker_set": "none"}}, until="limbs")
    assert again.limbs.names == ("limb0", "limb1", "limb2")


def test_a_marker_set_that_is_stated_binds_limbs_and_tree():
    simulated = skelgen.simulate("human", n_frames=200, noise=0.5, marker_set="animation-41")
    project = skelgen.reconstruct(simulated.take, parameters={"limbs": {"marker_set": "animation-41"}}, until="joints")
    limbs = [project.limbs.names[limb] for limb in project.limbs.limb_of_marker]
    named = dict(zip(simulated.take.names, limbs, strict=True))
    assert named == {marker.name: marker.limb for marker in worn_markers("animation-41")}
    parents = project.topology.parents
    assert project.limbs.names[int(project.topology.roots[0])] == "pelvis"
    assert project.limbs.names[parents[project.limbs.names.index("left hand")]] == "left forearm"


def test_a_marker_set_that_is_not_worn_is_refused(project):
    with pytest.raises(InputError, match=r"is not worn: the take has [0-9]+ of its [0-9]+ markers$"):
        skelgen.reconstruct(project.take, parameters={"limbs": {"marker_set": "ior"}})


def test_limbs_refuse_names_that_do_not_fit(project):
    with pytest.raises(InputError):
        dataclasses.replace(project.limbs, names=("a", "a", "b"))


def test_sentences_call_limbs_by_their_names():
    limbs = dataclasses.replace(limbs_of([["a"], ["b"], ["c"]])[0], names=("left hand", "limb1", "head"))
    assert with_names_of_limbs("limb 0 hangs on limb 2", limbs) == "left hand hangs on head"
    assert (
        with_names_of_limbs("the joint between limb 0 and 2 turns", limbs)
        == "the joint between left hand and head turns"
    )
    assert with_names_of_limbs("limbs 0 and 1 are 3 mm apart", limbs) == "left hand and limb 1 are 3 mm apart"
    assert with_names_of_limbs("limbs 1 and 3 are 3 mm apart", limbs) == "limbs 1 and 3 are 3 mm apart"
    assert with_names_of_limbs("of 3 limbs 0.5 % are seen", limbs) == "of 3 limbs 0.5 % are seen"


def test_a_joint_is_called_as_the_user_says_until_that_is_taken_back():
    project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=60, seed=1).take)
    names, joint = project.trajectories.names, project.skeleton.joints[0]
    ends = [names[int(project.skeleton.markers_of(limb)[0])] for limb in (joint.child, joint.parent)]
    named = skelgen.correct(project, "name-joint", ends, "coupling")
    assert named.skeleton.joint_names[0] == "coupling"
    assert "coupling" in set(named.joints_table()["joint"])
    again = skelgen.reconstruct(named.before("joints"))
    assert "coupling" in again.skeleton.joint_names
    assert without_correction(named, 0).skeleton.joint_names == project.skeleton.joint_names


def test_fingers_that_share_a_limb_are_a_hand():
    limbs, names = limbs_of([["hand_top", "thumb_tip", "index_tip"], ["ring_tip", "ring_middle"], ["elbow"]])
    assert name_limbs(limbs, names) == ("hand", "ring", "upper arm")
