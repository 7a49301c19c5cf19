"""Stages in their order, resumed anywhere, with checks before and reports after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.configuration import Settings
from skelgen.app.constraints import RunOptions
from skelgen.app.inputs import AXIS_LENGTHS
from skelgen.app.pipeline import run_stages
from skelgen.errors import Cancelled, InputError, MissingResultError, ParameterError
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen.model.project import STAGES
from skelgen.progress import SilentMonitor
from skelgen.simulation import simulate
from skelgen.stages.joints import JointParameters
from skelgen.stages.labels import LabelParameters


def cloud_from(take: Trajectories) -> PointCloud:
    n_frames, n_markers = take.positions.shape[:2]
    return PointCloud(take.positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, take.times, name="w.mfml")


def spinning_bodies(n_frames=8) -> Poses:
    """Two bodies: the first rests at the origin, the second turns about z at (500, 0, 0)."""
    poses = np.tile(np.eye(4), (n_frames, 2, 1, 1))
    for frame, angle in enumerate(np.linspace(0, 2, n_frames)):
        poses[frame, 1, :2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        poses[frame, 1, 0, 3] = 500
    return Poses(poses, ("base", "tip"), 100.0, "b.csv")


def test_every_stage_runs_and_reports(waving):
    project = run_stages(Project(waving))
    assert tuple(project.reports) == STAGES
    assert all(project.has(name) for name in STAGES)
    assert project.reports["joints"].parameters == JointParameters().as_mapping()
    assert all(report.seconds >= 0 for report in project.reports.values())


def test_labelled_markers_are_searched_for_errors(waving):
    project = run_stages(Project(waving), until_stage="labels")
    assert project.trajectories is waving
    assert project.reports["labels"].parameters == LabelParameters().as_mapping()
    assert "labelled already" in project.reports["labels"].notices[0]


def test_notices_of_limbs_call_them_by_the_names_that_they_get():
    take = simulate("rods", n_frames=200, seed=1, noise=0.3).take
    positions = take.positions.copy()
    positions[20:, take.names.index("rear rod 2")] = np.nan
    project = run_stages(Project(replace(take, positions=positions)), until_stage="limbs")
    (notice,) = project.reports["limbs"].notices
    assert notice.startswith("rear rod 2 is seen in 20 frames only: that it is on rear rod rests")


def test_a_marker_set_that_does_not_exist_is_refused_before_any_work(waving):
    class Watched(SilentMonitor):
        def begin(self, name):
            pytest.fail(f"{name} has begun")

    with pytest.raises(ParameterError, match="no marker set 'mine'; there are auto, none, "):
        skelgen.reconstruct(waving, parameters={"limbs": {"marker_set": "mine"}}, monitor=Watched())


def test_points_are_labelled_with_the_known_number(waving):
    project = run_stages(Project(cloud_from(waving)), options=RunOptions(n_markers=5), until_stage="labels")
    assert project.trajectories.n_markers == 5
    assert project.reports["labels"].notices[0] == "the number of markers was given: 5"


def test_another_number_of_markers_than_names_is_an_input_error(waving):
    named = waving.n_markers
    assert run_stages(Project(waving), options=RunOptions(n_markers=named), until_stage="labels").has("labels")
    with pytest.raises(InputError, match=f"5 markers are asked for, but the take has {named} with names"):
        run_stages(Project(waving), options=RunOptions(n_markers=5), until_stage="labels")


def test_stages_resume_where_results_end(waving):
    half = run_stages(Project(waving), until_stage="limbs")
    whole = run_stages(half)
    assert whole.limbs is half.limbs
    assert whole.has("skeleton")


def test_a_repeated_stage_drops_what_followed(waving):
    whole = run_stages(Project(waving))
    again = run_stages(whole, "limbs", "limbs", options=RunOptions(n_limbs=3))
    assert again.limbs.n_limbs == 3
    assert not again.has("joints")
    assert tuple(again.reports) == ("labels", "limbs")


def test_finished_project_runs_again_from_the_start(waving):
    whole = run_stages(Project(waving))
    again = run_stages(whole, settings=Settings({"joints": {"alpha": 0.5}}))
    assert again.topology.alpha == 0.5
    assert again.has("skeleton")


def test_stage_without_its_predecessor_says_what_is_missing(waving):
    with pytest.raises(MissingResultError, match="'joints' needs the result of 'labels'"):
        run_stages(Project(waving), from_stage="joints")


@pytest.mark.parametrize("span", [("fitting", None), (None, "fitting")])
def test_unknown_stage_lists_the_known_ones(waving, span):
    with pytest.raises(InputError, match="labels, limbs, joints, skeleton"):
        run_stages(Project(waving), *span)


def test_stages_in_the_wrong_order_are_refused(waving):
    whole = run_stages(Project(waving))
    with pytest.raises(InputError, match="comes after"):
        run_stages(whole, "skeleton", "limbs")


def test_bodies_become_markers_on_rigid_limbs():
    project = run_stages(Project(spinning_bodies()))
    points = ("o", "x", "y", "z", "-x", "-y", "-z")
    assert project.trajectories.names == tuple(f"{body}:{point}" for body in ("base", "tip") for point in points)
    assert project.limbs.limb_of_marker.tolist() == [0] * 7 + [1] * 7
    within = project.limbs.distance_deviation[:7, :7]
    assert within.max() < 1e-9  # mm: rounding of distances near 100 mm
    assert project.limbs.distance_deviation[1, 8] > 1
    assert "body:o" in project.reports["labels"].notices[0]


def test_axis_markers_follow_the_bodies():
    poses = spinning_bodies()
    project = run_stages(Project(poses), until_stage="labels")
    markers = dict(zip(project.trajectories.names, np.moveaxis(project.trajectories.positions, 1, 0), strict=True))
    length = np.linalg.norm(markers["tip:y"][0] - markers["tip:o"][0])
    assert AXIS_LENGTHS[0] <= length <= AXIS_LENGTHS[1]
    expected = poses.world_from_body[:, 1] @ [0, length, 0, 1]
    np.testing.assert_allclose(markers["tip:y"], expected[:, :3], atol=1e-9)


def test_unseen_body_gives_unseen_markers():
    transforms = np.array(spinning_bodies().world_from_body)
    transforms[2, 0] = np.nan
    project = run_stages(Project(Poses(transforms, ("base", "tip"), 100.0)), until_stage="limbs")
    assert project.trajectories.seen[2].tolist() == [False] * 7 + [True] * 7
    assert np.isfinite(project.limbs.distance_deviation).all()


def test_bodies_cannot_be_another_number_of_limbs():
    with pytest.raises(InputError, match="2 bodies"):
        run_stages(Project(spinning_bodies()), options=RunOptions(n_limbs=3))


def test_cancelled_run_raises_and_changes_nothing(waving):
    class Stopping(SilentMonitor):
        def advance(self, done, total):
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        run_stages(Project(waving), monitor=Stopping())


UNUSABLE = {
    "two frames": (lambda p: p[:2], "2 frames where at least 3"),
    "one marker": (lambda p: p[:, 3:4], "only 1 marker"),
    "one marker of six seen": (lambda p: np.where(np.arange(6)[:, None] == 3, p, np.nan), "only 1 marker"),
    "nothing seen": (lambda p: p * np.nan, "no marker is seen"),
    "no motion": (lambda p: np.tile(p[:1], (20, 1, 1)), "nothing moves"),
}


@pytest.mark.parametrize(("change", "sentence"), UNUSABLE.values(), ids=UNUSABLE)
def test_unusable_take_is_an_input_error_that_names_it(waving, change, sentence):
    positions = change(waving.positions)
    take = Trajectories(positions, waving.names[: positions.shape[1]], 50.0, "bad.trc")
    with pytest.raises(InputError, match=f"bad.trc: {sentence}"):
        run_stages(Project(take))


def test_empty_cloud_is_an_input_error():
    with pytest.raises(InputError, match="no marker"):
        run_stages(Project(PointCloud(np.zeros((0, 3)), np.zeros(6, int), np.arange(5.0))))
