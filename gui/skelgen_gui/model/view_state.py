"""What the window shows: parts of the 3-D view; and page, view, frame, forms and cameras, kept in the project file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Project
from skelgen_gui.model.cameras import ShownCamera

TRAIL_SECONDS = (0.25, 0.5, 1.0, 2.0)
"""Lengths of trails to choose from [s]."""

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100)
"""How many times larger than one standard deviation ellipsoids can be drawn: of good takes these are below 1 mm."""


@dataclass(frozen=True)
class Shown:
    """Which parts are drawn.

    Attributes
    ----------
    markers, filled, names, trails : bool
        Measured markers; markers that are unseen, where the skeleton places them; names beside markers; ways that
        markers came.
    bones, joints, uncertainty, axes : bool
        Bones; joints; ellipsoids of the joints' uncertainty; axes of hinges and of universal joints.
    floor, cameras, other : bool
        Floor grid and shadows; frustums of cameras; the second project.
    follow : bool
        Whether the viewer goes along with what moves.
    trail_seconds : float, s
        Length of trails.
    magnification : int or None
        Half axes of the ellipsoids in standard deviations; None chooses what can be seen and does not hide the rest.
    up : int or None
        Coordinate axis that points up, 0 .. 2, or down, 3 .. 5; None leaves it to the data.
    """

    markers: bool = True
    filled: bool = True
    names: bool = False
    trails: bool = True
    bones: bool = True
    joints: bool = True
    uncertainty: bool = True
    axes: bool = True
    floor: bool = True
    cameras: bool = True
    other: bool = True
    follow: bool = False
    trail_seconds: float = TRAIL_SECONDS[0]
    magnification: int | None = None
    up: int | None = None


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
    video : mapping of str to value
        The reference video, as its pane keeps it; empty for none.
    """

    page: str = ""
    tab: int = 0
    frame: int = 0
    forms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    cameras: tuple[ShownCamera, ...] = ()
    video: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, project: Project) -> ViewState:
        """Return what the window showed when a project was saved."""
        view = project.view
        page, tab, frame = str(view.get("page", "")), int(view.get("tab", 0)), int(view.get("frame", 0))
        video = view.get("video")
        video = video if isinstance(video, Mapping) else {}
        return cls(page, tab, frame, view.get("forms", {}), _cameras_from(view.get("cameras")), video)

    def kept_in(self, project: Project) -> Project:
        """Return a project that keeps what the window shows."""
        cameras = [
            {"pose": camera.world_from_camera.ravel().tolist(), "size": list(camera.size), "focal": list(camera.focal)}
            for camera in self.cameras
        ]
        forms = {stage: dict(values) for stage, values in self.forms.items()}
        view = {"page": self.page, "frame": self.frame, "forms": forms, "tab": self.tab, "cameras": cameras}
        return replace(project, view=view | ({"video": dict(self.video)} if self.video else {}))


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
