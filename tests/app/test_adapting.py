"""Takes whose file says rate, unit or axis wrongly, and parts of takes."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.app.first_look import AdaptParameters, adapted
from skelgen.errors import InputError
from skelgen.model import PointCloud, Poses, Project, Trajectories

POSITIONS = np.arange(60.0).reshape(10, 2, 3)
MARKERS = Trajectories(POSITIONS, ("a", "b"), 50.0, name="wave.csm")
POINTS = PointCloud(
    POSITIONS.reshape(20, 3), np.arange(0, 21, 2), np.arange(10) / 50.0, {"id": np.arange(20.0)}, name="wave.mfml"
)
BODIES = Poses(np.tile(np.eye(4), (10, 2, 1, 1)), ("a", "b"), 50.0)


@pytest.mark.parametrize("take", [MARKERS, POINTS, BODIES], ids=["markers", "points", "bodies"])
def test_a_part_of_a_take_has_its_frames_and_the_rate_that_is_given(take):
    part = adapted(Project(take), AdaptParameters(first_frame=2, last_frame=5, rate=25.0)).take
    assert (part.n_frames, part.rate) == (4, 25.0)
    assert part.notices[-1] == "opened with first frame 2, last frame 5, rate 25.0"


def test_points_of_a_part_are_those_of_its_frames():
    part = adapted(Project(POINTS), AdaptParameters(first_frame=3)).take
    np.testing.assert_array_equal(part.frame(0), POINTS.frame(3))
    np.testing.assert_array_equal(part.attributes["id"], np.arange(6.0, 20.0))


def test_metres_that_were_taken_for_millimetres_are_mended_and_z_turned_to_y():
    changed = adapted(Project(MARKERS), AdaptParameters(unit="m", axes="z-to-y")).take
    np.testing.assert_array_equal(changed.positions[..., 1], 1000 * POSITIONS[..., 2])


def test_nothing_changed_is_the_same_project_and_a_changed_one_refers_to_no_file():
    project = Project(MARKERS)
    assert adapted(project, AdaptParameters()) is project
    assert adapted(project, AdaptParameters(rate=10.0)).source is None


def test_a_part_beyond_the_end_is_refused():
    with pytest.raises(InputError, match=r"wave\.csm: frames 10 to 9 are asked for, and it has 0 to 9"):
        adapted(Project(MARKERS), AdaptParameters(first_frame=10))
