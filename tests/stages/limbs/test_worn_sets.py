"""Marker sets, and places of markers where no known set is worn, are told by the distances of markers alone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skelgen.benchmark.people import simulated_animal
from skelgen.marker_sets import EVERY_PLACE
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation import simulate
from skelgen.simulation.people import natural_motion, person
from skelgen.stages.limbs import LimbParameters, find_limbs
from skelgen.stages.limbs.pair_evidence import log_odds
from skelgen.stages.limbs.place_matching import nearest_places, segment_odds, worn_places
from skelgen.stages.limbs.revision import is_worn
from skelgen.stages.limbs.set_matching import Match, matches
from skelgen.stages.limbs.worn_places import (
    PLACES_BEYOND_DOUBT,
    Believed,
    Wear,
    believed_places,
    believed_wear,
    worn_odds,
)
from skelgen.stages.limbs.worn_sets import (
    HALVES,
    LEAST_OF_HALF,
    STRAINED,
    WORN,
    fitting_sets,
    nearest_set,
    readings,
    worn_sets,
)
from skelgen.stages.limbs.worn_shapes import OUTLINE, OUTLINE_SPREAD, Shape, shape_of


def test_a_set_that_is_worn_tells_which_markers_share_a_limb() -> None:
    case = simulate("human", seed=3, motion="walk", marker_set="plug-in-gait", n_frames=100, soft_tissue="realistic")
    shuffled = np.random.default_rng(0).permutation(case.take.n_markers)
    positions = np.asarray(case.take.positions)[:, shuffled]
    odds = worn_odds(positions, log_odds(positions))
    limb = case.truth.limb_of_marker[shuffled]
    pairs = np.triu_indices(len(limb), 1)
    assert np.array_equal(odds[pairs] > 0, (limb[:, np.newaxis] == limb)[pairs])


def test_the_lower_half_of_a_set_is_worn_as_well() -> None:
    case = simulate("human", seed=4, motion="walk", marker_set="cgm2-5", n_frames=100, soft_tissue="realistic")
    limb = np.asarray(case.truth.limb_of_marker)
    lower = np.isin(np.array(case.truth.limb_names)[limb], HALVES["lower"])
    positions, limb = np.asarray(case.take.positions)[:, lower], limb[lower]
    found = nearest_set(positions)
    assert found is not None and found[1].name == "cgm2-5" and found[0].misfit < WORN
    odds = worn_odds(positions, log_odds(positions))
    pairs = np.triu_indices(len(limb), 1)
    assert np.array_equal(odds[pairs] > 0, (limb[:, np.newaxis] == limb)[pairs])


def test_limbs_of_trunk_and_feet_are_whole_where_legs_wear_plates(
    same_partition: Callable[[np.ndarray, np.ndarray], bool],
) -> None:
    """Most limbs do not bend then; chest and pelvis do."""
    case = simulate(
        "human", seed=11, motion="walk", marker_set="cast", n_frames=200, soft_tissue="realistic", noise=0.3
    )
    limb = np.asarray(case.truth.limb_of_marker)
    kept = np.array(["arm" not in case.truth.limb_names[one] for one in limb])
    names = [f"M{marker}" for marker in range(kept.sum())]
    take = Trajectories(np.asarray(case.take.positions)[:, kept], names, case.take.rate)
    assert same_partition(find_limbs(take).limb_of_marker, limb[kept])


def test_a_few_markers_are_no_half_of_a_set() -> None:
    assert nearest_set(np.random.default_rng(0).normal(0.0, 500.0, (100, LEAST_OF_HALF - 1, 3))) is None


def test_a_set_is_told_in_strange_postures() -> None:
    case = simulate(
        "human", marker_set="cast", motion_range=2.0, n_frames=100, soft_tissue="realistic", noise=0.3, seed=3
    )
    positions, limb = np.asarray(case.take.positions), np.asarray(case.truth.limb_of_marker)
    found = nearest_set(positions)
    assert found is not None and found[1].name == "cast" and found[0].misfit < WORN
    odds = worn_odds(positions, log_odds(positions))
    together = (limb[:, np.newaxis] == limb) & ~np.eye(len(limb), dtype=np.bool_)
    assert together[odds > 1].all() and (odds > 1).sum() > together.sum() / 2
    assert not together[odds < -1].any()


@pytest.mark.parametrize("marker_set", ["animation-53", "plug-in-gait"])
def test_a_set_is_told_where_hands_are_at_the_hips(marker_set: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
        from learn_sets import seen_markers
        from postures import with_held_hands
    rng = np.random.default_rng(1)
    who = person(marker_set, 0.0, rng)
    angles, poses = natural_motion(who, "squat", 100, 100.0, rng)
    positions = seen_markers(who, angles, with_held_hands(who, poses, "hips", rng), rng)
    odds, limb = worn_odds(positions, log_odds(positions)), np.asarray(who.worn.limb_of_marker)
    pairs = np.triu_indices(len(limb), 1)
    assert np.array_equal(odds[pairs] > 0, (limb[:, np.newaxis] == limb)[pairs])


@pytest.mark.parametrize(("seed", "misfit"), [(5, 0.7), (38, 0.3), (22, 0.55), (172, 0.65)])  # far from the usual
def test_places_are_found_where_one_leg_hardly_moves(seed: int, misfit: float) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
        from learn_sets import seen_markers
        from postures import at_exercise
    rng = np.random.default_rng(seed)
    who = person(EVERY_PLACE, 0.0, rng)
    positions = seen_markers(who, *at_exercise(who, 100, rng), rng)
    kept = np.sort(rng.permutation(positions.shape[1])[:40])
    places = believed_places(positions[:, kept], np.zeros((40, 40)))
    assert places is not None and places.match.misfit < misfit
    segments, limb = places.worn.segments[places.match.of_set], who.worn.limb_of_marker[kept[places.match.markers]]
    pairs = np.triu_indices(len(limb), 1)
    alike = (segments[:, np.newaxis] == segments)[pairs] == (limb[:, np.newaxis] == limb)[pairs]
    assert alike.mean() > 0.98
    assert is_worn(np.zeros((40, 40)), positions[:, kept]) == (places.match.misfit < PLACES_BEYOND_DOUBT)


def test_places_are_found_from_a_set_that_is_not_worn() -> None:
    _, places, _, limb = _at_places()
    match, worn = places.match, places.worn
    found, limb = worn.segments[match.of_set], limb[match.markers]
    pairs = np.triu_indices(len(limb), 1)
    alike = (found[:, np.newaxis] == found)[pairs] == (limb[:, np.newaxis] == limb)[pairs]
    assert alike.mean() > 0.98
    assert match.misfit < 1.0


def test_places_of_few_markers_are_found_where_no_set_is_near() -> None:
    case = simulate("human", seed=36, motion="walk", marker_set="animation-41", n_frames=100, soft_tissue="realistic")
    kept = np.sort(np.random.default_rng(36).permutation(case.take.n_markers)[:22])
    positions, limb = np.asarray(case.take.positions)[:, kept], np.asarray(case.truth.limb_of_marker)[kept]
    by_motion, sets = np.zeros((22, 22)), fitting_sets(positions)[:2]
    match, places = nearest_places(shape_of(positions), sets, by_motion)
    segments, limb = places.segments[match.of_set], limb[match.markers]
    assert len(limb) == 22 and match.misfit < 0.3 and all(match.misfit > 1.4 for match, _ in sets)
    np.testing.assert_array_equal(segments[:, np.newaxis] == segments, limb[:, np.newaxis] == limb)


def test_markers_share_segments_as_often_as_their_places_say() -> None:
    shape, places, by_motion, limb = _at_places()
    pairs = np.triu_indices(len(limb), 1)
    odds, together = segment_odds(shape, places.match, by_motion)[pairs], (limb[:, np.newaxis] == limb)[pairs]
    assert together[odds < -3].mean() < 0.01
    assert together[odds > 3].mean() > 0.95
    assert (odds > 3).sum() > together.sum() / 2


def _at_places() -> tuple[Shape, Believed, Floats, Ints]:
    """A person in a set, taken for usual places from another set: shape, places, log odds by motion, and limbs."""
    case = simulate(
        "human", seed=104, motion="jump", marker_set="optitrack-biomech-57", n_frames=200, soft_tissue="realistic"
    )
    positions = np.asarray(case.take.positions)
    shape, other = shape_of(positions), next(worn for worn in worn_sets() if worn.name == "cgm2-5")
    by_motion, nearest = log_odds(positions), min(matches(shape, other), key=lambda one: one.misfit)
    places = Believed(*nearest_places(shape, [(nearest, other)], by_motion), 1.0)
    return shape, places, by_motion, np.asarray(case.truth.limb_of_marker)


def test_animals_and_trees_wear_nothing() -> None:
    for structure in ("quadruped", "tree:10"):
        positions = np.asarray(simulate(structure, n_frames=100, soft_tissue=3.0).take.positions)
        assert not worn_odds(positions, log_odds(positions)).any()


def test_plates_of_three_on_a_person_are_no_set_and_their_places_correct_more_than_they_spoil() -> None:
    case = simulate("human", n_frames=100, soft_tissue=3.0)
    positions, limb = np.asarray(case.take.positions), np.asarray(case.truth.limb_of_marker)
    by_motion, pairs = log_odds(positions), np.triu_indices(len(limb), 1)
    together = (limb[:, np.newaxis] == limb)[pairs]
    said = by_motion, by_motion + worn_odds(positions, by_motion)
    alone, with_places = (((odds > 0)[pairs] != together).sum() for odds in said)
    worn = believed_wear(positions, by_motion)
    assert worn is not None and sum(reading.belief for reading in worn.sets) < 0.1
    assert with_places < alone


def test_markers_that_are_never_seen_together_say_nothing() -> None:
    positions = np.full((20, 30, 3), np.nan)
    positions[np.arange(20), np.arange(20)] = 0.0
    assert not worn_odds(positions, np.zeros((30, 30))).any()


def test_hands_of_two_markers_are_found_without_names() -> None:
    case = simulate("human", seed=2, motion="walk", marker_set="animation-53", n_frames=300, soft_tissue="realistic")
    names = tuple(f"M{marker}" for marker in range(case.take.n_markers))
    take = Trajectories(case.take.positions, names, case.take.rate)
    names_of_limb = [case.truth.limb_names[limb] for limb in case.truth.limb_of_marker]
    hand = [marker for marker, name in enumerate(names_of_limb) if name == "left hand"]
    forearm = [marker for marker, name in enumerate(names_of_limb) if name == "left forearm"]
    with_set, without = (find_limbs(take, LimbParameters(marker_set=one)).limb_of_marker for one in ("auto", "none"))
    assert not set(with_set[hand]) & set(with_set[forearm])
    assert set(without[hand]) & set(without[forearm])


def test_hands_are_found_without_names_in_a_set_that_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """What two markers on a wrist do with one on the hand does not tell these apart, but places that fit well do."""
    others = tuple(worn for worn in worn_sets() if worn.name != "cgm2-5")
    monkeypatch.setattr("skelgen.stages.limbs.worn_sets.worn_sets", lambda: others)
    case = simulate(
        "human", seed=1, motion="walk", marker_set="cgm2-5", n_frames=200, soft_tissue="realistic", noise=0.3
    )
    names = [f"M{marker}" for marker in range(case.take.n_markers)]
    limb = find_limbs(Trajectories(case.take.positions, names, case.take.rate)).limb_of_marker
    segment = np.array(case.truth.limb_names)[np.asarray(case.truth.limb_of_marker)]
    for side in ("left", "right"):
        assert not set(limb[segment == f"{side} hand"]) & set(limb[segment == f"{side} forearm"])


def test_outlines_are_quantiles_of_what_is_known() -> None:
    positions = np.random.default_rng(1).normal(0.0, 500.0, (20, 7, 3))
    positions[:, 2] = np.nan
    shape = shape_of(positions)
    seen = np.delete(np.arange(7), 2)
    expected = np.nanquantile(shape.distances[seen], OUTLINE, axis=1).T
    weight = 1.0 / (OUTLINE_SPREAD[0] * np.sqrt(len(OUTLINE)))
    np.testing.assert_allclose(shape.outlines[seen, : len(OUTLINE)], weight * expected, atol=1e-5)
    assert not shape.outlines[2].any()


def test_single_places_are_believed_where_both_markers_fit() -> None:
    n_markers, places = 40, worn_places()
    misfits = np.full(n_markers, 2.0)
    misfits[:3] = 0.5
    every = np.arange(n_markers)
    spread = np.argsort(places.segments, kind="stable")[np.linspace(0, len(places.segments) - 1, n_markers).astype(int)]
    single = Believed(Match(every, spread, misfits, 1.0), places, 0.0, 1.0)
    belief = Wear((), single, 0.0).of_places(n_markers)
    assert (belief[:3, :3] == 1.0).all() and not belief[3:].any() and not belief[:, 3:].any()
    assert not Wear((), replace(single, single=0.0), 0.0).of_places(n_markers).any()


def test_no_place_is_believed_on_animals_not_even_a_single_one() -> None:
    for seed in (2, 14):  # of all the nearest to people
        case, *_ = simulated_animal(seed)
        positions = np.asarray(case.take.positions)
        places = believed_places(positions, log_odds(positions))
        assert places is not None and places.belief == places.single == 0.0


@pytest.mark.parametrize("frames", [slice(0, 1200), slice(530, 1061)])
def test_arms_held_out_are_read_as_arms(recording, frames) -> None:
    take = recording("bodies/landing.trc")
    match, worn = nearest_set(take.positions[frames])
    assert worn.name == "opencap" and match.misfit < STRAINED
    segment_of = {_plain(name): segment for name, segment in zip(worn.markers, worn.segments.tolist(), strict=True)}
    meant = np.array([segment_of.get(_plain(take.names[marker]), -1) for marker in match.markers])
    read, known = worn.segments[match.of_set], meant >= 0  # left and right may be exchanged: pairs are compared
    alike = (read[:, np.newaxis] == read) == (meant[:, np.newaxis] == meant)
    assert known.sum() > 40 and alike[np.ix_(known, known)].mean() > 0.98


def _plain(name: str) -> str:
    return name.lower().replace(".", "_")


def test_markers_that_are_none_of_the_set_are_left_out() -> None:
    case = simulate("human", seed=5, motion="walk", marker_set="animation-41", n_frames=100, soft_tissue="realistic")
    positions = np.asarray(case.take.positions)
    beside = positions[:, :2] + np.array([0.0, 900.0, 900.0])
    match, worn = nearest_set(np.concatenate([positions, beside], axis=1))
    assert worn.name == "animation-41" and match.misfit < WORN
    assert np.array_equal(np.sort(match.markers), np.arange(positions.shape[1]))


def test_motion_chooses_among_readings_that_fit_nearly_alike() -> None:
    case = simulate("human", seed=3, motion="walk", marker_set="plug-in-gait", n_frames=100, soft_tissue="realistic")
    positions = np.asarray(case.take.positions)
    near = readings(positions)
    assert len(near) > 1
    second = near[1][1]
    worn = believed_wear(positions, log_odds(positions), lambda match, *_: float(match is second))
    assert worn is not None
    beliefs = [one.belief for one in worn.sets]
    assert np.argmax(beliefs) == 1 and sum(beliefs) == beliefs[1] <= 1.0
