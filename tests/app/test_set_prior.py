"""A marker set that is recognised says what limbs and tree are, unless the data say otherwise and are sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.constraints import joints_of_person
from skelgen.app.limb_names import read_limb_names
from skelgen.model import Limbs
from skelgen.model.placed_joints import Place, count_places
from skelgen.stages.limbs.bodies import with_stated_bodies
from skelgen.stages.names import PARENTS


@pytest.fixture(scope="module")
def walking():
    options = {"motion": "walk", "marker_set": "plug-in-gait", "soft_tissue": "realistic"}
    return skelgen.simulate("human", n_frames=300, seed=0, noise=0.3, **options)


def edges_of(project):
    names = project.limbs.names
    return {frozenset((names[joint.parent], names[joint.child])) for joint in project.skeleton.joints}


def test_limbs_and_tree_are_those_of_the_set(walking):
    project = skelgen.reconstruct(walking.take)
    truth = walking.truth
    assert set(project.limbs.names) == set(truth.limb_names)
    assert edges_of(project) == {frozenset((truth.limb_names[a], truth.limb_names[b])) for a, b in truth.edges}
    assert edges_of(project) <= {frozenset(pair) for pair in PARENTS.items()}


def test_the_number_of_limbs_that_are_found_changes_nothing_when_it_is_stated(walking):
    found = skelgen.reconstruct(walking.take, until="limbs").limbs
    stated = skelgen.reconstruct(walking.take, until="limbs", n_limbs=found.n_limbs).limbs
    np.testing.assert_array_equal(stated.limb_of_marker, found.limb_of_marker)
    assert stated.names == found.names


@pytest.mark.parametrize("more", [-2, 2])
def test_another_number_of_limbs_merges_or_parts_those_that_are_found(walking, more):
    take = replace(walking.take, names=tuple(f"m{marker}" for marker in range(walking.take.n_markers)))
    found = skelgen.reconstruct(take, until="limbs").limbs
    stated = skelgen.reconstruct(take, until="limbs", n_limbs=found.n_limbs + more).limbs
    assert stated.n_limbs == found.n_limbs + more
    pairs = set(zip(found.limb_of_marker.tolist(), stated.limb_of_marker.tolist(), strict=True))
    assert len(pairs) == max(found.n_limbs, stated.n_limbs)


def test_joints_that_motion_alone_does_not_determine_are_placed_by_the_set(walking):
    project = skelgen.reconstruct(walking.take, root="chest")
    placed = {joint.child for joint in project.skeleton.joints if joint.is_placed_by_marker_set}
    names = dict(zip(project.skeleton.joint_names, project.skeleton.joints, strict=True))
    assert {names["waist"].child, names["neck"].child} <= placed  # a walk turns trunk and head by some degrees
    assert not any(joint.is_determined for joint in project.skeleton.joints if joint.child in placed)
    said = [notice for notice in project.reports["skeleton"].notices if "is placed by the marker set" in notice]
    assert len(said) == len(placed)
    unknown = skelgen.reconstruct(walking.take, parameters={"skeleton": {"known_build": False}})
    assert not any(joint.is_placed_by_marker_set for joint in unknown.skeleton.joints)


def test_joints_of_people_at_usual_places_are_said_to_be_placed_by_no_set():
    options = {"motion": "walk", "marker_set": "opencap", "soft_tissue": "realistic"}
    take = skelgen.simulate("human", n_frames=100, seed=5, **options).take
    some = np.flatnonzero(np.arange(take.n_markers) % 4 != 0)  # of which the set is not recognised
    names = [f"M{marker}" for marker in some]
    project = skelgen.reconstruct(skelgen.Trajectories(take.positions[:, some], names, take.rate))
    places = count_places(project.skeleton.joints)
    assert places[Place.USUAL] > 0
    assert places[Place.MARKER_SET] == 0
    notices = " ".join(project.reports["skeleton"].notices)
    assert notices.count(Place.USUAL.words) >= places[Place.USUAL]


def test_nothing_is_known_of_the_build_without_marker_sets(walking):
    def joints(skeleton):
        parameters = {"limbs": {"marker_set": "none"}, "skeleton": skeleton}
        return skelgen.reconstruct(walking.take, parameters=parameters).motion.joint_positions

    assert np.array_equal(joints({}), joints({"known_build": False}))


def test_a_limb_that_the_user_calls_otherwise_stays_where_the_set_has_it(walking, tmp_path):
    (tmp_path / "names.csv").write_text("marker, name\nLFIN, racket\n")
    assert read_limb_names(tmp_path / "names.csv") == {"LFIN": "racket"}
    project = skelgen.correct(skelgen.reconstruct(walking.take, until="limbs"), "name", ["LFIN"], "racket")
    named = skelgen.reconstruct(project)
    assert named.skeleton.limb_names[named.limbs.limb_of_marker[walking.take.names.index("LFIN")]] == "racket"
    assert frozenset(("racket", "left forearm")) in edges_of(named)


def test_a_marker_that_surely_moves_with_another_limb_stays_there_with_a_note():
    walking = skelgen.simulate("human", n_frames=300, seed=0, noise=0.1, motion="walk", marker_set="animation-41")
    take, truth = walking.take, walking.truth
    shank = truth.world_from_limb[:, truth.limb_names.index("left shank")]
    positions = take.positions.copy()
    on_thigh = take.names.index("LTHI")
    positions[:, on_thigh] = (shank @ np.array([20.0, 60.0, -150.0, 1.0]))[:, :3]
    project = skelgen.reconstruct(replace(take, positions=positions))
    limb = project.limbs.limb_of_marker
    assert limb[on_thigh] == limb[take.names.index("LSHN")]
    notices = project.reports["limbs"].notices
    assert any("LTHI with the left shank" in notice for notice in notices)


def test_what_the_user_states_of_a_marker_counts_more_than_the_set(walking):
    options = {"limbs": {"together": "LTHI, LKNE, LTIB"}}
    limb = skelgen.reconstruct(walking.take, until="limbs", parameters=options).limbs.limb_of_marker
    thigh, shank = (walking.take.names.index(name) for name in ("LTHI", "LTIB"))
    assert limb[thigh] == limb[shank]


def test_of_two_people_each_has_limbs_of_their_own():
    options = {"motion": "walk", "marker_set": "animation-41"}
    take = skelgen.simulate("human", n_frames=150, seed=0, noise=0.1, **options).take
    other = skelgen.simulate("human", n_frames=150, seed=9, noise=0.1, **options).take
    positions = np.concatenate([take.positions, other.positions + np.array([0.0, 3000.0, 0.0])], axis=1)
    names = [f"{who}:{name}" for who, one in (("Ann", take), ("Bob", other)) for name in one.names]
    project = skelgen.reconstruct(skelgen.Trajectories(positions, names, take.rate))
    limb = project.limbs.limb_of_marker
    for first, second in (("LTHI", "LKNE"), ("RTHI", "RKNE"), ("LFHD", "RBHD")):
        ann, bob = ([limb[names.index(f"{who}:{name}")] for name in (first, second)] for who in ("Ann", "Bob"))
        assert ann[0] == ann[1]
        assert bob[0] == bob[1]
        assert ann[0] != bob[0]


def test_notices_of_the_limbs_without_the_set_are_not_told(walking):
    notices = skelgen.reconstruct(walking.take).reports["limbs"].notices
    assert len(set(notices)) == len(notices)


def test_a_hand_hangs_on_the_forearm_without_names_where_motion_is_not_surer():
    """Motion alone joins the hand to the upper arm, and holds that for 95 %."""
    options = {"motion": "squat", "marker_set": "optitrack-37", "soft_tissue": "realistic"}
    case = skelgen.simulate("human", n_frames=600, seed=12, noise=0.3, dropouts=0.02, **options)
    names = [f"M{marker}" for marker in range(case.take.n_markers)]
    hidden = skelgen.Trajectories(case.take.positions, names, case.take.rate)
    project = skelgen.reconstruct(hidden, until="joints")
    true_of_limb = dict(zip(project.limbs.limb_of_marker.tolist(), case.truth.limb_of_marker.tolist(), strict=True))
    edges = [[true_of_limb[limb] for limb in edge] for edge in project.topology.edges.tolist()]
    assert {frozenset(edge) for edge in edges} == {frozenset(edge) for edge in case.truth.edges.tolist()}


def test_a_missing_segment_is_passed_over_unless_a_limb_without_a_name_may_be_it():
    limbs = Limbs(np.arange(4), np.zeros((4, 4)))
    assert set(joints_of_person(["left thigh", "pelvis", "left foot", "chest"], limbs)) == {(0, 1), (0, 2), (1, 3)}
    assert set(joints_of_person(["left thigh", "pelvis", "left foot", "limb3"], limbs)) == {(0, 1)}


def test_set_among_many_other_markers_is_left_to_the_user_with_a_note(walking):
    take = walking.take
    others = tuple(f"M{number:03d}" for number in range(26))
    positions = np.concatenate([take.positions, take.positions[:, :26] + 20.0], axis=1)
    wide = replace(take, positions=positions, names=(*take.names, *others))
    project = skelgen.reconstruct(wide, until="limbs")
    assert any("`--marker-set plug-in-gait` makes use of it" in notice for notice in project.reports["limbs"].notices)


@pytest.mark.parametrize("marker_set", ["animation-41", "auto"])
def test_each_of_two_people_has_the_limbs_and_the_tree_of_the_set_that_names_say_they_wear(marker_set):
    options = {"motion": "walk", "marker_set": "animation-41", "subjects": 2, "apart": 300.0, "seed": 1}
    take = skelgen.simulate("human", n_frames=200, noise=0.3, **options).take
    project = skelgen.reconstruct(take, parameters={"limbs": {"marker_set": marker_set}}, until="joints")
    for body, subject in zip(project.bodies, ("subject 1", "subject 2"), strict=True):
        assert {take.names[marker].rpartition(":")[0] for marker in body.markers} == {subject}
        names = {limb: project.limbs.names[limb].rpartition(": ")[2] for limb in body.limbs.tolist()}
        edges = [{names[limb] for limb in edge} for edge in project.topology.edges.tolist() if edge[0] in names]
        assert {frozenset(edge) for edge in edges} == {
            frozenset(pair) for pair in PARENTS.items() if "toes" not in pair[0]
        }
        assert marker_set == "auto" or names[body.root] == "pelvis"


def test_stated_set_that_is_worn_twice_without_names_of_the_people_is_refused():
    take = skelgen.simulate("human", n_frames=20, motion="walk", marker_set="animation-41", subjects=2).take
    plain = [name.rpartition(": ")[2] + "." * (marker >= 41) for marker, name in enumerate(take.names)]
    nameless = skelgen.Trajectories(take.positions, plain, take.rate)
    with pytest.raises(skelgen.errors.InputError, match="do not say who wears them"):
        skelgen.reconstruct(nameless, parameters={"limbs": {"marker_set": "animation-41"}})


def test_markers_of_no_stated_body_stay_with_those_to_which_their_distances_vary_least():
    deviation = np.array([[0, 9, 1, 9], [9, 0, 2, 9], [1, 2, 0, 9], [9, 9, 9, 0]], dtype=float)
    found, stated = np.array([0, 0, 0, 1]), (np.array([0]), np.array([1]))
    assert with_stated_bodies(found, stated, deviation).tolist() == [0, 1, 0, 3]
