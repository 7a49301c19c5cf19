"""The icon of the window is that of the desktop entry, and Qt can draw it."""

from __future__ import annotations

from PySide6.QtGui import QIcon
from skelgen_gui.main import ICON


def test_icon_is_drawn_at_every_size(qapp):
    for size in (16, 32, 256):
        image = QIcon(str(ICON)).pixmap(size, size).toImage()
        assert image.width() == size
        assert image.pixelColor(size // 2, size // 8 * 7).alpha() == 255
        assert image.pixelColor(0, 0).alpha() == 0
