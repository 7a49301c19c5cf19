"""The project: results in order, later ones dropped when an earlier one is replaced."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.errors import MissingResultError
from skelgen.model import Labelling, Project, StageReport

STAGES = ("labels", "limbs", "joints", "skeleton")


def replaced(project, stage):
    """The project with the result of one stage put in again."""
    report = StageReport(seconds=99.0)
    return {
        "labels": lambda: project.with_trajectories(project.trajectories, report),
        "limbs": lambda: project.with_limbs(project.limbs, report),
        "joints": lambda: project.with_topology(project.topology, report),
        "skeleton": lambda: project.with_skeleton(project.skeleton, project.motion, report),
    }[stage]()


@pytest.mark.parametrize("stage", STAGES)
def test_replacing_a_result_drops_those_after_it(small_project, stage):
    project = replaced(small_project, stage)
    kept = STAGES[: STAGES.index(stage) + 1]
    assert [name for name in STAGES if project.has(name)] == list(kept)
    assert tuple(project.reports) == kept
    assert project.reports[stage].seconds == 99.0


def test_account_of_labels_stays_with_them(small_project):
    trajectories = small_project.trajectories
    left_out = np.zeros(trajectories.n_frames, dtype=int)
    labelling = Labelling(np.where(trajectories.seen, 1.0, np.nan), (), (), left_out)
    project = small_project.with_trajectories(trajectories, StageReport(), labelling)
    assert project.with_limbs(small_project.limbs, StageReport()).labelling is labelling
    assert not project.with_trajectories(trajectories, StageReport()).has_labelling


def test_replacing_a_result_keeps_take_and_seed(small_project):
    project = replaced(small_project, "limbs")
    assert project.take is small_project.take
    assert project.seed == small_project.seed
    assert project.trajectories is small_project.trajectories


def test_projects_are_never_changed(small_project):
    replaced(small_project, "labels")
    assert all(small_project.has(name) for name in STAGES)
    with pytest.raises(dataclasses.FrozenInstanceError):
        small_project.seed = 3


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        ("trajectories", "this project has no labelled markers yet: run the stage 'labels' first"),
        ("limbs", "this project has no limbs yet: run the stage 'limbs' first"),
        ("topology", "this project has no joints yet: run the stage 'joints' first"),
        ("skeleton", "this project has no skeleton yet: run the stage 'skeleton' first"),
        ("motion", "this project has no motion yet: run the stage 'skeleton' first"),
    ],
)
def test_missing_result_says_which_stage_to_run(small_project, result, sentence):
    with pytest.raises(MissingResultError, match=f"^{sentence}$"):
        getattr(Project(small_project.take), result)


def test_stage_before_its_predecessor_is_refused(small_project):
    with pytest.raises(MissingResultError, match="'limbs' needs the result of 'labels'; run that first"):
        Project(small_project.take).with_limbs(small_project.limbs, StageReport())


def test_take_gives_the_project_its_name(small_project):
    assert small_project.name == small_project.take.name


def test_projects_are_compared_by_identity(small_project):
    assert small_project != dataclasses.replace(small_project)
    assert np.array_equal(small_project.trajectories.positions, small_project.take.positions, equal_nan=True)
