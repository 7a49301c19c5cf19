"""The cameras that took the open recording."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget
from skelgen_formats.capture_settings import read_any_settings

from skelgen.model import Project
from skelgen.model.rig import CameraRig, StereoRig
from skelgen_gui.model.viewpoint import ShownCamera, cameras_of
from skelgen_gui.project.deriving import Deriver

_STEREO = "stereo"  # format of a take that was read from the settings of a capture and its images


class Cameras(QObject):
    """The cameras of the recording that is open.

    Signals
    -------
    changed()
        Others, or none.

    Parameters
    ----------
    report_error : callable (error)
        Shows what went wrong.
    window : QWidget
        Parent of the dialog.
    """

    changed = Signal()

    def __init__(self, report_error: Callable[[Exception], None], window: QWidget) -> None:
        super().__init__(window)
        self._report_error, self._window = report_error, window
        self._shown: tuple[ShownCamera, ...] = ()
        self._folder = ""
        self._known: dict[Path, StereoRig | CameraRig] = {}
        self._reader = Deriver(self)

    @property
    def shown(self) -> tuple[ShownCamera, ...]:
        """The cameras that are shown."""
        return self._shown

    def remember(self, recording: Path, rig: StereoRig | CameraRig) -> None:
        """Note which rig a recording was made with, for when it is opened.

        Parameters
        ----------
        recording : Path
            The recorded file.
        rig : StereoRig or CameraRig
            The cameras that recorded it.
        """
        self._known[recording.absolute()] = rig

    def begin_with(self, project: Project, cameras: tuple[ShownCamera, ...]) -> None:
        """Show the cameras of another project.

        Parameters
        ----------
        project : Project
            If it keeps no cameras, those of its recording are shown, where they are known.
        cameras : tuple of ShownCamera
            The cameras that it keeps.
        """
        self._show(cameras)
        self._folder = "" if project.source is None else str(Path(project.source.path).parent)
        if self._shown or project.source is None:
            return
        path = Path(project.source.path)
        if path in self._known:
            self.show_rig(self._known[path])
        elif project.source.format == _STEREO:
            self._reader.derive(partial(_rig_in, path), self.show_rig, lambda _: None)  # the take is there all the same

    def show_rig(self, rig: StereoRig | CameraRig) -> None:
        """Show the cameras of a rig."""
        self._show(cameras_of(rig))

    def choose(self) -> None:
        """Ask for the settings of a capture, and show their cameras."""
        title, kinds = self.tr("Cameras of a capture"), self.tr("Settings (*.xml)")
        name, _ = QFileDialog.getOpenFileName(self._window, title, self._folder, kinds)
        if name:
            self._reader.derive(partial(_rig_in, Path(name)), self.show_rig, self._report_error)

    def _show(self, cameras: tuple[ShownCamera, ...]) -> None:
        self._reader.forget()  # what is still being read is of the cameras before
        self._shown = cameras
        self.changed.emit()


def _rig_in(path: Path) -> StereoRig | CameraRig:
    """The rig in the settings of a capture; on a thread, as lxml is loaded."""
    return read_any_settings(path).rig
