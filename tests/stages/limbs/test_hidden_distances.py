import numpy as np
import pytest

from skelgen.simulation.markers import carried_markers
from skelgen.simulation.people import natural_motion, person
from skelgen.stages.limbs.hidden_distances import LEAST_FRAMES, with_hidden
from skelgen.stages.limbs.worn_shapes import shape_of


@pytest.fixture(scope="module")
def distances():
    """Distances that vary in two ways, with and without those that are hidden in long pieces."""
    rng = np.random.default_rng(0)
    times, loadings = np.arange(60) / 20, rng.normal(0.0, 0.1, (2, 200))
    postures = np.stack([np.sin(2.0 * times), np.cos(3.1 * times)], axis=1)
    every = 300.0 * np.exp(postures @ loadings + rng.normal(0.0, 0.005, (60, 200)))
    seen = every.copy()
    for pair, first in enumerate(rng.integers(0, 40, 200)):
        seen[first : first + 25, pair] = np.nan
    return every, seen


def test_hidden_distances_are_found_from_those_that_are_seen(distances):
    every, seen = distances
    found, variances = with_hidden(seen)
    hidden = np.isnan(seen)
    np.testing.assert_array_equal(found[~hidden], seen[~hidden])
    errors, usual = np.log(found / every)[hidden], np.log(every / np.nanmedian(seen, axis=0))[hidden]
    assert np.sqrt(np.mean(errors**2)) < 0.2 * np.sqrt(np.mean(usual**2))
    assert np.sqrt(np.mean(errors**2)) < 2.0 * np.sqrt(variances.mean())


def test_distances_that_no_frame_shows_stay_unknown(distances):
    _, seen = distances
    seen = np.column_stack([seen, np.full(60, np.nan)])
    found, _ = with_hidden(seen)
    assert np.isnan(found[:, -1]).all()
    assert np.isfinite(found[:, :-1]).all()


def test_frames_that_show_nothing_are_as_usual(distances):
    every, seen = distances
    seen = np.concatenate([seen, np.full((3, seen.shape[1]), np.nan)])
    found, _ = with_hidden(seen)
    assert np.abs(np.log(found[-3:] / np.exp(np.log(every).mean(axis=0)))).max() < 0.1


def test_of_few_frames_nothing_is_found(distances):
    _, seen = distances
    few = seen[: LEAST_FRAMES - 1]
    np.testing.assert_array_equal(with_hidden(few)[0], few)


def test_shapes_of_who_is_hidden_for_a_third_are_nearly_those_of_who_is_seen():
    rng = np.random.default_rng(3)
    who = person("animation-41", 0.0, rng)
    _, poses = natural_motion(who, "run", 300, 100.0, rng)
    positions = carried_markers(who.worn, poses[:, who.limbs])
    hidden = positions.copy()
    for marker in np.repeat(np.arange(positions.shape[1]), 5).tolist():
        first = int(rng.integers(0, 300))
        hidden[first : first + 25, marker] = np.nan
    whole, found = shape_of(positions), shape_of(hidden)
    off = np.abs(found.distances - whole.distances), np.abs(found.motions - whole.motions)
    assert np.nanmean(off[0]) < 0.0125  # 0.016 by what is seen alone
    assert np.nanmean(off[1]) < 0.15
