"""Motions of many groups of markers are measured at once."""

import numpy as np
import pytest

from skelgen.stages.limbs.relative_motion import Movements

PAIRS = [((0, 1), (2, 3)), ((4, 5, 6), (0, 1)), ((2, 3), (4, 5, 6)), ((0, 1, 2), (3, 7)), ((0,), (4, 5, 6))]


@pytest.fixture(params=[False, True], ids=["complete", "with gaps"])
def movements(request):
    rng = np.random.default_rng(3)

    def made():
        positions = 100 * rng.normal(size=(1, 9, 3)) + rng.normal(size=(60, 9, 3))
        if request.param:
            positions[rng.random((60, 9)) < 0.2] = np.nan
            positions[5:, 8] = np.nan
        return positions

    positions = made()
    return [Movements(positions, np.arange(0, 60, 2)) for _ in range(2)]


def test_what_is_measured_at_once_is_what_is_measured_alone(movements):
    together, alone = movements
    together.measure(PAIRS)
    for pair in PAIRS:
        np.testing.assert_allclose(together.relative(*pair).covariance, alone.relative(*pair).covariance, rtol=1e-9)
        for group in pair:
            np.testing.assert_allclose(together.inner(group).covariance, alone.inner(group).covariance, rtol=1e-9)


def test_principal_variances_of_many_groups_are_those_of_each(movements):
    groups = [(0, 1, 2), (3, 4, 5, 6), (5, 6, 7), (0, 1, 2, 3)]
    noise = np.linspace(0.5, 2.0, 9)
    seen = set()
    for indices, spread in movements[0].all_inner(groups):
        ratios = spread.ratios(noise)
        for place, index in enumerate(indices.tolist()):
            seen.add(index)
            np.testing.assert_allclose(ratios[place], movements[1].inner(groups[index]).ratios(noise), rtol=1e-9)
    assert seen == {0, 1, 2, 3}


def test_groups_that_too_few_frames_show_have_no_motion(movements):
    together, _ = movements
    together.measure([((7,), (8,))])
    is_shown = together.seen_part[8] == 1
    assert (together.relative((7,), (8,)) is not None) == is_shown
    assert (together.inner((7, 8)) is not None) == is_shown
