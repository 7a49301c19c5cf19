"""Markers that stand still while others move are named, limbs that rest are not."""

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.advice import advice_on, open_questions, standing_markers
from skelgen.model import Identities, Identity, Labelling, PointCloud, Project, StageReport, Trajectories
from skelgen.model.labelling import Doubt, Tracklets
from skelgen.simulation import simulate


def project_with(fixed, noise, sway=0.0):
    """Six markers at 100 Hz that walk on; the last `fixed` of them rest from frame 300 on, and sway there [mm]."""
    rng = np.random.default_rng(0)
    path = rng.uniform(0, 500, (6, 3)) + np.arange(800.0)[:, np.newaxis, np.newaxis]
    swaying = sway * np.sin(np.arange(500) / 30)[:, np.newaxis, np.newaxis]
    path[300:, 6 - fixed :] = path[300, 6 - fixed :] + swaying
    take = Trajectories(path + noise * rng.normal(size=path.shape), tuple("abcdef"), 100.0)
    return Project(take).with_trajectories(take, StageReport())


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_a_marker_that_fell_off_is_found_with_its_frame(noise):
    ((marker, first),) = standing_markers(project_with(1, noise))
    assert marker == 5
    assert abs(first - 300) <= 2


def test_the_advice_names_it_and_its_frame():
    project = project_with(1, 0.0)
    seen = project.trajectories.seen
    labelling = Labelling(np.where(seen, 0.99, np.nan), (), (), np.zeros(len(seen), dtype=int))
    told = advice_on(Project(project.take).with_trajectories(project.trajectories, StageReport(), labelling))
    assert "f from frame 300 on" in told[0]


def test_a_marker_that_sways_is_on_a_body_that_holds_still():
    assert standing_markers(project_with(1, 0.3, sway=0.5)) == ()


def test_three_markers_that_rest_together_are_a_limb():
    assert standing_markers(project_with(3, 0.3)) == ()
    assert len(standing_markers(project_with(2, 0.3))) == 2


def haunted():
    """Points of rods, and a reflection that stays in its place, without names."""
    take = simulate("rods", n_frames=400, noise=0.2, seed=1).take
    ghost = np.array([900.0, 900.0, 400.0]) + np.random.default_rng(0).normal(0.0, 0.2, (400, 1, 3))
    points = np.concatenate([take.positions, ghost], axis=1)
    n_points = points.shape[1]
    return PointCloud(points.reshape(-1, 3), np.arange(401) * n_points, take.times)


def test_it_is_asked_whether_a_reflection_that_stays_is_a_marker_and_answered_once():
    project = skelgen.reconstruct(haunted(), until="limbs")
    (question,) = open_questions(project)
    (ghost,) = question.markers
    name = project.trajectories.names[ghost]
    assert question.kind == "still"
    assert question.sentence(project.trajectories.names).startswith(f"is {name}, which stands still in frames 0 to 399")
    confirmed = skelgen.correct(project, "confirm", [name])
    assert open_questions(confirmed) == standing_markers(confirmed) == ()
    assert open_questions(skelgen.correct(confirmed, "rename", [name], "glove")) == ()
    without = skelgen.correct(project, "delete", [name])
    for answered in (without, skelgen.reconstruct(without, until="limbs")):
        assert name not in answered.trajectories.names
        assert open_questions(answered) == ()


def test_a_track_that_is_stated_to_be_nobody_is_not_asked_for_again():
    project = skelgen.reconstruct(haunted(), until="labels", n_markers=9)
    (question,) = open_questions(project)
    assert question.kind == "whose"
    stated = Identities((Identity("nobody", 0, question.position),))
    assert open_questions(skelgen.reconstruct(haunted(), until="labels", n_markers=9, identities=stated)) == ()


@pytest.fixture
def followed():
    """Rods without labels; the first marker is one track, and unseen in its middle."""
    project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=61, labelled=False).take, until="labels")
    markers, labelling = project.trajectories, project.labelling
    positions, confidence = markers.positions.copy(), labelling.confidence.copy()
    positions[30, 0], confidence[30, 0] = np.nan, np.nan
    labelling = replace(labelling, confidence=confidence, tracklets=Tracklets([0], [0], [0], [60], [60]), doubts=())
    return replace(project, _trajectories=replace(markers, positions=positions), _labelling=labelling)


def test_a_confirmed_marker_whose_track_has_a_gap_in_the_middle_keeps_it(followed):
    confirmed = skelgen.correct(followed, "confirm", [followed.trajectories.names[0]], frames=(0, 10))
    assert confirmed.labelling.tracklets.marker.tolist() == [0]
    assert open_questions(confirmed) == ()


def test_it_is_not_asked_whether_what_the_user_named_is_a_marker(followed):
    doubt = Doubt(0, 5, 25, "alone", -1, 0.2, "nothing says so")
    doubtful = replace(followed, _labelling=replace(followed.labelling, doubts=(doubt,)))
    lower = replace(doubtful.labelling, confidence=np.minimum(doubtful.labelling.confidence, 0.2))
    doubtful = replace(doubtful, _labelling=lower)
    name, place = followed.trajectories.names[0], tuple(followed.trajectories.positions[5, 0])
    assert [one.kind for one in open_questions(doubtful)] == ["real"]
    named = replace(doubtful, identities=Identities((Identity(name, 5, place),)))
    assert open_questions(named) == ()
