"""Projects that refer to their recording read it again, where it was or beside them, and only if it is the same."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

import skelgen
from skelgen.app.files import open_input
from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.archive import open_project, save_project
from skelgen.errors import FormatError, WriteError
from skelgen.model import Project
from skelgen.simulation import simulate


@pytest.fixture
def recording(tmp_path):
    """A recording of labelled rods in a folder of its own."""
    path = tmp_path / "recordings" / "rods.c3d"
    path.parent.mkdir()
    skelgen.write(simulate("rods", n_frames=60, noise=0.1).take, path)
    return path


@pytest.fixture
def project(recording):
    return run_stages(open_input(recording))


def test_a_project_that_refers_is_small_and_opens_as_it_was(project, tmp_path):
    small = save_project(project, tmp_path / "small.skelgen", embed=False)
    again = open_project(small)
    np.testing.assert_array_equal(again.take.positions, project.take.positions)
    np.testing.assert_array_equal(again.motion.joint_positions, project.motion.joint_positions)
    assert small.stat().st_size < save_project(project, tmp_path / "whole.skelgen").stat().st_size


def test_the_recording_is_found_beside_the_project(project, recording, tmp_path):
    small = save_project(project, tmp_path / "small.skelgen", embed=False)
    shutil.move(recording, tmp_path / recording.name)
    assert open_project(small).source.path == str(tmp_path / recording.name)


def test_a_recording_that_is_gone_is_told(project, recording, tmp_path):
    small = save_project(project, tmp_path / "small.skelgen", embed=False)
    recording.unlink()
    with pytest.raises(FormatError, match=r"not at .*rods\.c3d"):
        open_project(small)


def test_another_recording_in_its_place_is_refused(project, recording, tmp_path):
    small = save_project(project, tmp_path / "small.skelgen", embed=False)
    skelgen.write(simulate("rods", n_frames=60, seed=1).take, recording)
    with pytest.raises(FormatError, match="content differs"):
        open_project(small)


def test_a_recording_that_changed_since_it_was_read_is_not_referred_to(project, recording, tmp_path):
    skelgen.write(simulate("rods", n_frames=61).take, recording)
    with pytest.raises(WriteError, match="has changed"):
        save_project(project, tmp_path / "small.skelgen", embed=False)
    assert not (tmp_path / "small.skelgen").exists()


def test_a_take_that_was_made_is_held(tmp_path):
    with pytest.raises(WriteError, match="must hold it"):
        save_project(Project(simulate("rods", n_frames=10).take), tmp_path / "a.skelgen", embed=False)
