"""Preferences, recent files and the window's place are kept between runs, whatever the file holds."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QByteArray, QSettings, Qt
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QApplication, QDialogButtonBox, QLabel
from skelgen_gui.widgets.painting import CHANGED_ROLE, PROBLEM_ROLE, Theme, is_dark, theme_palette
from skelgen_gui.widgets.preferences import MOST_RECENT, Preferences, PreferenceValues
from skelgen_gui.window_commands import PreferencesDialog, RecentMenu

READABLE = 4.0
"""Contrast of text on its ground; WCAG 2.1 asks for 4.5, and for 3 where it is large."""


@pytest.fixture
def reopened(tmp_path):
    """Preferences as the next run of the program finds them."""
    return lambda: Preferences(QSettings(str(tmp_path / "skelgen.ini"), QSettings.Format.IniFormat))


@pytest.fixture
def preferences(reopened):
    return reopened()


@pytest.fixture
def app_theme(qapp):
    """The application; its style and palette are given back."""
    style, palette = qapp.style().name(), QPalette(qapp.palette())
    yield qapp
    qapp.setStyle(style)
    qapp.setPalette(palette)


def test_preferences_are_kept(preferences, reopened):
    preferences.change(PreferenceValues(theme="dark", up_axis="y", autosave=0))
    assert reopened().values == PreferenceValues(theme="dark", up_axis="y", autosave=0)


@pytest.mark.parametrize("text", ["[preferences]\ntheme=pink\nautosave=soon\n", "\0\1 not a settings file", "[recent"])
def test_damaged_preferences_are_defaults(tmp_path, text, reopened):
    (tmp_path / "skelgen.ini").write_text(text)
    assert reopened().values == PreferenceValues()
    assert reopened().recent == ()


def test_one_good_value_survives_a_bad_one(tmp_path, reopened):
    (tmp_path / "skelgen.ini").write_text("[preferences]\ntheme=dark\nautosave=-3\n")
    assert reopened().values == PreferenceValues(theme="dark")


@pytest.mark.parametrize("names", [["a.c3d"], ["a, b; 100 %.c3d", "Gänge & Läufe.skelgen"]])
def test_recent_files_are_kept_the_last_one_first(preferences, reopened, tmp_path, names):
    for name in names:
        preferences.remember(tmp_path / name)
    assert reopened().recent == tuple(tmp_path / name for name in reversed(names))


def test_a_file_is_remembered_once_and_only_so_many_are(preferences, tmp_path):
    for number in (*range(MOST_RECENT + 3), 5):
        preferences.remember(tmp_path / f"{number}.c3d")
    assert len(preferences.recent) == MOST_RECENT
    assert [path.stem for path in preferences.recent[:3]] == ["5", "12", "11"]


def test_the_window_is_found_where_it_was(preferences, reopened):
    assert preferences.geometry.isEmpty()
    preferences.keep_window(QByteArray(b"\x01\x00place"), QByteArray(b"docks"))
    assert (reopened().geometry.data(), reopened().layout.data()) == (b"\x01\x00place", b"docks")


def test_recent_files_are_offered_and_missing_ones_are_grey(qtbot, preferences, tmp_path):
    (tmp_path / "this & that.c3d").write_text("")
    preferences.remember(tmp_path / "gone.c3d")
    preferences.remember(tmp_path / "this & that.c3d")
    menu = RecentMenu(preferences)
    qtbot.addWidget(menu)
    first, second = menu.actions()[:2]
    assert (first.text(), first.isEnabled()) == ("&1 this && that.c3d", True)
    assert (second.text(), second.isEnabled()) == ("&2 gone.c3d", False)
    with qtbot.waitSignal(menu.chosen) as chosen:
        first.trigger()
    assert chosen.args == [tmp_path / "this & that.c3d"]


def test_a_file_that_vanishes_turns_grey_when_the_menu_opens(qtbot, preferences, tmp_path):
    (tmp_path / "a.c3d").write_text("")
    preferences.remember(tmp_path / "a.c3d")
    menu = RecentMenu(preferences)
    qtbot.addWidget(menu)
    (tmp_path / "a.c3d").unlink()
    menu.aboutToShow.emit()
    assert not menu.actions()[0].isEnabled()
    assert "no longer there" in menu.actions()[0].toolTip()


def test_the_list_of_recent_files_can_be_cleared(qtbot, preferences, tmp_path):
    preferences.remember(tmp_path / "a.c3d")
    menu = RecentMenu(preferences)
    qtbot.addWidget(menu)
    menu.actions()[-1].trigger()
    assert preferences.recent == ()
    assert not menu.menuAction().isEnabled()


@pytest.fixture
def dialog(qtbot, preferences):
    dialog = PreferencesDialog(preferences)
    qtbot.addWidget(dialog)
    dialog.show()
    return dialog


def type_into(qtbot, editor, text):
    editor.selectAll()
    qtbot.keyClicks(editor, text)


def test_what_is_entered_is_kept_when_the_dialog_is_accepted(qtbot, dialog, preferences):
    type_into(qtbot, dialog.form.rows["autosave"].editor, "120")
    dialog.form.rows["theme"].editor.setCurrentText("dark")
    qtbot.mouseClick(dialog.buttons.button(QDialogButtonBox.StandardButton.Ok), Qt.MouseButton.LeftButton)
    assert preferences.values == PreferenceValues(theme="dark", autosave=120)


def test_nothing_is_kept_when_the_dialog_is_cancelled(qtbot, dialog, preferences):
    type_into(qtbot, dialog.form.rows["autosave"].editor, "120")
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    assert preferences.values == PreferenceValues()


def test_a_bad_value_cannot_be_accepted(qtbot, dialog):
    type_into(qtbot, dialog.form.rows["autosave"].editor, "9999")
    assert not dialog.buttons.button(QDialogButtonBox.StandardButton.Ok).isEnabled()
    assert dialog.form.problem() == "autosave is 9999; it must lie in 0 .. 3600 s"


def test_the_theme_follows_the_preferences_at_once(app_theme, preferences):
    theme = Theme(app_theme, preferences)
    preferences.change(PreferenceValues(theme="dark"))
    assert is_dark(app_theme.palette())
    preferences.change(PreferenceValues(theme="light"))
    assert not is_dark(app_theme.palette())
    theme.deleteLater()


def test_the_system_decides_unless_the_user_does(app_theme, preferences):
    theme = Theme(app_theme, preferences)
    is_dark_system = app_theme.styleHints().colorScheme() == Qt.ColorScheme.Dark
    assert is_dark(app_theme.palette()) == is_dark_system
    theme.deleteLater()


def test_the_theme_is_seen_in_the_pixels(qtbot, app_theme, preferences):
    theme = Theme(app_theme, preferences)
    label = QLabel("text")
    qtbot.addWidget(label)
    label.show()
    for name, is_dark_ground in (("dark", True), ("light", False)):
        preferences.change(PreferenceValues(theme=name))
        QApplication.processEvents()
        assert (label.grab().toImage().pixelColor(0, 0).lightness() < 128) == is_dark_ground
    theme.deleteLater()


def luminance(colour):
    """Relative luminance (WCAG 2.1)."""
    parts = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour.getRgbF()[:3])
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), parts, strict=True))


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize(
    ("text", "ground"),
    [
        (QPalette.ColorRole.WindowText, QPalette.ColorRole.Window),
        (QPalette.ColorRole.Text, QPalette.ColorRole.Base),
        (QPalette.ColorRole.Text, QPalette.ColorRole.AlternateBase),
        (QPalette.ColorRole.ButtonText, QPalette.ColorRole.Button),
        (QPalette.ColorRole.HighlightedText, QPalette.ColorRole.Highlight),
        (QPalette.ColorRole.ToolTipText, QPalette.ColorRole.ToolTipBase),
        (QPalette.ColorRole.PlaceholderText, QPalette.ColorRole.Base),
        (PROBLEM_ROLE, QPalette.ColorRole.Window),
        (CHANGED_ROLE, QPalette.ColorRole.Window),
    ],
)
def test_texts_can_be_read(dark, text, ground):
    palette = theme_palette(dark=dark)
    low, high = sorted(luminance(palette.color(role)) for role in (text, ground))
    assert (high + 0.05) / (low + 0.05) >= READABLE
