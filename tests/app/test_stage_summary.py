"""Sentences and pointers of every stage; results taken from a saved project."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.packing import with_saved
from skelgen.app.stage_summary import has_doubts, stage_pointers, stage_sentences, take_sentences
from skelgen.errors import InputError, MissingResultError
from skelgen.model import Project, Topology
from skelgen.model.labelling import Doubt
from skelgen.model.project import STAGES
from skelgen.simulation import simulate


@pytest.fixture(scope="module")
def done():
    """An unlabelled human with all stages done."""
    return run_stages(Project(simulate("human", n_frames=300, noise=0.5, labelled=False, ghosts=0.3).take))


def test_every_stage_tells_what_it_found(done):
    assert "points without labels" in take_sentences(done.take)[0]
    for stage in STAGES:
        assert 1 <= len(stage_sentences(done, stage)) <= 4
        assert stage_sentences(Project(done.take), stage) == ()
    assert stage_sentences(done, "limbs")[0] == f"{done.limbs.n_limbs} limbs with 3 markers each."


def test_limbs_of_two_sizes_are_told_in_two_numbers(done):
    limbs = np.array(done.limbs.limb_of_marker)
    limbs[np.flatnonzero(limbs == 0)[0]] = 1
    other = replace(done.limbs, limb_of_marker=limbs)
    assert stage_sentences(replace(done, _limbs=other), "limbs")[0].endswith(" limbs with 2 to 4 markers.")


def test_doubts_of_limbs_and_tree_are_told(done):
    membership = np.eye(done.limbs.n_limbs)[done.limbs.limb_of_marker]
    sure = replace(done, _limbs=replace(done.limbs, membership=membership))
    limb, other = int(done.limbs.limb_of_marker[4]), (int(done.limbs.limb_of_marker[4]) + 1) % done.limbs.n_limbs
    membership[4, [limb, other]] = 0.55, 0.45
    doubtful = replace(done, _limbs=replace(done.limbs, membership=membership))
    assert not has_doubts(sure, "limbs")
    assert has_doubts(doubtful, "limbs")
    called = [done.limbs.called(one) for one in (limb, other)]
    said = f"least sure {done.trajectories.names[4]}, {called[0]} 55 %, {called[1]} 45 %."
    assert said in " ".join(stage_sentences(doubtful, "limbs"))
    certain = np.ones(done.topology.n_joints)
    topology = replace(done.topology, edge_probability=certain)
    assert not has_doubts(replace(done, _topology=topology), "joints")
    topology = replace(topology, edge_probability=[0.6, *certain[1:]])
    assert has_doubts(replace(done, _topology=topology), "joints")


def test_a_skeleton_with_a_joint_that_motion_does_not_determine_is_doubtful(done):
    free = tuple(replace(joint, kind="ball", axis=None, open_directions=0) for joint in done.skeleton.joints)
    skeleton = replace(done.skeleton, joints=free)
    assert not has_doubts(replace(done, _skeleton=skeleton), "skeleton")
    skeleton = replace(skeleton, joints=(replace(free[0], open_directions=1), *free[1:]))
    assert has_doubts(replace(done, _skeleton=skeleton), "skeleton")
    hinge = replace(free[0], kind="hinge", axis=np.array([1.0, 0.0, 0.0]), open_directions=1)
    assert hinge.is_determined  # along its axis nothing is
    hinged = replace(done, _skeleton=replace(skeleton, joints=(hinge, *free[1:])))
    assert not has_doubts(hinged, "skeleton")
    assert "Along its axis the place of 1 hinge is a choice" in " ".join(stage_sentences(hinged, "skeleton"))


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"kind": "undetermined"}, "Turns do not tell the type of 1 joint:"),
        ({"is_placed_by_marker_set": True}, "The marker set places 1 joint, as the motion does not."),
        (
            {"open_directions": 1, "usual_directions": 1},
            "What is usual of bodies places 1 joint,",
        ),
        ({"open_directions": 2}, "Where 1 joint lies is in part a choice: the motion does not determine it."),
        ({"kind": "hinge", "axis": [1.0, 0.0, 0.0], "axis_std": [0.0, 0.1, 0.1]}, "determine the axis of 1 joint."),
    ],
)
def test_a_joint_whose_type_place_or_axis_motion_leaves_open_is_doubtful(done, changed, sentence):
    plain = {"kind": "ball", "axis": None, "second_axis": None, "open_directions": 0}
    first, *others = (replace(joint, **plain) for joint in done.skeleton.joints)
    skeleton = replace(done.skeleton, joints=(replace(first, **changed), *others))
    project = replace(done, _skeleton=skeleton)
    assert has_doubts(project, "skeleton")
    assert sentence in " ".join(stage_sentences(project, "skeleton"))


def test_one_tree_is_told_in_the_singular():
    project = run_stages(Project(simulate("rods", n_frames=60, noise=0.2).take))
    assert stage_sentences(project, "joints")[0] == "2 joints in 1 tree."


def test_a_marker_alone_is_told_as_no_body(done):
    """Of two trees, that of the last limb has one marker."""
    last = done.limbs.n_limbs - 1
    parents = np.append(np.arange(last) - 1, -1)
    n_joints, old = last - 1, done.topology
    raw = old.raw_joint_positions[:, :n_joints]
    topology = Topology(parents, old.joint_costs, raw, np.zeros(n_joints, int), np.zeros(n_joints), 0.1)
    limbs = np.array(done.limbs.limb_of_marker)
    limbs[np.flatnonzero(limbs == last)[1:]] = -1
    parted = replace(done, _limbs=replace(done.limbs, limb_of_marker=limbs), _topology=topology)
    assert stage_sentences(parted, "joints")[0] == f"{n_joints} joints in 1 tree; 1 marker alone."


def test_doubts_point_to_their_frame_and_marker(done):
    doubt = Doubt(4, 30, 50, "misfit", -1, 0.3, "it is off its place")
    doubted = replace(done, _labelling=replace(done.labelling, doubts=(doubt,)))
    (pointer,) = (pointer for pointer in stage_pointers(doubted, "labels") if pointer.frame is not None)
    assert (pointer.frame, pointer.markers[0]) == (30, 4)
    assert done.trajectories.names[4] in pointer.sentence


def test_notices_about_limbs_point_to_their_markers_and_where_they_are_unknown():
    project = run_stages(Project(simulate("human", n_frames=300, noise=0.5, dropouts=0.05).take))
    pointers = {pointer.sentence: pointer for pointer in stage_pointers(project, "skeleton")}
    (turning, *_) = (pointer for sentence, pointer in pointers.items() if "turns about one axis only" in sentence)
    called = re.search(r"between (.+) and (.+?) turns", turning.sentence).groups()
    first, second = (project.limbs.names.index(name) for name in called)
    limbs = project.limbs.limb_of_marker
    assert turning.markers == tuple(np.flatnonzero((limbs == first) | (limbs == second)))
    assert turning.frame is None
    (interpolated,) = (pointer for sentence, pointer in pointers.items() if sentence.startswith("interpolated"))
    named = sorted({int(limbs[marker]) for marker in interpolated.markers})
    assert not project.motion.limb_seen[interpolated.frame, named].all()
    assert project.motion.limb_seen[: interpolated.frame, named].all()


def test_notices_call_limbs_by_names_that_came_after_their_stage(done):
    names = ("mast", *done.limbs.names[1:])
    report = replace(done.reports["skeleton"], notices=("the joint between limb 0 and 1 turns",))
    named = replace(done, reports={**done.reports, "skeleton": report}).with_limb_names(names)
    (pointer,) = stage_pointers(named, "skeleton")
    assert pointer.sentence == f"the joint between mast and {named.limbs.called(1)} turns"
    assert set(pointer.markers) >= set(named.limbs.markers_of(0).tolist())


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
