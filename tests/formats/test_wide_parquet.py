"""Wide tables in Parquet."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from skelgen.errors import FormatError
from tests.formats.wide_rows import POSITIONS, TIMES


def test_parquet_is_read_alike(tmp_path):
    table = pytest.importorskip("pandas").DataFrame({"time": TIMES})
    for column, title in enumerate(("nose_x", "nose_y", "nose_z", "tail_x", "tail_y", "tail_z")):
        table[title] = POSITIONS.reshape(2, -1)[:, column]
    table.to_parquet(tmp_path / "points.parquet")
    take = read_take(tmp_path / "points.parquet")
    assert (take.names, take.rate) == (("nose", "tail"), 50.0)
    np.testing.assert_array_equal(take.positions, POSITIONS)


def test_damaged_parquet_is_refused(refused, put):
    pytest.importorskip("pyarrow")
    assert "damaged" in refused(put("points.parquet", b"PAR1 and nothing else PAR1"))


def test_parquet_with_a_column_twice_is_refused(refused, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = [f"{point}_{axis}" for point in ("nose", "tail") for axis in "xyz"] + ["nose_x"]
    table = pyarrow.Table.from_arrays([pyarrow.array([1.0, 2.0])] * len(names), names=names)
    parquet.write_table(table, tmp_path / "points.parquet")
    assert "two columns are called nose_x" in refused(tmp_path / "points.parquet")


def test_parquet_without_a_frame_is_refused(refused, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = [f"{point}_{axis}" for point in ("nose", "tail") for axis in "xyz"]
    table = pyarrow.table([pyarrow.array([], pyarrow.float64())] * len(names), names=names)
    parquet.write_table(table, tmp_path / "points.parquet")
    assert "holds no frame" in refused(tmp_path / "points.parquet")


def test_seconds_and_nanoseconds_in_two_columns_tell_the_rate(tmp_path):
    table = pytest.importorskip("pandas").DataFrame({"sec": [7, 8, 8], "nanosec": [990_000_000, 0, 10_000_000]})
    for number, title in enumerate(("a_x", "a_y", "a_z", "b_x", "b_y", "b_z")):
        table[title] = [number + 1.0] * 3
    table.to_parquet(tmp_path / "points.parquet")
    assert read_take(tmp_path / "points.parquet").rate == pytest.approx(100.0)


def test_tidy_tables_and_tables_of_vectors_are_read(tmp_path):
    frame = pytest.importorskip("pandas").DataFrame
    tidy = [(f, name, f + 0.5, 2.0, 3.0) for f in range(3) for name in ("nose", "tail")]
    frame(tidy, columns=["frame", "keypoint", "x", "y", "z"]).to_parquet(tmp_path / "tidy.parquet")
    vectors = {"time": TIMES, "nose": [[1.5, 2.0, 3.0]] * 2, "tail": [[4.0, 5.0, 6.0], None]}
    frame(vectors).to_parquet(tmp_path / "vectors.parquet")
    assert read_take(tmp_path / "tidy.parquet").positions[2, 1].tolist() == [2500.0, 2000.0, 3000.0]
    take = read_take(tmp_path / "vectors.parquet")
    assert (take.names, take.rate, take.seen.tolist()) == (("nose", "tail"), 50.0, [[True, True], [True, False]])
    frame({"a": [1.0, 2.0]}).to_parquet(tmp_path / "other.parquet")
    with pytest.raises(FormatError, match="no columns such as name_x"):
        read_take(tmp_path / "other.parquet")
