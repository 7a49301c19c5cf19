"""Tool tips show names of markers as they are."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QPointF
from PySide6.QtGui import QHelpEvent
from PySide6.QtWidgets import QToolTip, QWidget
from skelgen_gui.widgets.painting import as_rich_text, show_tip


def test_names_that_look_like_tags_are_shown(qtbot):
    assert as_rich_text("M<b>1</b>&\nseen") == "<qt>M&lt;b&gt;1&lt;/b&gt;&amp;<br>seen</qt>"


def test_only_questions_for_a_tip_are_answered(qtbot):
    widget, asked = QWidget(), []
    qtbot.addWidget(widget)
    question = QHelpEvent(QHelpEvent.Type.ToolTip, QPoint(3, 4), QPoint(30, 40))
    assert show_tip(widget, question, lambda place: asked.append(place) or "told")
    assert asked == [QPointF(3, 4)]
    assert not show_tip(widget, QHelpEvent(QHelpEvent.Type.WhatsThis, QPoint(), QPoint()), lambda place: "told")
    QToolTip.hideText()
