"""Limbs whose markers fit in two ways are turned to where their joints are."""

import numpy as np
import pytest

from skelgen.model import Trajectories
from skelgen.simulation import simulate
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.model_fit.model import find_structure, fit_model
from skelgen.stages.labels.model_fit.symmetry import fitting_orders, turned_limbs

BORDER = 10  # frames about a change that noise may give to either side
LIMB = 3  # of the tree: markers wind around it, so that the reverse order fits as well


@pytest.mark.parametrize(("side", "n_orders"), [(30.0, 2), (45.0, 1)])
def test_a_triangle_fits_in_two_ways_if_two_of_its_sides_are_equal(side, n_orders):
    places = np.array([[0.0, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, 30.0]])
    orders = fitting_orders(places, 1.0)
    assert len(orders) == n_orders
    np.testing.assert_array_equal(orders[0], np.arange(3))


def test_many_markers_are_not_tried():
    assert len(fitting_orders(np.zeros((9, 3)), 1.0)) == 1


def test_a_limb_that_was_turned_for_a_while_is_turned_back():
    made = simulate("tree:5", n_frames=1000, seed=4, noise=0.3, labelled=False)
    true = made.truth.marker_of_point.astype(np.int32)
    members = np.flatnonzero(made.truth.limb_of_marker == LIMB)
    frames = np.repeat(np.arange(1000), made.take.points_per_frame)
    becomes = np.arange(made.truth.n_markers, dtype=np.int32)
    becomes[members] = members[::-1]
    given = np.where((frames >= 400) & (frames < 550), becomes[true], true)
    sampled = np.arange(0, 1000, 2)
    positions = point_labels.sampled_positions(made.take, given, sampled)
    sample = Trajectories(positions, point_labels.marker_names(len(becomes)), 50.0)
    core = np.arange(len(becomes))
    model = fit_model(sample, core, 50.0, find_structure(sample, core, 0))
    inner = (np.abs(frames - 400) > BORDER) & (np.abs(frames - 550) > BORDER)
    np.testing.assert_array_equal(turned_limbs(made.take, given, model, 100.0)[inner], true[inner])
    np.testing.assert_array_equal(turned_limbs(made.take, true, model, 100.0), true)
