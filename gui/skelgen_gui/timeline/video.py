"""A reference video beside the views: the picture of the frame that is shown, aligned by an offset in time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QDoubleSpinBox, QFileDialog, QLabel, QPushButton, QWidget

from skelgen.capture.sources.video import ReferenceVideo
from skelgen.capture.values import Image
from skelgen.errors import SkelgenError
from skelgen_gui.model.view_state import KeptVideo
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.fields import set_up_number
from skelgen_gui.widgets.layouts import column, put_texts, row_of
from skelgen_gui.widgets.painting import paint_words

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
