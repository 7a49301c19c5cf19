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


def sparse(n_columns, entries):
    rows = "".join(f"{frame + 1}\t{column + 1}\t{value:.6f}\n" for frame, column, value in entries)
    return f"xyz coordinates\n{N_FRAMES}\t{n_columns}\t{len(entries)}\n{rows}"


def test_sparse_tables_of_dltdv_are_points_with_gaps(put):
    columns = POSITIONS.reshape(N_FRAMES, -1)
    entries = [
        (frame, column, columns[frame, column]) for column in range(18) for frame in range(column // 3, N_FRAMES)
    ]
    take = read_take(put("wing-xyzpts.tsv", sparse(18, entries)))
    unseen = np.arange(N_FRAMES)[:, np.newaxis] < np.arange(6)  # the first frames of all points but the first
    np.testing.assert_allclose(take.positions[~unseen], POSITIONS[~unseen], atol=1e-3)
    assert np.isnan(take.positions[unseen]).all()


@pytest.mark.parametrize(
    ("name", "n_columns", "entry", "what"),
    [
        ("wing-xypts.tsv", 12, (0, 0, 1.0), "two coordinates"),
        ("wing-xyzpts.tsv", 4, (0, 0, 1.0), "two coordinates"),
        ("wing-xyzpts.tsv", 6, (N_FRAMES, 0, 1.0), "entries beyond"),
    ],
)
def test_sparse_tables_in_images_or_beyond_their_sizes_are_refused(refused, put, name, n_columns, entry, what):
    entries = [(frame, 0, 1.0) for frame in range(20)]
    assert what in refused(put(name, sparse(n_columns, [*entries, entry])))


def test_sparse_tables_of_hardly_any_numbers_are_refused(refused, put):
    few = "title\n100000000\t9\t900000000\n1\t1\t0.5\n2\t1\t0.5\n"
    assert "only 2 numbers" in refused(put("few-xyzpts.tsv", few))


def test_last_points_may_be_unseen_at_first(put):
    rows = text(POSITIONS.reshape(N_FRAMES, -1), ",").splitlines()
    rows[:9] = [",".join([*row.split(",")[:15], "", "", ""]) for row in rows[:9]]
    take = read_take(put("numbers.csv", "\n".join(rows)))
    assert take.seen[:, 5].tolist() == [False] * 9 + [True] * (N_FRAMES - 9)
    np.testing.assert_allclose(take.positions[9:], POSITIONS[9:], atol=1e-3)


def test_a_row_that_is_too_long_is_named(put, refused):
    rows = text(POSITIONS.reshape(N_FRAMES, -1), ",").splitlines()
    rows[20] += ",1"
    assert "21: 19 cells where 18 belong" in refused(put("numbers.csv", "\n".join(rows)))


@pytest.mark.parametrize("name", ["wing-xyzpts.csv", "wing_xyzpts.txt"])
def test_columns_of_dltdv_without_titles_are_points_however_few(put, name):
    rows = POSITIONS.reshape(N_FRAMES, -1)[:, :9].copy()
    rows[:9, 3:6] = np.nan
    take = read_take(put(name, text(rows, ",")))
    np.testing.assert_allclose(take.positions, rows.reshape(N_FRAMES, 3, 3), atol=1e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_that_keeps_distances_counts_more_than_the_name_of_a_file(put, layout):
    take = read_take(put("arm_xyzpts.txt", text(LAYOUTS[layout])))
    np.testing.assert_allclose(take.positions, POSITIONS, atol=1e-3)
