"""`skelgen motion-capture` with two FireWire cameras on the virtual bus, which look at the simulated arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.c3d import read_c3d
from skelgen_formats.capture_settings import write_settings
from skelgen_formats.mfml import read_mfml

from skelgen.capture.simulated_rig import simulated_rig

RUN = """
import contextlib, io, os, sys, threading
from skelgen.cli import main
out, err = io.StringIO(), io.StringIO()
def watch():
    while out.getvalue().count("\\n") < LINES:
        time.sleep(0.01)
    ACTION
threading.Thread(target=watch, daemon=True).start()
with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
    found["code"] = main(["motion-capture", "-nl", "SETTINGS", "--record", "TAKE.mfml", "--record", "TAKE.c3d"])
found["out"], found["err"] = out.getvalue().splitlines(), err.getvalue().splitlines()
"""


@pytest.fixture
def capture(bus, tmp_path):
    """A function that captures until an action after some lines ends it."""
    rig = simulated_rig("arm", n_frames=12)
    bus.show(np.array([[pair.left, pair.right] for pair in rig]))

    def run(source="firewire:?order=every&timeout=1", action="pass", lines=10, **settings):
        write_settings(replace(rig.settings, source=source), tmp_path / "settings.xml")
        program = RUN.replace("SETTINGS", str(tmp_path / "settings.xml")).replace("TAKE", str(tmp_path / "take"))
        return bus.run(program.replace("ACTION", action).replace("LINES", str(lines)), **settings)

    return run


def test_cameras_to_joint_angles_without_a_lost_pair(capture):
    found = capture("firewire:?order=every&frames=12&rate=15")
    assert found["code"] == 0
    assert [line.split("\t")[0] for line in found["out"]] == [str(index) for index in range(12)]
    assert "nan" not in "".join(found["out"])
    assert found["err"][-1].startswith("12 pairs captured, 0 lost; recorded: ")


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        ("bus['unplugged'] = 2", "camera 00accef000001001 (skelgen test virtual IIDC) was unplugged"),
        ("bus['silent'] = 1", "has sent no image for 1 s; check its cable and its trigger"),
    ],
)
def test_a_camera_that_is_gone_while_running_ends_it_and_every_pair_is_kept(capture, tmp_path, action, sentence):
    found = capture("firewire:?order=every&timeout=1&rate=15", action)
    assert found["code"] == 2
    assert sentence in found["err"][-1]
    n_pairs = len(found["out"])
    assert n_pairs >= 10
    assert f"{n_pairs} pairs captured, " in found["err"][-2]
    assert read_mfml(tmp_path / "take.mfml").n_frames == n_pairs
    assert read_c3d(tmp_path / "take.c3d").n_frames == int(found["out"][-1].split("\t")[0]) + 1


def test_pairs_that_were_lost_are_told_and_empty_in_the_recording(capture, tmp_path):
    found = capture("firewire:?order=every&frames=30&rate=15", "bus['lose'] = 3")
    assert found["code"] == 0
    told = [line for line in found["err"] if " lost before frame " in line]
    assert told
    n_lost = sum(int(line.split()[1]) for line in told)
    assert f"{len(found['out'])} pairs captured, {n_lost} lost" in found["err"][-1]
    take = read_c3d(tmp_path / "take.c3d")
    assert take.n_frames == len(found["out"]) + n_lost
    assert int(np.isnan(take.positions).all(axis=(1, 2)).sum()) == n_lost


def test_a_missing_camera_is_told_and_nothing_is_recorded(capture, tmp_path):
    found = capture(nodes=1)
    assert (found["code"], found["out"]) == (2, [])
    assert "one camera is missing: only 00accef000001000 is on the IEEE 1394 bus" in found["err"][-1]
    assert not list(tmp_path.glob("take.*"))
