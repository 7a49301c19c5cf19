"""Fixtures of the window's tests: without a display, and not under Xvfb, they run on Qt's offscreen platform."""

from __future__ import annotations

import gc
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("PySide6.QtWidgets", reason="PySide6 is not installed: pip install 'skelgen-mocap[gui]'")

from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtGui import QImage
from skelgen_gui.project.session import Session

import skelgen


@pytest.fixture(scope="session")
def qapp_args(qapp_args):
    """Choose the platform when the application is made: by then pytest-xvfb has its display."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    return qapp_args


@pytest.fixture(scope="module", autouse=True)
def frozen():
    """What other tests and libraries left in memory is not searched after each test: that takes a second and more."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def collected():
    """Python ends widgets that refer to each other between tests, and not amid their events, in any order."""
    gc.disable()
    yield
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    gc.enable()


@pytest.fixture(scope="session")
def walked():
    """A simulated human of 400 frames, with all four stages done: project and truth."""
    from skelgen.simulation import simulate

    case = simulate("human", n_frames=400, noise=0.5, dropouts=0.05)
    return skelgen.reconstruct(case.take), case.truth


@pytest.fixture(scope="session")
def doubted(small_project):
    """The small project with doubts about its second marker in frames 3 to 5, and about its third in frame 8."""
    from skelgen.model import Labelling
    from skelgen.model.labelling import Doubt

    doubts = (
        Doubt(1, 3, 5, "misfit", -1, 0.3, "it is off its place"),
        Doubt(2, 8, 8, "rival", 1, 0.5, "it may be another"),
    )
    seen = small_project.trajectories.seen
    labelling = Labelling(np.where(seen, 0.95, np.nan), doubts, (), np.zeros(len(seen), dtype=int))
    return replace(small_project, _labelling=labelling)


@pytest.fixture
def session(qtbot, walked):
    """A session with `walked` open."""
    session = Session()
    session.open(walked[0])
    return session


@pytest.fixture
def shown(qtbot):
    """Show a widget in a size, and wait until what it derives in the background is there."""

    def show(widget, width=900, height=400):
        from skelgen_gui.project.deriving import Deriver

        qtbot.addWidget(widget)
        widget.resize(width, height)
        widget.show()
        qtbot.waitUntil(lambda: not any(one.is_busy for one in widget.findChildren(Deriver)))
        return widget

    return show


@pytest.fixture
def has_colour():
    """Whether a grab of a widget holds a colour, up to the rounding of opacities."""

    def has(widget, colour, least=1):
        import numpy as np

        picture = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGBA8888)
        pixels = np.frombuffer(picture.constBits(), np.uint8).reshape(picture.height(), picture.width(), 4)
        wanted = (colour.red(), colour.green(), colour.blue())
        return int((np.abs(pixels[..., :3].astype(int) - wanted).max(axis=2) <= 2).sum()) >= least

    return has


@pytest.fixture
def recording():
    """Read a real recording, or skip the test where they are not there."""

    def read(path):
        file = Path(__file__).parents[3] / "shared" / "data" / path
        if not file.exists():
            pytest.skip(f"the real recording {path} is not here: ../shared/data is absent")
        return skelgen.read(file)

    return read
