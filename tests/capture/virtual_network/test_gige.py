"""GigE Vision cameras through viva-genicam; the fake ones run freely, so they are milliseconds apart."""

from __future__ import annotations

import pytest

from skelgen.capture.sources import open_source
from skelgen.errors import ParameterError

ERROR = """
try:
    with open_source({text!r}) as source:
        found["n"] = sum(1 for pair in source)
except SkelgenError as error:
    found["error"] = str(error)
"""


def test_pairs_come_from_two_cameras_with_rate_and_exposure_set(network):
    found = network(
        """
with open_source("gige:?rate=50&exposure=3000&gain=2&skew=100&frames=40") as source:
    found["source"] = [list(source.size), round(source.rate), source.n_frames]
    left, right = source.running
    found["names"], found["set"] = [left.name, right.name], [right._camera.exposure_time(), right._camera.gain()]
    pairs = list(source)
found["seconds"] = pairs[-1].time
found["consistent"] = all(b.index - a.index == 1 + b.dropped for a, b in zip(pairs, pairs[1:]))
found["index"] = pairs[-1].index
"""
    )
    assert found["source"] == [[512, 512], 50, 40]
    assert found["names"] == ["camera 127.0.0.1 (Aravis Fake)", "camera 127.0.0.2 (Aravis Fake)"]
    assert found["set"] == [3000.0, 2.0]
    assert found["consistent"]
    # The fake's timer is loose by five frames, and slow on a busy machine
    assert found["index"] / 50 - 0.1 < found["seconds"] < 3 * found["index"] / 50


def test_named_cameras_are_left_and_right_as_named(network):
    found = network(
        """
with open_source("gige:127.0.0.2,127.0.0.1?skew=100") as source:
    found["names"] = [source.running[0].name, source.running[1].name]
"""
    )
    assert found["names"] == ["camera 127.0.0.2 (Aravis Fake)", "camera 127.0.0.1 (Aravis Fake)"]


def test_a_camera_switched_off_while_running_ends_cleanly(network):
    found = network(
        """
found["n"] = 0
try:
    with open_source("gige:?timeout=0.5&skew=100&rate=50") as source:
        for pair in source:
            found["n"] += 1
            if found["n"] == 5:
                cameras[1].kill()
except SkelgenError as error:
    found["error"] = str(error)
"""
    )
    assert found["n"] >= 5
    assert found["error"].startswith("camera 127.0.0.2 (Aravis Fake)")


@pytest.mark.parametrize(
    ("text", "addresses", "sentence"),
    [
        ("gige:", ("127.0.0.1",), "one camera is missing: found 127.0.0.1 (Aravis Fake), and a pair needs two"),
        ("gige:", (), "no GigE Vision camera answers on the network"),
        ("gige:127.0.0.1,127.0.0.9", ("127.0.0.1",), "no GigE Vision camera answers at 127.0.0.9; found 127.0.0.1"),
        ("gige:?exposure=1e7&gain=99&skew=100", ("127.0.0.1", "127.0.0.2"), "camera 127.0.0.1 (Aravis Fake): GainRaw"),
        (
            "gige:?trigger=Line0&timeout=0.3",
            ("127.0.0.1", "127.0.0.2"),
            "sends no image within 0.3 s; check its trigger",
        ),
    ],
)
def test_what_cannot_be_is_told(network, text, addresses, sentence):
    assert sentence in network(ERROR.format(text=text), addresses)["error"]


def test_one_address_is_refused():
    with pytest.raises(ParameterError, match="gige: names 1 cameras where left and right belong"):
        open_source("gige:10.0.0.2")
