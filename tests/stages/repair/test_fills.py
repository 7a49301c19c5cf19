"""Gaps that a program filled are found, whatever the curve, and nothing that was measured is taken for one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from skelgen.model import Trajectories
from skelgen.stages.limbs import find_limbs
from skelgen.stages.repair import RepairParameters, repair_take
from skelgen.stages.repair.fills import find_fills
from skelgen.stages.repair.smoothed_fills import find_smoothed_fills

MARKERS, EVERY, LONG = range(0, 40, 3), 90, 14
LEAST_PART = 0.3  # of what lines and splines filled: the rest is near to where the marker was
OPTIONS = {"n_frames": 500, "noise": 0.2, "motion": "walk", "marker_set": "animation-41", "soft_tissue": "realistic"}


def held(known: np.ndarray, positions: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """The last position that was seen."""
    return positions[known[np.searchsorted(known, frames) - 1]]


def on_lines(known: np.ndarray, positions: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Positions on straight lines."""
    return np.stack([np.interp(frames, known, positions[known, axis]) for axis in range(3)], axis=1)


def on_splines(known: np.ndarray, positions: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Positions on cubic splines."""
    return np.asarray(CubicSpline(known, positions[known])(frames))


@pytest.fixture(scope="module")
def walker(simulated) -> Trajectories:
    return simulated("human", seed=1, **OPTIONS).take


def filled(take: Trajectories, curve, long: int = LONG) -> tuple[Trajectories, np.ndarray]:
    """The take with gaps that were filled, at other times for each marker, in single precision, and where."""
    where = np.zeros(take.positions.shape[:2], dtype=np.bool_)
    for marker in MARKERS:
        for first in range(20 + 2 * marker, take.n_frames - long, EVERY):
            where[first : first + long, marker] = True
    positions = take.positions.copy()
    for marker in MARKERS:
        known, frames = np.flatnonzero(~where[:, marker]), np.flatnonzero(where[:, marker])
        positions[frames, marker] = curve(known, positions[:, marker], frames)
    return dataclasses.replace(take, positions=positions.astype(np.float32).astype(np.float64)), where


@pytest.mark.parametrize("curve", [held, on_lines, on_splines])
def test_gaps_that_were_filled_are_gaps_again(walker, curve) -> None:
    take, where = filled(walker, curve)
    repair = repair_take(take)
    found = np.isnan(repair.trajectories.positions[..., 0]) & take.seen
    assert (found & where).sum() > 0.9 * where.sum() and not (found & ~where).any()
    assert {one.kind for one in repair.findings} == {"filled"} and len(repair.findings) == len(MARKERS)
    np.testing.assert_array_equal(repair.trajectories.positions[~found], take.positions[~found])


def test_markers_with_both_kinds_of_filled_gaps_are_counted_once(walker, notices) -> None:
    again = filled(smoothed(filled(walker, on_lines, long=35)[0], 8.0), held, long=20)[0]
    repair = repair_take(again, monitor=notices)
    assert len([one for one in repair.findings if one.kind == "filled"]) > len(MARKERS)
    assert any(f"of {len(MARKERS)} markers" in notice for notice in notices.sentences)


def test_filled_gaps_stay_if_wanted(walker) -> None:
    take, _ = filled(walker, on_lines)
    kept = repair_take(take, RepairParameters(fills=False, slips=False)).trajectories
    assert kept.seen.all()


def test_limbs_are_the_same_as_with_gaps(walker) -> None:
    take, where = filled(walker, on_lines)
    gaps = dataclasses.replace(walker, positions=np.where(where[..., np.newaxis], np.nan, walker.positions))
    limbs = [find_limbs(one).limb_of_marker for one in (repair_take(take).trajectories, gaps)]
    np.testing.assert_array_equal(*limbs)


def smoothed(take: Trajectories, cutoff: float) -> Trajectories:
    """The take behind a low pass."""
    paths = filtfilt(*butter(2, cutoff / (take.rate / 2)), take.positions, axis=0)
    return dataclasses.replace(take, positions=paths)


@pytest.mark.parametrize("cutoff", [3.0, 6.0, 12.0])
def test_smoothed_paths_are_measured(walker, recording, cutoff) -> None:
    for take in (walker, recording("bodies/landing.trc"), recording("bodies/flips.c3d")):
        assert find_fills(smoothed(take, cutoff)) == find_smoothed_fills(smoothed(take, cutoff)) == ()


@pytest.mark.parametrize("curve", [on_lines, on_splines])
def test_gaps_that_were_filled_before_all_was_smoothed(walker, curve) -> None:
    take, where = filled(walker, curve, long=35)
    found = np.zeros_like(where)
    for fill in find_smoothed_fills(smoothed(take, 8.0)):
        found[fill.frames, fill.marker] = True
    assert (found & where).sum() > LEAST_PART * where.sum() and (found & where).sum() > 0.95 * found.sum()


@pytest.mark.parametrize("decimals", [0, 2])
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("structure", ["human", "quadruped", "rods"])
def test_paths_without_noise_and_with_few_decimals_are_measured(simulated, structure, noise, decimals) -> None:
    take = simulated(structure, n_frames=400, noise=noise).take
    assert find_fills(take) == ()
    assert find_fills(dataclasses.replace(take, positions=np.round(take.positions, decimals))) == ()


def test_frames_between_which_all_markers_were_drawn_are_no_gaps(walker) -> None:
    frames, known = np.arange(walker.n_frames), np.arange(0, walker.n_frames, 5)
    drawn = [on_lines(known, walker.positions[:, marker], frames) for marker in range(walker.n_markers)]
    assert find_fills(dataclasses.replace(walker, positions=np.stack(drawn, axis=1))) == ()


def test_a_recording_in_which_curves_were_drawn(recording) -> None:
    punch = find_fills(recording("bodies/punch.c3d"))
    assert sum(fill.n_gaps for fill in punch) == 16 and sum(len(fill.frames) for fill in punch) > 400
    assert find_fills(recording("bodies/landing.trc")) == ()
