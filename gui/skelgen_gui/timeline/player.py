"""Plays a take against the clock, carries out the commands of the menu Play, and shows a video beside the take.

Frames are left out where they cannot be shown in time; a take is never slowed down.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import QObject, QPointF, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QAction, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QDoubleSpinBox, QFileDialog, QLabel, QPushButton, QWidget

from skelgen.capture.sources.video import ReferenceVideo
from skelgen.capture.values import Image
from skelgen.errors import SkelgenError
from skelgen_gui.model.lanes import next_doubt
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.view_state import KeptVideo
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.fields import set_up_number
from skelgen_gui.widgets.layouts import column, put_texts, row_of
from skelgen_gui.widgets.painting import paint_words

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Speeds to choose from, in parts of the take's own."""

_TICK = 16  # ms: no screen shows more than about 60 pictures a second
_ROUNDING = 1e-6  # of a frame: a clock that says 0.29999999 s at 100 Hz means frame 30


class Player(QObject):
    """Plays the session's take.

    Attributes
    ----------
    speed : float
        Speed as a multiple of that of the take.
    loop : bool
        Whether the range is played again and again.

    Parameters
    ----------
    session : Session
        Whose frame is moved.
    clock : callable, optional
        Gives the time [s]; only differences count.

    Signals
    -------
    playing_changed(bool)
        Playing has started or ended.
    settings_changed()
        Another speed, another range, or looped otherwise.
    """

    playing_changed = Signal(bool)
    settings_changed = Signal()

    def __init__(
        self, session: Session, parent: QObject | None = None, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(parent)
        self._session, self._clock = session, clock
        self.speed, self.loop = 1.0, False
        self._first, self._last = 0, 0
        self._started, self._origin, self._shown = 0.0, 0, 0
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.setInterval(_TICK)
        self._timer.timeout.connect(self._tick)
        session.take_changed.connect(self._play_all)
        session.frame_changed.connect(self._follow_frame)
        self._play_all()

    @property
    def is_playing(self) -> bool:
        """Whether the take is playing."""
        return self._timer.isActive()

    @property
    def range(self) -> tuple[int, int]:
        """First and last frame that is played."""
        return self._first, self._last

    def play(self) -> None:
        """Play from the frame that is shown, or from the first if that is the last or outside the range."""
        if self.is_playing or self._session.n_frames == 0:
            return
        if not self._first <= self._session.frame < self._last:
            self._session.show_frame(self._first)
        self._anchor()
        self._timer.start()
        self.playing_changed.emit(True)

    def pause(self) -> None:
        """Stop where it is."""
        if self.is_playing:
            self._timer.stop()
            self.playing_changed.emit(False)

    def toggle(self) -> None:
        """Play or pause."""
        (self.pause if self.is_playing else self.play)()

    def step(self, frames: int) -> None:
        """Pause and move on by some frames, back if negative."""
        self.pause()
        self._session.show_frame(self._session.frame + frames)

    def set_speed(self, speed: float) -> None:
        """Play faster or slower from here on, within the bounds of `SPEEDS`."""
        self.speed = min(max(float(speed), SPEEDS[0]), SPEEDS[-1])
        self._anchor()
        self.settings_changed.emit()

    def set_loop(self, loop: bool) -> None:
        """Play the range again and again, or once."""
        self.loop = bool(loop)
        self._anchor()
        self.settings_changed.emit()

    def set_range(self, first: int, last: int) -> None:
        """Play only from a first to a last frame; both are brought into the take, and in order.

        Parameters
        ----------
        first, last : int
            Frames, both included.
        """
        end = max(self._session.n_frames - 1, 0)
        first, last = sorted((int(first), int(last)))
        self._first, self._last = min(max(first, 0), end), min(max(last, 0), end)
        self._anchor()
        self.settings_changed.emit()

    def _play_all(self) -> None:
        """Play all of another take; another result of the same take changes nothing."""
        self.pause()
        self.set_range(0, self._session.n_frames - 1)

    def _follow_frame(self, frame: int) -> None:
        """Go on from a frame that was chosen elsewhere."""
        if frame != self._shown:
            self._anchor()

    def _anchor(self) -> None:
        """Count the time from here: nothing is added up from tick to tick, so that nothing drifts."""
        self._started, self._origin = self._clock(), self._session.frame
        self._shown = self._origin

    def _tick(self) -> None:
        passed = (self._clock() - self._started) * self._session.rate * self.speed
        frame = self._origin + math.floor(passed + _ROUNDING)
        if self.loop and frame > self._last:
            frame = self._first + (frame - self._first) % (self._last - self._first + 1)
        self._shown = min(frame, self._last)
        self._session.show_frame(self._shown)
        if frame >= self._last and not self.loop:
            self.pause()


class PlayCommands(QObject):
    """Connects the commands of the menu Play with a player.

    Parameters
    ----------
    session : Session
        Whose frame is moved.
    player : Player
        What moves it.
    actions : mapping of str to QAction
        What `skelgen_gui.widgets.shortcuts.make_actions` gives.
    """

    def __init__(
        self, session: Session, player: Player, actions: Mapping[str, QAction], parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._session = session
        slots: dict[str, Callable[[], object]] = {
            "play": player.toggle,
            "loop": lambda: player.set_loop(not player.loop),
            "next_frame": lambda: player.step(1),
            "previous_frame": lambda: player.step(-1),
            "next_second": lambda: player.step(max(round(session.rate), 1)),
            "previous_second": lambda: player.step(-max(round(session.rate), 1)),
            "first_frame": lambda: session.show_frame(player.range[0]),
            "last_frame": lambda: session.show_frame(player.range[1]),
            "faster": lambda: player.set_speed(next((one for one in SPEEDS if one > player.speed), SPEEDS[-1])),
            "slower": lambda: player.set_speed(max((one for one in SPEEDS if one < player.speed), default=SPEEDS[0])),
            "range_from": lambda: player.set_range(session.frame, max(player.range[1], session.frame)),
            "range_to": lambda: player.set_range(min(player.range[0], session.frame), session.frame),
            "range_all": lambda: player.set_range(0, session.n_frames - 1),
            "next_doubt": lambda: self._go_to_doubt(1),
            "previous_doubt": lambda: self._go_to_doubt(-1),
        }
        for name, slot in slots.items():
            actions[name].triggered.connect(slot)

    def _go_to_doubt(self, direction: int) -> None:
        """Show where the next doubt begins, and select its marker."""
        project = self._session.project
        doubt = next_doubt(project, self._session.frame, direction) if project is not None else None
        if doubt is not None:
            self._session.show_frame(doubt.first_frame)
            self._session.select(Selection(frozenset({doubt.marker})))


_MOST_SECONDS = 36_000.0  # of the offset
_MOST_RATE = 10_000.0  # Hz
_SIZE = QSize(240, 160)  # px, the least that is useful


class VideoPicture(QWidget):
    """Shows one picture as large as there is room, or a sentence."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.image: QImage | None = None
        self.sentence = ""
        put_texts(self)
        self.setMinimumSize(_SIZE)

    def show_picture(self, picture: Image | None, sentence: str) -> None:
        """Show another picture, or a sentence if there is none.

        Parameters
        ----------
        picture : ndarray of uint8, shape (height, width, 3), or None
            Red, green and blue.
        sentence : str
            Why there is none.
        """
        self.sentence = "" if picture is not None else sentence
        if picture is None:
            self.image = None
        else:
            height, width = picture.shape[:2]
            image = QImage(picture.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888)
            self.image = image.copy()  # else it would point into bytes that are gone
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint it in the middle."""
        painter, room = QPainter(self), QRectF(self.rect())
        if self.image is None:
            paint_words(painter, room, self.sentence, self.palette())
            return
        box = QRectF(QPointF(), self.image.size().scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio).toSizeF())
        box.moveCenter(room.center())
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(box, self.image)


class VideoPane(QWidget):
    """A reference video; pictures are decoded beside the window, the newest that is wanted first.

    Parameters
    ----------
    session : Session
        Whose frame is followed.
    report_error : callable (error)
        Shows what went wrong.
    """

    def __init__(self, session: Session, report_error: Callable[[Exception], None]) -> None:
        super().__init__()
        self._session, self._report_error = session, report_error
        self._video: ReferenceVideo | None = None
        self._lost: KeptVideo | None = None
        self._shown: int | None = None
        self._deriver = Deriver(self)
        self.picture = VideoPicture(self)
        self.choose, self.remove = QPushButton(self.tr("Choose…"), self), QPushButton(self.tr("Remove"), self)
        self.offset, self.rate = QDoubleSpinBox(self), QDoubleSpinBox(self)
        put_texts(self)
        set_up_number(self.offset, (-_MOST_SECONDS, _MOST_SECONDS), 3, " s")
        set_up_number(self.rate, (0.001, _MOST_RATE), 3, " Hz")
        choices = row_of(self.choose, self.remove, room=True)
        numbers = row_of(
            QLabel(self.tr("Offset"), self), self.offset, QLabel(self.tr("Rate"), self), self.rate, room=True
        )
        column(self, (self.picture, choices, numbers)).setStretchFactor(self.picture, 1)
        self.choose.clicked.connect(self._choose)
        self.remove.clicked.connect(lambda: self.show_video(None))
        for number in (self.offset, self.rate):
            number.valueChanged.connect(self._follow)
        session.frame_changed.connect(self._follow)
        session.project_changed.connect(self._follow)
        self.show_video(None)

    @property
    def kept(self) -> KeptVideo | None:
        """The video as a project keeps it."""
        if self._video is None:
            return self._lost
        return KeptVideo(str(self._video.path), self.offset.value(), self.rate.value())

    def begin_with(self, kept: KeptVideo | None) -> None:
        """Show the video that a project keeps, if it is still there."""
        if kept is None or not kept.path:
            self.show_video(None)
            return
        try:
            self.show_video(ReferenceVideo(Path(kept.path)))
        except SkelgenError as error:
            self.show_video(None)
            self._lost = kept  # it may be there again next time
            self.picture.show_picture(None, str(error))
            return
        self.offset.setValue(kept.offset)
        if kept.rate > 0:
            self.rate.setValue(kept.rate)

    def show_video(self, video: ReferenceVideo | None) -> None:
        """Show another video, from the beginning of the recording on; None shows none."""
        self._deriver.forget()
        self._deriver.wait()
        if self._video is not None:
            self._video.close()
        self._video, self._shown, self._lost = video, None, None
        for widget in (self.offset, self.rate, self.remove):
            widget.setEnabled(video is not None)
        self.offset.setValue(0.0)
        self.rate.setValue(25.0 if video is None else video.rate)
        self.picture.show_picture(None, self.tr("Choose a video that was filmed beside the recording"))
        self._follow()

    def _choose(self) -> None:
        kinds = self.tr("Videos (*.mp4 *.mov *.avi *.mkv *.m4v *.webm);;All files (*)")
        name, _ = QFileDialog.getOpenFileName(self, self.tr("Video"), "", kinds)
        if name:
            try:
                self.show_video(ReferenceVideo(Path(name)))
            except SkelgenError as error:
                self._report_error(error)

    def _follow(self) -> None:
        """Ask for the picture of the frame that is shown, unless one is being decoded: then that comes first."""
        video, project = self._video, self._session.project
        self.offset.setSingleStep(1.0 / self.rate.value())
        if video is None or project is None or self._deriver.is_busy:
            return
        index = round((self._session.frame / self._session.rate + self.offset.value()) * self.rate.value())
        if index != self._shown:
            self._deriver.derive(lambda: video.picture(index), lambda picture: self._show(index, picture))

    def _show(self, index: int, picture: Image | None) -> None:
        self._shown = index
        self.picture.show_picture(picture, self.tr("The video has no picture at this time"))
        self._follow()
