"""A form shows what is declared, says beside a field what is wrong with it, and leads back to the defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QCheckBox, QComboBox, QLineEdit
from skelgen_gui.widgets.fields import FoundOrGiven, stepped
from skelgen_gui.widgets.forms import ParameterForm, stage_form

from skelgen.app.configuration import all_parameter_classes, parameters_class
from skelgen.errors import ParameterError
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class Soup(StageParameters):
    """Something to cook."""

    stage: ClassVar[str] = "soup"
    litres: float = declare(1.5, "how much", unit="l", within=(0.0, 20.0), basic=True)
    kind: str = declare("pea", "Which.", choices=("pea", "bean"), basic=True)
    is_hot: bool = declare(True, "Whether it is heated.", basic=True)
    guest_name: str = declare("", "Who eats it.", basic=True)
    eggs: int = declare(2, "How many.", within=(0, None))
    grain: float = declare(1e-12, "How fine.", within=(0.0, None))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.guest_name == "nobody":
            raise ParameterError("guest_name: nobody eats no soup")


@pytest.fixture
def form(qtbot):
    form = stage_form(Soup)
    qtbot.addWidget(form)
    with qtbot.waitActive(form):
        form.show()
        form.activateWindow()
    return form


@pytest.fixture
def typed(qtbot, form):
    """Type a text into a field, in place of what stands there."""

    def type_(name, text):
        editor = form.rows[name].editor
        editor.setFocus()
        editor.selectAll()
        qtbot.keyClicks(editor, text)

    return type_


def test_kinds_have_their_editors(form):
    kinds = {"litres": QAbstractSpinBox, "kind": QComboBox, "is_hot": QCheckBox, "guest_name": QLineEdit}
    assert all(isinstance(form.rows[name].editor, kind) for name, kind in kinds.items())


@pytest.mark.parametrize("declared", all_parameter_classes(), ids=lambda declared: declared.stage)
def test_every_stage_has_a_form_with_its_defaults_and_none_changed(qtbot, declared):
    form = stage_form(declared)
    qtbot.addWidget(form)
    assert form.values() == declared().as_mapping()
    assert not any(row.is_changed for row in form.rows.values())


@pytest.mark.parametrize("stage", ["labels", "limbs", "joints", "skeleton"])
def test_stages_show_a_handful_of_parameters_at_once(stage):
    basic = [entry for entry in parameters_class(stage).declarations() if entry.basic]
    assert 3 <= len(basic) <= 6


def test_typed_values_are_returned_in_their_type(form, typed):
    typed("litres", "12.5")
    typed("guest_name", "Eve")
    assert form.values() == {**Soup().as_mapping(), "litres": 12.5, "guest_name": "Eve"}


def test_a_number_out_of_bounds_is_said_to_be_wrong_and_stands(form, typed):
    typed("litres", "21")
    row = form.rows["litres"]
    assert row.problem == form.problem() == "litres is 21; it must lie in 0 .. 20 l"
    assert row.editor.accessibleDescription() == row.problem
    assert row.editor.text() == "21"
    with pytest.raises(ParameterError, match=r"0 \.\. 20 l"):
        form.values()


def test_what_is_no_number_is_said_to_be_wrong(form, typed):
    typed("litres", "1,5")
    assert form.problem() == "litres is '1,5'; it must be a number"


def test_a_problem_disappears_with_its_cause(form, typed):
    typed("litres", "much")
    typed("litres", "2")
    assert form.problem() == ""


def test_what_the_stage_refuses_beyond_bounds_is_said_beside_the_field(form, typed):
    typed("guest_name", "nobody")
    assert form.rows["guest_name"].problem == "guest_name: nobody eats no soup"


def test_changed_values_are_marked_and_reset_one_by_one(qtbot, form, typed):
    typed("litres", "3")
    typed("guest_name", "Eve")
    assert form.rows["litres"].label.text() == "• Litres"
    assert form.rows["kind"].label.text() == "Kind"
    qtbot.mouseClick(form.rows["litres"].reset_button, Qt.MouseButton.LeftButton)
    assert form.values() == {**Soup().as_mapping(), "guest_name": "Eve"}
    assert not form.rows["litres"].reset_button.isVisible()


def test_all_values_are_reset_at_once(qtbot, form, typed):
    typed("litres", "99")
    form.rows["is_hot"].editor.click()
    qtbot.mouseClick(form._reset_all, Qt.MouseButton.LeftButton)
    assert form.values() == Soup().as_mapping()
    assert not form._reset_all.isEnabled()


def test_advanced_parameters_wait_behind_the_expander(qtbot, form):
    assert form.rows["litres"].editor.isVisible()
    assert not form.rows["eggs"].editor.isVisible()
    qtbot.mouseClick(form._expander, Qt.MouseButton.LeftButton)
    assert form.rows["eggs"].editor.isVisible()


def test_the_expander_counts_what_is_changed_behind_it(form):
    form.set_values({"eggs": 5})
    assert form._expander.text() == "Advanced (2, 1 changed)"


def test_a_problem_behind_the_expander_opens_it(form):
    form.set_values({"eggs": -1})
    assert form.rows["eggs"].editor.isVisible()
    assert form.problem() == "eggs is -1; it must lie in 0 .. inf"


def test_values_of_a_file_are_shown_whatever_else_it_holds(form):
    form.set_values({"litres": 2.0, "kind": "leek", "salt": 3})
    assert form.rows["litres"].value() == 2.0
    assert form.problem() == "kind is 'leek'; it must be one of pea, bean"


def test_values_that_are_set_together_are_told_once(qtbot, form):
    told = []
    form.changed.connect(lambda: told.append(form.problem()))
    form.set_values({"litres": 2.0, "eggs": 3, "kind": "bean"})
    assert told == [""]


def test_help_follows_the_focus(form):
    form.rows["litres"].editor.setFocus()
    assert form._help.text() == "How much. Allowed: 0 .. 20 l. Default: 1.5 l."
    form.rows["eggs"].looked_at.emit()
    assert form._help.text() == "How many. Allowed: 0 or more. Default: 2."


def test_every_control_has_a_name_and_a_tool_tip(form):
    for row in form.rows.values():
        assert row.editor.accessibleName() and row.editor.toolTip() and row.editor.whatsThis()
        assert row.reset_button.accessibleName() and row.reset_button.toolTip()


def test_the_keyboard_reaches_every_field_in_order(qtbot, form):
    form.rows["litres"].editor.setFocus()
    reached = [QApplication.focusWidget().objectName()]
    for _ in range(3):
        qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        reached.append(QApplication.focusWidget().objectName())
    assert reached == ["litres", "kind", "is_hot", "guest_name"]


def test_arrow_keys_step_within_the_bounds(qtbot, form, typed):
    typed("litres", "19.5")
    for _ in range(2):
        qtbot.keyClick(form.rows["litres"].editor, Qt.Key.Key_Up)
    assert form.rows["litres"].value() == 20.0
    typed("litres", "much")
    qtbot.keyClick(form.rows["litres"].editor, Qt.Key.Key_Up)
    assert form.rows["litres"].editor.text() == "much"


@pytest.mark.parametrize(
    ("name", "value", "steps", "result"),
    [
        ("litres", 0.8, 1, 0.81),
        ("litres", 1.0, -1, 0.99),
        ("litres", 0.0, 1, 0.1),
        ("litres", 0.0, -1, 0.0),
        ("grain", 1e-12, 1, 1.1e-12),
        ("eggs", 7, 1, 8),
        ("eggs", 2, -3, 0),
    ],
)
def test_steps_suit_the_size_of_the_number(name, value, steps, result):
    declaration = {entry.name: entry for entry in Soup.declarations()}[name]
    assert stepped(declaration, value, steps) == pytest.approx(result, rel=1e-12)


def test_the_wheel_scrolls_the_page_and_not_a_field_without_focus(qtbot, form):
    form.rows["kind"].editor.setFocus()
    for name, expected in (("litres", 1.5), ("kind", "bean")):
        editor = form.rows[name].editor
        buttons, keys = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
        event = QWheelEvent(
            QPointF(5, 5), QPointF(5, 5), QPoint(), QPoint(0, -120), buttons, keys, Qt.ScrollPhase.NoScrollPhase, False
        )
        QApplication.sendEvent(editor, event)
        assert form.rows[name].value() == expected


def test_a_form_of_plain_declarations_shows_all_if_none_is_basic(qtbot):
    form = ParameterForm([entry for entry in Soup.declarations() if not entry.basic])
    qtbot.addWidget(form)
    form.show()
    assert all(row.editor.isVisible() for row in form.rows.values())
    assert not form._expander.isVisible()


def test_a_number_is_found_unless_it_is_given(qtbot):
    number = FoundOrGiven("Number of limbs")
    qtbot.addWidget(number)
    number.show()
    assert number.value() is None
    assert not number._number.isEnabled()
    qtbot.mouseClick(number._given, Qt.MouseButton.LeftButton, pos=QPoint(8, number._given.height() // 2))
    number._number.selectAll()
    qtbot.keyClicks(number._number, "14")
    assert number.value() == 14


def test_what_was_found_is_said_and_offered(qtbot):
    number = FoundOrGiven("Number of limbs")
    qtbot.addWidget(number)
    number.show_found(13)
    assert number._found.text() == "found: 13"
    assert number.value() is None
    number._given.setChecked(True)
    assert number.value() == 13
    number.set_value(None)
    assert number.value() is None
