"""Filled gaps against the positions that were hidden."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.kinematics.gap_filling.filling import fill_gaps
from skelgen.model import Joint, Motion, Skeleton, Trajectories
from skelgen.model.filled import PositionSource
from skelgen.model.topology import outward_order
from skelgen.simulation import find_structure, simulate

EXACT = 1e-5  # mm; nothing moves on the limb, rounding and the bridge's jitter are left
GAP = slice(100, 150)
FULLER = "tree:4"  # with more than three markers on a limb


@pytest.fixture(scope="module")
def case():
    """`case(hide, **options)`: a simulated tree with the true skeleton, some positions hidden: `.filled`, `.whole`."""

    def make(hide=(), name="quadruped", limb_seen=True, left_out=(), **options) -> SimpleNamespace:
        options = {"n_frames": 300, **options}
        body, simulated = find_structure(name, 0), simulate(name, seed=0, **options)
        whole, world = simulated.take, simulated.truth.world_from_limb
        limb_of_marker, offsets = body.limb_of_marker.copy(), body.marker_offsets.copy()
        limb_of_marker[list(left_out)], offsets[list(left_out)] = -1, np.nan
        skeleton = make_skeleton(body, limb_of_marker, offsets, world)
        take = hidden(whole, hide)
        filled = fill_gaps(take, skeleton, make_motion(take, skeleton, world, limb_seen))
        return SimpleNamespace(filled=filled, whole=whole, take=take, skeleton=skeleton)

    return make


def hidden(whole, hide):
    positions = whole.positions.copy()
    for marker, frames in hide:
        positions[frames, marker] = np.nan
    return Trajectories(positions, whole.names, whole.rate)


def make_skeleton(body, limb_of_marker, offsets, world):
    o = np.zeros(3)
    children = [int(limb) for limb in outward_order(body.parents) if body.parents[limb] >= 0]
    joints = tuple(
        Joint(int(body.parents[child]), child, np.asarray(body.limbs[child].joint), o, "ball", None, o)
        for child in children
    )
    spread = np.full(len(limb_of_marker), 1.0)
    return Skeleton(body.parents, joints, limb_of_marker, offsets, spread, world[0])


def make_motion(take, skeleton, world, limb_seen):
    limbs = np.maximum(skeleton.limb_of_marker, 0)
    poses = world[:, limbs]
    carried = np.einsum("fmij,mj->fmi", poses[..., :3, :3], skeleton.marker_offsets) + poses[..., :3, 3]
    children = [joint.child for joint in skeleton.joints]
    seen = np.full(world.shape[:2], limb_seen)
    residuals = np.linalg.norm(take.positions - carried, axis=2)
    return Motion(world, world[:, children][..., :3, 3], carried, residuals, seen, take.rate)


def test_measured_positions_stay_to_the_last_bit(case):
    done = case([(0, GAP)], noise=0.5)
    seen = done.take.seen
    assert np.array_equal(done.filled.positions[seen], done.take.positions[seen])
    assert (done.filled.std[seen] == 0).all()
    assert (done.filled.source[seen] == PositionSource.MEASURED).all()


def test_a_rigid_limb_fills_its_gaps_exactly(case):
    done = case([(0, GAP)])
    assert done.filled.positions == pytest.approx(done.whole.positions, abs=EXACT)
    assert (done.filled.std[GAP, 0] < EXACT).all()


def test_source_is_the_limb_while_three_other_markers_are_seen_and_a_joint_below(case):
    sizes = np.bincount(case(name=FULLER).skeleton.limb_of_marker)
    assert sizes.max() > 3
    markers = np.flatnonzero(case(name=FULLER).skeleton.limb_of_marker == sizes.argmax()).tolist()
    enough = case([(markers[0], GAP)], name=FULLER, noise=0.5).filled
    few = case([(marker, GAP) for marker in markers[:-1]], name=FULLER, noise=0.5).filled
    assert (enough.source[GAP, markers[0]] == PositionSource.LIMB).all()
    assert (few.source[GAP, markers[0]] == PositionSource.JOINT).any()


def test_what_is_filled_while_nothing_is_seen_is_called_interpolated(case):
    filled = case([(slice(None), GAP)], limb_seen=False).filled
    assert (filled.source[GAP, 0] == PositionSource.INTERPOLATED).all()


def test_markers_that_are_left_out_are_interpolated(case):
    done = case([(0, slice(100, 103))], left_out=[0])
    assert (done.filled.source[100:103, 0] == PositionSource.INTERPOLATED).all()
    assert done.filled.positions[101, 0] == pytest.approx(done.whole.positions[101, 0], abs=3.0)  # of 10 in two frames


def test_a_marker_that_is_never_seen_stays_empty(case):
    filled = case([(0, slice(None))]).filled
    assert (filled.source[:, 0] == PositionSource.NONE).all()
    assert np.isnan(filled.positions[:, 0]).all()
    assert np.isnan(filled.std[:, 0]).all()


def test_one_seen_frame_is_not_taken_for_certainty(case):
    filled = case([(0, slice(1, None))], noise=0.5).filled
    assert (filled.std[1:, 0] >= 1.0).all()  # mm, the deviation of every marker of the skeleton made here


def test_gaps_at_both_ends_are_filled(case):
    done = case([(0, slice(0, 40)), (1, slice(260, None))])
    assert done.filled.positions == pytest.approx(done.whole.positions, abs=EXACT)


def test_skin_is_bridged_better_than_by_a_rigid_limb(case):
    hide = [(marker, slice(20 + 12 * marker, 40 + 12 * marker)) for marker in range(20)]
    done = case(hide, n_frames=600, soft_tissue=2.0, noise=0.3)
    gaps = ~done.take.seen
    limbs = done.skeleton.limb_of_marker
    assert (limbs >= 0).all()
    error = np.linalg.norm((done.filled.positions - done.whole.positions)[gaps], axis=1)
    skin = 2.0 * np.sqrt(3)  # mm; what a rigid limb with the true pose leaves
    assert np.sqrt((error**2).mean()) < 0.8 * skin


def test_deviations_cover_what_was_hidden(case):
    hide = [(marker, slice(20 + 12 * marker, 70 + 12 * marker)) for marker in range(20)]
    done = case(hide, n_frames=600, soft_tissue=2.0, noise=0.3)
    gaps = ~done.take.seen
    off = np.abs(done.filled.positions - done.whole.positions)[gaps] / done.filled.std[gaps][:, np.newaxis]
    assert (off < 1).mean() == pytest.approx(0.68, abs=0.15)  # 20 gaps are some 60 independent values
    assert (off < 2).mean() > 0.85


def test_the_same_take_is_filled_with_the_same_bits(case):
    options = {"n_frames": 200, "noise": 0.5}
    assert np.array_equal(case([(0, GAP)], **options).filled.positions, case([(0, GAP)], **options).filled.positions)


def test_a_motion_of_another_take_is_refused(case):
    long, short = case(), case(n_frames=200)
    motion = make_motion(long.take, long.skeleton, simulate("quadruped", n_frames=300).truth.world_from_limb, True)
    with pytest.raises(InputError, match="give the motion that was fitted to this take"):
        fill_gaps(short.take, short.skeleton, motion)
