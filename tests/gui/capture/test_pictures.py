"""The pictures that `skelgen motion-capture` shows, on a screen that nobody sees."""

from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QApplication
from skelgen_formats.capture_settings import write_settings
from skelgen_gui.capture.pictures import LivePictures, Pictures

from skelgen.capture.live import MotionCapture
from skelgen.capture.room.live import RoomCapture
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.cli import main


@pytest.fixture(scope="module")
def captured():
    source = simulated_rig("arm", n_frames=2)
    with MotionCapture(source.settings, threads=False) as capture:
        return source.settings, [capture.see(source.render(index)[0]) for index in range(2)]


def bright(view):
    """How many pixels of the widget are coloured: rings and names of targets."""
    image = view.grab().toImage()
    colours = [image.pixelColor(x, y) for x in range(0, image.width(), 2) for y in range(0, image.height(), 2)]
    return sum(colour.saturation() > 100 and colour.value() > 100 for colour in colours)


class PaintedPictures(QObject):
    """Counts how often pictures are painted."""

    count = 0

    def eventFilter(self, watched, event):  # noqa: N802 - Qt calls it so
        self.count += isinstance(watched, Pictures) and event.type() == QEvent.Type.Paint
        return False


def test_pictures_show_what_was_found(qapp, captured):
    settings, frames = captured
    with LivePictures([body.name for body in settings.bodies]) as pictures:
        pictures.view.resize(900, 340)
        assert pictures.view.isVisible()
        before = bright(pictures.view)
        pictures.show(frames[0])
        assert bright(pictures.view) > before + 50
    assert not pictures.view.isVisible()


def test_a_window_that_was_closed_stays_closed(qapp, captured):
    with LivePictures(()) as pictures:
        pictures.view.close()
        pictures.show(captured[1][0])
        assert not pictures.view.isVisible()


def test_the_command_shows_pictures_unless_it_is_told_not_to(qapp, captured, tmp_path, monkeypatch, capsys):
    path, watcher = tmp_path / "settings.xml", PaintedPictures()
    write_settings(captured[0], path)
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    qapp.installEventFilter(watcher)
    source = ["--source", "simulated:arm?frames=2"]
    assert main(["motion-capture", "-sn", str(path), *source]) == 0
    assert not watcher.count
    assert main(["motion-capture", "-s", str(path), *source]) == 0
    assert watcher.count
    qapp.removeEventFilter(watcher)
    assert not any(isinstance(widget, Pictures) and widget.isVisible() for widget in QApplication.topLevelWidgets())
    assert "note" not in capsys.readouterr().err


def test_all_cameras_of_a_room_are_shown(qapp):
    source = open_room_source("room:arm?cameras=4&frames=2")
    with RoomCapture(source.settings) as capture, LivePictures(["torso", "lower arm"], source.cameras) as pictures:
        pictures.view.resize(900, 680)
        captured = list(capture.run(source))
        before = bright(pictures.view)
        pictures.show(captured[1])
        assert bright(pictures.view) > before + 50
        assert {pictures.view.place_of(camera, 0, 0).x() > 450 for camera in range(4)} == {True, False}
        lost = replace(captured[1].pair, images=(None, *captured[1].pair.images[1:]))
        pictures.view.hide()
        pictures.view.show()
        pictures.show(replace(captured[1], pair=lost))
