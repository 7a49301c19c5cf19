"""What a C3D file holds beside its points comes back when it is written again; ezc3d reads both."""

from __future__ import annotations

from pathlib import Path

import ezc3d
import numpy as np
import pytest
from skelgen_formats.registry import read_take, write_file

from skelgen.model import Project

N_FRAMES, SAMPLES = 20, 7
UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # z-to-y


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Three markers, four channels at seven times the rate, a force plate and two events, as ezc3d writes them."""
    rng = np.random.default_rng(1)
    content = ezc3d.c3d()
    points = np.concatenate([rng.uniform(-900, 900, (3, 3, N_FRAMES)), np.ones((1, 3, N_FRAMES))])
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["A", "B", "C"]
    content["parameters"]["ANALOG"]["RATE"]["value"] = [100.0 * SAMPLES]
    content["parameters"]["ANALOG"]["LABELS"]["value"] = ["Fx", "Fy", "Fz", "EMG"]
    content["data"]["points"] = points
    content["data"]["analogs"] = rng.normal(size=(1, 4, N_FRAMES * SAMPLES))
    content.add_parameter("EVENT", "USED", [2])
    content.add_parameter("EVENT", "LABELS", ["Foot Strike", "Foot Off"])
    content.add_parameter("EVENT", "TIMES", np.array([[0.0, 0.0], [0.07, 0.15]]))
    content.add_parameter("FORCE_PLATFORM", "USED", [1])
    content.add_parameter("FORCE_PLATFORM", "TYPE", [2])
    content.add_parameter("FORCE_PLATFORM", "CORNERS", rng.uniform(-500, 500, (3, 4, 1)))
    content.add_parameter("FORCE_PLATFORM", "ORIGIN", np.array([[1.0], [2.0], [-40.0]]))
    content.add_parameter("FORCE_PLATFORM", "CHANNEL", np.array([[1.0], [2.0], [3.0], [0.0], [0.0], [0.0]]))
    path = tmp_path / "recorded.c3d"
    content.write(str(path))
    return path


def facts(path: Path) -> dict[str, np.ndarray]:
    content = ezc3d.c3d(str(path))
    event, plate = content["parameters"]["EVENT"], content["parameters"]["FORCE_PLATFORM"]
    return {
        "points": content["data"]["points"][:3],
        "analogs": content["data"]["analogs"],
        "rate": np.array(content["parameters"]["ANALOG"]["RATE"]["value"]),
        "times": event["TIMES"]["value"],
        "corners": plate["CORNERS"]["value"],
        "origin": plate["ORIGIN"]["value"],
        "channel": plate["CHANNEL"]["value"],
    }


def test_events_analogue_values_and_plates_come_back(recorded, tmp_path):
    (again,) = write_file(read_take(recorded), tmp_path / "again.c3d")
    before, after = facts(recorded), facts(again)
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values, err_msg=name)
    labels = [ezc3d.c3d(str(path))["parameters"]["EVENT"]["LABELS"]["value"] for path in (recorded, again)]
    assert labels[0] == labels[1] == ["Foot Strike", "Foot Off"]


def test_project_keeps_them_too_over_its_own_recording(recorded):
    before = facts(recorded)
    write_file(Project(read_take(recorded)), recorded)
    np.testing.assert_array_equal(facts(recorded)["analogs"], before["analogs"])


def test_plates_turn_and_scale_with_the_points(recorded, tmp_path):
    (again,) = write_file(read_take(recorded), tmp_path / "again.c3d", axes="z-to-y", unit="m")
    before, after = facts(recorded), facts(again)
    for name in ("points", "corners"):
        np.testing.assert_allclose(after[name], np.einsum("ij,j...->i...", UP, before[name]) / 1000, rtol=1e-6)
    np.testing.assert_allclose(after["origin"], before["origin"] / 1000, rtol=1e-6)
    np.testing.assert_array_equal(after["analogs"], before["analogs"])


def test_take_with_other_frames_is_written_without_them(recorded, tmp_path):
    (again,) = write_file(read_take(recorded), tmp_path / "again.c3d", rate=50.0)
    assert ezc3d.c3d(str(again))["data"]["analogs"].size == 0


def test_take_whose_recording_is_gone_is_written_without_them(recorded, tmp_path):
    take = read_take(recorded)
    recorded.unlink()
    (again,) = write_file(take, tmp_path / "again.c3d")
    assert read_take(again).n_frames == N_FRAMES


def test_real_recording_in_whole_numbers_keeps_its_values(recording, tmp_path):
    path = recording("wild/BMClab_Gait.c3d")
    (again,) = write_file(read_take(path), tmp_path / "again.c3d")
    before, after = (ezc3d.c3d(str(one)) for one in (path, again))
    np.testing.assert_allclose(after["data"]["analogs"], before["data"]["analogs"], rtol=0, atol=1e-9)
    seen = ~np.isnan(before["data"]["points"][0])
    np.testing.assert_allclose(after["data"]["points"][:3, seen], before["data"]["points"][:3, seen], rtol=1e-6)
