"""Cameras that look at the same balls, the rigid targets that carry the balls, and the joints between targets.

A camera is a pinhole with the distortion of Brown (1966) in OpenCV's order. Pixel (0, 0) has its centre at (0.0, 0.0);
x points right and y down in the image; a camera looks along its own +z. The world is the left camera's frame unless a
rig says otherwise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Self

import numpy as np

from skelgen import parameters
from skelgen.errors import InputError
from skelgen.model.arrays import Floats, check_coordinates, check_fields, check_floats, check_names, set_fields

ParameterValue = parameters.ParameterValue

N_DISTORTION = 5
TYPICAL_NOISE = 0.1
"""Standard deviation [px] of a ball's centre along one axis, calibration included (Gaschler 2011, chapter 6.1)."""

JOINT_TYPES = ("ball", "hinge")

N_CAMERA_STD = 4 + N_DISTORTION + 6
"""Numbers of a camera that a calibration measures: fx, fy, cx, cy, the lens, its turn and its shift against the first
camera, about and along its own axes."""

_ROTATION_TOLERANCE = 1e-6  # of R R^T = 1: a file with 7 digits gives 1e-7


@dataclass(frozen=True, eq=False)
class Camera:
    """One calibrated camera.

    Attributes
    ----------
    width, height : int, px
        Size of its images.
    matrix : ndarray, shape (3, 3), px
        Focal lengths and principal point, last row 0 0 1.
    distortion : ndarray, shape (5,)
        k1, k2, p1, p2, k3; zeros for a lens without distortion.
    camera_from_world : ndarray, shape (4, 4), translation in mm
        Where the camera stands.
    name : str
        For people: ``left``, a serial number.
    """

    width: int
    height: int
    matrix: Floats
    distortion: Floats = field(default_factory=lambda: np.zeros(N_DISTORTION))
    camera_from_world: Floats = field(default_factory=lambda: np.eye(4))
    name: str = ""

    def __post_init__(self) -> None:
        what = f"camera {self.name}".strip()
        if self.width < 1 or self.height < 1:
            raise InputError(f"{what} has images of {self.width} x {self.height} pixels; both must be at least 1")
        check_fields(self, {"matrix": (3, 3), "distortion": (N_DISTORTION,)}, f"{{}} of {what}", finite=True)
        if min(self.matrix[0, 0], self.matrix[1, 1]) <= 0 or (self.matrix[2] != (0, 0, 1)).any():
            raise InputError(f"the matrix of {what} needs focal lengths above 0 and 0 0 1 as its last row")
        set_fields(self, camera_from_world=check_pose(self.camera_from_world, f"camera_from_world of {what}"))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.width, self.height


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Two cameras calibrated together.

    Attributes
    ----------
    left, right : Camera
        Both placed in one world.
    noise : float, px
        Standard deviation of a ball's centre along one axis of an image, calibration included.
    covariance : ndarray, shape (30, 30), optional
        Of the numbers of both cameras (`N_CAMERA_STD` of each), by their calibration; None if unknown.
    """

    left: Camera
    right: Camera
    noise: float = TYPICAL_NOISE
    covariance: Floats | None = None

    def __post_init__(self) -> None:
        _check_noise(self.noise)
        if self.covariance is not None:
            n_numbers = 2 * N_CAMERA_STD
            covariance = check_floats(self.covariance, (n_numbers, n_numbers), "covariance of the rig", finite=True)
            if (np.diag(covariance) < 0).any():
                raise InputError("the covariance of the rig has a variance below 0")
            set_fields(self, covariance=covariance)
        if self.baseline == 0.0:
            raise InputError("both cameras stand at one place, so that no depth can be seen; calibrate the rig again")

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        """The left and the right one."""
        return self.left, self.right

    @property
    def names(self) -> tuple[str, str]:
        """What the cameras are called."""
        return "the left camera", "the right camera"

    @cached_property
    def right_from_left(self) -> Floats:
        """Pose of the left camera's frame in the right one's, shape (4, 4)."""
        return np.asarray(self.right.camera_from_world @ np.linalg.inv(self.left.camera_from_world))

    @property
    def baseline(self) -> float:
        """Distance [mm] between the cameras."""
        return float(np.linalg.norm(self.right_from_left[:3, 3]))


CAMERAS_OF_A_ROOM = (2, 16)
"""Fewest and most cameras around a room."""


@dataclass(frozen=True, eq=False)
class CameraRig:
    """Cameras around a room, calibrated together.

    Attributes
    ----------
    cameras : tuple of Camera
        Two to sixteen, placed in one world; their names differ.
    noise : float, px
        Standard deviation of a ball's centre along one axis of an image, calibration included.
    std : ndarray, shape (n_cameras, 15)
        Standard deviations of each camera's fx, fy, cx, cy [px], k1, k2, p1, p2, k3, of its turn about its own axes
        [rad] and of its place along them [mm], against the first camera; zeros where taken as exact.
    """

    cameras: Sequence[Camera]
    noise: float = TYPICAL_NOISE
    std: Floats | None = None

    def __post_init__(self) -> None:
        n_cameras, (fewest, most) = len(self.cameras), CAMERAS_OF_A_ROOM
        if not fewest <= n_cameras <= most:
            raise InputError(f"the rig has {n_cameras} cameras; it needs {fewest} to {most}")
        check_names([camera.name for camera in self.cameras], n_cameras, "camera")
        _check_noise(self.noise)
        std = np.zeros((n_cameras, N_CAMERA_STD)) if self.std is None else self.std
        std = check_floats(std, (n_cameras, N_CAMERA_STD), "std of the cameras", finite=True)
        if (std < 0).any():
            raise InputError("std of the cameras is below 0; a standard deviation is 0 or more")
        places = self.places
        for one, place in enumerate(places[:-1]):
            if (same := np.flatnonzero((places[one + 1 :] == place).all(axis=1))).size:
                names = self.cameras[one].name, self.cameras[one + 1 + same[0]].name
                raise InputError(f"cameras {names[0]!r} and {names[1]!r} stand at one place; calibrate the rig again")
        set_fields(self, cameras=tuple(self.cameras), std=std)

    @property
    def places(self) -> Floats:
        """Where the cameras stand in the world, shape (n_cameras, 3), mm."""
        return np.array([np.linalg.inv(camera.camera_from_world)[:3, 3] for camera in self.cameras])

    @property
    def names(self) -> tuple[str, ...]:
        """What the cameras are called."""
        return tuple(camera.name for camera in self.cameras)


def _check_noise(noise: float) -> None:
    if not np.isfinite(noise) or noise <= 0:
        raise InputError(f"the noise of the rig is {noise:g} px; it must be above 0")


@dataclass(frozen=True, eq=False)
class BodyTarget:
    """A rigid body of balls that the capture looks for.

    Attributes
    ----------
    name : str
        What it is called in the output.
    points : ndarray, shape (n_points, 3), mm
        Balls in the body's own frame.
    std : ndarray, shape (n_points, 3), mm
        Standard deviations of `points`, from the calibration; zeros where they are taken as exact.
    noise : float, px
        Standard deviation of the balls' centres in the images, as the calibration saw them; 0 if it is unknown.
    """

    name: str
    points: Floats
    std: Floats | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        check_names([self.name], 1, "target")
        points = check_floats(self.points, (None, 3), f"points of body {self.name!r}", finite=True)
        std = np.zeros_like(points) if self.std is None else self.std
        std = check_floats(std, points.shape, f"std of body {self.name!r}", finite=True)
        if not 0.0 <= self.noise < np.inf:
            raise InputError(f"the noise of body {self.name!r} is {self.noise:g} px; it must be 0 or more")
        set_fields(self, points=points, std=std)


@dataclass(frozen=True, eq=False)
class TargetJoint:
    """A joint between two targets; a hinge turns about the z axis of the joint's frames.

    Attributes
    ----------
    name : str
        What it is called in the output.
    kind : str
        ``ball`` or ``hinge``.
    parent, child : str
        Names of the two bodies.
    parent_from_joint, child_from_joint : ndarray, shape (4, 4), translations in mm
        The joint's frame in both bodies; they coincide in the world when all angles are zero.
    std : ndarray, shape (2, 3), mm
        Standard deviations of the joint's place in the parent, then in the child; zeros where taken as exact.
    axis_std : ndarray, shape (2,), rad
        Standard deviation of a tilt of a hinge's axis in the parent, then in the child; zeros for a ball.
    """

    name: str
    kind: str
    parent: str
    child: str
    parent_from_joint: Floats
    child_from_joint: Floats
    std: Floats = field(default_factory=lambda: np.zeros((2, 3)))
    axis_std: Floats = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        check_names([self.name], 1, "joint")
        if self.kind not in JOINT_TYPES:
            types = ", ".join(JOINT_TYPES)
            raise InputError(f"joint {self.name!r} is of type {self.kind!r}; it must be one of {types}")
        if self.parent == self.child:
            raise InputError(f"joint {self.name!r} connects body {self.parent!r} with itself")
        for frame in ("parent_from_joint", "child_from_joint"):
            set_fields(self, **{frame: check_pose(getattr(self, frame), f"{frame} of joint {self.name!r}")})
        check_fields(self, {"std": (2, 3), "axis_std": (2,)}, f"{{}} of joint {self.name!r}", finite=True)


@dataclass(frozen=True, eq=False)
class _Settings:
    """Settings of a capture, as one settings file holds them.

    Attributes
    ----------
    rig : StereoRig or CameraRig
        The cameras.
    bodies : tuple of BodyTarget
        Bodies to look for; their names differ.
    joints : tuple of TargetJoint
        Joints between those bodies; their names differ.
    source : str
        Where frames come from, e.g. ``firewire:``; empty if it is stated elsewhere.
    detection, search : mapping of str to number, bool or str
        Parameters of the detection of balls and of the search for bodies that differ from their defaults.
    """

    rig: StereoRig | CameraRig
    bodies: Sequence[BodyTarget] = ()
    joints: Sequence[TargetJoint] = ()
    source: str = ""
    detection: Mapping[str, ParameterValue] = field(default_factory=dict)
    search: Mapping[str, ParameterValue] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_targets(self.bodies, self.joints)
        detection, search = (MappingProxyType(dict(values)) for values in (self.detection, self.search))
        set_fields(self, bodies=tuple(self.bodies), joints=tuple(self.joints), detection=detection, search=search)

    def with_rig(self, rig: StereoRig | CameraRig) -> Self:
        """Return the settings with other cameras, or with the same ones calibrated anew."""
        return replace(self, rig=rig)


@dataclass(frozen=True, eq=False)
class CaptureSettings(_Settings):
    """Settings of a stereo capture."""

    rig: StereoRig


@dataclass(frozen=True, eq=False)
class RoomSettings(_Settings):
    """Settings of a capture by the cameras of a room."""

    rig: CameraRig


AnySettings = CaptureSettings | RoomSettings
"""Settings of two cameras, or of those of a room."""


def _check_targets(bodies: Sequence[BodyTarget], joints: Sequence[TargetJoint]) -> None:
    """Check that names differ, and that joints are between bodies that are there."""
    names = check_names([body.name for body in bodies], len(bodies), "target")
    check_names([joint.name for joint in joints], len(joints), "joint")
    for joint in joints:
        for body in (joint.parent, joint.child):
            if body not in names:
                known = ", ".join(names) or "none"
                raise InputError(f"joint {joint.name!r} names body {body!r}, which is not there (there are: {known})")


def check_pose(pose: Floats, what: str) -> Floats:
    """Return a read-only rigid transform.

    Parameters
    ----------
    pose : ndarray, shape (4, 4), translation in mm
        The transform.
    what : str
        What it is, for errors.

    Raises
    ------
    InputError
        If it is no rotation with a translation, or this is impossibly far.
    """
    clean = check_floats(pose, (4, 4), what, finite=True)
    turn = clean[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        wrong = not np.abs(turn @ turn.T - np.eye(3)).max() <= _ROTATION_TOLERANCE or np.linalg.det(turn) < 0
    if wrong or (clean[3] != (0, 0, 0, 1)).any():
        raise InputError(f"{what} is not a rotation with a translation")
    check_coordinates(clean[:3, 3], what)
    return clean
