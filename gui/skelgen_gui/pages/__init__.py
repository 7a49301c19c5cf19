"""The pages of the window: one table, so that a new page touches nothing else."""

from functools import partial

from PySide6.QtWidgets import QWidget

from skelgen.app import STAGE_SUMMARIES
from skelgen_gui.pages.export import ExportPage
from skelgen_gui.pages.steps import OpenPage, StagePage
from skelgen_gui.project.context import HOME, Context, PageEntry

_TITLES = {"labels": "Labels", "limbs": "Limbs", "joints": "Joints", "skeleton": "Skeleton"}


def _make_capture_page(context: Context) -> QWidget:
    """Build the Capture page from what pages are given."""
    from skelgen_gui.capture.page import CapturePage  # noqa: PLC0415 - the window is shown before

    return CapturePage(context)


def _make_export_page(context: Context) -> QWidget:
    return ExportPage(context.session, context.jobs)


def _make_takes_page(context: Context) -> QWidget:
    from skelgen_gui.pages.takes import TakesPage  # noqa: PLC0415 - the window is shown before

    return TakesPage(context)


PAGES: tuple[PageEntry, ...] = (
    PageEntry("capture", "Capture", "Record with two or more cameras, and calibrate them.", _make_capture_page),
    PageEntry(HOME, "Open", "Open a recording or a project.", OpenPage),
    *(
        PageEntry(stage, _TITLES[stage], summary, partial(StagePage, stage), stage)
        for stage, summary in STAGE_SUMMARIES.items()
    ),
    PageEntry("export", "Export", "Write the result for other programs.", _make_export_page),
    PageEntry("takes", "Takes", "Run many takes, with one skeleton or each its own.", _make_takes_page),
)
"""In the order in which they are shown."""
