"""The page that writes the result for other programs."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from skelgen_gui.export_page import ExportPage
from skelgen_gui.pages.context import Context


def make_export_page(context: Context) -> QWidget:
    """Build the export page from what pages are given."""
    page = ExportPage(context.session, context.jobs.start)
    page.setObjectName("page-export")
    return page
