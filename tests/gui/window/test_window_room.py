"""The window fits the screen, works when it is small, fills the screen, and its layout can be put back."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QDockWidget


def test_at_first_it_fits_the_screen(window):
    room = window.screen().availableSize().expandedTo(QSize(1024, 700))
    assert window.width() <= room.width()
    assert window.height() <= room.height()


def test_it_works_at_1024_by_700(qtbot, window, person, rods):
    person.opens(rods)
    window.resize(1024, 700)
    qtbot.waitUntil(lambda: window.width() == 1024)
    for entry in window.pages.entries:
        window.pages.page(entry.key)
        qtbot.wait(1)
        assert (window.width(), window.height()) == (1024, 700), entry.key
    window.pages.page("open")
    assert window.minimumSizeHint().width() <= 1024
    assert window.minimumSizeHint().height() <= 700
    assert window.view3d.width() >= 300


def test_it_stays_small_however_much_came_out_of_a_step(qtbot, window, gapped):
    window.session.open(gapped)
    window.resize(1024, 640)
    page = window.pages.page("skeleton")
    page.result.setText("A joint is not determined. " * 40)
    page.warnings.show()
    qtbot.wait(1)
    assert (window.width(), window.height()) == (1024, 640)
    assert page.result.height() >= page.result.heightForWidth(page.result.width())  # nothing is cut off


def test_the_layout_is_put_back(window, person):
    docks = {dock.objectName(): dock for dock in window.findChildren(QDockWidget)}
    before = {name: (window.dockWidgetArea(dock), dock.isHidden()) for name, dock in docks.items()}
    docks["corrections"].setFloating(True)
    docks["timeline"].hide()
    person.does("reset_layout")
    assert {name: (window.dockWidgetArea(dock), dock.isHidden()) for name, dock in docks.items()} == before
    assert not docks["corrections"].isFloating()


def test_the_screen_is_filled_and_left_again(qtbot, window, person):
    person.does("full_screen")
    qtbot.waitUntil(window.isFullScreen)
    person.does("full_screen")
    qtbot.waitUntil(lambda: not window.isFullScreen())
