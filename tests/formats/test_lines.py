"""A sample of a large file: what is counted is exact, and no position is one that the file does not hold."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from skelgen_formats.lines import Sample, read_lines
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Poses, Trajectories

N_FRAMES, N_MARKERS, MOST = 700, 5, 40
FOUR_TIMES = 4  # the memory of a reader in sizes of its file, as docs/bad-input.md states
NAMES = tuple(f"M{number}" for number in range(N_MARKERS))


@pytest.fixture
def positions():
    """Five markers [mm]; the second is unseen in a third of the frames, all in the last fifth but one."""
    positions = np.random.default_rng(4).uniform(-900, 900, (N_FRAMES, N_MARKERS, 3)).round(3)
    positions[200:430, 1] = np.nan
    positions[560:690] = np.nan
    return positions


def small_sample():
    return Sample(MOST, above=0)


def rows_of(positions, delimiter, first):
    """One line per frame: what `first` says of its number, then its coordinates, empty where unseen."""
    cells = [["" if np.isnan(x) else f"{x:.3f}" for x in frame.ravel()] for frame in positions]
    return "".join(delimiter.join([*first(number), *row]) + "\n" for number, row in enumerate(cells))


def nexus_text(positions, first=lambda number: (str(number + 7), "0")):
    titles = ",,,".join(NAMES)
    head = f"Trajectories\n120\n,,{titles},,\nFrame,Sub Frame{',X,Y,Z' * N_MARKERS}\n,{',mm,mm,mm' * N_MARKERS}\n"
    return head + rows_of(positions, ",", first) + "\nDevices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,5\n"


def wide_text(positions):
    titles = ",".join(f"{name}_{axis}" for name in NAMES for axis in "xyz")
    return f"time,{titles}\n" + rows_of(positions, ",", lambda number: (f"{number / 120:.3f}",))


def qualisys_text_of(positions):
    head = f"NO_OF_FRAMES\t{len(positions)}\nNO_OF_MARKERS\t{N_MARKERS}\nFREQUENCY\t120\nDATA_INCLUDED\t3D\n"
    titles = "\t".join(f"{name} {axis}" for name in NAMES for axis in "XYZ")
    names = "MARKER_NAMES\t" + "\t".join(NAMES) + f"\nFrame\tTime\t{titles}\n"
    return head + names + rows_of(positions, "\t", lambda number: (str(number + 1), f"{number / 120:.5f}"))


def motive_text_of(positions):
    head = "Format Version,1.23,Export Frame Rate,120,Length Units,Millimeters,Rotation Type,Quaternion\n\n"
    titles = ("Marker", "S:{}", "id{}", "Position")
    rows = "".join(
        f",{label}," + ",".join(title.format(name) for name in NAMES for _ in "XYZ") + "\n"
        for label, title in zip(("", "Name", "ID", ""), titles, strict=True)
    )
    axes = "Frame,Time (Seconds)," + ",".join("XYZ" * N_MARKERS) + "\n"
    return head + rows + axes + rows_of(positions, ",", lambda number: (str(number), f"{number / 120:.6f}"))


def made(name, positions, tmp_path):
    """A file of a format, by its writer or as the program that has it writes it."""
    texts = {
        "nexus": (nexus_text, ".csv"),
        "wide-csv": (wide_text, ".csv"),
        "qualisys": (qualisys_text_of, ".tsv"),
        "motive": (motive_text_of, ".csv"),
    }
    if name in texts:
        path = tmp_path / f"take{texts[name][1]}"
        path.write_text(texts[name][0](positions), encoding="utf-8")
        return path
    if name == "numpy":
        path = tmp_path / "take.npz"
        np.savez(path, positions=positions, names=np.array(NAMES), rate=120.0, unit="mm")
        return path
    path = tmp_path / f"take.{name}"
    write_file(Trajectories(positions, NAMES, 120.0), path, name)
    return path


@pytest.mark.parametrize("name", ["trc", "c3d", "csm", "qualisys", "motive", "nexus", "wide-csv", "numpy"])
def test_sample_counts_all_frames_and_holds_some_of_them(name, positions, tmp_path):
    path, sample = made(name, positions, tmp_path), small_sample()
    whole, some = read_take(path, name), read_take(path, name, sample=sample)
    assert some.n_frames == MOST
    assert some.n_frames + sample.n_left_out == whole.n_frames == N_FRAMES
    assert (some.names, some.rate) == (whole.names, whole.rate)
    chosen = np.linspace(0, N_FRAMES - 1, MOST).astype(int)
    np.testing.assert_array_equal(some.positions, whole.positions[chosen])


def test_sampled_cloud_counts_frames_and_keeps_the_rate(tmp_path, positions):
    seen = ~np.isnan(positions[:, :, 0])
    starts = np.concatenate(([0], np.cumsum(seen.sum(axis=1))))
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / 59.94)
    write_file(cloud, tmp_path / "take.mfml")
    sample = small_sample()
    some = read_take(tmp_path / "take.mfml", sample=sample)
    assert some.n_frames + sample.n_left_out == N_FRAMES
    assert sample.rate == read_take(tmp_path / "take.mfml").rate
    assert {tuple(point) for point in some.points.tolist()} <= {
        tuple(point) for point in np.float32(cloud.points).astype(float).tolist()
    }


def test_sampled_poses_are_those_of_the_file(tmp_path, sensors):
    poses = Poses(np.tile(sensors.world_from_body, (50, 1, 1, 1)), sensors.names, 60.0)
    write_file(poses, tmp_path / "take.poses.csv")
    sample = small_sample()
    some = read_take(tmp_path / "take.poses.csv", sample=sample)
    assert (some.n_frames, some.n_frames + sample.n_left_out, some.rate) == (MOST, 400, 60.0)


def test_small_file_is_read_whole(positions, tmp_path):
    sample = Sample(MOST)
    assert read_take(made("trc", positions, tmp_path), sample=sample).n_frames == N_FRAMES
    assert sample.n_left_out == 0


def test_blank_lines_are_no_frames(positions, tmp_path):
    path, sample = made("trc", positions, tmp_path), small_sample()
    path.write_text(path.read_text().replace("\n300\t", "\n\n \t\n\f\n300\t") + "\n\n\n", encoding="utf-8")
    assert read_take(path, sample=sample).n_frames + sample.n_left_out == N_FRAMES


def test_text_of_blank_lines_is_counted_in_memory_of_its_size(positions, tmp_path):
    path, n_blank = made("trc", positions, tmp_path), 2_000_000
    path.write_bytes(path.read_bytes() + b"\n" * n_blank)
    tracemalloc.start()
    try:
        sample = small_sample()
        assert read_take(path, sample=sample).n_frames + sample.n_left_out == N_FRAMES
        assert tracemalloc.get_traced_memory()[1] < FOUR_TIMES * n_blank
    finally:
        tracemalloc.stop()


def test_long_line_of_blanks_among_the_sampled_is_left_out(positions, tmp_path):
    path = made("csm", positions[:MOST], tmp_path)
    path.write_text(path.read_text() + "\x1f" * 200 + "\n", encoding="utf-8")
    assert read_take(path, sample=small_sample()).n_frames == MOST


def test_line_that_is_cut_off_is_told_and_not_counted(positions, tmp_path):
    path, sample = made("qualisys", positions, tmp_path), small_sample()
    text = path.read_text()
    path.write_text(text[: text.rindex("\n700\t") + 12], encoding="utf-8")
    take = read_take(path, sample=sample)
    assert take.n_frames + sample.n_left_out == N_FRAMES - 1
    assert take.notices == read_take(path).notices


def test_frames_of_infinite_numbers_are_counted_by_the_whole_file(tmp_path, positions):
    path = tmp_path / "take.csv"
    path.write_text(nexus_text(positions, lambda number: ("inf" if number % 699 == 0 else "3", "0")), encoding="utf-8")
    with np.errstate(all="raise"):
        assert read_take(path, sample=small_sample()).n_frames == N_FRAMES


def test_frames_that_an_export_leaves_out_are_counted_by_the_whole_file(positions, tmp_path):
    path = tmp_path / "take.csv"
    path.write_text(nexus_text(positions, lambda number: (str(number + 5 * (number > 300)), "0")), encoding="utf-8")
    sample = small_sample()
    assert read_take(path, sample=sample).n_frames == N_FRAMES + 5
    assert sample.n_left_out == 0


def test_damage_in_the_sample_is_refused_as_in_the_whole_file(positions, tmp_path):
    path = made("trc", positions, tmp_path)
    path.write_text(path.read_text().replace("\n1\t", "\n1\tx"), encoding="utf-8")
    with pytest.raises(FormatError) as whole:
        read_take(path)
    with pytest.raises(FormatError) as some:
        read_take(path, sample=small_sample())
    assert str(some.value) == str(whole.value)


@pytest.mark.parametrize("name", ["qualisys", "wide-csv"])
def test_frames_of_empty_cells_keep_their_time_where_no_column_tells_it(name, positions, tmp_path):
    path = tmp_path / "take.csv"
    delimiter, text = ("\t", qualisys_text_of(positions)) if name == "qualisys" else (",", wide_text(positions))
    n_leading = 2 if name == "qualisys" else 1
    lines = text.splitlines()
    first = len(lines) - N_FRAMES
    rows = [line.split(delimiter, n_leading)[-1] for line in lines[first:]]
    head = lines[: first - 1] if name == "qualisys" else [lines[0].removeprefix("time,")]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    sample = small_sample()
    some, whole = read_take(path, name, sample=sample), read_take(path, name)
    np.testing.assert_allclose(whole.positions, positions)
    assert some.n_frames + sample.n_left_out == N_FRAMES
    np.testing.assert_array_equal(some.positions, whole.positions[np.linspace(0, N_FRAMES - 1, MOST).astype(int)])


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf16_without_a_mark_is_told_by_its_zeros(put, encoding):
    assert read_lines(put("wide.txt", "Frame;Knie\r\n1;2\r\n".encode(encoding)))[:] == ["Frame;Knie", "1;2", ""]


def test_lines_are_found_in_any_order(put):
    held = [f"{'x' * (n % 4)}" for n in range(50)]
    lines = read_lines(put("any.txt", "\n".join(held)))
    order = np.random.default_rng(5).integers(0, 50, 400)
    assert [lines[index] for index in order] == [held[index] for index in order]
