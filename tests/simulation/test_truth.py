"""The truth survives its file, and a damaged file says so."""

from __future__ import annotations

import dataclasses
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from skelgen.errors import FormatError, InputError, SkelgenError
from skelgen.simulation import Truth, read_truth, simulate, write_truth


@pytest.fixture(scope="module")
def truth() -> Truth:
    """A human in 20 frames, seen as points."""
    return simulate("human", n_frames=20, labelled=False, ghosts=1.0).truth


def test_a_truth_file_holds_every_bit(truth: Truth, tmp_path: Path) -> None:
    again = read_truth(write_truth(truth, tmp_path / "walk.truth.npz"))
    for field in dataclasses.fields(Truth):
        written, read = getattr(truth, field.name), getattr(again, field.name)
        assert type(written) is type(read), field.name
        np.testing.assert_array_equal(written, read, err_msg=field.name)


def test_the_same_truth_gives_the_same_file(truth: Truth, tmp_path: Path) -> None:
    first, again = (write_truth(truth, tmp_path / name).read_bytes() for name in ("a.npz", "b.npz"))
    assert first == again


def test_a_cut_or_changed_file_is_a_format_error_or_the_same_truth(truth: Truth, tmp_path: Path) -> None:
    whole = write_truth(truth, tmp_path / "walk.truth.npz").read_bytes()
    damaged = tmp_path / "damaged.npz"
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(whole), size=60):
        cut = whole[:place]
        changed = whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]
        for content in (cut, changed):
            damaged.write_bytes(content)
            try:
                read_truth(damaged)
            except SkelgenError as error:
                assert isinstance(error, FormatError) and "damaged.npz" in str(error)


def test_a_damaged_array_header_is_a_format_error(truth: Truth, tmp_path: Path) -> None:
    with zipfile.ZipFile(write_truth(truth, tmp_path / "walk.truth.npz")) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for damage in (b"[", b"9", b"'", b"\xff"):
        with zipfile.ZipFile(tmp_path / "damaged.npz", "w") as archive:
            for name, content in members.items():
                changed = content.replace(b"(", damage, 1) if name == "parents.npy" else content
                archive.writestr(name, changed)
        with pytest.raises(FormatError, match="damaged"):
            read_truth(tmp_path / "damaged.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"nonsense"])
def test_a_foreign_file_is_a_format_error(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "foreign.truth.npz"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"foreign\.truth\.npz"):
        read_truth(path)


def test_an_archive_without_a_truth_is_a_format_error(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(FormatError, match="other"):
        read_truth(tmp_path / "other.npz")


def test_a_bare_array_is_a_format_error(tmp_path: Path) -> None:
    np.save(tmp_path / "bare.npy", np.zeros(3))
    with pytest.raises(FormatError, match="bare"):
        read_truth(tmp_path / "bare.npy")


def test_a_missing_file_is_a_format_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot be read"):
        read_truth(tmp_path / "nowhere.truth.npz")


def test_a_cycle_of_parents_is_an_input_error(truth: Truth) -> None:
    parents = truth.parents.copy()
    parents[1], parents[2] = 2, 1
    with pytest.raises(InputError):
        dataclasses.replace(truth, parents=parents)


def test_arrays_that_are_far_larger_than_their_file_are_refused_before_they_are_made(tmp_path):
    path = tmp_path / "bomb.truth.npz"
    np.savez_compressed(path, skelgen_truth=np.array(1), world_from_limb=np.zeros((2**20, 4, 4)))
    tracemalloc.start()
    with pytest.raises(FormatError, match=r"announces arrays of 13421\d+ bytes"):
        read_truth(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**22
