"""Markers that stand still while others move are named, limbs that rest are not."""

import numpy as np
import pytest

from skelgen.app.advice import advice_on
from skelgen.app.standing import standing_markers
from skelgen.model import Labelling, Project, StageReport, Trajectories


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
