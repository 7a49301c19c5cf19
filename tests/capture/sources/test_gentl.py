"""GenTL cameras, by the producer of moving pictures that the package genicam brings."""

from __future__ import annotations

import importlib.util
from itertools import pairwise
from pathlib import Path

import pytest

from skelgen.capture.sources import open_source
from skelgen.errors import CaptureError, ParameterError

FREE_RUNNING = "skew=100"  # ms: these cameras have no trigger and no clock


@pytest.fixture(scope="module")
def producer():
    """Return the producer's file."""
    pytest.importorskip("harvesters", reason="the extra gentl is not installed")
    found = importlib.util.find_spec("genicam")
    path = Path(found.origin).with_name("viky.cti")
    if not path.is_file():
        pytest.skip("this genicam brings no producer")
    return path


def test_pairs_come_from_two_cameras_by_identifier_and_serial_number(producer):
    text = f"gentl:{producer},VikyTL_DEV_red,1?rate=100&frames=20&order=every&{FREE_RUNNING}"
    with open_source(text) as source:
        assert (source.size, source.rate, source.n_frames) == ((400, 400), 100.0, 20)
        pairs = list(source)
    assert [pair.index for pair in pairs[1:]] == [before.index + 1 + pair.dropped for before, pair in pairwise(pairs)]
    assert any((pair.left != pairs[0].left).any() for pair in pairs[1:])  # a ball moves


def test_cameras_are_free_again_after_the_source_is_closed(producer):
    for _ in range(2):
        with open_source(f"gentl:{producer},0,1?frames=1&{FREE_RUNNING}") as source:
            assert len(list(source)) == 1


@pytest.mark.parametrize(
    ("rest", "sentence"),
    [
        ("", "found VikyTL_DEV_red, VikyTL_DEV_green, VikyTL_DEV_blue; name left and right"),
        (",0,9", "viky.cti has no camera 9; found VikyTL_DEV_red"),
        (",0,1?rate=900", r"AcquisitionFrameRate is 900; the camera takes 1 .. 200"),
        (",0,1?exposure=100", "has no ExposureTime that could be set"),
        (",0,1?trigger=Line1", "has no TriggerSelector that could be set"),
        (",0,VikyTL_DEV_red", "VikyTL_DEV_red"),
    ],
)
def test_what_cannot_be_is_told(producer, rest, sentence):
    with pytest.raises((CaptureError, ParameterError), match=sentence), open_source(f"gentl:{producer}{rest}"):
        pass


def test_a_file_that_is_no_producer_is_told(producer, tmp_path):
    (tmp_path / "empty.cti").write_text("nothing")
    with pytest.raises(CaptureError, match=r"empty.cti"), open_source(f"gentl:{tmp_path / 'empty.cti'}"):
        pass
    with pytest.raises(CaptureError, match=r"gone.cti: no such GenTL producer"):
        open_source(f"gentl:{tmp_path / 'gone.cti'}")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("gentl:", "names no producer's"),
        ("gentl:producer.cti,left", "names 1 cameras where left and right belong"),
        ("gentl:producer.cti,left,left", "left and right are both left"),
    ],
)
def test_a_wrong_text_is_refused_before_the_producer_is_loaded(text, sentence):
    with pytest.raises(ParameterError, match=sentence):
        open_source(text)
