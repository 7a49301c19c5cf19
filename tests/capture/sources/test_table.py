"""The table of sources: texts, options, and what is no source."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from skelgen.capture.sources import SOURCES, open_source
from skelgen.capture.sources.options import parse_source
from skelgen.errors import CaptureError, InputError, ParameterError


@pytest.mark.parametrize("text", ["webcam:0", "left.avi", "", "C:\\images", "video"])
def test_an_unknown_text_is_told_what_would_be_known(text):
    with pytest.raises(InputError, match=r"is no source of images; known are folder:images.*firewire:"):
        open_source(text)


def test_every_example_of_the_table_belongs_to_its_row():
    for kind in SOURCES:
        assert parse_source(kind.example).kind == kind.name


@pytest.mark.parametrize(
    ("text", "place", "options"),
    [
        ("folder:/a b/c?", "/a b/c?", {}),
        ("folder:take?1", "take?1", {}),
        ("folder:take?left=a*.png&rate=60", "take", {"left": "a*.png", "rate": "60"}),
        ("firewire:", "", {}),
        ("video:C:\\left.avi,D:\\right.avi", "C:\\left.avi,D:\\right.avi", {}),
    ],
)
def test_a_text_is_kind_place_and_options(text, place, options):
    parsed = parse_source(text)
    assert (parsed.place, parsed.options) == (place, options)
    assert parse_source(str(parsed)) == parsed


@pytest.mark.parametrize("kind", SOURCES, ids=lambda kind: kind.name)
def test_an_unknown_option_is_told_which_there_are(kind):
    with pytest.raises(ParameterError, match=r"no parameter 'colour'; it has rate, "):
        open_source(f"{kind.example}?colour=red")


def test_a_folder_needs_no_kind(tmp_path, save):
    save(tmp_path / "left1.png", 1, 1)
    save(tmp_path / "right1.png", 1, 2)
    assert open_source(str(tmp_path)).n_frames == 1


def test_a_missing_folder_is_an_error(tmp_path):
    with pytest.raises(CaptureError, match="no such folder"):
        open_source(f"folder:{tmp_path / 'gone'}")


def test_without_opencv_the_way_to_it_is_said(tmp_path, save, monkeypatch):
    save(tmp_path / "left1.png", 1, 1)
    save(tmp_path / "right1.png", 1, 2)
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(CaptureError, match=r"needs OpenCV: pip install 'skelgen-mocap\[capture\]'"):
        open_source(f"folder:{tmp_path}")


def test_the_page_of_the_sources_names_every_kind_and_option():
    page = (Path(__file__).parents[3] / "docs" / "capture" / "sources.md").read_text(encoding="utf-8")
    options = {entry.name for kind in SOURCES for entry in kind.options.declarations()}
    assert [kind.name for kind in SOURCES if f"| `{kind.name}:" not in page] == []
    assert sorted(name for name in options if f"`{name}`" not in page) == []


def test_the_simulated_rig_is_a_source_like_others(marks):
    source = open_source("simulated:?frames=2&rate=30&seed=1")
    assert (source.n_frames, source.rate) == (2, 30.0)
    assert [index for index, *_ in marks(source)] == [0, 1]


def test_the_simulated_rig_shows_the_targets_that_are_named():
    _, truth = open_source("simulated:arm?frames=1&show=torso").render(0)
    assert (truth.left.visible > 0).sum() == 5
    with pytest.raises(InputError, match="the arm has no target 'head' to show; it has torso, upper arm, lower arm"):
        open_source("simulated:arm?show=head")


def test_producer_that_a_file_names_is_loaded_only_from_where_producers_are_installed(tmp_path, monkeypatch):
    producer = tmp_path / "evil.cti"
    producer.write_text("a program")
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed" / "link.cti").symlink_to(producer)
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(tmp_path / "installed"))
    for place in (producer, tmp_path / "installed" / "link.cti", tmp_path / "installed" / ".." / "evil.cti"):
        with pytest.raises(CaptureError, match="loaded only from a folder of GENICAM_GENTL64_PATH"):
            open_source(f"gentl:{place}", from_file=True)
    assert open_source(f"gentl:{producer}").name == f"gentl:{producer}"
    monkeypatch.setenv("GENICAM_GENTL64_PATH", f"{tmp_path}{os.pathsep}/elsewhere")
    assert open_source(f"gentl:{producer}", from_file=True).name == f"gentl:{producer}"
