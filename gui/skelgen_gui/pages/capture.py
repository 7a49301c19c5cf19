"""The page that captures with two cameras."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from skelgen_gui.pages.context import Context


def make_capture_page(context: Context) -> QWidget:
    """Build the Capture page from what pages are given."""
    from skelgen_gui.capture.page import CapturePage  # noqa: PLC0415 - the window is shown before

    return CapturePage(context)
