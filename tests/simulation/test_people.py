"""People: marker sets as worn, motions on the ground, and soft tissue of the sizes that the tables state."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from skelgen.errors import ParameterError
from skelgen.marker_sets import _FOLDER, MARKER_SETS, read_table, worn_markers
from skelgen.simulation import read_truth, simulate, write_truth
from skelgen.simulation.articulated import LimbModel, Structure
from skelgen.simulation.people import MOTIONS, natural_motion, person, realistic_soft_tissue
from skelgen.simulation.people.body import MEASURED_AT, TABLES, tissue_of

SEGMENTS = [row["name"] for row in read_table("soft_tissue", TABLES)["segments"]]
DEEPEST = 25.0  # mm below the ground that a sole may come: a foot that swings past, or is put down
ROUNDING = 1e-9  # mm


def test_every_marker_set_is_in_its_table_with_title_and_source() -> None:
    assert set(MARKER_SETS) == set(read_table("marker_sets"))
    assert all(table["title"] and table["source"] for table in read_table("marker_sets").values())


@pytest.mark.parametrize(
    ("name", "n_markers"),
    [
        *(("plug-in-gait", 39), ("helen-hayes", 25), ("ior", 32), ("cast", 42), ("animation-41", 41)),
        *(("animation-53", 53), ("optitrack-37", 37), ("optitrack-41", 41), ("optitrack-50", 50), ("qualisys-42", 42)),
    ],
)
def test_marker_set_has_its_markers_with_names_and_places_of_their_own(name: str, n_markers: int) -> None:
    markers = worn_markers(name)
    assert len(markers) == n_markers == len({marker.name for marker in markers})
    assert len({(marker.limb, *marker.offset) for marker in markers}) == n_markers


@pytest.mark.parametrize(
    ("folder", "table"),
    [(_FOLDER, "places"), (_FOLDER, "marker_sets"), (TABLES, "soft_tissue"), (TABLES, "motions")],
)
def test_tables_are_toml_and_every_place_that_they_name_exists(folder: Path, table: str) -> None:
    found = tomllib.loads((folder / f"{table}.toml").read_text())  # the files as they are shipped
    places = {place for segment in read_table("places").values() for place in segment}
    if table == "soft_tissue":
        assert set(found["places"]) <= places
    if table == "marker_sets":
        named = [text for one in found.values() for text in one["markers"].values()]
        assert {text.removeprefix("left ").removeprefix("right ") for text in named} <= places


@pytest.mark.parametrize("marker_set", MARKER_SETS)
def test_person_wears_the_set_on_limbs_that_hang_together(marker_set: str) -> None:
    someone = person(marker_set, 0.0, np.random.default_rng(1))
    assert sorted(someone.worn.marker_names) == sorted(marker.name for marker in worn_markers(marker_set))
    assert all(len(limb.markers) for limb in someone.worn.limbs)
    assert someone.worn.n_limbs >= 8


def test_right_side_mirrors_the_left() -> None:
    left, right = ({m.place: m.offset for m in worn_markers("ior") if m.name[0] == side} for side in "LR")
    for place, offset in left.items():
        np.testing.assert_array_equal(right[place], offset * [1, -1, 1])


@pytest.mark.parametrize("height", [1550.0, 1950.0])
def test_person_is_as_tall_as_told(height: float) -> None:
    truth = simulate("human", motion="walk", marker_set="animation-53", height=height, n_frames=200).truth
    top = truth.marker_positions[:, truth.marker_names.index("ARIEL"), 2]
    assert height - 80 < top.max() < height + 60  # a walker's head bobs; the marker lies above it


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_feet_are_on_the_ground_and_never_far_below(motion: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    someone = person("animation-53", 0.0, rng)
    _, poses = natural_motion(someone, motion, 400, 100.0, rng)
    heights = []
    for name, points in someone.contacts.items():
        pose = poses[:, someone.body.limb_names.index(name)]
        heights.append((pose[:, np.newaxis, :3, 3] + points @ pose[:, :3, :3].swapaxes(1, 2))[..., 2])
    lowest = np.concatenate(heights, axis=1).min(axis=1)
    assert lowest.min() > -DEEPEST
    on_ground = np.mean(lowest < 10)
    assert on_ground > 0.99 if motion in {"walk", "squat", "reach"} else 0.4 < on_ground < 0.95


@pytest.mark.parametrize("motion", ["squat", "reach"])
def test_feet_of_who_stands_stay_where_they_are(motion: str) -> None:
    truth = simulate("human", motion=motion, marker_set="animation-53", n_frames=300, seed=1).truth
    feet = np.array([truth.limb_names.index(f"{side} foot") for side in ("left", "right")])
    assert np.ptp(truth.world_from_limb[..., :3, 3][:, feet], axis=0).max() < 15


@pytest.mark.parametrize("motion", ["walk", "run"])
def test_arms_swing_opposite_to_legs(motion: str) -> None:
    truth = simulate("human", motion=motion, marker_set="plug-in-gait", n_frames=400, seed=2).truth

    def ahead(name: str) -> np.ndarray:
        """How far a limb's markers are before the pelvis [mm], over time."""
        markers = truth.limb_of_marker == truth.limb_names.index(name)
        pelvis = truth.world_from_limb[:, 0]
        return ((truth.marker_positions[:, markers].mean(axis=1) - pelvis[:, :3, 3]) * pelvis[:, :3, 0]).sum(axis=1)

    assert np.corrcoef(ahead("left foot"), ahead("right foot"))[0, 1] < -0.7
    assert np.corrcoef(ahead("left forearm"), ahead("left foot"))[0, 1] < -0.5


