"""`skelgen calibrate stereo` and `skelgen evaluate rig` as a user calls them."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("cv2")

from skelgen_formats.capture_settings import read_settings, write_settings

from skelgen.capture.reference_rig import reference_rig
from skelgen.cli import main
from skelgen.cli.calibrate_commands import split_pairs
from skelgen.errors import InputError
from skelgen.model.rig import CaptureSettings

CHESSBOARDS = Path(__file__).parents[2] / ".." / "shared" / "data" / "stereo_chessboard"


@pytest.fixture
def chessboards() -> list[str]:
    if not CHESSBOARDS.is_dir():
        pytest.skip("the recordings in ../shared/data are not here")
    return [str(path) for side in ("left", "right") for path in sorted(CHESSBOARDS.glob(f"{side}*.jpg"))]


@pytest.fixture
def settings(tmp_path) -> Path:
    write_settings(CaptureSettings(reference_rig()), tmp_path / "rig.xml")
    return tmp_path / "rig.xml"


def test_chessboards_become_a_settings_file_and_a_verdict(chessboards, tmp_path, capsys):
    rig = tmp_path / "rig.xml"
    assert main(["calibrate", "stereo", *chessboards, "--board", "9x6", "--square", "25", "-o", str(rig), "-q"]) == 0
    assert "Good: corners lie 0.20 px" in capsys.readouterr().out
    assert read_settings(rig).rig.left.matrix[0, 0] == pytest.approx(533.0, abs=2.0)


def test_json_holds_the_verdict_and_all_deviations(chessboards, tmp_path, capsys):
    assert main(["calibrate", "stereo", *chessboards, "-o", str(tmp_path / "rig.xml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["grade"] == "good"
    assert found["left_std"]["fx [px]"] == pytest.approx(0.3, abs=0.2)
    assert len(found["pairs"]) == 13


def test_a_missing_right_image_is_told_and_nothing_is_written(chessboards, tmp_path, capsys):
    rig = tmp_path / "rig.xml"
    assert main(["calibrate", "stereo", *chessboards[:-1], "-o", str(rig)]) == 2
    assert "13 left and 12 right images" in capsys.readouterr().err
    assert not rig.exists()


def test_new_cameras_leave_targets_and_joints_of_the_settings(chessboards, tmp_path):
    path = tmp_path / "settings.xml"
    assert main(["calibrate", "simulated", "-o", str(path), "-q"]) == 0
    before = read_settings(path)
    assert main(["calibrate", "stereo", *chessboards, "-o", str(path), "-q"]) == 0
    after = read_settings(path)
    assert after.rig.left.matrix[0, 0] == pytest.approx(533.0, abs=2.0)
    assert (
        [body.name for body in after.bodies]
        == [body.name for body in before.bodies]
        == ["torso", "upper arm", "lower arm"]
    )
    assert (len(after.joints), after.source) == (2, "simulated:arm")


def test_simulated_settings_without_targets_hold_the_cameras_alone(tmp_path):
    path = tmp_path / "settings.xml"
    assert main(["calibrate", "simulated", "--cameras-only", "-o", str(path), "-q"]) == 0
    found = read_settings(path)
    assert (found.bodies, found.joints, found.source) == ((), (), "simulated:arm")


def test_simulated_settings_replace_no_others(tmp_path, capsys):
    path = tmp_path / "settings.xml"
    path.write_text("a calibration")
    assert main(["calibrate", "simulated", "-o", str(path)]) == 2
    assert "is there already, perhaps with a real calibration; choose another name with -o" in capsys.readouterr().err
    assert path.read_text() == "a calibration"


def test_what_is_no_settings_file_is_refused_before_anything_is_calibrated(chessboards, tmp_path, capsys):
    path = tmp_path / "settings.xml"
    path.write_text("no settings")
    assert main(["calibrate", "stereo", *chessboards, "-o", str(path), "-q"]) == 2
    out, err = capsys.readouterr()
    assert (out, "broken XML" in err) == ("", True)
    assert path.read_text() == "no settings"


def test_targets_that_no_capture_could_find_are_left_out_and_told(tmp_path, capsys):
    assert main(["calibrate", "simulated", "human", "-o", str(tmp_path / "human.xml")]) == 0
    assert "targets and joints are left out: body 'pelvis' has 3 balls" in capsys.readouterr().err
    assert read_settings(tmp_path / "human.xml").bodies == ()


def test_images_are_told_apart_by_name_or_by_half():
    names = [Path(name) for name in ("a/left1.png", "a/right1.png", "a/left2.png", "a/right2.png")]
    assert split_pairs(names) == ([names[0], names[2]], [names[1], names[3]])
    plain = [Path(name) for name in ("c0_1.png", "c0_2.png", "c1_1.png", "c1_2.png")]
    assert split_pairs(plain) == (plain[:2], plain[2:])
    with pytest.raises(InputError, match="1 left and 2 right"):
        split_pairs(plain[:3])


def test_a_rigs_errors_are_printed_and_drawn(settings, tmp_path, capsys):
    picture = tmp_path / "errors.svg"
    assert main(["evaluate", "rig", str(settings), "--plot", str(picture)]) == 0
    shown = capsys.readouterr().out
    assert "Angle of typical hinge [degrees]" in shown
    drawn = ElementTree.parse(picture).getroot()
    texts = [text.text for text in drawn.iter("{http://www.w3.org/2000/svg}text")]
    assert texts.count("distance [m]") == 5  # a ball, position and orientation of a target, two joints
    assert {"angle of typical hinge", "standard deviation [degrees]", "held by the joint"} <= set(texts)


def test_a_rigs_errors_as_json_grow_with_distance(settings, capsys):
    assert main(["evaluate", "rig", str(settings), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["curves"][0]["rows"]
    assert (np.diff([row["in all"] for row in rows]) > 0).all()


def test_a_picture_of_no_known_kind_is_refused(settings, tmp_path, capsys):
    assert main(["evaluate", "rig", str(settings), "--plot", str(tmp_path / "errors.nothing")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_plot_without_a_rig_is_refused(tmp_path, capsys):
    assert main(["evaluate", str(tmp_path), str(tmp_path), "--plot", "x.png"]) == 2
    assert "evaluate rig settings.xml" in capsys.readouterr().err
