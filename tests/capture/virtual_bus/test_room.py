"""Four FireWire cameras of a room on the virtual bus, through the unmodified libdc1394."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.capture_settings import write_settings

from skelgen.capture.room.sources import open_room_source

GUIDS = ",".join(f"00accef00000100{k}" for k in range(4))
READ = """
from skelgen.capture.room.sources import open_room_source
def numbers(frame):
    return [-1 if image is None else int(image[0, :4].copy().view("<u4")[0]) for image in frame.images]
with open_room_source("SOURCE") as source:
    found["cameras"] = list(source.cameras)
    found["numbers"], found["dropped"], found["time"] = [], [], []
    try:
        for frame in source:
            found["numbers"].append(numbers(frame))
            found["dropped"].append(frame.dropped)
            found["time"].append(frame.time)
            if frame.index == 5:
                ACTION
    except SkelgenError as error:
        found["error"] = str(error)
"""


CAPTURE = """
import contextlib, io
from skelgen.cli import main
out, err = io.StringIO(), io.StringIO()
with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
    found["code"] = main(["motion-capture", "-nl", "SETTINGS"])
found["out"], found["err"] = out.getvalue().splitlines(), err.getvalue().splitlines()
"""


@pytest.fixture
def reads(bus):
    def read(source, action="pass", **settings):
        return bus.run(READ.replace("SOURCE", source).replace("ACTION", action), nodes=4, **settings)

    return read


def test_four_cameras_start_on_one_frame_and_stay_together(reads):
    found = reads(f"firewire:{GUIDS}?order=every&frames=15&rate=15")
    assert found["cameras"] == GUIDS.split(",")
    assert found["numbers"] == [[k] * 4 for k in range(1, 16)]
    assert sum(found["dropped"]) == 0
    np.testing.assert_allclose(found["time"], np.arange(15) / 15, atol=130e-6)  # a cycle of the bus is 125 us


def test_an_image_that_one_of_four_loses_is_its_own_loss(reads):
    found = reads(f"firewire:{GUIDS}?order=every&frames=15&rate=15", "bus['lose'] = 2")
    lost = np.array(found["numbers"]) == -1
    assert lost.sum(axis=0).tolist() == [2, 0, 0, 0]
    kept = np.array(found["numbers"])[:, 1:]
    assert (kept == kept[:, :1]).all()


def test_a_camera_of_four_that_falls_silent_does_not_end_the_others(reads):
    found = reads(f"firewire:{GUIDS}?order=every&frames=16&rate=15&timeout=0.3", "bus['silent'] = 4")
    numbers = np.array(found["numbers"])
    assert (numbers[12:, 2] == -1).all()
    assert (numbers[:, [0, 1, 3]] > 0).all()


def test_four_cameras_become_joint_angles(bus, tmp_path):
    room = open_room_source("room:arm?cameras=4&frames=8&rate=15")
    bus.show(np.array([frame.images for frame in room]))
    path = tmp_path / "room.xml"
    write_settings(replace(room.settings, source=f"firewire:{GUIDS}?order=every&frames=8&rate=15"), path)
    found = bus.run(CAPTURE.replace("SETTINGS", str(path)), nodes=4)
    assert found["code"] == 0
    assert [line.split("\t")[0] for line in found["out"]] == [str(index) for index in range(8)]
    assert "nan" not in "".join(found["out"])
    assert found["err"][-1].startswith("8 sets of images captured, 0 lost")
