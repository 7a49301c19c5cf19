"""Corrections by hand change what they are about, are obeyed by later runs, and survive the project file."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skelgen
from skelgen.app.corrections import place_of, with_correction, without_correction
from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.archive import open_project, save_project
from skelgen.cli import main
from skelgen.errors import InputError
from skelgen.model import Project, Trajectories
from skelgen.model.corrections import RULES, Correction
from skelgen.model.labelling import Doubt
from skelgen.simulation import simulate
from skelgen.stages.labels import stated_positions


@pytest.fixture(scope="module")
def human():
    """A labelled human with all stages done."""
    return run_stages(Project(simulate("human", n_frames=300, noise=0.5).take))


def labelled(project, *corrections):
    """The project with corrections, and its labels made anew."""
    for correction in corrections:
        project = with_correction(project, correction)
    return run_stages(project, "labels", "labels")


def column(project, name):
    return project.trajectories.positions[:, project.trajectories.names.index(name)]


def test_a_split_marker_that_is_merged_again_is_the_one_that_it_was(human):
    split = with_correction(human, Correction("split", ("head 1",), 100, 199, "stranger"))
    assert np.isnan(column(split, "head 1")[100:200]).all()
    np.testing.assert_array_equal(column(split, "stranger")[100:200], column(human, "head 1")[100:200])
    merged = with_correction(split, Correction("merge", ("head 1", "stranger")))
    assert merged.trajectories.names == human.trajectories.names
    np.testing.assert_array_equal(merged.trajectories.positions, human.trajectories.positions)


def test_two_markers_change_places_from_here_to_there(human):
    swapped = with_correction(human, Correction("swap", ("head 1", "chest 1"), 50, 60))
    np.testing.assert_array_equal(column(swapped, "head 1")[50:61], column(human, "chest 1")[50:61])
    np.testing.assert_array_equal(column(swapped, "head 1")[61:], column(human, "head 1")[61:])


@pytest.fixture(scope="module")
def exchanged():
    """A human with two labels exchanged in its file in some frames, labelled: both are doubted there."""
    take = simulate("human", n_frames=300, noise=0.5).take
    positions = np.array(take.positions)
    pair = [take.names.index(name) for name in ("head 1", "chest 1")]
    positions[100:140, pair] = positions[100:140, pair[::-1]]
    return run_stages(Project(dataclasses.replace(take, positions=positions)), "labels", "labels")


def doubted(project):
    names = project.trajectories.names
    return {(names[one.marker], one.first_frame, one.kind) for one in project.labelling.doubts}


def test_doubts_of_other_markers_stay_when_one_is_corrected(exchanged):
    assert {name for name, *_ in doubted(exchanged)} == {"head 1", "chest 1"}
    other = with_correction(exchanged, Correction("swap", ("left hand 1", "right foot 1"), 10, 12))
    assert doubted(other) >= doubted(exchanged)
    stated = with_correction(exchanged, Correction("swap", ("head 1", "chest 1"), 100, 139))
    assert not any(kind == "repaired" for *_, kind in doubted(stated))
    merged = with_correction(exchanged, Correction("delete", ("left foot 1",)))
    assert doubted(merged) >= doubted(exchanged)


def test_doubts_of_points_stay_when_other_markers_are_corrected():
    take = simulate("rods", n_frames=200, noise=1.5, dropouts=0.2, labelled=False, seed=3).take
    found = run_stages(Project(take), "labels", "labels")
    names = found.trajectories.names
    first = with_correction(found, Correction("swap", (names[0], names[1]), 100, 101))
    assert doubted(first) >= doubted(found)
    assert doubted(found)
    sure = first.labelling.confidence[100:102, :2]
    second = with_correction(first, Correction("swap", (names[5], names[6]), 20, 21))
    np.testing.assert_array_equal(second.labelling.confidence[100:102, :2], sure)


def test_what_is_confirmed_is_certain_and_keeps_every_result(human):
    confidence = np.where(human.trajectories.seen, 0.4, np.nan)
    doubtful = dataclasses.replace(human, _labelling=dataclasses.replace(human.labelling, confidence=confidence))
    sure = with_correction(doubtful, Correction("confirm", ("head 1",), 10, 19))
    marker = human.trajectories.names.index("head 1")
    assert np.nanmin(sure.labelling.confidence[10:20, marker]) > 0.99
    assert sure.skeleton is human.skeleton
    np.testing.assert_array_equal(sure.trajectories.positions, human.trajectories.positions)


def test_notices_call_a_limb_as_it_is_called_now(human):
    said = "head 1 is on head (60 %), but could be on neck (40 %)"
    reports = {**human.reports, "limbs": dataclasses.replace(human.reports["limbs"], notices=(said,))}
    named = with_correction(dataclasses.replace(human, reports=reports), Correction("name", ("head 1",), value="skull"))
    assert named.reports["limbs"].notices == ("head 1 is on skull (60 %), but could be on neck (40 %)",)
    assert without_correction(named, len(named.corrections) - 1).reports["limbs"].notices == (said,)


def test_notices_call_a_marker_as_it_is_called_now(human):
    notices = ("head 1 is on head (60 %), but could be on neck (40 %)", "head 10, head 1 and head 2 are one")
    reports = {**human.reports, "limbs": dataclasses.replace(human.reports["limbs"], notices=notices)}
    marker = human.trajectories.names.index("head 1")
    doubt = Doubt(marker, 3, 9, "misfit", -1, 0.2, "the distances of head 1 to others")
    project = dataclasses.replace(
        human, reports=reports, _labelling=dataclasses.replace(human.labelling, doubts=(doubt,))
    )
    renamed = with_correction(project, Correction("rename", ("head 1",), value="LFHD"))
    now = ("LFHD is on head (60 %), but could be on neck (40 %)", "head 10, LFHD and head 2 are one")
    assert renamed.reports["limbs"].notices == now
    assert renamed.labelling.doubts[0].reason == "the distances of LFHD to others"


def test_what_is_confirmed_stays_certain_when_the_marker_is_renamed(human):
    confidence = np.where(human.trajectories.seen, 0.4, np.nan)
    doubtful = dataclasses.replace(human, _labelling=dataclasses.replace(human.labelling, confidence=confidence))
    sure = with_correction(doubtful, Correction("confirm", ("head 1",), 10, 19))
    renamed = with_correction(sure, Correction("rename", ("head 1",), value="LFHD"))
    other = with_correction(renamed, Correction("delete", ("left foot 1",), 0, 3))
    marker = other.trajectories.names.index("LFHD")
    stated = stated_positions(other.trajectories, other.corrections)
    assert stated[10:20, marker].all()
    assert stated.sum() == 10


def test_a_smoothed_marker_loses_what_is_faster_than_the_cutoff():
    time = np.arange(300)[:, np.newaxis, np.newaxis] / 100
    slow, fast = 100 * np.sin(2 * np.pi * time), 5 * np.sin(2 * np.pi * 30 * time)
    places = np.random.default_rng(0).uniform(0, 500, (6, 3)) + slow
    noisy = places.copy()
    noisy[:, 0] += fast[:, 0]
    noisy[100:120, 0] = np.nan
    project = run_stages(Project(Trajectories(noisy, tuple("abcdef"), 100.0)), "labels", "labels")
    smooth = with_correction(project, Correction("smooth", ("a",), 50, 299, value="6"))
    off = np.abs(smooth.trajectories.positions - places)
    assert np.nanmax(off[60:95, 0]) < 0.5
    assert np.nanmax(off[130:290, 0]) < 0.5
    np.testing.assert_array_equal(smooth.trajectories.positions[:50], project.trajectories.positions[:50])
    np.testing.assert_array_equal(smooth.trajectories.positions[:, 1:], project.trajectories.positions[:, 1:])
    with pytest.raises(InputError, match="half"):
        with_correction(project, Correction("smooth", ("a",), value="60"))


def test_a_new_name_keeps_every_result(human):
    renamed = with_correction(human, Correction("rename", ("head 1",), value="crown"))
    assert "crown" in renamed.trajectories.names
    assert renamed.skeleton is human.skeleton


def test_a_deleted_marker_is_gone_and_its_points_are_left_out(human):
    deleted = with_correction(human, Correction("delete", ("head 1",)))
    assert "head 1" not in deleted.trajectories.names
    assert deleted.labelling.confidence.shape == deleted.trajectories.seen.shape
    assert deleted.labelling.left_out.sum() == np.isfinite(column(human, "head 1")[:, 0]).sum()


def test_later_runs_obey_corrections_of_labels(human):
    corrections = (
        Correction("rename", ("head 1",), value="crown"),
        Correction("merge", ("crown", "head 2")),
        Correction("delete", ("chest 1",), 0, 9),
    )
    again = labelled(human, *corrections)
    assert "head 2" not in again.trajectories.names
    assert np.isnan(column(again, "chest 1")[:10]).all()
    assert any("head 2" in sentence for sentence in again.reports["labels"].notices)


def test_a_marker_is_found_by_its_place_when_a_run_calls_it_otherwise(human):
    names = human.trajectories.names
    place = place_of(human.trajectories, names.index("head 1"), 40)
    other = dataclasses.replace(human.take, names=tuple(f"M{index:03}" for index in range(len(names))))
    fresh = run_stages(Project(other), None, "labels")
    deleted = with_correction(fresh, Correction("delete", ("head 1",), places=(place,)))
    assert f"M{names.index('head 1'):03}" not in deleted.trajectories.names


def test_limbs_obey_together_and_apart_and_number(human):
    wanted = with_correction(human, Correction("apart", ("head 1", "head 2")))
    limbs = run_stages(wanted, None, "limbs").limbs.limb_of_marker
    names = human.trajectories.names
    assert limbs[names.index("head 1")] != limbs[names.index("head 2")]
    few = run_stages(with_correction(human, Correction("n_limbs", value="14")), None, "limbs")
    assert few.limbs.n_limbs == 14


def test_a_marker_moves_to_another_limb(human):
    moved = with_correction(human, Correction("move", ("left hand 1", "left forearm 1", "left hand 2")))
    limbs = run_stages(moved, None, "limbs").limbs.limb_of_marker
    first, second, old = (human.trajectories.names.index(name) for name in moved.corrections[0].names[:3])
    assert limbs[first] == limbs[second] != limbs[old]


def test_a_limb_that_a_marker_moves_to_stays_whole(human):
    names = human.trajectories.names
    pelvis = human.limbs.markers_of(int(human.limbs.limb_of_marker[names.index("pelvis 1")])).tolist()
    mate = names[next(m for m in range(len(names)) if names[m].startswith("head"))]
    said = with_correction(human, Correction("move", (mate, names[pelvis[-1]])))
    limbs = run_stages(said, None, "limbs").limbs.limb_of_marker
    assert len(set(limbs[[names.index(mate), *pelvis]].tolist())) == 1
    with pytest.raises(InputError, match="already"):
        with_correction(human, Correction("move", ("pelvis 1", names[pelvis[-1]])))


@pytest.mark.parametrize(
    ("kind", "names", "against"),
    [
        ("apart", ("left hand 1", "left forearm 2"), ("move", ("left hand 1", "left forearm 1"))),
        ("together", ("head 1", "chest 1"), ("apart", ("chest 1", "head 1"))),
        ("move", ("left hand 1", "head 1"), ("move", ("left hand 1", "left forearm 1"))),
        ("join", ("head 1", "chest 2"), ("part", ("chest 1", "head 2"))),
    ],
)
def test_what_contradicts_an_earlier_correction_is_refused_and_names_it(human, kind, names, against):
    said = with_correction(human, Correction(*against))
    said = run_stages(said, None, "limbs")
    with pytest.raises(InputError, match="contradicts the correction") as told:
        with_correction(said, Correction(kind, names))
    assert said.corrections[0].sentence in str(told.value)


def test_joints_are_forced_and_forbidden_and_the_root_is_obeyed(human):
    names, before = human.trajectories.names, human.limbs.limb_of_marker

    def limb(name):
        return int(before[names.index(name)])

    def joined(project, first, second):
        parents = project.topology.parents
        return parents[limb(first)] == limb(second) or parents[limb(second)] == limb(first)

    assert joined(human, "head 1", "chest 1")
    parted = run_stages(with_correction(human, Correction("part", ("head 1", "chest 1"))), None, "joints")
    assert not joined(parted, "head 1", "chest 1")
    forced = run_stages(with_correction(human, Correction("join", ("head 1", "pelvis 1"))), None, "joints")
    assert joined(forced, "head 1", "pelvis 1")
    rooted = run_stages(with_correction(human, Correction("root", ("head 1",))), None, "joints")
    assert rooted.topology.parents[limb("head 1")] == -1


def test_the_kind_of_a_joint_is_obeyed(human):
    said = with_correction(human, Correction("kind", ("head 1", "chest 1"), value="hinge"))
    fitted = run_stages(said)
    limbs = {int(fitted.limbs.limb_of_marker[fitted.trajectories.names.index(name)]) for name in ("head 1", "chest 1")}
    (joint,) = (joint for joint in fitted.skeleton.joints if {joint.parent, joint.child} == limbs)
    assert joint.kind == "hinge"


def test_a_correction_drops_the_results_of_its_stage_and_after(human):
    parted = with_correction(human, Correction("part", ("head 1", "chest 1")))
    assert parted.has("limbs")
    assert not parted.has("joints")
    assert without_correction(parted, 0).corrections == ()


def test_corrections_survive_the_project_file(human, tmp_path):
    place = place_of(human.trajectories, 0, 0)
    correction = Correction("swap", ("head 1", "chest 1"), 3, None, places=(place, place))
    project = dataclasses.replace(human, corrections=(correction,), view={"page": "limbs", "frame": 7})
    again = open_project(save_project(project, tmp_path / "a.skelgen"))
    assert again.corrections == (correction,)
    assert again.view == {"page": "limbs", "frame": 7}


def test_a_name_that_is_not_there_is_told(human):
    with pytest.raises(InputError, match="take it back"):
        with_correction(human, Correction("delete", ("nobody here",)))


@pytest.mark.parametrize(
    ("kind", "names", "facts"),
    [
        ("fold", ("a",), {}),
        ("merge", ("a",), {}),
        ("merge", ("a", "a"), {}),
        ("rename", ("a",), {}),
        ("n_limbs", (), {"value": "many"}),
        ("n_limbs", ("a",), {"value": "3"}),
        ("swap", ("a", "b"), {"first_frame": 9, "last_frame": 3}),
        ("fill", ("a", "b"), {"value": "rigid"}),
        ("fill", ("a",), {"value": "magic"}),
        ("smooth", ("a",), {"value": "soft"}),
        ("apart", ("a", "b"), {"first_frame": 9}),
    ],
)
def test_corrections_that_mean_nothing_are_refused(kind, names, facts):
    with pytest.raises(InputError):
        Correction(kind, names, **facts)


SENTENCES = {
    "merge": "a and b are one marker, a",
    "split": "a is another marker, x",
    "rename": "a is called x",
    "delete": "a is nobody",
    "swap": "a and b change places",
    "confirm": "a is rightly called so",
    "smooth": "a is smoothed at 6 Hz",
    "fill": "gaps of a are filled by spline",
    "n_markers": "there are 3 markers",
    "name": "the limb of a is called x",
    "together": "a and b share a limb",
    "apart": "no two of a and b share a limb",
    "move": "a is on the limb of b",
    "n_limbs": "there are 3 limbs",
    "join": "the limbs of a and b are joined",
    "part": "the limbs of a and b are not joined",
    "root": "the limb of a is the root",
    "name-joint": "the joint between the limbs of a and b is called x",
    "kind": "the joint between the limbs of a and b is of the type hinge",
}


@pytest.mark.parametrize("kind", RULES)
def test_every_kind_says_what_it_means(kind):
    rule = RULES[kind]
    values = {"n_markers": "3", "n_limbs": "3", "smooth": "6", "fill": "spline", "kind": "hinge"}
    value = values.get(kind, "x") if rule.needs_value else ""
    assert Correction(kind, tuple("abc"[: rule.least]), value=value).sentence == SENTENCES[kind]


def test_frames_are_said_too():
    correction = Correction("swap", ("a", "b"), 3, None)
    assert correction.sentence == "a and b change places, from frame 3 to the end"


@pytest.fixture(scope="module")
def rods(tmp_path_factory):
    """Three rods with a stated root and all stages done, in a file."""
    folder = tmp_path_factory.mktemp("rods")
    stated = Correction("root", ("rear rod 1",))
    project = run_stages(Project(simulate("rods", n_frames=100).take, corrections=(stated,)))
    return save_project(project, folder / "stated.skelgen")


def test_what_is_stated_is_listed_and_taken_back_by_its_number(rods, tmp_path, capsys):
    target = tmp_path / "back.skelgen"
    assert main(["correct", str(rods), "--list"]) == 0
    assert re.search(r"0 .* the limb of rear rod 1 is the root .* joints", capsys.readouterr().out)
    assert main(["correct", str(rods), "--take-back", "0", "-o", str(target)]) == 0
    assert f"to be run again: joints, skeleton (skelgen run {target})" in " ".join(capsys.readouterr().err.split())
    back = skelgen.load(target)
    assert back.corrections == () and back.has("limbs") and not back.has("joints")
    assert main(["correct", str(target), "--list"]) == 0
    assert "nothing is stated" in capsys.readouterr().out


def test_markers_that_are_seen_together_are_merged_with_a_note(rods, tmp_path, capsys):
    target = tmp_path / "two words.skelgen"
    assert main(["correct", str(rods), "merge", "rear rod 1", "rear rod 2", "-o", str(target)]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "seen at the same time in 100 frames" in said
    assert f"(skelgen run '{target}')" in said


def test_what_was_never_stated_cannot_be_taken_back(rods, tmp_path, capsys):
    for index in (1, -2):
        with pytest.raises(InputError, match=f"no correction {index} .* there are 0 to 0"):
            skelgen.take_back(skelgen.load(rods), index)
    assert main(["correct", str(rods), "--take-back", "7", "-o", str(tmp_path / "back.skelgen")]) == 2
    assert main(["correct", str(rods), "root", "rear rod 1", "--take-back", "0"]) == 2
    assert "--take-back N" in capsys.readouterr().err


def test_the_last_correction_is_taken_back_by_minus_one(rods):
    twice = skelgen.correct(skelgen.load(rods), "rename", ["rear rod 1"], "tip")
    assert [one.kind for one in skelgen.take_back(twice, -1).corrections] == ["root"]


def test_help_of_the_command_names_every_kind(capsys):
    assert main(["correct", "--help"]) == 0
    words = set(re.findall(r"[\w-]+", capsys.readouterr().out))
    assert set(RULES) - words == set()


@pytest.mark.parametrize(
    ("kind", "names", "value", "frames", "said"),
    [
        ("kind", ["rear rod 1", "middle rod 1"], "knee", (None, None), "'knee' is no type of a joint; there are ball"),
        ("delete", ["rear rod 1"], "", (5, 100), "no frame 100; the last one is 99"),
    ],
)
def test_what_no_run_could_obey_is_refused_when_it_is_stated(rods, kind, names, value, frames, said):
    with pytest.raises(InputError, match=said):
        skelgen.correct(skelgen.load(rods), kind, names, value, frames)
