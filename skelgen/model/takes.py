"""Takes as they are read: unlabelled points, labelled markers, or bodies with orientation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints, check_floats, check_ints, check_names, check_rate

_ROTATION_TOLERANCE = 1e-6  # of R R^T = 1: double rounding is 1e-15, a file with 7 digits gives 1e-7


@dataclass(frozen=True, eq=False)
class PointCloud:
    """An unlabelled capture: in each frame some points, in no particular order.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        All points, frame after frame.
    frame_starts : ndarray of intp, shape (n_frames + 1,)
        Points of frame f are ``points[frame_starts[f]:frame_starts[f + 1]]``.
    times : ndarray, shape (n_frames,), s
        Time stamps, never falling.
    attributes : mapping of str to ndarray, shape (n_points,)
        What the file says of each point, e.g. ``reprojection_error`` [mm], ``n_blobs``, ``id``.
    name : str
        Where it comes from, usually the file's name.
    notices : tuple of str
        What the reader did that the user should know.
    """

    points: Floats
    frame_starts: Ints
    times: Floats
    attributes: Mapping[str, Floats] = field(default_factory=dict)
    name: str = ""
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        points = check_floats(self.points, (None, 3), "points", finite=True)
        starts = check_ints(self.frame_starts, (None,), "frame_starts")
        if len(starts) == 0 or starts[0] != 0 or starts[-1] != len(points) or (np.diff(starts) < 0).any():
            raise InputError(f"frame_starts must rise from 0 to the number of points, {len(points)}")
        times = check_floats(self.times, (len(starts) - 1,), "times", finite=True)
        if (np.diff(times) < 0).any():
            raise InputError(f"time stamps go back at frame {int(np.argmax(np.diff(times) < 0)) + 1}")
        attributes = {key: check_floats(value, (len(points),), key) for key, value in self.attributes.items()}
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "frame_starts", starts)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "attributes", MappingProxyType(attributes))
        object.__setattr__(self, "notices", tuple(self.notices))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.times)

    @property
    def n_points(self) -> int:
        """Number of points in all frames together."""
        return len(self.points)

    @property
    def points_per_frame(self) -> Ints:
        """Number of points in each frame, shape (n_frames,)."""
        return np.diff(self.frame_starts)

    @property
    def rate(self) -> float:
        """Frame rate [Hz] from the median step of the time stamps; 1 if they do not rise."""
        steps = np.diff(self.times)
        rising = steps[steps > 0]
        return 1.0 / float(np.median(rising)) if len(rising) else 1.0

    def frame(self, index: int) -> Floats:
        """Points of one frame [mm], shape (n, 3)."""
        return self.points[self.frame_starts[index] : self.frame_starts[index + 1]]

    def __iter__(self) -> Iterator[Floats]:
        return (self.frame(index) for index in range(self.n_frames))


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Labelled markers over time.

    Attributes
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where a marker is unseen; all three coordinates of a marker are NaN together.
    names : tuple of str, length n_markers
        Distinct labels.
    rate : float, Hz
        Frame rate.
    name : str
        Where it comes from, usually the file's name.
    notices : tuple of str
        What the reader or the labelling did that the user should know.
    """

    positions: Floats
    names: tuple[str, ...]
    rate: float
    name: str = ""
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        positions = check_floats(self.positions, (None, None, 3), "positions")
        unseen = np.isnan(positions)
        half_seen: Bools = np.asarray(unseen.any(axis=2) & ~unseen.all(axis=2))
        if half_seen.any():
            positions = np.where(half_seen[..., np.newaxis], np.nan, positions)
            positions.flags.writeable = False
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "names", check_names(self.names, positions.shape[1], "marker"))
        object.__setattr__(self, "rate", check_rate(self.rate, "the take"))
        object.__setattr__(self, "notices", tuple(self.notices))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.positions.shape[0])

    @property
    def n_markers(self) -> int:
        """Number of markers."""
        return int(self.positions.shape[1])

    @property
    def times(self) -> Floats:
        """Time of each frame [s] from the first, shape (n_frames,)."""
        return np.arange(self.n_frames) / self.rate

    @property
    def seen(self) -> Bools:
        """Whether each marker is seen in each frame, shape (n_frames, n_markers)."""
        return ~np.isnan(self.positions[:, :, 0])


