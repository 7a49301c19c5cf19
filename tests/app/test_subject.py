"""One body, many takes: from the command line to the files, and several takes calibrated together."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skelgen
from skelgen.app.several_takes import calibrate_together
from skelgen.app.subject import run_with_subject
from skelgen.cli import main
from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model import PointCloud, Poses, Project
from skelgen.model.corrections import Correction
from skelgen.simulation import Structure, find_structure, read_truth, simulate

FRAMES = 200
OPTIONS = {"n_frames": FRAMES, "noise": 1.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A range-of-motion take of the rods, reconstructed, and another take of them without names."""
    place = tmp_path_factory.mktemp("takes")
    words = ["--n-frames", str(FRAMES), "--noise", "0.3", "-q"]
    assert main(["simulate", "rods", "-o", str(place / "rom.c3d"), "--seed", "1", *words]) == 0
    assert main(["run", str(place / "rom.c3d"), "-o", str(place / "rom"), "-q"]) == 0
    assert main(["simulate", "rods", "-o", str(place / "walk.mfml"), "--seed", "2", "--no-labelled", *words]) == 0
    return place


@pytest.mark.parametrize("command", ["fit", "run"])
def test_take_is_fitted_by_the_skeleton_of_another_one(folder, tmp_path, command):
    words = [command, "--skeleton", str(folder / "rom"), str(folder / "walk.mfml"), "-o", str(tmp_path / "out"), "-q"]
    assert main(words) == 0
    project = skelgen.app.project_file.archive.open_project(tmp_path / "out" / "walk.skelgen")
    scores = evaluate(project, read_truth(folder / "walk.truth.npz"))
    assert scores.labels.idf1 > 0.99
    assert scores.as_mapping()["summary"]["mean_joint_error"] < 1.0
    known = skelgen.app.project_file.archive.open_project(folder / "rom" / "rom.skelgen")
    assert project.skeleton.lengths == known.skeleton.lengths
    assert project.labelling.subject == str(folder / "rom.c3d")
    assert {".xml", ".html", ".json"} <= {path.suffix for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["run", "--skeleton", "rom", "walk.mfml", "--n-limbs", "3"], "--n-limbs cannot be given beside --skeleton"),
        (["fit", "--skeleton", "walk.skelgen", "walk.mfml"], "walk.skelgen"),
        (["calibrate", "skeleton", "rom.c3d", "-o", "out"], "give at least two"),
        (["calibrate", "skeleton", "rom.c3d", "./rom.c3d", "-o", "out"], "two results would be called 'rom'"),
    ],
)
def test_what_cannot_be_done_is_refused(folder, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(folder)
    assert main(words) == 2
    assert sentence in capsys.readouterr().err


def test_takes_are_calibrated_together_from_the_command_line(folder, tmp_path):
    takes = [str(folder / name) for name in ("rom.c3d", "walk.mfml")]
    assert main(["calibrate", "skeleton", *takes, "-o", str(tmp_path), "-q"]) == 0
    projects = [
        skelgen.app.project_file.archive.open_project(tmp_path / name)
        for name in ("skeleton.skelgen", "rom/rom.skelgen", "walk/walk.skelgen")
    ]
    assert [project.motion.n_frames for project in projects] == [2 * FRAMES, FRAMES, FRAMES]
    assert projects[1].skeleton.lengths == projects[2].skeleton.lengths == projects[0].skeleton.lengths


def test_two_takes_tell_lengths_better_than_one():
    errors = []
    for seed in (1, 2, 3):
        sims = [simulate("human", seed=seed + first, **OPTIONS) for first in (0, 100)]
        both = calibrate_together([one.take for one in sims])
        alone = [evaluate(skelgen.reconstruct(one.take), one.truth) for one in sims]
        together = [evaluate(project, one.truth) for project, one in zip(both.takes, sims, strict=True)]
        errors.append(
            [[one.as_mapping()["summary"]["mean_length_error"] for one in some] for some in (alone, together)]
        )
    alone, together = np.mean(errors, axis=(0, 2))
    assert together < 0.85 * alone  # twice the frames: 0.71 where the motions tell as much


def test_marker_that_slipped_between_takes_does_not_spoil_the_skeleton():
    first, second = (simulate("human", seed=seed, n_frames=FRAMES, noise=0.5) for seed in (1, 2))
    positions = np.array(second.take.positions)
    pose = second.truth.world_from_limb[:, 3, :3, :3]
    positions[:, 10] += pose @ np.array([0.0, 0.0, 25.0])
    moved = skelgen.Trajectories(positions, second.take.names, second.take.rate, "second")
    both = calibrate_together([first.take, moved])
    names = both.skeleton.trajectories.names
    assert "left upper arm 2" in names
    assert "left upper arm 2 in second" in names
    assert both.skeleton.skeleton.marker_std[names.index("left upper arm 2")] < 1.0


def test_bodies_with_orientation_are_not_calibrated_together():
    poses = Poses(np.tile(np.eye(4), (10, 2, 1, 1)), ("a", "b"), 50.0, "sensors")
    with pytest.raises(InputError, match="sensors: holds bodies with orientation"):
        calibrate_together([poses, poses])


class TestSensors:
    """Sensors on the limbs of the quadruped, off by 0.5 mm and a tenth of a degree."""

    SHIFT, TURN = 0.5, 0.002  # mm, rad

    def sensors(self, seed, mounts=None, structure="quadruped", n_frames=300):
        truth, random = simulate(structure, seed=seed, n_frames=n_frames).truth, np.random.default_rng(seed)
        world = truth.world_from_limb @ self.mounts(truth.n_limbs) if mounts is None else truth.world_from_limb @ mounts
        world = world.copy()
        world[..., :3, :3] @= matrix_from_vector(self.TURN * random.normal(size=(*world.shape[:2], 3)))
        world[..., :3, 3] += self.SHIFT * random.normal(size=(*world.shape[:2], 3))
        return Poses(world, truth.limb_names, 100.0, "sensors"), truth

    @staticmethod
    def mounts(n_limbs, seed=0):
        random = np.random.default_rng(seed)
        vectors, places = random.normal(size=(n_limbs, 3)), 30 * random.normal(size=(n_limbs, 3))
        return transform_from(matrix_from_vector(vectors), places)

    @staticmethod
    def joint_error(project, truth):
        """Mean distance [mm] of joints from the true ones that lie across the axes of hinges."""
        names = [name.rpartition(":")[0] for name in project.trajectories.names]
        body = [names[int(project.skeleton.markers_of(limb)[0])] for limb in range(project.skeleton.n_limbs)]
        apart = []
        for index, joint in enumerate(project.skeleton.joints):
            pair = {body[joint.parent], body[joint.child]}
            true = next(
                number
                for number, edge in enumerate(truth.edges.tolist())
                if {truth.limb_names[limb] for limb in edge} == pair
            )
            if truth.joint_kinds[true] == "ball":
                off = project.motion.joint_positions[:, index] - truth.joint_positions[:, true]
                apart.append(np.linalg.norm(off, axis=1).mean())
        return float(np.mean(apart))

    def said(self, project):
        return "; ".join(project.reports["labels"].notices)

    def test_lengths_are_those_of_the_calibrated_take(self, known):
        take, truth = self.sensors(2)
        walk = run_with_subject(Project(take), known)
        assert walk.skeleton.lengths == known.skeleton.lengths
        assert "elsewhere" not in self.said(walk)
        assert "hold together" not in self.said(walk)
        assert self.joint_error(walk, truth) < 1.0

    def test_sensor_that_moved_is_placed_anew(self, known):
        mounts = self.mounts(17)
        limb = self.sensors(2, n_frames=30)[1].limb_names.index("trunk")
        mounts[limb, :3, 3] += [8.0, 0.0, 0.0]
        take, truth = self.sensors(2, mounts)
        walk = run_with_subject(Project(take), known)
        [shift] = re.findall(r"placed anew by their joints: trunk by ([\d.]+) mm", self.said(walk))
        assert float(shift) == pytest.approx(8.0, abs=0.5)
        assert self.joint_error(walk, truth) < 1.5

    def test_all_sensors_put_on_anew(self, known):
        take, truth = self.sensors(2, self.mounts(17, seed=5))
        walk = run_with_subject(Project(take), known)
        assert self.said(walk).count(" mm and ") == 17
        assert self.joint_error(walk, truth) < 3.0  # what 300 frames tell of joints that all sensors carry anew
        assert walk.skeleton.lengths == known.skeleton.lengths

    def test_larger_body_does_not_hold_together(self, known):
        take, _ = self.sensors(2, structure=larger(1.05))
        assert "this is another body" in self.said(run_with_subject(Project(take), known))

    def test_missing_and_unknown_bodies_are_said(self, known):
        take, _ = self.sensors(2)
        names = ("spare", *take.names[1:])
        said = self.said(run_with_subject(Project(Poses(take.world_from_body, names, take.rate, "sensors")), known))
        assert f"does not have: {take.names[0]}" in said
        assert "left out: spare" in said

    def test_other_names_and_other_kinds_of_takes_are_refused(self, known):
        take, _ = self.sensors(2)
        other = Poses(take.world_from_body, tuple(f"s{index}" for index in range(17)), take.rate, "sensors")
        with pytest.raises(InputError, match="sensors: its bodies are called s0, s1"):
            run_with_subject(Project(other), known)
        with pytest.raises(
            InputError, match="holds markers, and the calibrated skeleton is of bodies with orientation"
        ):
            run_with_subject(Project(simulate("rods", n_frames=100).take), known)


@pytest.fixture(scope="module")
def known():
    """The quadruped calibrated with sensors."""
    return skelgen.reconstruct(TestSensors().sensors(1)[0])


def larger(factor):
    """The quadruped with longer bones."""
    body = find_structure("quadruped")
    limbs = [
        dataclasses.replace(limb, joint=factor * np.asarray(limb.joint), segment=factor * np.asarray(limb.segment))
        for limb in body.limbs
    ]
    return Structure(body.name, tuple(limbs))


def test_names_that_the_user_gave_stay_when_the_take_is_labelled_by_the_skeleton_again(folder):
    known = skelgen.load(folder / "rom")
    project = run_with_subject(Project(skelgen.read(folder / "walk.mfml")), known)
    marker = project.trajectories.names[0]
    stated = skelgen.correct(skelgen.correct(project, "name", [marker], "boom"), "rename", [marker], "tip")
    deleted = skelgen.correct(stated, "delete", [project.trajectories.names[-1]])
    again = run_with_subject(deleted, known)
    assert again.trajectories.names == ("tip", *project.trajectories.names[1:])
    assert again.limbs.names[again.limbs.limb_of_marker[0]] == again.skeleton.limb_names[0] == "boom"
    last = project.trajectories.names[-1]
    assert not again.trajectories.seen[:, -1].any()
    assert f"as stated: {last} is nobody" in again.reports["labels"].notices


def test_markers_that_the_user_corrected_stay_so_when_the_skeleton_labels_the_take_again(folder):
    known = skelgen.load(folder / "rom")
    project = run_with_subject(Project(skelgen.read(folder / "walk.mfml")), known)
    first, second, third = project.trajectories.names[:3]
    stated = skelgen.correct(project, "swap", [first, second], frames=(50, 80))
    stated = skelgen.correct(stated, "delete", [third], frames=(100, 120))
    stated = skelgen.correct(stated, "split", [second], "glove", frames=(150, None))
    assert stated.skeleton.lengths == known.skeleton.lengths
    assert not stated.motion.residuals[100:121, 2].any() or np.isnan(stated.motion.residuals[100:121, 2]).all()
    again = run_with_subject(stated, known)
    assert again.trajectories.names == stated.trajectories.names
    np.testing.assert_allclose(again.motion.world_from_limb, stated.motion.world_from_limb, atol=1e-6)
    np.testing.assert_array_equal(again.trajectories.positions, stated.trajectories.positions)
    assert again.labelling.confidence[60, :2].min() > 0.99
    assert again.limbs.limb_of_marker[-1] == -1
    assert not any(notice.startswith("not obeyed") for notice in again.reports["labels"].notices)


def test_corrections_of_markers_that_the_skeleton_does_not_find_are_passed_over_and_told(folder):
    known = skelgen.load(folder / "rom")
    alone = Project(skelgen.read(folder / "walk.mfml"))
    ghost = dataclasses.replace(alone, corrections=(Correction("delete", ("M007",)),))
    told = run_with_subject(ghost, known).reports["labels"].notices
    assert any("passed over" in notice and "'M007'" in notice for notice in told)


def test_a_take_that_a_skeleton_labelled_keeps_it_when_a_correction_is_taken_back(folder):
    project = run_with_subject(Project(skelgen.read(folder / "walk.mfml")), skelgen.load(folder / "rom"))
    first, second, third = project.trajectories.names[:3]
    stated = skelgen.correct(project, "rename", [first], "tip")
    stated = skelgen.correct(stated, "swap", ["tip", second], frames=(50, 80))
    stated = skelgen.correct(stated, "split", [third], "glove", frames=(150, None))
    for _ in range(3):
        stated = skelgen.take_back(stated, 0)
    assert stated.trajectories.names == project.trajectories.names
    np.testing.assert_array_equal(stated.trajectories.positions, project.trajectories.positions)
    np.testing.assert_allclose(stated.motion.world_from_limb, project.motion.world_from_limb, atol=1e-6)
    assert stated.labelling.subject == project.labelling.subject
    assert not any("as stated" in notice for notice in stated.reports["labels"].notices)


def test_run_of_a_take_that_a_skeleton_labelled_says_that_it_does_without(folder):
    take = skelgen.apply_subject(skelgen.read(folder / "walk.mfml"), folder / "rom")
    again = skelgen.app.pipeline.run_stages(take, until_stage="limbs")
    assert ["rom.c3d, which this run does without" in " ".join(one.notices) for one in again.reports.values()] == [1, 0]


def test_taking_back_what_a_skeleton_decides_changes_no_result(folder):
    take = skelgen.read(folder / "walk.mfml")
    stated = Project(take, corrections=(Correction("n_limbs", value="2"),))
    project = run_with_subject(stated, skelgen.load(folder / "rom"))
    before = skelgen.take_back(project, 0)
    assert before.skeleton is project.skeleton and not before.corrections
    assert not any("not obeyed" in notice for notice in before.reports["labels"].notices)


def alike(folder, names, take):
    """What is said of a take labelled by copies of one skeleton, one of each name."""
    rom = skelgen.load(folder / "rom")
    called = [dataclasses.replace(rom, take=dataclasses.replace(rom.take, name=name), source=None) for name in names]
    return " ".join(skelgen.apply_subject(take, called).reports["labels"].notices)


def test_of_three_bodies_that_are_alike_all_that_are_absent_are_told(folder):
    told = alike(folder, ["anna", "ben", "carl"], skelgen.read(folder / "walk.mfml"))
    assert "not all of anna, ben and carl are there; ben and carl are taken as absent" in told


def test_bodies_that_are_alike_may_be_exchanged_and_a_notice_says_where(folder):
    cloud = simulate("rods", n_frames=FRAMES, noise=0.3, seed=2, labelled=False, subjects=2).take
    frames = np.repeat(np.arange(FRAMES), np.diff(cloud.frame_starts))
    is_seen = (frames < 80) | (frames >= 120)
    starts = np.searchsorted(frames[is_seen], np.arange(FRAMES + 1))
    told = alike(folder, ["anna", "ben"], PointCloud(cloud.points[is_seen], starts, cloud.times))
    assert "anna and ben are alike, so that which is which is not known" in told
    assert "they may change places at frame 120," in told
