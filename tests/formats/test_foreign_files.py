"""Files that are no files, absurdly long or short ones, and names as other systems write them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from skelgen_formats.acclaim import read_acclaim
from skelgen_formats.identities_csv import read_identities
from skelgen_formats.lines import read_lines
from skelgen_formats.registry import known_formats, read_take, write_file

from skelgen.errors import FormatError, WriteError
from skelgen.files import UNFINISHED, arriving_together, replacing

READABLE = [entry.name for entry in known_formats() if entry.read is not None]
HEADER = (
    "PathFileType\t4\t(X/Y/Z)\tw.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    "100\t100\t2\t1\tmm\nFrame#\tTime\tA\t\t\n\t\tX1\tY1\tZ1\n"
)

# Reads a file and tells by how many MB the process has grown at most.
PEAK = """
import resource, sys
import numba, scipy.spatial.transform
from pathlib import Path
from skelgen_formats import c3d, classic_xml, mfml, trc
from skelgen.errors import FormatError
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    readers = {".c3d": c3d.read_c3d, ".mfml": mfml.read_mfml, ".trc": trc.read_trc}
    readers |= {".xml": classic_xml.read_classic_xml}
    readers[Path(sys.argv[1]).suffix](Path(sys.argv[1]))
except FormatError:
    pass
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


def megabytes_to_read(path: Path) -> float:
    done = subprocess.run([sys.executable, "-c", PEAK, str(path)], capture_output=True, text=True, check=True)
    return float(done.stdout)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("name", [None, *READABLE])
def test_pipe_is_refused_at_once(tmp_path, name):
    os.mkfifo(tmp_path / "walk.trc")
    with pytest.raises(FormatError, match="a pipe or a device"):
        read_take(tmp_path / "walk.trc", name)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs a device without end")
@pytest.mark.parametrize("name", [None, *READABLE])
def test_device_without_end_is_refused(name):
    with pytest.raises(FormatError, match="a pipe or a device"):
        read_take("/dev/zero", name)


@pytest.mark.parametrize("name", ["walk.C3D", "walk", "walk.c3d.bak"])
def test_c3d_is_written_under_any_name(walk, tmp_path, name):
    write_file(walk, tmp_path / name, "c3d")
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert read_take(tmp_path / name).names == walk.names


def test_name_as_long_as_names_may_be_is_written(walk, tmp_path):
    path = tmp_path / f"{'w' * 240}.trc"
    write_file(walk, path)
    assert read_take(path).n_frames == walk.n_frames


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have names in Unicode")
@pytest.mark.parametrize("name", ["c3d", "trc", "csm"])
def test_name_that_is_not_utf8_is_read_and_written(walk, tmp_path, name):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/w\xe4lk." + name.encode()))
    write_file(walk, path)
    again = read_take(path)
    assert again.name == f"w?lk.{name}"
    write_file(again, path)


def test_folder_named_like_an_output_hinders_all(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "b.txt").mkdir()
    with pytest.raises(WriteError, match=r"b\.txt: .*a folder has this name"), arriving_together(tmp_path) as folder:
        for name in ("a.txt", "b.txt"):
            (folder / name).write_text("new")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert not list(tmp_path.glob(f"{UNFINISHED}*"))


def test_folder_of_the_name_leaves_no_temporary_file(tmp_path):
    (tmp_path / "walk.c3d").mkdir()
    with pytest.raises(WriteError), replacing(tmp_path / "walk.c3d") as temporary:
        temporary.write_text("new")
    assert [file.name for file in tmp_path.iterdir()] == ["walk.c3d"]


def test_identities_need_all_three_coordinates(put):
    with pytest.raises(FormatError, match=r"1: the columns .* x, y, z, all three"):
        read_identities(put("id.csv", "name,frame,x,point\nA,0,5,3\n"))


def test_second_name_of_a_bone_is_refused_with_its_line(put):
    bone = "  begin\n    name a\n    name b\n    direction 0 1 0\n    length 1\n  end\n"
    put("a.asf", f":root\n  order TX\n:bonedata\n{bone}:hierarchy\n  begin\n    root a\n    a b\n  end\n")
    with pytest.raises(FormatError, match=r"a\.asf:6: a second name of the bone 'a'"):
        read_acclaim(put("a.amc", "1\nroot 0\n2\nroot 1\n"))


def test_lines_are_those_of_the_text(put):
    texts = ["", "one", " ", "", "  ", "zwei ä", "", "x" * 5, "\t", ""]
    for end in ("\n", "\r\n", "\r"):
        for encoding in ("utf-8", "utf-8-sig", "latin-1", "utf-16"):
            lines = read_lines(put("lines.txt", end.join(texts).encode(encoding)))
            assert list(lines) == lines[:] == texts
            assert [lines[index] for index in (-1, 5, 1, 7)] == ["", "zwei ä", "one", "x" * 5]
            assert list(lines.numbered()) == [(2, "one"), (6, "zwei ä"), (8, "x" * 5)]
            assert list(lines.numbered(5)) == [(6, "zwei ä"), (8, "x" * 5)]


def test_line_that_is_too_long_is_refused(put):
    with pytest.raises(FormatError, match="6: a line of 9000002 characters"):
        read_take(put("long.trc", f"{HEADER}1\t{'1' * 9_000_000}\n"))


@pytest.mark.parametrize("blank", ["\n", " \n", "\t\r\n"])
def test_blank_lines_take_no_more_than_the_file(put, blank):
    size = 40 * 2**20
    path = put("blank.trc", HEADER.encode() + blank.encode() * (size // len(blank)) + b"1\t0\t1\t2\t3\n")
    assert megabytes_to_read(path) < 4 * 40


def test_empty_frames_take_no_more_than_four_times_the_file(put):
    frame = np.zeros(2**20, dtype=[("count", "<u4"), ("time", "<u8")])
    assert megabytes_to_read(put("empty.mfml", frame.tobytes())) < 4 * 12


def test_c3d_takes_no_more_than_four_times_the_file(put, walk, tmp_path):
    content = write_file(walk, tmp_path / "walk.c3d")[0].read_bytes()
    n_frames, frame = 400_000, np.tile(np.array([1, 2, 3, 0], "<f4"), 6).tobytes()
    start = content.index(b"ACTUAL_END_FIELD") + len("ACTUAL_END_FIELD") + 5
    data = (content[16] - 1) * 512
    head = bytearray(content[:data])
    head[start : start + 4] = np.array([n_frames], "<u4").tobytes()
    path = put("long.c3d", bytes(head) + frame * n_frames)
    assert read_take(path).n_frames == n_frames
    assert megabytes_to_read(path) < 4 * len(frame) * n_frames / 2**20


def test_elements_that_nobody_takes_do_not_pile_up(small_project, put, tmp_path):
    content = write_file(small_project, tmp_path / "all.xml", "classic-xml")[0].read_bytes()
    head, rest = content.split(b"<MarkerNames", 1)
    path = put("junk.xml", head + b"<a/>" * 2**23 + b"<MarkerNames" + rest)
    assert megabytes_to_read(path) < 700  # an element takes 120 bytes, however short it is
    with pytest.raises(FormatError, match="without a bone, a key, a joint or a frame"):
        read_take(path)
