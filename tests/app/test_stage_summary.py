"""Sentences and pointers of every stage; results taken from a saved project."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.checks import with_saved
from skelgen.app.stage_summary import stage_pointers, stage_sentences, take_sentences
from skelgen.errors import InputError, MissingResultError
from skelgen.model import Project
from skelgen.model.project import STAGES
from skelgen.simulation import simulate


@pytest.fixture(scope="module")
def done():
    """An unlabelled human with all stages done."""
    return run_stages(Project(simulate("human", n_frames=300, noise=0.5, labelled=False, ghosts=0.3).take))


def test_every_stage_tells_what_it_found(done):
    assert "points without labels" in take_sentences(done.take)[0]
    for stage in STAGES:
        assert 1 <= len(stage_sentences(done, stage)) <= 3
        assert stage_sentences(Project(done.take), stage) == ()
    assert stage_sentences(done, "limbs")[0] == f"{done.limbs.n_limbs} limbs with 3 markers each."


def test_limbs_of_two_sizes_are_told_in_two_numbers(done):
    limbs = np.array(done.limbs.limb_of_marker)
    limbs[np.flatnonzero(limbs == 0)[0]] = 1
    other = replace(done.limbs, limb_of_marker=limbs)
    assert stage_sentences(replace(done, _limbs=other), "limbs")[0].endswith(" limbs with 2 to 4 markers.")


def test_one_tree_is_told_in_the_singular():
    project = run_stages(Project(simulate("rods", n_frames=60, noise=0.2).take))
    assert stage_sentences(project, "joints")[0] == "2 joints in 1 tree."


def test_doubts_point_to_their_frame_and_marker(done):
    for pointer in stage_pointers(done, "labels"):
        if pointer.frame is not None:
            assert 0 <= pointer.frame < done.take.n_frames
            assert done.trajectories.names[pointer.markers[0]] in pointer.sentence


def test_notices_about_limbs_point_to_their_markers_and_where_they_are_unknown():
    project = run_stages(Project(simulate("human", n_frames=300, noise=0.5, dropouts=0.05).take))
    pointers = {pointer.sentence: pointer for pointer in stage_pointers(project, "skeleton")}
    (turning, *_) = (pointer for sentence, pointer in pointers.items() if "turns about one axis only" in sentence)
    first, second = map(int, re.search(r"limb (\d+) and (\d+)", turning.sentence).groups())
    limbs = project.limbs.limb_of_marker
    assert turning.markers == tuple(np.flatnonzero((limbs == first) | (limbs == second)))
    assert turning.frame is None
    (interpolated,) = (pointer for sentence, pointer in pointers.items() if sentence.startswith("interpolated"))
    named = sorted({int(limbs[marker]) for marker in interpolated.markers})
    assert not project.motion.limb_seen[interpolated.frame, named].all()
    assert project.motion.limb_seen[: interpolated.frame, named].all()


def test_a_saved_result_replaces_a_run(done):
    project = Project(done.take)
    for stage in STAGES:
        project = with_saved(project, done, stage)
    np.testing.assert_array_equal(project.motion.joint_positions, done.motion.joint_positions)


def test_results_of_another_take_are_refused(done):
    other = Project(simulate("rods", n_frames=100).take)
    with pytest.raises(InputError, match="same recording"):
        with_saved(other, done, "labels")
    with pytest.raises(MissingResultError):
        with_saved(Project(done.take), Project(done.take), "labels")