@pytest.mark.parametrize("motion", MOTIONS)
def test_without_soft_tissue_distances_within_a_limb_are_constant(motion: str) -> None:
    simulated = simulate("human", motion=motion, marker_set="optitrack-50", n_frames=60)
    truth, positions = simulated.truth, simulated.take.positions
    for limb in range(truth.n_limbs):
        mine = positions[:, truth.limb_of_marker == limb]
        apart = np.linalg.norm(mine[:, :, np.newaxis] - mine[:, np.newaxis], axis=3)
        assert np.ptp(apart, axis=0).max() < ROUNDING
    assert not truth.soft_tissue.any()


def test_truth_tells_what_soft_tissue_did(tmp_path) -> None:
    simulated = simulate("human", motion="run", soft_tissue="realistic", n_frames=60)
    truth = simulated.truth
    np.testing.assert_array_equal(simulated.take.positions, truth.marker_positions + truth.soft_tissue)
    again = read_truth(write_truth(truth, tmp_path / "run.truth.npz"))
    np.testing.assert_array_equal(again.soft_tissue, truth.soft_tissue)


def test_truth_files_of_before_soft_tissue_was_told_are_read(tmp_path) -> None:
    file = write_truth(simulate("rods", n_frames=20).truth, tmp_path / "old.truth.npz")
    with np.load(file) as archive:
        old = {name: archive[name] for name in archive.files if name != "soft_tissue"}
    np.savez_compressed(file, **old)
    assert not read_truth(file).soft_tissue.any()


def turned(name: str, markers: np.ndarray, n_frames: int = 2) -> tuple[Structure, np.ndarray, list[np.ndarray]]:
    """A limb on a hinge at its origin that is turned by the angle of the tables, and its root, which stays."""
    segment, none = np.array([[0, 0, 0], [0, 0, -400.0]]), np.empty((0, 3))
    root = LimbModel("stand", "", "free", np.zeros(3), segment, 10, none, np.eye(3)[::-1], np.zeros(3), np.zeros(3))
    axis, at_rest = np.array([[0.0, 1.0, 0.0]]), np.zeros(1)
    limb = LimbModel(name, "stand", "hinge", np.zeros(3), segment, 10, markers, axis, at_rest, at_rest)
    angles = [np.zeros((n_frames, 3)), np.full((n_frames, 1), MEASURED_AT)]
    return Structure("turned", (root, limb)), np.tile(np.eye(4), (n_frames, 2, 1, 1)), angles


@pytest.mark.parametrize("segment", SEGMENTS)
def test_markers_beside_a_joint_move_as_far_as_tabled(segment: str) -> None:
    structure, poses, angles = turned(segment, np.zeros((1, 3)))
    moved = [realistic_soft_tissue(structure, poses, angles, 100.0, np.random.default_rng(seed)) for seed in range(400)]
    tissue = tissue_of(segment)
    wanted = np.hypot(tissue.joint, tissue.wander) * np.exp(0.25**2)  # people differ
    assert np.sqrt(np.mean(np.sum(np.square(moved), axis=3))) == pytest.approx(wanted, rel=0.1)


