"""Image files as a frame source: pairs by name and by list, lost partners, damaged files."""

from __future__ import annotations

import contextlib
import struct
import zlib
from time import perf_counter

import numpy as np
import pytest

from skelgen.capture.images import read_image
from skelgen.capture.sources import open_source
from skelgen.errors import CaptureError, FormatError, InputError, ParameterError


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left{}.png", "right{}.png"),
        ("left/{}.png", "right/{}.png"),
        ("frame{}_L.png", "frame{}_R.png"),
        ("{}-left.png", "{}-right.png"),
        ("cam0_{}.png", "cam1_{}.png"),
    ],
)
def test_pairs_are_found_by_the_usual_names_in_the_order_of_their_numbers(tmp_path, save, marks, left, right):
    for index in (0, 2, 10, 9):
        save(tmp_path / left.format(index), index, 1)
        save(tmp_path / right.format(index), index, 2)
    expected = [(position, 10 * index + 1, 10 * index + 2) for position, index in enumerate((0, 2, 9, 10))]
    assert marks(open_source(f"folder:{tmp_path}")) == expected


def test_a_given_pattern_pairs_what_its_star_stands_for(tmp_path, save, marks):
    for index in range(2):
        save(tmp_path / f"a{index}.bmp", index, 1)
        save(tmp_path / f"b{index}.bmp", index, 2)
    assert marks(open_source(f"folder:{tmp_path}?left=a*.bmp&right=b*.bmp")) == [(0, 1, 2), (1, 11, 12)]


def test_an_image_without_partner_is_a_dropped_pair(tmp_path, save, marks):
    for index in range(4):
        save(tmp_path / f"left{index}.png", index, 1)
        if index not in (1, 2):
            save(tmp_path / f"right{index}.png", index, 2)
    source = open_source(f"folder:{tmp_path}?rate=50")
    assert marks(source) == [(0, 1, 2), (3, 31, 32)]
    assert source.n_dropped == 2
    assert [pair.time for pair in source] == [0.0, 3 / 50]


def test_one_camera_missing_is_said(tmp_path, save):
    save(tmp_path / "left0.png", 0, 1)
    with pytest.raises(CaptureError, match="1 image of one camera, but none of the right one"):
        open_source(f"folder:{tmp_path}")


def test_names_that_do_not_fit_are_said(tmp_path, save):
    save(tmp_path / "left0.png", 0, 1)
    save(tmp_path / "right1.png", 0, 2)
    with pytest.raises(CaptureError, match=r"left0.png and right1.png do not belong together"):
        open_source(f"folder:{tmp_path}")


def test_cameras_of_different_sizes_are_refused(tmp_path, save):
    save(tmp_path / "left0.png", 0, 1)
    save(tmp_path / "right0.png", 0, 2, size=(24, 18))
    with pytest.raises(CaptureError, match=r"left0.png 24 x 16, .*right0.png 24 x 18"):
        open_source(f"folder:{tmp_path}")


@pytest.mark.parametrize("damage", ["cut off", "empty", "text", "other size", "gone"])
def test_a_damaged_image_stops_with_its_name_after_the_pairs_before(tmp_path, save, damage):
    for index in range(3):
        save(tmp_path / f"left{index}.jpg", index, 1)
        save(tmp_path / f"right{index}.jpg", index, 2)
    source, bad = open_source(f"folder:{tmp_path}"), tmp_path / "right1.jpg"
    whole = bad.read_bytes()
    if damage == "other size":
        save(bad, 1, 2, size=(24, 18))
    elif damage == "gone":
        bad.unlink()
    else:
        bad.write_bytes({"cut off": whole[:-20], "empty": b"", "text": b"not an image"}[damage])
    seen = []
    with source, pytest.raises(FormatError, match=r"right1.jpg:? "):
        seen.extend(pair.index for pair in source)
    assert seen == [0]


def test_a_cut_png_is_not_filled_with_black(tmp_path, save):
    save(tmp_path / "image.png", 3, 1)
    (tmp_path / "image.png").write_bytes((tmp_path / "image.png").read_bytes()[:-20])
    with pytest.raises(FormatError, match="cut off"):
        read_image(tmp_path / "image.png")


def test_sixteen_bits_become_eight(tmp_path):
    cv2 = pytest.importorskip("cv2")
    cv2.imwrite(str(tmp_path / "deep.png"), np.full((4, 6), 0x7F00, np.uint16))
    image = read_image(tmp_path / "deep.png")
    assert image.dtype == np.uint8
    assert abs(int(image[0, 0]) - 0x7F) <= 1  # scaled with rounding


