"""Two results of a take are compared by their points, whatever their markers are called."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.app.comparison import compare_results, comparison_sentences
from skelgen.errors import InputError
from skelgen.simulation import simulate


@pytest.fixture(scope="module")
def rods():
    return skelgen.reconstruct(simulate("rods", n_frames=120, noise=0.2).take)


def test_a_result_is_the_same_as_itself_under_other_names(rods):
    renamed = skelgen.correct(rods, "rename", [rods.trajectories.names[0]], "other")
    found = compare_results(rods, renamed)
    assert all(match.other == match.marker and match.share == 1.0 for match in found.markers)
    assert found.other_of_limb == tuple(range(rods.limbs.n_limbs))
    assert [match.median for match in found.joints] == [0.0] * len(found.joints)
    assert "9 of 9 markers" in comparison_sentences(rods, renamed, found)[0]


def test_exchanged_frames_and_other_limbs_are_told(rods):
    first, *_, last = rods.trajectories.names
    swapped = skelgen.correct(rods, "swap", [first, last], frames=(0, 59))
    found = compare_results(rods, swapped)
    assert found.markers[0].share == pytest.approx(0.5, abs=0.02)
    assert found.other_of_limb == ()
    fewer = skelgen.reconstruct(skelgen.correct(rods, "delete", [last]))
    found = compare_results(rods, fewer)
    assert found.markers[-1].other == -1
    assert -1 in found.other_of_limb
    assert any(np.isnan(match.median) for match in found.joints)


def test_results_of_two_takes_are_refused(rods):
    with pytest.raises(InputError, match="two takes"):
        compare_results(rods, skelgen.reconstruct(simulate("rods", n_frames=60).take, until="labels"))
