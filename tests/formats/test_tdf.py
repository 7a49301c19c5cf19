"""TDF files as SMART Tracker writes them: two tracks of five frames in metres, the second with a gap."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from skelgen.model import Trajectories

TRACKS = np.random.default_rng(0).uniform(-2, 2, (2, 5, 3)).astype("<f4")
SEGMENTS = ([(0, 5)], [(0, 1), (3, 2)])
SIGNATURE = bytes.fromhex("824b604 1d31184ca6000b6ac16680c08".replace(" ", ""))


def content(form: int = 1, rate: int = 100, n_frames: int = 5, kind: int = 5, links: int = 1) -> bytes:
    block = struct.pack("<iifI", n_frames, rate, 0.0, 2) + bytes(4 * 15) + struct.pack("<I", 0)
    block += struct.pack("<iiII", links, 0, 0, 1) if form == 1 else b""
    for name, track, segments in zip((b"c7", b"LASI"), TRACKS, SEGMENTS, strict=True):
        block += name.ljust(256, b"\0") + struct.pack("<ii", len(segments), 0)
        block += b"".join(struct.pack("<ii", *segment) for segment in segments)
        block += b"".join(track[first : first + count].tobytes() for first, count in segments)
    header = SIGNATURE + struct.pack("<Ii", 1, 2) + bytes(40)
    entries = struct.pack("<IIii", 11, 1, 0, 0) + bytes(272)
    entries += struct.pack("<IIii", kind, form, 64 + 2 * 288, len(block)) + bytes(272)
    return header + entries + block


@pytest.mark.parametrize("form", [1, 2])
def test_tracks_are_read_with_their_gaps(put, form):
    path = put("walk.tdf", content(form))
    take = read_take(path)
    assert recognise(path).name == "tdf"
    assert isinstance(take, Trajectories)
    assert (take.names, take.rate) == (("c7", "LASI"), 100.0)
    assert take.seen.tolist() == [[True, True], [True, False], [True, False], [True, True], [True, True]]
    wanted = TRACKS.transpose(1, 0, 2).astype(np.float64) * 1000.0
    np.testing.assert_array_equal(take.positions[take.seen], wanted[take.seen])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"form": 3}, "frame by frame"),
        ({"kind": 11}, "no 3D points"),
        ({"rate": 0}, "rate is 0"),
        ({"n_frames": 4}, "beyond the 4"),
        ({"n_frames": 2_000_000_000}, "not in such a file"),
        ({"links": 1_000_000}, "cut off or damaged"),
    ],
)
def test_what_is_wrong_is_told(refused, put, changes, sentence):
    assert sentence in refused(put("odd.tdf", content(**changes)))


@pytest.mark.parametrize("size", [20, 70, 400, 700, 1000])
def test_file_that_is_cut_off_is_refused(refused, put, size):
    assert "cut off" in refused(put("cut.tdf", content()[:size]))
