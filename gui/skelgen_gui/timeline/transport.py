"""The row of buttons above the lanes: play, step, speed, loop, range, frame and time."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QSpinBox, QToolButton, QWidget

from skelgen.app.report.wording import plain
from skelgen_gui.session import Session
from skelgen_gui.timeline.icons import transport_icon
from skelgen_gui.timeline.player import SPEEDS, Player
from skelgen_gui.timeline.scale import clock

_LONG_STEP = 10
_TIME_STEP = 0.01  # s, to which the time of a frame is shown


class Transport(QWidget):
    """Buttons that play the take.

    Parameters
    ----------
    session : Session
        Whose frame is moved.
    player : Player
        What moves it.
    """

    def __init__(self, session: Session, player: Player, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._player = session, player
        self._icons: dict[QAction, str] = {}
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(6, 3, 6, 3)
        self._row.setSpacing(2)
        self._add_moves()
        self._add_frame()
        self._add_range()
        self._row.addStretch(1)
        self._draw_icons()
        for signal in (session.project_changed, session.frame_changed):
            signal.connect(self._follow)
        for signal in (player.playing_changed, player.settings_changed):
            signal.connect(self._follow_player)
        self._follow_player()
        self._follow()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        """Draw the signs anew in the colours of another palette."""
        if event.type() == QEvent.Type.PaletteChange:
            self._draw_icons()
        super().changeEvent(event)

    def _add_moves(self) -> None:
        self._button("first", self.tr("First frame of the range"), self._to_first, "Home")
        self._button("back", self.tr("One frame back"), self._step_back, "Left")
        self._play = self._button("play", self.tr("Play or pause"), self._player.toggle, "Space", "Media Play")
        self._button("forward", self.tr("One frame on"), self._step_on, "Right")
        self._button("last", self.tr("Last frame of the range"), self._to_last, "End")
        self._keys(self.tr("Ten frames back"), self._leap_back, "Shift+Left")
        self._keys(self.tr("Ten frames on"), self._leap_on, "Shift+Right")

    def _add_frame(self) -> None:
        self.frame = QSpinBox(self)
        self.frame.setKeyboardTracking(False)
        self.frame.setMinimumWidth(84)
        self.frame.setAccessibleName(self.tr("Frame"))
        self.frame.setToolTip(self.tr("The frame that is shown, counted from 0"))
        self.frame.valueChanged.connect(self._session.show_frame)
        self._time = QLabel(self)
        self._time.setAccessibleName(self.tr("Time"))
        self._time.setToolTip(self.tr("Time of the frame, and of the last one"))
        self._row.addSpacing(10)
        self._row.addWidget(self.frame)
        self._row.addSpacing(6)
        self._row.addWidget(self._time)
        self._row.addSpacing(10)

    def _add_range(self) -> None:
        self.speed = QComboBox(self)
        self.speed.setAccessibleName(self.tr("Speed"))
        self.speed.setToolTip(self.tr("How fast the take is played"))
        for speed in SPEEDS:
            self.speed.addItem(f"{plain(speed)} ×", speed)
        self.speed.activated.connect(self._set_speed)
        self._row.addWidget(self.speed)
        self._loop = self._button("loop", self.tr("Loop"), self._set_loop, "L")
        self._loop.setCheckable(True)
        self._row.addSpacing(10)
        self._button("range from", self.tr("Play from this frame on"), self._range_from, "I")
        self._button("range to", self.tr("Play up to this frame"), self._range_to, "O")
        self._button("range all", self.tr("Play the whole take"), self._range_all, "A")

    def _button(self, icon: str, words: str, slot: Callable[..., None], *keys: str) -> QAction:
        action = self._keys(words, slot, *keys)
        button = QToolButton(self)
        button.setDefaultAction(action)
        button.setAutoRaise(True)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.setAccessibleName(words)
        self._icons[action] = icon
        self._row.addWidget(button)
        return action

    def _keys(self, words: str, slot: Callable[..., None], *keys: str) -> QAction:
        """An action with single keys: they work in the views that it is added to, and leave text fields alone."""
        action = QAction(words, self)
        action.setShortcuts([QKeySequence(key) for key in keys])
        action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        action.setToolTip(f"{words} ({QKeySequence(keys[0]).toString(QKeySequence.SequenceFormat.NativeText)})")
        action.triggered.connect(slot)
        self.addAction(action)
        return action

    def _draw_icons(self) -> None:
        for action, name in self._icons.items():
            action.setIcon(transport_icon(name, self.palette()))

    def _follow(self) -> None:
        """Show the session's frame and time."""
        n_frames, rate, frame = self._session.n_frames, self._session.rate, self._session.frame
        self.setEnabled(n_frames > 0)
        self.frame.blockSignals(True)
        self.frame.setRange(0, max(n_frames - 1, 0))
        self.frame.setValue(frame)
        self.frame.blockSignals(False)
        last = max(n_frames - 1, 0) / rate
        self._time.setText(f"{clock(frame / rate, _TIME_STEP)} / {clock(last, _TIME_STEP)}")

    def _follow_player(self) -> None:
        self._icons[self._play] = "pause" if self._player.is_playing else "play"
        self._play.setIcon(transport_icon(self._icons[self._play], self.palette()))
        self._loop.setChecked(self._player.loop)
        self.speed.setCurrentIndex(self.speed.findData(self._player.speed))

    def _set_speed(self, index: int) -> None:
        self._player.set_speed(self.speed.itemData(index))

    def _set_loop(self) -> None:
        self._player.set_loop(not self._player.loop)

    def _to_first(self) -> None:
        self._session.show_frame(self._player.range[0])

    def _to_last(self) -> None:
        self._session.show_frame(self._player.range[1])

    def _step_back(self) -> None:
        self._player.step(-1)

    def _step_on(self) -> None:
        self._player.step(1)

    def _leap_back(self) -> None:
        self._player.step(-_LONG_STEP)

    def _leap_on(self) -> None:
        self._player.step(_LONG_STEP)

    def _range_from(self) -> None:
        self._player.set_range(self._session.frame, max(self._player.range[1], self._session.frame))

    def _range_to(self) -> None:
        self._player.set_range(min(self._player.range[0], self._session.frame), self._session.frame)

    def _range_all(self) -> None:
        self._player.set_range(0, self._session.n_frames - 1)
