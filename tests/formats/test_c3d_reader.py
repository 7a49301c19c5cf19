from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from pathlib import Path

import c3d as independent
import ezc3d
import numpy as np
import pytest
from skelgen_formats.c3d.layout import BLOCK, read_layout
from skelgen_formats.c3d.parameters import dec_floats
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import Trajectories

F32 = 2000 * 2.0**-24  # mm: rounding to f32 of coordinates within two metres

RECORDINGS = {
    "arm/arm-4-4-4_clean_30fps.c3d": (1831, 12),
    "human/nick_freeform_001.c3d": (1101, 52),  # one of the 53 is never seen
    "mouse/mouse_S15.c3d": (6000, 11),
    "rods_pendulum/pendulum_01.c3d": (3201, 22),
    "wheelchair/racing_full.c3d": (700, 40),  # Probe1-6 are never seen
    "wheelchair/walkingOptiTrack.c3d": (3361, 12),  # i16 data
}


def random_take(n_frames: int, n_markers: int) -> Trajectories:
    positions = np.random.default_rng(4).uniform(-1000, 1000, (n_frames, n_markers, 3))
    positions[1, 0] = np.nan
    return Trajectories(positions, tuple(f"marker {number}" for number in range(n_markers)), 100.0)


def write_with_ezc3d(path: Path, labels: list[str], units: list[str], points: np.ndarray) -> None:
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = labels
    content["parameters"]["POINT"]["UNITS"]["value"] = units
    content["data"]["points"] = np.concatenate([points, np.ones((1, *points.shape[1:]))])
    content.write(str(path))


@pytest.mark.parametrize("name", RECORDINGS)
def test_real_recordings_read_as_ezc3d_reads_them(recording, name):
    path = recording(name)
    take = read_take(path)
    content = ezc3d.c3d(str(path))
    points = content["data"]["points"][:3].transpose(2, 1, 0)
    labels = [label.rpartition(":")[2] for label in content["parameters"]["POINT"]["LABELS"]["value"]]
    unit = 1000.0 if content["parameters"]["POINT"]["UNITS"]["value"] == ["m"] else 1.0
    assert take.positions.shape[:2] == RECORDINGS[name]
    chosen = [labels.index(marker) for marker in take.names]
    np.testing.assert_array_equal(take.positions, points[:, chosen] * unit)
    assert take.rate == pytest.approx(content["header"]["points"]["frame_rate"])


@pytest.mark.parametrize("name", RECORDINGS)
def test_real_recordings_lie_within_a_few_metres(recording, name):
    assert 100 < np.nanmax(np.abs(read_take(recording(name)).positions)) < 5000


def test_empty_markers_and_prefixes_are_noticed(recording):
    notices = read_take(recording("human/nick_freeform_001.c3d")).notices
    assert any("never seen: Nick01:CLAV" in notice for notice in notices)
    assert any("Nick01:" in notice and "dropped from" in notice for notice in notices)


def test_another_library_reads_what_is_written(walk, valid_file):
    with warnings.catch_warnings(), valid_file("c3d").open("rb") as stream:
        warnings.simplefilter("ignore")  # it warns that there are no analogue data
        reader = independent.Reader(stream)
        frames = [points for _, points, _ in reader.read_frames()]
        labels = tuple(label.strip() for label in reader.point_labels)
    assert (labels, reader.point_rate) == (walk.names, walk.rate)
    seen = walk.seen
    written = np.stack(frames)
    np.testing.assert_allclose(written[:, :, :3][seen], walk.positions[seen], rtol=0, atol=F32)
    np.testing.assert_array_equal(written[:, :, 3] < 0, ~seen)


def test_more_than_255_labels_survive(tmp_path):
    take = random_take(3, 600)
    write_file(take, tmp_path / "many.c3d")
    back = read_take(tmp_path / "many.c3d")
    assert back.names == take.names
    np.testing.assert_allclose(back.positions, take.positions, rtol=0, atol=F32)


def test_more_than_65535_frames_survive_and_another_library_sees_them(tmp_path):
    take = random_take(70_000, 1)
    write_file(take, tmp_path / "long.c3d")
    np.testing.assert_allclose(read_take(tmp_path / "long.c3d").positions, take.positions, rtol=0, atol=F32)
    with warnings.catch_warnings(), (tmp_path / "long.c3d").open("rb") as stream:
        warnings.simplefilter("ignore")
        assert independent.Reader(stream).frame_count == 70_000


def test_frames_are_counted_where_the_file_does_not_state_them(tmp_path):
    path = tmp_path / "counted.c3d"
    points = np.random.default_rng(5).uniform(1, 2, (3, 1, 66_000))
    write_with_ezc3d(path, ["a"], ["mm"], points)
    back = read_take(path)
    assert back.n_frames == 66_000
    assert any("66000 were found" in notice for notice in back.notices)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1000.0), ("cm", 10.0), ("mm", 1.0)])
def test_units_of_the_file_are_heeded(tmp_path, unit, factor):
    path = tmp_path / "unit.c3d"
    write_with_ezc3d(path, ["a", "b"], [unit], np.full((3, 2, 4), 2.0))
    assert (read_take(path).positions == 2.0 * factor).all()


