"""Labelled takes of one body by the names of their markers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.app.several_takes import are_named_alike, calibrate_together, moved_markers
from skelgen.errors import InputError
from skelgen.evaluation import evaluate
from skelgen.simulation import simulate


def person(motion, n_frames, seed=1):
    return simulate(
        "human",
        seed=seed,
        motion=motion,
        marker_set="plug-in-gait",
        n_frames=n_frames,
        noise=0.3,
        soft_tissue="realistic",
    )


def test_no_marker_of_a_person_sits_elsewhere_because_the_motion_is_another():
    squat = person("squat", 300).take
    assert [moved_markers(squat, person(motion, 200).take) for motion in ("reach", "walk")] == [(), ()]


def test_marker_that_was_put_elsewhere_is_found():
    first, second = (simulate("human", seed=seed, n_frames=200, noise=0.5) for seed in (1, 2))
    positions = second.take.positions.copy()
    limb = int(second.truth.limb_of_marker[10])
    positions[:, 10] += second.truth.world_from_limb[:, limb, :3, :3] @ [0.0, 0.0, 25.0]
    moved = dataclasses.replace(second.take, positions=positions)
    assert moved_markers(first.take, moved) == (first.take.names[10],)
    assert moved_markers(first.take, second.take) == ()


def test_names_that_do_not_say_which_marker_is_which_are_not_believed():
    first, second = (simulate("human", seed=seed, n_frames=200, noise=0.5).take for seed in (1, 2))
    mixed = np.random.default_rng(0).permutation(second.n_markers)
    assert moved_markers(first, dataclasses.replace(second, positions=second.positions[:, mixed])) is None
    assert not are_named_alike([first, dataclasses.replace(second, names=tuple(f"t{n}" for n in mixed))])


def test_takes_that_show_one_half_each_give_the_whole_body():
    """Legs move in the longer take only and arms in the other: each alone lacks limbs, both together have all."""
    whole = simulate("human", seed=1, n_frames=400, noise=0.3)
    names, limbs = whole.truth.limb_names, whole.truth.limb_of_marker
    is_leg = np.array([any(part in names[limb] for part in ("thigh", "shank", "foot")) for limb in limbs])
    takes = []
    for still, first, end in ((~is_leg, 0, 250), (is_leg, 250, 400)):
        positions = whole.take.positions[first:end].copy()
        trunk = int(np.argmax([name == "pelvis" for name in names]))
        pose = whole.truth.world_from_limb[first:end, trunk]
        shape = (whole.take.positions[first] - pose[0, :3, 3]) @ pose[0, :3, :3]
        carried = np.einsum("fij,mj->fmi", pose[:, :3, :3], shape) + pose[:, np.newaxis, :3, 3]
        noise = np.random.default_rng(first).normal(0, 0.3, positions.shape)
        positions[:, still] = (carried + noise)[:, still]
        takes.append(dataclasses.replace(whole.take, positions=positions, name=f"from {first}"))
    both = calibrate_together(takes)
    assert evaluate(both.skeleton, whole.truth).limbs.is_exact


def test_takes_of_one_body_are_posed_as_exactly_as_their_skeleton_was_fitted():
    """The right knee's place along its axis is open: it lies on the line of the shank's two markers."""
    takes = [
        simulate("human", seed=5, motion=motion, marker_set="plug-in-gait", n_frames=120).take
        for motion in ("squat", "walk")
    ]
    both = calibrate_together(takes)
    shank = both.skeleton.skeleton.limb_names.index("right shank")
    for one in both.takes:
        assert one.motion.limb_seen[:, shank].all()
        assert np.nanmax(one.motion.residuals) < 0.1  # mm


def test_longer_bones_between_the_same_clusters_are_another_body():
    first, second = (simulate("human", seed=seed, n_frames=200, noise=0.5) for seed in (1, 2))
    poses, limbs = second.truth.world_from_limb, second.truth.limb_of_marker
    longer = 0.15 * (poses[:, :, :3, 3] - poses[:, :1, :3, 3])
    other = dataclasses.replace(second.take, positions=second.take.positions + longer[:, limbs], name="long")
    with pytest.raises(InputError, match=r"not all of one body: markers of .* lie \d+ mm from"):
        calibrate_together([first.take, other])


@pytest.mark.parametrize(
    ("factor", "labelled", "sentence"),
    [
        (1.1, True, r"large: the skeleton explains \d+ % of the positions that it could; it is of another body"),
        (1.02, False, r"large: \d+ of \d+ markers sit elsewhere on their limbs .*: this is another body, or"),
    ],
)
def test_take_of_another_body_is_refused_with_a_sentence_that_says_so(factor, labelled, sentence):
    first = simulate("human", seed=1, n_frames=300, noise=0.5).take
    second = simulate("human", seed=2, n_frames=200, noise=0.5, labelled=labelled).take
    places = "positions" if labelled else "points"
    larger = dataclasses.replace(second, name="large", **{places: factor * getattr(second, places)})
    with pytest.raises(InputError, match=sentence):
        calibrate_together([first, larger])
