"""Takes whose identities are hard to find: fast bodies, long gaps, near markers, several bodies."""

import numpy as np
import pytest

from skelgen.errors import ParameterError
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model import Poses
from skelgen.simulation import find_structure, simulate
from skelgen.simulation.articulated import with_spacing
from skelgen.simulation.markers import bursts_lost


def test_the_first_of_two_bodies_moves_as_if_it_were_alone():
    alone, both = (simulate("human", n_frames=50, seed=3, subjects=count).truth for count in (1, 2))
    assert both.n_markers == 2 * alone.n_markers
    np.testing.assert_array_equal(both.marker_positions[:, : alone.n_markers], alone.marker_positions)
    np.testing.assert_array_equal(
        both.joint_names[0], f"subject 1: {alone.joint_names[0].replace(' - ', ' - subject 1: ')}"
    )


def test_two_bodies_are_two_trees_as_far_apart_as_wished():
    truth = simulate("tree:4", n_frames=200, subjects=2, apart=2500.0, walk=0.0).truth
    roots = np.flatnonzero(truth.parents < 0)
    assert len(roots) == 2
    aside = truth.world_from_limb[:, roots[1], 1, 3] - truth.world_from_limb[:, roots[0], 1, 3]
    np.testing.assert_allclose(aside, 2500.0)


def test_joints_of_two_bodies_are_where_both_of_their_limbs_say():
    truth = simulate("tree:4", n_frames=20, subjects=2).truth
    limb = truth.edges[:, 0]
    pose = truth.world_from_limb[:, limb]
    places = np.einsum("fjab,jb->fja", pose[..., :3, :3], truth.positions_in_parent) + pose[..., :3, 3]
    np.testing.assert_allclose(places, truth.joint_positions, atol=1e-9)


def test_people_with_marker_sets_come_in_pairs_too():
    take = simulate("human", n_frames=30, motion="walk", subjects=2).take
    assert take.names[0].startswith("subject 1: ") and take.names[-1].startswith("subject 2: ")


def test_markers_are_as_near_as_wished():
    tree = with_spacing(find_structure("tree:6", 1), 25.0)
    for limb in tree.limbs:
        apart = np.linalg.norm(limb.markers[:, np.newaxis] - limb.markers, axis=2) + np.diag(
            [np.inf] * len(limb.markers)
        )
        assert np.median(apart.min(axis=1)) == pytest.approx(25.0)


def test_twice_the_speed_is_the_same_motion_in_half_the_frames():
    usual = simulate("human", n_frames=101, seed=2).truth.marker_positions
    fast = simulate("human", n_frames=51, seed=2, speed=2.0).truth.marker_positions
    np.testing.assert_allclose(fast, usual[::2], atol=1e-6)


def test_pieces_that_are_lost_have_the_length_and_the_share_that_were_wished():
    lost = bursts_lost(20_000, 20, 0.2, 35.0, np.random.default_rng(0))
    begins = (lost[1:] & ~lost[:-1]).sum()
    assert lost.mean() == pytest.approx(0.2, abs=0.02)
    assert lost.sum() / begins == pytest.approx(35.0, rel=0.1)


def test_a_marker_set_has_its_own_spacing():
    with pytest.raises(ParameterError, match="spacing belongs to"):
        simulate("human", n_frames=30, motion="walk", spacing=20.0)


@pytest.mark.parametrize("hold", ["partners", "tool"])
def test_who_holds_on_keeps_a_point_in_common_for_the_span_and_all_joints_all_the_time(hold):
    truth = simulate("human", n_frames=400, seed=1, hold=hold, subjects=2 if hold == "partners" else 1).truth
    alone = simulate("human", n_frames=400, seed=1).truth
    np.testing.assert_array_equal(truth.world_from_limb[:, : alone.n_limbs], alone.world_from_limb)
    (first, last), pair = truth.hold_frames[0], truth.hold_limbs[0]
    one, other = (truth.world_from_limb[:, limb] for limb in pair)
    gap = fit_fixed_point(one[first : last + 1], other[first : last + 1], np.zeros(3), np.zeros(3))
    assert gap is not None and gap.gap < 1e-4
    apart = fit_fixed_point(one, other, np.zeros(3), np.zeros(3))
    assert apart is not None and apart.gap > 100.0**2
    pose = truth.world_from_limb[:, truth.edges[:, 0]]
    places = np.einsum("fjab,jb->fja", pose[..., :3, :3], truth.positions_in_parent) + pose[..., :3, 3]
    np.testing.assert_allclose(places, truth.joint_positions, atol=1e-9)


def test_sensors_sit_anywhere_on_their_limbs_and_err_as_wished():
    simulated = simulate("human", n_frames=300, sensors=True, noise=2.0, turn_noise=0.5, dropouts=0.1)
    take, truth = simulated.take, simulated.truth
    assert isinstance(take, Poses) and take.names == truth.limb_names
    mounts = np.linalg.inv(truth.world_from_limb) @ take.world_from_body
    assert np.nanstd(mounts[..., :3, 3], axis=0).mean() == pytest.approx(2.0, rel=0.1)
    assert np.isnan(mounts[..., 0, 0]).mean() == pytest.approx(0.1, abs=0.04)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"hold": "partners"}, "partners who hold hands are two; there is 1 subject$"),
        ({"hold": "partners", "subjects": 3}, "there are 3 subjects$"),
        ({"apart": 500.0}, "apart belongs to takes of several bodies"),
        ({"dropout_seconds": 0.2}, "dropout_seconds belongs to what is lost: it needs dropouts above 0"),
        ({"hold": "tool", "subjects": 2}, "one subject takes the tool"),
        ({"sensors": True, "ghosts": 1.0}, "belongs to markers"),
        ({"turn_noise": 1.0}, "turn_noise belongs to sensors"),
    ],
)
def test_what_does_not_belong_together_is_refused(options, says):
    with pytest.raises(ParameterError, match=says):
        simulate("human", n_frames=20, **options)
