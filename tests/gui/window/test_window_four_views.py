"""Four views of the same: one key shows them, each stands where it says, and a click in any of them selects."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Qt

Key = Qt.Key


def test_four_views_show_and_select_the_same(qtbot, active, window, person, walked):
    window.document.open(walked[0])
    person.waits()
    four = window.view3d.parentWidget()
    qtbot.keyClick(window.view3d, Key.Key_4)
    qtbot.waitUntil(lambda: len(four.others) == 3 and all(view.isVisible() for view in four.others))
    above, front, side = four.others
    qtbot.waitUntil(lambda: above.viewpoint.elevation > 1.5)
    assert np.isclose(abs(front.viewpoint.azimuth - side.viewpoint.azimuth), np.pi / 2)
    front.grab()
    marker = 4
    qtbot.mouseClick(front, Qt.MouseButton.LeftButton, pos=front.place_of_marker(marker).toPoint())
    assert len(window.session.selection.markers) == 1
    qtbot.keyClick(window.view3d, Key.Key_N)
    assert side.shown.names
    assert window.view_state().shown.four
    qtbot.keyClick(front, Key.Key_4)
    qtbot.waitUntil(lambda: not any(view.isVisible() for view in four.others))
    assert window.view3d.isVisible()