@dataclass(frozen=True, eq=False)
class Poses:
    """Bodies with position and orientation over time, as magnetic sensors or rigid-body trackers give.

    Attributes
    ----------
    world_from_body : ndarray, shape (n_frames, n_bodies, 4, 4), translations in mm
        Proper rigid transforms; NaN where a body is unseen.
    names : tuple of str, length n_bodies
        Distinct names.
    rate : float, Hz
        Frame rate.
    name : str
        Where it comes from, usually the file's name.
    notices : tuple of str
        What the reader did that the user should know.
    """

    world_from_body: Floats
    names: tuple[str, ...]
    rate: float
    name: str = ""
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        transforms = check_floats(self.world_from_body, (None, None, 4, 4), "world_from_body")
        unseen: Bools = np.asarray(np.isnan(transforms).any(axis=(2, 3)))
        seen = transforms[~unseen]
        rotations = seen[:, :3, :3]
        off = np.abs(rotations @ rotations.swapaxes(1, 2) - np.eye(3)).max(initial=0.0)
        mirrored = bool((np.linalg.det(rotations) < 0).any()) if len(seen) else False
        if off > _ROTATION_TOLERANCE or mirrored:
            raise InputError("a pose holds a matrix that is not a proper rotation")
        if unseen.any():
            transforms = np.where(unseen[..., np.newaxis, np.newaxis], np.nan, transforms)
            transforms.flags.writeable = False
        object.__setattr__(self, "world_from_body", transforms)
        object.__setattr__(self, "names", check_names(self.names, transforms.shape[1], "body"))
        object.__setattr__(self, "rate", check_rate(self.rate, "the take"))
        object.__setattr__(self, "notices", tuple(self.notices))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.world_from_body.shape[0])

    @property
    def n_bodies(self) -> int:
        """Number of bodies."""
        return int(self.world_from_body.shape[1])


Take = PointCloud | Trajectories | Poses


@dataclass(frozen=True, eq=False)
class BoneMotion:
    """A tree of bones and where each is in its parent in every frame; no markers, no kinds of joints.

    Attributes
    ----------
    names : tuple of str, length n_bones
        Names of the bones.
    parents : ndarray of intp, shape (n_bones,)
        Parent of each bone, which stands before it; -1 for roots, which are placed in the world.
    rotations : ndarray, shape (n_frames, n_bones, 3, 3)
        Parent from bone.
    places : ndarray, shape (n_frames, n_bones, 3), mm
        Each bone's origin in its parent's frame; the same in all frames unless the bone slides.
    tips : tuple of ndarray, length n_bones, shape (n_tips, 3), mm
        Where a bone ends in its own frame, besides the origins of its children.
    rate : float, Hz
        Frame rate.
    name : str
        Name of the motion.
    notices : tuple of str
        What the reader did that the user should know.
    """

    names: tuple[str, ...]
    parents: Ints
    rotations: Floats
    places: Floats
    tips: tuple[Floats, ...]
    rate: float
    name: str = ""
    notices: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "parents", check_ints(self.parents, (None,), "parents"))
        n_bones = len(self.parents)
        if n_bones == 0:
            raise InputError("a motion needs at least one bone")
        object.__setattr__(self, "names", check_names(self.names, n_bones, "bone"))
        if (self.parents >= np.arange(n_bones)).any() or (self.parents < -1).any():
            raise InputError("the parent of each bone must stand before it")
        rotations = check_floats(self.rotations, (None, n_bones, 3, 3), "rotations", finite=True)
        if len(rotations) == 0:
            raise InputError("a motion needs at least one frame")
        object.__setattr__(self, "rotations", rotations)
        places = check_floats(self.places, (len(rotations), n_bones, 3), "places", finite=True)
        object.__setattr__(self, "places", places)
        if len(self.tips) != n_bones:
            raise InputError(f"tips of {len(self.tips)} bones where {n_bones} belong")
        tips = (check_floats(tips, (None, 3), "tips of a bone", finite=True) for tips in self.tips)
        object.__setattr__(self, "tips", tuple(tips))
        object.__setattr__(self, "rate", check_rate(self.rate, "the motion"))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.rotations)

    @property
    def n_bones(self) -> int:
        """Number of bones."""
        return len(self.parents)

    @property
    def world_from_bone(self) -> Floats:
        """Poses of all bones, shape (n_frames, n_bones, 4, 4), translations in mm."""
        poses = np.zeros((self.n_frames, self.n_bones, 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = self.rotations, self.places, 1.0
        for bone, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                poses[:, bone] = poses[:, parent] @ poses[:, bone]
        return poses