def test_a_list_gives_pairs_times_and_gaps(tmp_path, save, marks):
    lines = ["# left right time", ""]
    for index, time in enumerate((5.0, 5.02, 5.08, 5.10, 5.12)):
        save(tmp_path / f"a {index}.png", index, 1)
        save(tmp_path / f"b {index}.png", index, 2)
        lines.append(f"a {index}.png\tb {index}.png\t{time}")
    (tmp_path / "pairs.txt").write_text("\n".join(lines))
    source = open_source(f"list:{tmp_path / 'pairs.txt'}")
    assert source.rate == pytest.approx(50)
    assert marks(source) == [(0, 1, 2), (1, 11, 12), (4, 21, 22), (5, 31, 32), (6, 41, 42)]
    assert source.n_dropped == 2
    assert [pair.time for pair in source] == pytest.approx([0, 0.02, 0.08, 0.10, 0.12])


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("a.png", "pairs.txt:2: 1 entries where a left and a right image"),
        ("a.png b.png noon", "pairs.txt:2: 'noon' is no time in seconds"),
        ("a.png b.png 1.0", "pairs.txt:2: the time 1 s is not later"),
    ],
)
def test_a_wrong_line_of_a_list_is_named(tmp_path, line, sentence):
    (tmp_path / "pairs.txt").write_text(f"a.png, b.png, 1.0\n{line}\n")
    with pytest.raises(FormatError, match=sentence):
        open_source(f"list:{tmp_path / 'pairs.txt'}")


@pytest.mark.parametrize(("text", "where"), [("", "lists no images"), (None, "cannot be read: ")])
def test_an_empty_or_missing_list_is_an_error(tmp_path, text, where):
    if text is not None:
        (tmp_path / "pairs.txt").write_text(text)
    with pytest.raises(FormatError, match=where):
        open_source(f"list:{tmp_path / 'pairs.txt'}")


def test_images_are_read_only_and_at_most_as_many_as_asked(tmp_path, save):
    for index in range(3):
        save(tmp_path / f"left{index}.png", index, 1)
        save(tmp_path / f"right{index}.png", index, 2)
    source = open_source(f"folder:{tmp_path}?frames=2")
    assert source.n_frames == 2
    assert not any(image.flags.writeable for pair in source for image in (pair.left, pair.right))


def test_a_rate_below_zero_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="rate is -1; it must lie in 0"):
        open_source(f"folder:{tmp_path}?rate=-1")


def png(width, height, rows, *chunks):
    """A grey PNG with these compressed rows, and further chunks between head and rows."""

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">2I5B", width, height, 8, 0, 0, 0, 0)
    parts = [(b"IHDR", head), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def test_image_of_absurd_size_is_refused_by_its_header(tmp_path):
    path = tmp_path / "left.png"
    path.write_bytes(png(30000, 30000, bytes(1000)))
    with pytest.raises(FormatError, match="announces 30000 x 30000 pixels"):
        read_image(path)


def test_warnings_of_libpng_stay_off_the_terminal(tmp_path, capfd):
    path = tmp_path / "left.png"
    path.write_bytes(png(2, 2, bytes([0, 1, 2, 0, 3, 4]), (b"gAMA", b"1"), (b"pHYs", b"")))
    with contextlib.suppress(FormatError):
        read_image(path)
    assert capfd.readouterr().err == ""


def test_pattern_of_many_stars_is_matched_in_no_time(tmp_path, save):
    for side in "lr":
        save(tmp_path / f"{side}{'a' * 60}.bmp", 1, 1)
    start = perf_counter()
    with pytest.raises(CaptureError):
        open_source(f"folder:{tmp_path}?left=l{'*a' * 25}*b.bmp&right=r*.bmp")
    assert perf_counter() - start < 1.0
    open_source(f"folder:{tmp_path}?left=l{'*a' * 25}*.bmp&right=r{'*a' * 25}*.bmp")


@pytest.mark.parametrize("pattern", ["/**", "a**", "/tmp/*"])
def test_pattern_that_leaves_the_folder_is_refused(tmp_path, save, pattern):
    save(tmp_path / "left1.bmp", 1, 1)
    with pytest.raises(InputError):
        open_source(f"folder:{tmp_path}?left={pattern}&right=*")
