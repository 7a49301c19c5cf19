"""The pages of the window: one table, so that a new page touches nothing else."""

from __future__ import annotations

from functools import partial

from skelgen.app.stages import PIPELINE
from skelgen_gui.pages.capture import make_capture_page
from skelgen_gui.pages.context import HOME, Context, PageEntry, view_of
from skelgen_gui.pages.export import make_export_page
from skelgen_gui.pages.open import OpenPage
from skelgen_gui.pages.stage import StagePage

__all__ = ["HOME", "PAGES", "Context", "PageEntry", "view_of"]

_TITLES = {
    "labels": "Labels",
    "limbs": "Limbs",
    "joints": "Joints",
    "skeleton": "Skeleton",
}

PAGES: tuple[PageEntry, ...] = (
    PageEntry(
        "capture",
        "Capture",
        "Record with two cameras, and calibrate them.",
        make_capture_page,
    ),
    PageEntry(
        HOME,
        "Open",
        "Open a recording or a project.",
        OpenPage,
    ),
    *(
        PageEntry(stage.name, _TITLES[stage.name], stage.summary, partial(StagePage, stage.name), stage.name)
        for stage in PIPELINE
    ),
    PageEntry(
        "export",
        "Export",
        "Write the result for other programs.",
        make_export_page,
    ),
)
"""In the order in which they are shown."""
