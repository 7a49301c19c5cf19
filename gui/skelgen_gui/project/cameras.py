"""Which cameras took the recording that is open: shown as frustums in the 3-D view, and kept in the project."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from skelgen.errors import InputError, SkelgenError
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera, StereoRig, check_pose
from skelgen_gui.model.lines import frustum
from skelgen_gui.model.viewpoint import DOWN
from skelgen_gui.project.deriving import Deriver

DEPTH = 1 / 3
"""Length of a camera's pyramid, as part of its distance to what it looks at."""

VIEW = "cameras"
"""Name of the cameras in what a project keeps of the window."""

_STEREO = "stereo"  # format of a take that was read from the settings of a capture and its images
_DISTANCE = 1000.0  # mm, to what is looked at, if nothing is seen


@dataclass(frozen=True, eq=False)
class SeeingCamera:
    """As much of a camera as is shown.

    Attributes
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Where it stands; it looks along its z, with x to the right and y down in its image.
    size, focal : tuple of float, px
        Of its image, and focal lengths.
    """

    world_from_camera: Floats
    size: tuple[float, float]
    focal: tuple[float, float]

    def lines(self, depth: float) -> Floats:
        """Return its pyramid as `frustum` gives it."""
        return frustum(self.world_from_camera, self.size, self.focal, depth)


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
        self._shown: tuple[SeeingCamera, ...] = ()
        self._known: dict[Path, StereoRig] = {}
        self._reader = Deriver(self)

    @property
    def shown(self) -> tuple[SeeingCamera, ...]:
        """The cameras that are shown."""
        return self._shown

    def remember(self, recording: Path, rig: StereoRig) -> None:
        """Note which rig a recording was made with, for when it is opened.

        Parameters
        ----------
        recording : Path
            The recorded file.
        rig : StereoRig
            The rig that recorded it.
        """
        self._known[recording.absolute()] = rig

    def begin_with(self, project: Project) -> None:
        """Show the cameras of another project: those that it keeps, or that its recording is known to be of."""
        self._show(cameras_from_view(project.view.get(VIEW)))
        if self._shown or project.source is None:
            return
        path = Path(project.source.path)
        if path in self._known:
            self.show_rig(self._known[path])
        elif project.source.format == _STEREO:
            self._reader.derive(partial(_rig_or_reason, path), self._show_if_read)

    def show_rig(self, rig: StereoRig) -> None:
        """Show the cameras of a rig."""
        self._show(cameras_of(rig))

    def choose(self) -> None:
        """Ask for the settings of a capture, and show their cameras."""
        title, kinds = self.tr("Cameras of a capture"), self.tr("Settings (*.xml)")
        name, _ = QFileDialog.getOpenFileName(self._window, title, "", kinds)
        if name:
            self._reader.derive(partial(_rig_or_reason, Path(name)), self._show_or_tell)

    def as_view(self) -> list[dict[str, Any]]:
        """Return the cameras as plain values, for the project file."""
        return [
            {"pose": camera.world_from_camera.ravel().tolist(), "size": list(camera.size), "focal": list(camera.focal)}
            for camera in self._shown
        ]

    def frustums(self, points: Floats | None) -> list[Floats]:
        """Return the pyramids of all cameras, of a length that suits the points [mm], shape (n, 3), that they see."""
        return [camera.lines(DEPTH * _distance(camera, points)) for camera in self._shown]

    @property
    def up(self) -> int | None:
        """The coordinate axis that points up, or with `DOWN` added down, as cameras that stand upright have it."""
        if not self._shown:
            return None
        down = np.mean([camera.world_from_camera[:3, 1] for camera in self._shown], axis=0)
        axis = int(np.argmax(np.abs(down)))
        return axis + DOWN if down[axis] > 0 else axis

    def _show_if_read(self, read: StereoRig | SkelgenError) -> None:
        """Show the cameras of a take; it is there even if its settings are gone, or others by now."""
        if isinstance(read, StereoRig):
            self.show_rig(read)

    def _show_or_tell(self, read: StereoRig | SkelgenError) -> None:
        if isinstance(read, StereoRig):
            self.show_rig(read)
        else:
            self._report_error(read)

    def _show(self, cameras: tuple[SeeingCamera, ...]) -> None:
        self._reader.forget()  # what is still being read is of the cameras before
        self._shown = cameras
        self.changed.emit()


def cameras_of(rig: StereoRig) -> tuple[SeeingCamera, ...]:
    """Return both cameras of a rig."""
    return tuple(_seeing(camera) for camera in (rig.left, rig.right))


def cameras_from_view(kept: Any) -> tuple[SeeingCamera, ...]:
    """Return the cameras that a project keeps; none if it keeps none, or something that is no camera."""
    try:
        return tuple(_camera_from(entry) for entry in kept or ())
    except (InputError, KeyError, TypeError, ValueError):
        return ()


def _camera_from(entry: Any) -> SeeingCamera:
    pose = check_pose(np.array(entry["pose"], dtype=np.float64).reshape(4, 4), "the pose of a camera")
    (width, height), (across, down) = entry["size"], entry["focal"]
    numbers = float(width), float(height), float(across), float(down)
    if not all(0 < number < np.inf for number in numbers):
        raise InputError("a camera needs sizes and focal lengths above 0")
    return SeeingCamera(pose, numbers[:2], numbers[2:])


def _seeing(camera: Camera) -> SeeingCamera:
    pose = np.asarray(np.linalg.inv(camera.camera_from_world), dtype=np.float64)
    focal = float(camera.matrix[0, 0]), float(camera.matrix[1, 1])
    return SeeingCamera(pose, (float(camera.width), float(camera.height)), focal)


def _distance(camera: SeeingCamera, points: Floats | None) -> float:
    if points is None:
        return _DISTANCE
    known = points[np.isfinite(points).all(axis=-1)]
    if not len(known):
        return _DISTANCE
    return float(np.median(np.linalg.norm(known - camera.world_from_camera[:3, 3], axis=1)))


def _rig_or_reason(path: Path) -> StereoRig | SkelgenError:
    """The rig in the settings of a capture, or why there is none; on a thread, as lxml must be loaded first."""
    from skelgen_formats.capture_settings import read_settings  # noqa: PLC0415

    try:
        return read_settings(path).rig
    except SkelgenError as error:
        return error
