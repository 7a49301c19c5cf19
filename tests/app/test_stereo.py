"""Images of two cameras to a skeleton in one command, and to what other commands make of a take."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.capture_settings import write_settings
from skelgen_formats.mfml import read_mfml

import skelgen
from skelgen.app.files import NamedFile, format_rows, is_stereo, name_of_format, open_input
from skelgen.app.project_file.archive import open_project
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.cli import main
from skelgen.errors import InputError, WriteError
from skelgen.evaluation import evaluate

N_FRAMES = 240
SOURCE = f"simulated:arm?frames={N_FRAMES}&seed=1"
JOINT = 0.5  # mm: a ball errs by 0.1 mm, a joint by less


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    """Settings of the cameras alone, with the source."""
    path = tmp_path_factory.mktemp("stereo") / "arm.xml"
    known = simulated_rig("arm", n_frames=2).settings
    write_settings(replace(known, bodies=(), joints=(), source=SOURCE), path)
    return path


@pytest.fixture(scope="module")
def project(settings, tmp_path_factory):
    """What the one command makes of the images."""
    folder = tmp_path_factory.mktemp("result")
    assert main(["run", str(settings), "-o", str(folder), "-q"]) == 0
    return open_project(folder / "arm.skelgen")


def test_one_command_makes_a_skeleton_of_images(project):
    scene = simulated_rig("arm", n_frames=N_FRAMES, seed=1).scene
    marker_of_point = np.concatenate(
        [
            np.nanargmin(np.linalg.norm(points[:, np.newaxis] - scene.points[frame], axis=2), axis=1)
            for frame, points in enumerate(project.take)
        ]
    )
    scores = evaluate(project, replace(scene.truth, marker_of_point=marker_of_point))
    assert scores.labels.n_markers_found == 15
    assert scores.labels.idf1 > 0.99
    assert scores.limbs.is_exact and scores.topology.is_exact
    assert {score.name: score.kind_found for score in scores.joints} == {
        "torso - upper arm": "ball",
        "upper arm - lower arm": "hinge",
    }
    assert all(score.mean < JOINT for score in scores.joints)


def test_the_project_holds_the_points_and_says_what_was_left_out(project):
    assert project.take.name == "arm.xml"
    assert any("fit only by chance" in note for note in project.take.notices)
    assert set(project.take.attributes) == {"reprojection_error", "std", "n_blobs"}


def test_points_are_converted_with_another_source_and_fewer_frames(settings, tmp_path):
    target = tmp_path / "points.mfml"
    source = ["--source", "simulated:rods?seed=2", "--frames", "20"]
    assert main(["convert", str(settings), str(target), *source, "-q"]) == 0
    assert read_mfml(target).n_frames == 20


def test_images_of_a_folder_are_a_source(settings, tmp_path):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'skelgen-mocap[capture]'")
    rig = simulated_rig("arm", n_frames=N_FRAMES, seed=1)
    for index, pair in enumerate(rig):
        if index == 12:
            break
        if index != 5:  # a pair that was lost
            cv2.imwrite(str(tmp_path / f"left{index:03}.png"), pair.left)
        cv2.imwrite(str(tmp_path / f"right{index:03}.png"), pair.right)
    cloud = skelgen.read(settings, source=f"folder:{tmp_path}?rate=60")
    assert cloud.times == pytest.approx(np.delete(np.arange(12), 5) / 60)
    other = skelgen.read(settings, frames=12)
    assert cloud.frame(3) == pytest.approx(other.frame(3))


def test_labels_alone_are_made_of_images(settings, tmp_path):
    assert main(["label", str(settings), "--frames", "60", "-o", str(tmp_path), "-q"]) == 0
    assert open_project(tmp_path / "arm.skelgen").trajectories.n_markers >= 12


def test_settings_are_told_from_other_xml_by_their_root(settings, tmp_path):
    assert is_stereo(settings) and name_of_format(settings) == "stereo"
    other = tmp_path / "other.xml"
    other.write_text('<?xml version="1.0"?>\n<!-- <capture> -->\n<Skeleton/>')
    assert not is_stereo(other) and not is_stereo(tmp_path / "absent.xml") and is_stereo(other, "stereo")
    assert [row["read"] for row in format_rows() if row["name"] == "stereo"] == ["yes"]


@pytest.mark.parametrize(
    "before", ["<?a?>", "<!-- b -->", "<?a?> <!-- b -->\n", "<!DOCTYPE c>", "  ", "<?a?><?", "<!--<!-- b -->"]
)
def test_what_stands_before_the_root_is_passed_in_no_time(settings, tmp_path, before):
    root = settings.read_text().split("<capture", 1)[1]
    settings_behind, other = tmp_path / "behind.xml", tmp_path / "other.xml"
    settings_behind.write_text(f"{before * 20}<capture{root}")
    other.write_text(before * 40 + "<SkelFit/>")
    start = time.process_time()
    assert is_stereo(settings_behind) is not before.endswith("<?")
    assert not is_stereo(other)
    assert time.process_time() - start < 1.0


@pytest.mark.parametrize(
    ("options", "error", "sentence"),
    [
        ({"source": "nowhere:"}, InputError, "'nowhere:' is no source of images; known are folder:images"),
        ({"source": "folder:/no/such"}, skelgen.SkelgenError, "/no/such: no such folder"),
        ({"frames": -1}, skelgen.SkelgenError, "frames is -1; it must lie in 0 .. inf"),
        ({"unit": "m"}, WriteError, "the format stereo has no option 'unit'; it has source, frames"),
    ],
)
def test_what_cannot_be_read_is_said(settings, options, error, sentence):
    with pytest.raises(error, match=sentence):
        open_input(NamedFile(settings, options=options))


def test_settings_without_a_source_ask_for_one(tmp_path, capsys):
    path = tmp_path / "rig.xml"
    write_settings(replace(simulated_rig("arm", n_frames=2).settings, bodies=(), joints=()), path)
    assert main(["run", str(path)]) == 2
    assert "the settings name no source of images; add <source> to them, or give one with --source" in (
        capsys.readouterr().err
    )
