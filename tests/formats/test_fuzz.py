"""Valid files of every format, cut and mutated: only the project's own error type may escape."""

from __future__ import annotations

import contextlib
import struct
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numba  # noqa: F401 - loaded when bones are first posed, which is no memory of a reader
import numpy as np
import pytest
import scipy.spatial.transform  # noqa: F401 - as numba
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from skelgen_formats.registry import known_formats, read_motion, read_take

from skelgen.errors import SkelgenError
from skelgen.simulation import recorded_body

FORMATS = ("c3d", "trc", "csm", "qualisys", "motive", "poses-csv", "mfml")
MOTIONS = ("bvh", "asf", "amc")
MEMORY_BYTES = 32 * 2**20  # far above what reading these small files takes, far below what mutated headers announce

NUMBERS = (
    "0",
    "-1",
    "1e308",
    "1e-320",
    "nan",
    "inf",
    "4294967295",
    "10000000000",
    "99999999999999999999",
    "",
    "x",
    "1_0",
)
WORDS = (b"\x00\x00", b"\xff\xff", b"\xff\x7f", b"\x00\x80", struct.pack("<I", 2**32 - 1), struct.pack("<Q", 10**10))
FUZZ = settings(
    max_examples=120,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@contextlib.contextmanager
def bounded_memory() -> Iterator[None]:
    """Fail if what is done within takes much memory."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < MEMORY_BYTES
    finally:
        tracemalloc.stop()


@bounded_memory()
def reads_or_refuses(path: Path, name: str) -> None:
    for format_name in (None, name):
        try:
            read_take(path, format_name)
        except SkelgenError as error:
            assert "\n" not in str(error)


@bounded_memory()
def poses_or_refuses(path: Path) -> None:
    """Whether a motion is read, and then stands somewhere and can be played by a body with markers; or is refused."""
    try:
        motion = read_motion(path.with_suffix(".amc") if path.suffix == ".asf" else path)
        assert np.isfinite(motion.world_from_bone).all()
        recorded_body(motion)
    except SkelgenError as error:
        assert "\n" not in str(error)


def position(data: st.DataObject, content: bytes | bytearray) -> int:
    # Damage in the first part, where headers are, is the dangerous one.
    early = data.draw(st.booleans())
    return data.draw(st.integers(0, max(0, min(len(content), 2048 if early else len(content)) - 1)))


def mutated_bytes(data: st.DataObject, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = position(data, changed)
        match data.draw(st.integers(0, 4)):
            case 0:
                changed[at : at + 1] = bytes([data.draw(st.integers(0, 255))])
            case 1:
                word = data.draw(st.sampled_from(WORDS))
                changed[at : at + len(word)] = word
            case 2:
                del changed[at : at + data.draw(st.integers(1, 64))]
            case 3:
                changed[at:at] = changed[at : at + data.draw(st.integers(1, 64))]
            case _:
                del changed[at:]
    return bytes(changed)


def mutated_lines(data: st.DataObject, content: bytes) -> bytes:
    lines = content.decode().split("\n")
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        match data.draw(st.integers(0, 3)):
            case 0:
                del lines[at]
            case 1:
                lines.insert(at, lines[at])
            case 2:
                lines[at] = lines[at][: data.draw(st.integers(0, len(lines[at])))]
            case _:
                separator = next((mark for mark in "\t;, " if mark in lines[at]), " ")
                cells = lines[at].split(separator)
                cells[data.draw(st.integers(0, len(cells) - 1))] = data.draw(st.sampled_from(NUMBERS))
                lines[at] = separator.join(cells)
        lines = lines or [""]
    return "\n".join(lines).encode()


@pytest.mark.parametrize("name", FORMATS)
@FUZZ
@given(data=st.data())
def test_mutated_bytes_are_read_or_refused(valid_file, name, data):
    path = valid_file(name)
    path.write_bytes(mutated_bytes(data, path.read_bytes()))
    reads_or_refuses(path, name)


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in {"c3d", "mfml"}])
@FUZZ
@given(data=st.data())
def test_mutated_lines_are_read_or_refused(valid_file, name, data):
    path = valid_file(name)
    path.write_bytes(mutated_lines(data, path.read_bytes()))
    reads_or_refuses(path, name)


@pytest.mark.parametrize("name", FORMATS)
def test_every_cut_is_read_or_refused(valid_file, name):
    path = valid_file(name)
    content = path.read_bytes()
    step = max(1, len(content) // 150)
    for end in [*range(0, min(len(content), 40)), *range(40, len(content), step)]:
        path.write_bytes(content[:end])
        reads_or_refuses(path, name)


@FUZZ
@given(content=st.binary(max_size=300), entry=st.sampled_from([entry for entry in known_formats() if entry.read]))
def test_noise_is_read_or_refused(tmp_path, content, entry):
    path = tmp_path / f"noise{entry.suffixes[0]}"
    path.write_bytes(content)
    reads_or_refuses(path, entry.name)


@pytest.mark.parametrize("suffix", MOTIONS)
@FUZZ
@given(data=st.data())
def test_mutated_motions_are_read_or_refused(valid_motion, suffix, data):
    path = valid_motion(suffix)
    mutate = mutated_lines if data.draw(st.booleans()) else mutated_bytes
    path.write_bytes(mutate(data, path.read_bytes()))
    poses_or_refuses(path)


@pytest.mark.parametrize("suffix", MOTIONS)
def test_every_cut_of_a_motion_is_read_or_refused(valid_motion, suffix):
    path = valid_motion(suffix)
    content = path.read_bytes()
    for end in range(0, len(content), max(1, len(content) // 150)):
        path.write_bytes(content[:end])
        poses_or_refuses(path)
