"""What the window shows beside the results of a project; kept in the project file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Project
from skelgen_gui.model.cameras import ShownCamera


@dataclass(frozen=True, eq=False)
class ViewState:
    """What the window shows.

    Attributes
    ----------
    page : str
        Key of the page.
    tab, frame : int
        Index of the view in the middle, and the frame.
    forms : mapping of str to mapping of str to value
        Parameters that were entered, by stage and name.
    cameras : tuple of ShownCamera
        Cameras in the 3-D view.
    """

    page: str = ""
    tab: int = 0
    frame: int = 0
    forms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    cameras: tuple[ShownCamera, ...] = ()

    @classmethod
    def of(cls, project: Project) -> ViewState:
        """Return what the window showed when a project was saved."""
        view = project.view
        page, tab, frame = str(view.get("page", "")), int(view.get("tab", 0)), int(view.get("frame", 0))
        return cls(page, tab, frame, view.get("forms", {}), _cameras_from(view.get("cameras")))

    def kept_in(self, project: Project) -> Project:
        """Return a project that keeps what the window shows."""
        cameras = [
            {"pose": camera.world_from_camera.ravel().tolist(), "size": list(camera.size), "focal": list(camera.focal)}
            for camera in self.cameras
        ]
        forms = {stage: dict(values) for stage, values in self.forms.items()}
        return replace(
            project, view={"page": self.page, "frame": self.frame, "forms": forms, "tab": self.tab, "cameras": cameras}
        )


def _cameras_from(kept: Any) -> tuple[ShownCamera, ...]:
    """Cameras that a project keeps; none if it keeps none, or something that is no camera."""
    try:
        return tuple(_camera_from(entry) for entry in kept or ())
    except (InputError, KeyError, TypeError, ValueError):
        return ()


def _camera_from(entry: Mapping[str, Any]) -> ShownCamera:
    pose = np.array(entry["pose"], dtype=np.float64).reshape(4, 4)
    (width, height), (across, down) = entry["size"], entry["focal"]
    return ShownCamera(pose, (float(width), float(height)), (float(across), float(down)))
