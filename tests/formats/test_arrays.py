from __future__ import annotations

import contextlib

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from skelgen.errors import FormatError, SkelgenError

POSITIONS = np.random.default_rng(0).uniform(100, 900, (4, 2, 3))


def test_array_is_read_with_assumed_rate_and_unit(tmp_path):
    path = tmp_path / "points.npy"
    np.save(path, POSITIONS)
    take = read_take(path)
    assert recognise(path).name == "numpy"
    assert (take.names, take.rate) == (("point 1", "point 2"), 100.0)
    np.testing.assert_array_equal(take.positions, POSITIONS)
    assert [notice.split("; ")[1] for notice in take.notices] == [
        "mm is assumed since coordinates reach " + f"{POSITIONS.max():.3g}",
        "100 Hz is assumed, `--recorded-rate` states another",
    ]


@pytest.mark.parametrize("key", ["positions", "anything"])
def test_archive_states_names_rate_and_unit(tmp_path, key):
    path = tmp_path / "points.npz"
    np.savez_compressed(path, names=["hip", "knee"], fps=59.94, unit="m", extra=np.zeros(5), **{key: POSITIONS})
    take = read_take(path)
    assert (take.names, take.rate) == (("hip", "knee"), pytest.approx(59.94, abs=1e-9))
    np.testing.assert_array_equal(take.positions, POSITIONS * 1000)
    assert take.notices == ()


def test_times_tell_the_rate(tmp_path):
    np.savez(tmp_path / "points.npz", xyz=POSITIONS, times=np.arange(4) / 25)
    assert read_take(tmp_path / "points.npz").rate == 25.0


def test_angles_of_a_body_model_say_what_to_do(refused, tmp_path):
    np.savez(tmp_path / "amass.npz", poses=np.zeros((9, 156)), trans=np.zeros((9, 3)), betas=np.zeros(16))
    assert "AMASS, SMPL" in refused(tmp_path / "amass.npz")


def test_flat_array_says_what_shape_is_needed(refused, tmp_path):
    np.save(tmp_path / "flat.npy", POSITIONS.reshape(4, 6))
    assert "(frames, points, 3); reshape" in refused(tmp_path / "flat.npy")


def test_pickled_objects_are_never_loaded(refused, tmp_path):
    np.save(tmp_path / "object.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    assert "never loaded" in refused(tmp_path / "object.npy")
    np.savez(tmp_path / "some.npz", positions=POSITIONS, who=np.array([{"a": 1}], dtype=object))
    assert read_take(tmp_path / "some.npz").n_frames == 4


def test_header_that_announces_more_than_the_file_holds_is_refused(refused, tmp_path, put):
    np.save(tmp_path / "points.npy", POSITIONS)
    content = (tmp_path / "points.npy").read_bytes().replace(b"(4, 2, 3), }  ", b"(9999999, 2, 3), }")
    assert "announces an array" in refused(put("huge.npy", content))


def test_text_of_no_characters_is_refused_in_words(tmp_path):
    names = np.frombuffer(np.array([2**31, 65], "<u4").tobytes(), "<U1")
    np.savez(tmp_path / "odd.npz", positions=np.arange(60.0).reshape(10, 2, 3), names=names, rate=1e-320)
    with pytest.raises(FormatError, match="a text that is none"):
        read_take(tmp_path / "odd.npz")
    np.savez(
        tmp_path / "odd.npz", positions=np.arange(60.0).reshape(10, 2, 3), rate=1e-320, times=np.arange(10) * 1e300
    )
    with contextlib.suppress(SkelgenError), np.errstate(all="raise"):
        read_take(tmp_path / "odd.npz")


@pytest.mark.filterwarnings("error")
def test_signalling_nan_is_a_gap(tmp_path):
    bits = POSITIONS.copy().view(np.uint64)
    bits[1, 0, 2] = 0x7FF0000000000001
    np.save(tmp_path / "points.npy", bits.view(np.float64))
    seen = read_take(tmp_path / "points.npy").seen
    assert not seen[1, 0]
    assert seen.sum() == seen.size - 1
