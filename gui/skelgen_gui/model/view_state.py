"""What the window shows: parts of the 3-D view; and page, view, frame, forms and cameras, kept in the project file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Project
from skelgen_gui.model.viewpoint import DOWN, ShownCamera, Viewpoint

_T = TypeVar("_T")

TRAIL_SECONDS = (0.25, 0.5, 1.0, 2.0)
"""Lengths of trails to choose from [s]."""

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100)
"""How many times larger than one standard deviation ellipsoids can be drawn: of good takes these are below 1 mm."""


@dataclass(frozen=True)
class Shown:
    """The parts that are drawn.

    Attributes
    ----------
    markers, filled, names, trails : bool
        Measured markers; markers that are unseen, where the skeleton places them; names beside markers; ways that
        markers came.
    bones, joints, uncertainty, axes : bool
        Bones; joints; ellipsoids of the uncertainty of all joints, and not of the selected one alone; axes of hinges
        and of universal joints.
    floor, cameras, other : bool
        Floor grid and shadows; frustums of cameras; the second project.
    follow, four : bool
        Whether the viewer goes along with what moves; whether views from the front, the side and above are beside.
    trail_seconds : float, s
        Length of trails.
    magnification : int or None
        Half axes of the ellipsoids in standard deviations; None chooses what can be seen and does not hide the rest.
    up : int or None
        Coordinate axis that points up, 0 .. 2, or down, 3 .. 5; None leaves it to the data.
    hidden : tuple of str
        Markers that are hidden; limbs with them if all their markers are.
    """

    markers: bool = True
    filled: bool = True
    names: bool = False
    trails: bool = True
    bones: bool = True
    joints: bool = True
    uncertainty: bool = False
    axes: bool = True
    floor: bool = True
    cameras: bool = True
    other: bool = True
    follow: bool = False
    four: bool = False
    trail_seconds: float = TRAIL_SECONDS[0]
    magnification: int | None = None
    up: int | None = None
    hidden: tuple[str, ...] = ()


@dataclass(frozen=True)
class KeptVideo:
    """The reference video that a project keeps.

    Attributes
    ----------
    path : str
        Its file.
    offset : float, s
        Time of the video where the recording begins.
    rate : float, Hz
        Pictures per second as they were filmed; 0 takes what the file says.
    """

    path: str = ""
    offset: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True, eq=False)
class ViewState:
    """The state of the window.

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
    video : KeptVideo or None
        The reference video.
    viewpoint : Viewpoint or None
        Where the viewer stands; None fits the take.
    shown : Shown or None
        Which parts are drawn; None leaves them as they are.
    """

    page: str = ""
    tab: int = 0
    frame: int = 0
    forms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    cameras: tuple[ShownCamera, ...] = ()
    video: KeptVideo | None = None
    viewpoint: Viewpoint | None = None
    shown: Shown | None = None

    @classmethod
    def of(cls, project: Project) -> ViewState:
        """Return what the window showed when a project was saved."""
        view = project.view
        page, tab, frame = str(view.get("page", "")), int(view.get("tab", 0)), int(view.get("frame", 0))
        video = _kept(KeptVideo, view.get("video"))
        cameras, viewpoint = _cameras_from(view.get("cameras")), _kept(Viewpoint, view.get("viewpoint"))
        shown = _kept(Shown, view.get("shown"))
        return cls(page, tab, frame, view.get("forms", {}), cameras, video, viewpoint, shown)

    def kept_in(self, project: Project) -> Project:
        """Return a project that keeps what the window shows."""
        cameras = [
            {"pose": camera.world_from_camera.ravel().tolist(), "size": list(camera.size), "focal": list(camera.focal)}
            for camera in self.cameras
        ]
        forms = {stage: dict(values) for stage, values in self.forms.items()}
        view = {"page": self.page, "frame": self.frame, "forms": forms, "tab": self.tab, "cameras": cameras}
        for name, part in (("viewpoint", self.viewpoint), ("shown", self.shown), ("video", self.video)):
            if part is not None:
                view[name] = asdict(part)
        return replace(project, view=view)


def _kept(kind: type[_T], kept: Any) -> _T | None:
    """The value of a dataclass that a project keeps; None if it keeps none, or something else."""
    try:
        default = kind()
        values = {one.name: kept[one.name] for one in fields(default) if one.name in kept}  # type: ignore[arg-type]
        for name, value in values.items():
            before = getattr(default, name)
            if name == "hidden":
                values[name] = tuple(str(part) for part in value)
                is_right = not isinstance(value, str)
            elif isinstance(before, tuple):
                values[name] = tuple(float(part) for part in value)
                is_right = len(values[name]) == len(before) and all(map(math.isfinite, values[name]))
            elif before is None:
                is_right = value is None or type(value) is int
            else:
                is_right = type(value) is type(before) and (not isinstance(value, float) or math.isfinite(value))
            if not is_right:
                return None
        return kind(**values) if values and values.get("up") in {None, *range(2 * DOWN)} else None
    except (TypeError, ValueError, KeyError):
        return None


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