@pytest.mark.parametrize(("reach", "factor"), [(2.0, 1000.0), (900.0, 1.0)])
def test_missing_unit_is_guessed_with_a_notice(tmp_path, reach, factor):
    path = tmp_path / "no_unit.c3d"
    write_with_ezc3d(path, ["a", "b"], [], np.full((3, 2, 4), reach))
    take = read_take(path)
    assert (take.positions == reach * factor).all()
    assert any("no length unit" in notice for notice in take.notices)


def test_rate_has_no_more_digits_than_its_32_bits(walk, tmp_path):
    take = read_take(*write_file(replace(walk, rate=59.94), tmp_path / "walk.c3d"))
    assert take.rate == 59.94
    assert take.times[6] == 6 / 59.94


def test_all_zero_points_are_unseen(tmp_path):
    path = tmp_path / "zeros.c3d"
    points = np.ones((3, 2, 4))
    points[:, 1, 2] = 0.0
    write_with_ezc3d(path, ["a", "b"], ["mm"], points)
    assert read_take(path).seen[:, 1].tolist() == [True, True, False, True]


def test_points_without_labels_get_numbers(tmp_path):
    path = tmp_path / "unnamed.c3d"
    write_with_ezc3d(path, ["", "b", ""], ["mm"], np.ones((3, 3, 4)))
    assert read_take(path).names == ("point 1", "b", "point 3")


@pytest.mark.parametrize(
    ("byte", "value", "place"),
    [
        (1, b"\x51", ":byte 1:"),
        (0, b"\xff", ":byte 0:"),
        (2, b"\x00\x00", ":byte 2:"),
        (12, struct.pack("<f", np.nan), ":byte 12:"),
        (BLOCK + 3, b"\x10", ":byte 515:"),
    ],
)
def test_damaged_header_names_the_byte(refused, valid_file, put, byte, value, place):
    content = bytearray(valid_file("c3d").read_bytes())
    content[byte : byte + len(value)] = value
    assert refused(put("damaged.c3d", bytes(content)), "c3d").startswith(place)


def test_header_of_ten_gigabytes_is_refused_without_reading(refused, put, valid_file):
    content = bytearray(valid_file("c3d").read_bytes())
    content[2:6] = struct.pack("<2H", 6, 60_000)  # analogue samples per frame
    content[6:10] = struct.pack("<2H", 1, 60_000)  # frames: 14 GB of data in 4 kB
    assert "cut off" in refused(put("huge.c3d", bytes(content[:-600])))  # else the size of the file tells


def test_whole_part_of_a_truncated_file_is_taken_with_a_notice(refused, put, valid_file, walk):
    content = valid_file("c3d").read_bytes()
    start = read_layout(put("whole.c3d", content)).data_start
    take = read_take(put("cut.c3d", content[: start + 5 * 6 * 16 + 7]))
    whole = read_take(put("whole.c3d", content))
    np.testing.assert_array_equal(take.positions, whole.positions[:5])
    assert any("cut off: 5 of 12 frames are there" in notice for notice in take.notices)
    assert refused(put("bare.c3d", content[: start + 7])).startswith(":frame 1: 12 frames are announced")


def test_big_endian_file_reads_alike(put, valid_file, walk):
    assert read_take(put("mips.c3d", _swapped(valid_file("c3d")))).names == walk.names


def test_dec_numbers_are_understood():
    raw = struct.pack("<f", 4 * -12.375)
    assert dec_floats(raw[2:] + raw[:2]).tolist() == [-12.375]


def test_overlong_name_cannot_be_written(tmp_path):
    with pytest.raises(WriteError, match="too long"):
        write_file(Trajectories(np.ones((2, 1, 3)), ("x" * 300,), 50.0), tmp_path / "long.c3d")


def _swapped(path: Path) -> bytes:
    """The same content as a big-endian machine writes it."""
    layout = read_layout(path)
    content = bytearray(path.read_bytes())
    header = np.frombuffer(bytes(content[2:12]), "<u2").byteswap().tobytes()
    content[2:12], content[16:18] = header, content[17:15:-1]
    for start in (12, 20):
        content[start : start + 4] = content[start : start + 4][::-1]
    content[layout.data_start :] = np.frombuffer(bytes(content[layout.data_start :]), "<u4").byteswap().tobytes()
    content[BLOCK + 3] = 86
    position = BLOCK + 4
    while content[position]:
        name_length = abs(struct.unpack_from("b", content, position)[0])  # below 0 marks a locked record
        pointer = position + 2 + name_length
        step = struct.unpack_from("<h", content, pointer)[0]
        content[pointer : pointer + 2] = content[pointer : pointer + 2][::-1]
        if struct.unpack_from("b", content, position + 1)[0] > 0:
            _swap_values(content, pointer + 2)
        if step == 0:
            break
        position = pointer + step
    return bytes(content)


def _swap_values(content: bytearray, at: int) -> None:
    size = abs(struct.unpack_from("b", content, at)[0])
    shape = content[at + 2 : at + 2 + content[at + 1]]
    start = at + 2 + len(shape)
    for value in range(start, start + size * int(np.prod(shape, dtype=int)), size):
        content[value : value + size] = content[value : value + size][::-1]


@pytest.mark.parametrize("n_bytes", [600, 1500])
def test_a_disk_that_is_full_is_one_sentence(walk, tmp_path, full_disk, n_bytes):
    path = tmp_path / "walk.c3d"
    path.write_text("precious")
    with full_disk(n_bytes), pytest.raises(WriteError, match=r"walk\.c3d: cannot be written: "):
        write_file(walk, path)
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("walk.c3d", "precious")]
