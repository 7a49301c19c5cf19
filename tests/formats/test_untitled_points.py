"""Numbers without titles: an arm that swings beside a body that goes, three points each."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

N_FRAMES = 60
TURN = np.linspace(0.0, 2.5, N_FRAMES)
ARM = [np.stack([np.cos(TURN) * r, np.full(N_FRAMES, r / 3), np.sin(TURN) * r], axis=1) for r in (300, 500, 640)]
BODY = [
    np.stack([900 * TURN + x, 900 - x + 260 * np.sin(7 * TURN), 300 * np.sin(3 * TURN) + 20 * x], axis=1)
    for x in (5, 40, 95)
]
POSITIONS = np.stack([*ARM, *BODY], axis=1)


def text(numbers, delimiter=" "):
    return "".join(delimiter.join(f"{x:.4f}" for x in row) + "\n" for row in numbers)


LAYOUTS = {
    "in turn": POSITIONS.reshape(N_FRAMES, -1),
    "by axis": POSITIONS.swapaxes(1, 2).reshape(N_FRAMES, -1),
    "with confidence": np.concatenate([POSITIONS, np.full((N_FRAMES, 6, 1), 0.9)], axis=2).reshape(N_FRAMES, -1),
}


@pytest.mark.parametrize("delimiter", [" ", ",", "\t"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_columns_are_taken_so_that_points_keep_distances(put, layout, delimiter):
    path = put("numbers.txt", text(LAYOUTS[layout], delimiter))
    take = read_take(path)
    assert recognise(path).name == "untitled-points"
    np.testing.assert_allclose(take.positions, POSITIONS, atol=1e-3)
    assert take.notices[0].startswith("numbers without titles are taken as")


@pytest.mark.parametrize("behind", [False, True])
def test_columns_that_rise_evenly_are_frames_and_times(put, behind):
    counts = np.stack([np.arange(N_FRAMES), np.arange(N_FRAMES) / 50], axis=1)
    parts = [LAYOUTS["in turn"], counts] if behind else [counts, LAYOUTS["in turn"]]
    take = read_take(put("times.csv", text(np.concatenate(parts, axis=1), ",")))
    assert (take.positions.shape[1], take.rate) == (6, pytest.approx(50.0))


def test_comment_names_the_points(put):
    take = read_take(put("named.txt", "# a b c d e f\n" + text(LAYOUTS["in turn"])))
    assert take.names == tuple("abcdef")


def test_flat_array_is_read_as_columns_are(tmp_path):
    np.save(tmp_path / "flat.npy", LAYOUTS["by axis"])
    np.testing.assert_array_equal(read_take(tmp_path / "flat.npy").positions, POSITIONS)


@pytest.mark.parametrize(
    "numbers", [np.cumsum(np.random.default_rng(1).normal(size=(60, 18)), axis=0), np.ones((60, 18))]
)
def test_numbers_that_keep_no_distances_are_refused(put, refused, numbers):
    assert "no layout in which points keep distances" in refused(put("angles.txt", text(numbers)))