def test_markers_of_a_segment_move_together_as_far_as_tabled() -> None:
    far_apart = np.array([[150.0, 0, 0], [-150.0, 0, 0]])
    structure, poses, angles = turned("left thigh", far_apart)
    random = map(np.random.default_rng, range(600))
    moved = np.array([realistic_soft_tissue(structure, poses, angles, 100.0, rng)[0] for rng in random])
    shared = np.sum(moved[:, 0] * moved[:, 1]) / np.sum(moved[:, 0] ** 2)
    assert shared == pytest.approx(tissue_of("left thigh").together, abs=0.12)


def test_skin_at_rest_only_wanders() -> None:
    structure, poses, angles = turned("left thigh", np.array([[50.0, 0, -100]]), n_frames=500)
    moved = realistic_soft_tissue(structure, poses, [0 * one for one in angles], 100.0, np.random.default_rng(0))
    assert 0 < np.abs(moved).max() < 5 * tissue_of("left thigh").wander


def test_an_impact_sets_soft_tissue_swinging_and_it_calms_down() -> None:
    structure, poses, angles = turned("left thigh", np.array([[50.0, 0, -100]]), n_frames=300)
    poses[100:, :, 2, 3] -= np.minimum(np.arange(200) * 10.0, 50.0)[:, np.newaxis]  # 1 m/s for 50 ms
    still, struck = (
        realistic_soft_tissue(structure, place, [0 * one for one in angles], 100.0, np.random.default_rng(0))
        for place in (np.tile(np.eye(4), (300, 2, 1, 1)), poses)
    )
    swing = np.abs(struck - still)[..., 2].max(axis=1)
    assert swing[100:115].max() > 5
    assert swing[250:].max() < 0.1 * swing.max()


def test_markers_of_a_plate_keep_their_distances_under_soft_tissue() -> None:
    simulated = simulate("human", motion="squat", marker_set="cast", soft_tissue="realistic", n_frames=300)
    names = simulated.take.names
    plate = simulated.take.positions[:, [names.index(f"LTH{i}") for i in (1, 2, 3, 4)]]
    apart = np.linalg.norm(plate[:, :, np.newaxis] - plate[:, np.newaxis], axis=3)
    single = simulate("human", motion="squat", marker_set="ior", soft_tissue="realistic", n_frames=300).take
    thigh = single.positions[:, [single.names.index(name) for name in ("LGT", "LLE", "LME")]]
    loose = np.linalg.norm(thigh[:, :, np.newaxis] - thigh[:, np.newaxis], axis=3)
    assert np.ptp(apart, axis=0).max() < 4 < np.ptp(loose, axis=0).max()


def test_same_seed_is_the_same_person_and_another_one_is_another() -> None:
    options = {"motion": "walk", "soft_tissue": "realistic", "n_frames": 30}
    first, again, other = (simulate("human", seed=seed, **options).take.positions for seed in (4, 4, 5))
    assert first.tobytes() == again.tobytes()
    assert not np.allclose(first, other)


def test_soft_tissue_does_not_change_the_motion() -> None:
    soft, firm = (
        simulate("human", motion="jump", marker_set="ior", soft_tissue=tissue, n_frames=30).truth
        for tissue in ("realistic", "none")
    )
    np.testing.assert_array_equal(soft.world_from_limb, firm.world_from_limb)


@pytest.mark.parametrize(
    ("structure", "options", "sentence"),
    [
        ("quadruped", {"motion": "walk"}, "motion belongs to the structure human, not to quadruped"),
        ("rods", {"marker_set": "cast"}, "marker_set belongs to the structure human, not to rods"),
        ("human", {"motion": "fly"}, "motion is 'fly'; it must be one of random, walk, run"),
        ("human", {"motion": "walk", "walk": 5.0}, "walk belongs to random motion, not to motion walk"),
        ("human", {"motion": "run", "rate": 5.0}, "rate is 5 Hz; motion run needs at least 20 Hz"),
        ("human", {"soft_tissue": "much"}, "'much'; it must be a number, or be realistic or none"),
        ("human", {"soft_tissue": -1.0}, "soft_tissue is -1; it must lie in 0 .. 1000 mm"),
        ("human", {"height": 300.0}, "it must be 0 or at least 1000 mm"),
    ],
)
def test_what_does_not_belong_together_is_said(structure: str, options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        simulate(structure, n_frames=10, **options)


@pytest.mark.parametrize("structure", ["quadruped", "tree:8", "classic-human"])
def test_any_structure_can_have_realistic_soft_tissue(structure: str) -> None:
    truth = simulate(structure, n_frames=100, soft_tissue="realistic").truth
    assert 1 < np.sqrt((truth.soft_tissue**2).sum(axis=2).mean()) < 40
