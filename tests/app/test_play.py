"""The view that plays: what is packed comes back, and a real browser plays, turns and scrubs it without complaint."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import subprocess
import sys
import zlib

import numpy as np
import pytest

import skelgen
from skelgen.app.drawing.poses import MarkerState
from skelgen.app.report import report_html, write_report, write_view
from skelgen.app.report.play import play_content
from skelgen.errors import InputError
from skelgen.model import PointCloud, Project, StageReport, Trajectories
from tests.app.chromium import Chromium, find_chromium
from tests.app.known_project import N_FRAMES, NAMES, build_project

needs_chromium = pytest.mark.skipif(
    find_chromium() is None, reason="no Chromium on this machine: apt-get install chromium"
)
N_JOINTS = 3


def unpacked(content):
    """The data of the view, its states, shape (n_columns, n_frames), and its places [mm], (n_frames, n_points, 3)."""
    data = json.loads(content.data)
    packed = np.frombuffer(zlib.decompress(base64.b64decode(data["packed"])), dtype=np.uint8)
    n_frames, n_points = data["nFrames"], len(data["joints"]) + len(data["names"])
    states, rest = np.split(packed, [(n_points + len(data["limbs"])) * n_frames])
    size = 3 * n_points * n_frames
    words = rest[:size] + 256 * rest[size : 2 * size].astype(np.uint16)
    steps = np.cumsum(np.cumsum(words.reshape(n_points, 3, n_frames), axis=2, dtype=np.uint16), axis=2, dtype=np.uint16)
    places = (np.array(data["low"]) + data["step"] * steps.transpose(2, 0, 1)) @ np.array(data["axes"]).T
    return data, states.reshape(-1, n_frames), places


def test_places_come_back_within_half_a_step():
    project = build_project()
    data, states, places = unpacked(play_content(project))
    measured = project.take.positions
    seen = states[N_JOINTS : N_JOINTS + 12].T == MarkerState.SEEN
    np.testing.assert_array_equal(seen, ~np.isnan(measured[..., 0]))
    assert np.abs(places[:, N_JOINTS:] - measured)[seen].max() < data["step"]  # half a step along each axis, turned
    assert data["step"] < 0.02  # mm, of a body of a metre
    assert np.abs(places[:, :N_JOINTS] - project.motion.joint_positions).max() < data["step"]


def test_gaps_stay_gaps_until_a_skeleton_places_the_marker():
    _, bare, _ = unpacked(play_content(build_project("labels")))
    _, fitted, _ = unpacked(play_content(build_project()))
    assert set(bare[3, 10:20]) == {MarkerState.ABSENT}
    assert set(fitted[N_JOINTS + 3, 10:20]) == {MarkerState.FILLED}


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_ten_seconds_of_fifty_markers_take_less_than_two_megabytes(rate, tmp_path):
    n_frames = round(10 * rate)
    rng = np.random.default_rng(0)
    times = np.arange(n_frames)[:, np.newaxis, np.newaxis] / rate
    swing = 400 * np.sin(2 * np.pi * times * rng.uniform(0.5, 2, (50, 3)) + rng.uniform(0, 6, (50, 3)))
    positions = swing + [0, 0, 1000] + [300, 0, 0] * times + rng.normal(scale=0.2, size=swing.shape)
    take = Trajectories(positions, tuple(f"M{index}" for index in range(50)), rate)
    path = write_view(Project(take).with_trajectories(take, StageReport()), tmp_path / "view.html")
    assert path.stat().st_size < 2e6


def test_script_is_the_one_that_the_page_allows():
    html = report_html(build_project())
    script = re.search(r"<script>(.*?)</script>", html, flags=re.DOTALL)[1]
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{allowed}'" in html


def test_marker_named_script_does_not_end_the_data():
    data = re.search(r'id="play-data">(.*?)</script>', report_html(build_project()), flags=re.DOTALL)[1]
    assert json.loads(data)["names"] == list(NAMES)


def test_view_of_a_take_that_shows_nothing_is_an_error(tmp_path):
    take = Trajectories(np.full((3, 2, 3), np.nan), ("a", "b"), 60.0, name="dark.csm")
    with pytest.raises(InputError, match=r"dark\.csm: no point is seen in any frame"):
        write_view(Project(take), tmp_path / "view.html")


def test_command_opens_the_view_in_the_browser_or_says_where_it_is(waving, tmp_path):
    skelgen.write(waving, tmp_path / "wave.csm")
    command = [sys.executable, "-m", "skelgen", "view", tmp_path / "wave.csm", "--output", tmp_path / "wave.html"]
    bare = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")}
    without = subprocess.run(command, capture_output=True, text=True, check=True, env=bare)
    assert f"no browser could be opened here: open {tmp_path / 'wave.html'} in one" in without.stderr
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/opened\n')
    browser.chmod(0o755)
    seen = subprocess.run(command, capture_output=True, text=True, check=True, env=bare | {"BROWSER": str(browser)})
    assert (tmp_path / "opened").read_text().strip() == (tmp_path / "wave.html").as_uri()
    assert "no browser" not in seen.stderr


@pytest.fixture(scope="module")
def browser():
    with Chromium() as started:
        yield started


@pytest.fixture
def page(browser, tmp_path):
    """The report of the known project in a browser, scrolled to the view."""
    browser.complaints.clear()
    browser.open(write_report(build_project(), tmp_path / "report.html"))
    browser.evaluate("document.getElementById('play-canvas').scrollIntoView({behavior: 'instant', block: 'center'})")
    yield browser
    assert browser.complaints == []


def picture(page):
    """What the canvas shows once everything asked for is drawn."""
    wait = "requestAnimationFrame(() => "  # for what the system says, for what that asks for, and for the drawing
    drawn = f"new Promise((done) => {4 * wait}done(){4 * ')'})"
    return page.evaluate(f"{drawn}.then(() => document.getElementById('play-canvas').toDataURL())")


def frame(page):
    return int(page.evaluate("document.getElementById('play-slider').value"))


def press(page, control, *keys):
    page.evaluate(f"document.getElementById('play-{control}').focus({{preventScroll: true}})")
    for key in keys:
        page.press(key)


@needs_chromium
def test_it_plays_and_pauses(page):
    page.evaluate("document.getElementById('play-toggle').click()")
    page.wait_until("document.getElementById('play-slider').value > 5")
    page.evaluate("document.getElementById('play-toggle').click()")
    stopped = frame(page)
    picture(page)
    assert frame(page) == stopped
    text = page.evaluate("document.getElementById('play-time').textContent")
    assert text == f"{stopped / 60:.2f} s, frame {stopped} of {N_FRAMES}"


@needs_chromium
def test_it_turns_by_mouse_touch_and_keys_and_comes_back(page):
    first = picture(page)
    box = page.evaluate("(({x, y}) => [x, y])(document.getElementById('play-canvas').getBoundingClientRect())")
    start, end = [(box[0] + x, box[1] + y) for x, y in ((200, 200), (320, 230))]
    pictures = [first]
    page.drag(start, end)
    pictures.append(picture(page))
    page.pinch(start, end)
    pictures.append(picture(page))
    press(page, "canvas", "ArrowLeft")
    pictures.append(picture(page))
    assert len(set(pictures)) == len(pictures)
    press(page, "canvas", "0")
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=1, y=1)  # no marker under the pointer shows its name
    assert picture(page) == first


@needs_chromium
def test_it_is_scrubbed_by_slider_and_keys(page):
    press(page, "slider", "ArrowRight", "ArrowRight")
    assert frame(page) == 2
    press(page, "canvas", ".", ".", ",")
    assert frame(page) == 3
    press(page, "canvas", "End")
    assert frame(page) == N_FRAMES - 1
    assert page.evaluate("document.getElementById('play-slider').ariaValueText").endswith(f"of {N_FRAMES}")


@needs_chromium
def test_it_is_dark_where_the_system_is(page):
    light = picture(page)
    page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    dark = picture(page)
    page.call("Emulation.setEmulatedMedia", features=[])
    assert dark != light
    assert picture(page) == light


@needs_chromium
def test_points_without_names_are_played_too(browser, tmp_path):
    browser.complaints.clear()
    rng = np.random.default_rng(0)
    starts = np.concatenate([[0], np.cumsum(rng.integers(0, 9, 40))])
    cloud = PointCloud(rng.normal(size=(starts[-1], 3)) * 300, starts, np.arange(40) / 50.0)
    browser.open(write_view(Project(cloud), tmp_path / "view.html"))
    first = picture(browser)
    press(browser, "canvas", ".")
    assert picture(browser) != first
    assert browser.complaints == []
