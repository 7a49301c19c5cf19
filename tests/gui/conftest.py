"""Fixtures of the window's tests: without a display, and not under Xvfb, they run on Qt's offscreen platform."""

from __future__ import annotations

import os

import pytest

pytest.importorskip("PySide6.QtWidgets", reason="PySide6 is not installed: pip install 'skelgen[gui]'")

if not os.environ.get("DISPLAY"):
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from skelgen_gui.session import Session

import skelgen


@pytest.fixture(scope="session")
def walked():
    """A simulated human of 400 frames, with all four stages done: project and truth."""
    from skelgen.simulation import simulate

    case = simulate("human", n_frames=400, noise=0.5, dropouts=0.05)
    return skelgen.reconstruct(case.take), case.truth


@pytest.fixture
def session(qtbot, walked):
    """A session with `walked` open."""
    session = Session()
    session.open(walked[0])
    return session
