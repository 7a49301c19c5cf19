"""The pages of the window: one table, so that a new page touches nothing else."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QT_TRANSLATE_NOOP

from skelgen.app.stages import PIPELINE
from skelgen_gui.pages.context import Context, PageEntry
from skelgen_gui.pages.export import make_export_page
from skelgen_gui.pages.open import OpenPage
from skelgen_gui.pages.stage import StagePage

__all__ = ["PAGES", "Context", "PageEntry"]

_TITLES = {
    "labels": QT_TRANSLATE_NOOP("Pages", "Labels"),
    "limbs": QT_TRANSLATE_NOOP("Pages", "Limbs"),
    "joints": QT_TRANSLATE_NOOP("Pages", "Joints"),
    "skeleton": QT_TRANSLATE_NOOP("Pages", "Skeleton"),
}

PAGES: tuple[PageEntry, ...] = (
    PageEntry(
        "open",
        QT_TRANSLATE_NOOP("Pages", "Open"),
        QT_TRANSLATE_NOOP("Pages", "Open a recording or a project."),
        OpenPage,
    ),
    *(
        PageEntry(stage.name, _TITLES[stage.name], stage.summary, partial(StagePage, stage.name), stage.name)
        for stage in PIPELINE
    ),
    PageEntry(
        "export",
        QT_TRANSLATE_NOOP("Pages", "Export"),
        QT_TRANSLATE_NOOP("Pages", "Write the result for other programs."),
        make_export_page,
    ),
)
"""In the order in which they are shown."""
