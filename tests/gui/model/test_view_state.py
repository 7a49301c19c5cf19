"""What the window shows survives the project file; what no window has written is left out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from skelgen_gui.model.view_state import KeptVideo, ViewState
from skelgen_gui.model.viewpoint import cameras_of

from skelgen.capture.reference_rig import reference_rig
from skelgen.model import Project

POSE = np.eye(4).ravel().tolist()


@pytest.fixture
def project(walked):
    return Project(walked[0].take)


def stored(project):
    """The project as its file gives it back."""
    return replace(project, view=json.loads(json.dumps(dict(project.view))))


def test_a_project_without_a_view_gives_the_first_one(project):
    state = ViewState.of(project)
    assert (state.page, state.tab, state.frame, state.forms, state.cameras) == ("", 0, 0, {}, ())


def test_what_the_window_shows_survives_the_project_file(project):
    cameras = cameras_of(reference_rig())
    forms = {"limbs": {"method": "rigidity", "alpha": 0.5}}
    state = ViewState.of(stored(ViewState("joints", 2, 17, forms, cameras).kept_in(project)))
    assert (state.page, state.tab, state.frame, state.forms) == ("joints", 2, 17, forms)
    for camera, same in zip(cameras, state.cameras, strict=True):
        np.testing.assert_allclose(same.lines(400.0), camera.lines(400.0))


@pytest.mark.parametrize("kept", [None, {}, {"path": 5}, {"path": "walk.avi", "offset": "late"}, "walk.avi"])
def test_a_video_survives_the_project_file_and_what_is_none_is_left_out(project, kept):
    video = KeptVideo("walk.avi", 0.2, 25.0)
    assert ViewState.of(stored(ViewState(video=video).kept_in(project))).video == video
    assert ViewState.of(replace(project, view={"video": kept})).video is None


def test_names_in_the_project_file_are_those_of_version_0_1(project):
    view = ViewState("joints", 2, 17).kept_in(project).view
    assert set(view) == {"page", "tab", "frame", "forms", "cameras"}


@pytest.mark.parametrize(
    "kept",
    [
        5,
        "no",
        [{}],
        [{"pose": [1.0] * 16, "size": [1, 1], "focal": [1, 1]}],
        [{"pose": "x"}],
        [None],
        [{"pose": POSE, "size": [640, 0], "focal": [800, 800]}],
    ],
)
def test_what_is_no_camera_is_left_out(project, kept):
    assert ViewState.of(replace(project, view={"cameras": kept})).cameras == ()


def test_a_camera_of_an_older_project_is_shown(project):
    kept = [{"pose": POSE, "size": [640, 480], "focal": [800, 800]}]
    assert len(ViewState.of(replace(project, view={"cameras": kept})).cameras) == 1
