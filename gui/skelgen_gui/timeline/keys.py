"""What the commands of the menu Play do."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction

from skelgen_gui.session import Selection, Session
from skelgen_gui.timeline.lanes import next_doubt
from skelgen_gui.timeline.player import SPEEDS, Player


class PlayCommands(QObject):
    """Connects the commands of the menu Play with a player.

    Parameters
    ----------
    session : Session
        Whose frame is moved.
    player : Player
        What moves it.
    actions : mapping of str to QAction
        What `skelgen_gui.shortcuts.make_actions` gives.
    """

    def __init__(
        self, session: Session, player: Player, actions: Mapping[str, QAction], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._session, self._player = session, player
        slots = {
            "play": player.toggle,
            "loop": self._loop,
            "next_frame": self._next_frame,
            "previous_frame": self._previous_frame,
            "next_second": self._next_second,
            "previous_second": self._previous_second,
            "first_frame": self._first_frame,
            "last_frame": self._last_frame,
            "faster": self._faster,
            "slower": self._slower,
            "range_from": self._range_from,
            "range_to": self._range_to,
            "range_all": self._range_all,
            "next_doubt": self._next_doubt,
            "previous_doubt": self._previous_doubt,
        }
        for name, slot in slots.items():
            actions[name].triggered.connect(slot)

    def _loop(self) -> None:
        self._player.set_loop(not self._player.loop)

    def _next_frame(self) -> None:
        self._player.step(1)

    def _previous_frame(self) -> None:
        self._player.step(-1)

    def _next_second(self) -> None:
        self._player.step(max(round(self._session.rate), 1))

    def _previous_second(self) -> None:
        self._player.step(-max(round(self._session.rate), 1))

    def _first_frame(self) -> None:
        self._session.show_frame(self._player.range[0])

    def _last_frame(self) -> None:
        self._session.show_frame(self._player.range[1])

    def _faster(self) -> None:
        self._player.set_speed(min((speed for speed in SPEEDS if speed > self._player.speed), default=SPEEDS[-1]))

    def _slower(self) -> None:
        self._player.set_speed(max((speed for speed in SPEEDS if speed < self._player.speed), default=SPEEDS[0]))

    def _range_from(self) -> None:
        frame = self._session.frame
        self._player.set_range(frame, max(self._player.range[1], frame))

    def _range_to(self) -> None:
        frame = self._session.frame
        self._player.set_range(min(self._player.range[0], frame), frame)

    def _range_all(self) -> None:
        self._player.set_range(0, self._session.n_frames - 1)

    def _next_doubt(self) -> None:
        self._go_to_doubt(1)

    def _previous_doubt(self) -> None:
        self._go_to_doubt(-1)

    def _go_to_doubt(self, direction: int) -> None:
        """Show where the next doubt begins, and select its marker."""
        project = self._session.project
        doubt = next_doubt(project, self._session.frame, direction) if project is not None else None
        if doubt is not None:
            self._session.show_frame(doubt.first_frame)
            self._session.select(Selection(frozenset({doubt.marker})))
