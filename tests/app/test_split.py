"""Parts of a marker that was split share its limb, whatever part limbs are found with."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.app.inputs import limbs_with_parts
from skelgen.model import Limbs, Trajectories

NAMES = ("A", "B", "C", "A_2")


def take(slip):
    """Three markers, the first of which is called A_2 from one frame of ten on."""
    positions = np.random.default_rng(0).normal(size=(10, 4, 3))
    positions[slip:, 0], positions[:slip, 3] = np.nan, np.nan
    return Trajectories(positions, NAMES, 100.0)


@pytest.mark.parametrize("slip", [2, 8])
def test_the_longer_part_stands_for_the_marker_and_the_other_joins_it(slip):
    asked = []

    def find(trajectories):
        asked.append(trajectories)
        limbs = {"A": 7, "B": 8, "C": -1}
        return Limbs(
            np.array([limbs[name] - 7 if name != "C" else -1 for name in trajectories.names]), np.zeros((3, 3))
        )

    limbs = limbs_with_parts(take(slip), (("A", "A_2"),), find)
    assert sorted(asked[0].names) == ["A", "B", "C"]
    assert asked[0].seen[:, asked[0].names.index("A")].sum() == max(slip, 10 - slip)
    assert limbs.limb_of_marker.tolist() == [0, 1, -1, 0]
    assert np.isnan(limbs.distance_deviation[0, 3])
    assert np.isfinite(limbs.distance_deviation[0, 1:3]).all()


def test_without_split_markers_the_take_is_passed_as_it_is():
    whole, asked = take(5), []

    def find(trajectories):
        asked.append(trajectories)
        return Limbs(np.arange(4), np.zeros((4, 4)))

    limbs = limbs_with_parts(whole, (), find)
    assert [given is whole for given in asked] == [True]
    assert limbs.limb_of_marker.tolist() == [0, 1, 2, 3]
