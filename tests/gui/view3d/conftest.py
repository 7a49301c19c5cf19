"""Fixtures of the 3-D view's tests: a view, an eye that looks at its pixels, and a hand that moves the mouse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication
from skelgen_gui.model.view_state import Shown
from skelgen_gui.view3d.view import View3D
from skelgen_gui.widgets.painting import theme_palette

ALONE = 26  # px to the next thing that is drawn: nothing covers it, nor the light and the shade of its ball
NOTHING = Shown(**dict.fromkeys(("filled", "trails", "bones", "joints", "uncertainty", "axes", "floor"), False))
LEFT, NONE, NO_KEY = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier


class CameraImage:
    """Looks at views."""

    MARKERS, BARE = NOTHING, replace(NOTHING, markers=False)

    def picture_of(self, view):
        return view.grab().toImage()

    def scaled(self, image, place, radius=0):
        """A place and a radius of the view in pixels of its picture, of which a dense screen has more."""
        ratio = image.devicePixelRatio()
        return round(place.x() * ratio), round(place.y() * ratio), round(radius * ratio)

    def colour_at(self, image, place):
        return image.pixelColor(*self.scaled(image, place)[:2])

    def pixels(self, image):
        """Red, green and blue of all pixels, shape (height, width, 3)."""
        image = image.convertToFormat(image.Format.Format_RGB32)
        rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
        return rows[:, : image.width(), 2::-1].astype(int)

    def changed(self, before, after, place=None, radius=20):
        """How many pixels differ clearly, around a place or anywhere."""
        difference = np.abs(self.pixels(before) - self.pixels(after)).max(axis=2) > 12
        if place is not None:
            x, y, radius = self.scaled(after, place, radius)
            difference = difference[max(y - radius, 0) : y + radius, max(x - radius, 0) : x + radius]
        return int(difference.sum())

    def ink(self, without, image):
        """Number of pixels above the legend that differ at all."""
        return int((np.abs(self.pixels(without) - self.pixels(image)).max(axis=2)[:660] > 4).sum())

    def near(self, image, place, colour, radius=14, tolerance=40):
        """How many pixels around a place have a colour."""
        x, y, radius = self.scaled(image, place, radius)
        patch = self.pixels(image)[y - radius : y + radius, x - radius : x + radius]
        return int((np.abs(patch - colour.getRgb()[:3]).max(axis=2) < tolerance).sum())

    def lone_markers(self, view):
        """Markers that are drawn with nothing else near, and not below the buttons."""
        places = {marker: place for marker in range(100) if (place := view.place_of_marker(marker)) is not None}
        return [
            marker
            for marker, place in places.items()
            if place.y() > 60
            and all((place - other).manhattanLength() > ALONE for index, other in places.items() if index != marker)
        ]


class Hand:
    """Uses a mouse."""

    def __init__(self, qtbot):
        self._qtbot = qtbot

    def click(self, view, place, button=LEFT, modifier=NO_KEY):
        self._qtbot.mouseClick(view, button, modifier, place.toPoint())

    def drag(self, view, start, end, button=LEFT, modifier=NO_KEY):
        self._qtbot.mousePress(view, button, modifier, start)
        for part in (0.3, 0.6, 1.0):
            self.move(view, start + (end - start) * part, button, modifier)
        self._qtbot.mouseRelease(view, button, modifier, end)

    def move(self, view, place, buttons=NONE, modifier=NO_KEY):
        spot = QPointF(place)
        event = QMouseEvent(QEvent.Type.MouseMove, spot, QPointF(view.mapToGlobal(place)), NONE, buttons, modifier)
        QApplication.sendEvent(view, event)


@pytest.fixture
def eye():
    return CameraImage()


@pytest.fixture
def hand(qtbot):
    return Hand(qtbot)


@pytest.fixture
def make_view(qtbot):
    """`make_view(session)`: a view of a session, shown."""

    def make(session, size=(900, 700)):
        view = View3D(session)
        qtbot.addWidget(view)
        view.setPalette(theme_palette(dark=False))
        view.resize(*size)
        view.show()
        return view

    return make


@pytest.fixture
def view(make_view, session, eye):
    """A view of `walked`, shown, in which only seen markers are drawn; frame 20."""
    view = make_view(session)
    session.show_frame(20)
    view.set_shown(eye.MARKERS)
    eye.picture_of(view)
    return view
