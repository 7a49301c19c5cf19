"""Takes as they are read: unlabelled points, labelled markers, bodies with orientation, or animated bones."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from skelgen.errors import InputError
from skelgen.model.arrays import (
    Bools,
    Floats,
    Ints,
    as_floats,
    check_floats,
    check_ints,
    check_names,
    check_rate,
    displayable,
    set_fields,
)
from skelgen.model.rates import rate_of
from skelgen.progress import counted

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Units of length that arrays may be in, in mm."""

_SMALLEST_SPREAD, _LARGEST_SPREAD = 10.0, 1e5  # mm: markers of a take lie farther apart, and nearer together
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
        set_fields(self, points=points, frame_starts=starts, times=times)
        set_fields(
            self, attributes=MappingProxyType(attributes), notices=tuple(self.notices), name=displayable(self.name)
        )

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

    @cached_property
    def rate(self) -> float:
        """Frame rate [Hz] that the time stamps tell; see `skelgen.model.rates.rate_of`."""
        return rate_of(self.times)

    def frame(self, index: int) -> Floats:
        """Points of one frame [mm], shape (n, 3)."""
        return self.points[self.frame_starts[index] : self.frame_starts[index + 1]]

    def __iter__(self) -> Iterator[Floats]:
        return (self.frame(index) for index in range(self.n_frames))


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Labelled markers over time.

    A take without frames, as an empty file or an empty selection gives, is a value too; `from_array`, which makes takes
    of what a user has, and the stages refuse it.

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
    origin : str
        Path of the file that it was read from; what else a C3D file holds is written back from there.
    are_keypoints : bool
        Whether the points sit on joints, as pose estimation gives them, and not on limbs, as markers do.
    are_all_wanted : bool
        Whether the user asked for all points, those that a model computed, too: none is left out by its name.
    """

    positions: Floats
    names: tuple[str, ...]
    rate: float
    name: str = ""
    notices: tuple[str, ...] = ()
    origin: str = field(default="", metadata={"is_stored": False})
    are_keypoints: bool = False
    are_all_wanted: bool = False

    def __post_init__(self) -> None:
        positions = check_floats(self.positions, (None, None, 3), "positions")
        unseen = np.isnan(positions)
        half_seen: Bools = np.asarray(unseen.any(axis=2) & ~unseen.all(axis=2))
        if half_seen.any():
            positions = np.where(half_seen[..., np.newaxis], np.nan, positions)
            positions.flags.writeable = False
        names, rate = check_names(self.names, positions.shape[1], "marker"), check_rate(self.rate, "the take")
        set_fields(
            self, positions=positions, names=names, rate=rate, notices=tuple(self.notices), name=displayable(self.name)
        )

    @classmethod
    def from_array(
        cls,
        positions: ArrayLike,
        rate: float,
        unit: str = "mm",
        *,
        names: Sequence[str] | None = None,
        name: str = "",
        zeros_are_gaps: bool = True,
    ) -> Trajectories:
        """Make labelled markers from an array, with checks for what is often wrong in one.

        Whatever is changed or looks odd is a notice of the result, and a `UserWarning`.

        Parameters
        ----------
        positions : array_like, shape (n_frames, n_markers, 3), in `unit`
            NaN or masked where a marker is unseen.
        rate : float, Hz
            Frame rate.
        unit : str
            ``mm``, ``cm``, ``m`` or ``inch``.
        names : sequence of str, optional
            Distinct labels; ``M1``, ``M2``, ... if not given.
        name : str
            Name of the take.
        zeros_are_gaps : bool
            Take positions that are exactly (0, 0, 0) as unseen, as many programs write them.

        Raises
        ------
        InputError
            If the array holds no frame, no marker, another shape or anything but real numbers that are finite or NaN,
            the unit is unknown, or names or rate are wrong.

        Examples
        --------
        >>> take = Trajectories.from_array(np.ones((100, 2, 3)), 100.0, "m", names=("knee", "ankle"))
        >>> take.positions[0, 0].tolist(), take.names
        ([1000.0, 1000.0, 1000.0], ('knee', 'ankle'))
        """
        if unit not in UNITS:
            raise InputError(f"there is no unit {unit!r}; units are {', '.join(UNITS)}")
        array = as_floats(positions, "positions", "the shape (n_frames, n_markers, 3)")
        if array.ndim != 3 or array.shape[2] != 3:
            raise InputError(
                f"positions has shape {array.shape}; it must be (n_frames, n_markers, 3), so reshape it first, e.g. "
                "positions.reshape(n_frames, n_markers, 3) where a row holds x, y, z of one marker after the other"
            )
        for count, what in zip(array.shape, ("frame", "marker"), strict=False):
            if count == 0:
                raise InputError(f"positions has shape {array.shape}, that is no {what}; it must hold one at least")
        array = check_floats(array, array.shape, "positions") * UNITS[unit]
        notices = []
        zeros: Bools = np.asarray((array == 0.0).all(axis=2))
        if zeros_are_gaps and zeros.any():
            array[zeros] = np.nan
            one = "position is exactly (0, 0, 0) and was taken as a gap"
            several = "positions are exactly (0, 0, 0) and were taken as gaps"
            notices.append(counted(int(zeros.sum()), one, several))
        notices += [*_odd_size(array, unit)]
        for notice in notices:
            warnings.warn(notice, stacklevel=2)
        labels = tuple(f"M{index + 1}" for index in range(array.shape[1])) if names is None else names
        return cls(array, check_names(labels, array.shape[1], "marker"), rate, name, tuple(notices))

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
        with np.errstate(all="ignore"):  # in matrices of any numbers
            off = np.abs(rotations @ rotations.swapaxes(1, 2) - np.eye(3)).max(initial=0.0)
            mirrored = bool((np.linalg.det(rotations) < 0).any())
        if not off <= _ROTATION_TOLERANCE or mirrored:
            raise InputError("a pose holds a matrix that is not a proper rotation")
        if unseen.any():
            transforms = np.where(unseen[..., np.newaxis, np.newaxis], np.nan, transforms)
            transforms.flags.writeable = False
        names, rate = check_names(self.names, transforms.shape[1], "body"), check_rate(self.rate, "the take")
        set_fields(
            self,
            world_from_body=transforms,
            names=names,
            rate=rate,
            notices=tuple(self.notices),
            name=displayable(self.name),
        )

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return int(self.world_from_body.shape[0])

    @property
    def n_bodies(self) -> int:
        """Number of bodies."""
        return int(self.world_from_body.shape[1])


@dataclass(frozen=True, eq=False)
class BoneMotion:
    """A tree of bones and where each is in its parent in every frame; no markers, no types of joints.

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
        parents = check_ints(self.parents, (None,), "parents")
        n_bones = len(parents)
        if n_bones == 0:
            raise InputError("a motion needs at least one bone")
        names = check_names(self.names, n_bones, "bone")
        if (parents >= np.arange(n_bones)).any() or (parents < -1).any():
            raise InputError("the parent of each bone must stand before it")
        rotations = check_floats(self.rotations, (None, n_bones, 3, 3), "rotations", finite=True)
        if len(rotations) == 0:
            raise InputError("a motion needs at least one frame")
        places = check_floats(self.places, (len(rotations), n_bones, 3), "places", finite=True)
        if len(self.tips) != n_bones:
            raise InputError(f"tips of {len(self.tips)} bones where {n_bones} belong")
        tips = tuple(check_floats(tips, (None, 3), "tips of a bone", finite=True) for tips in self.tips)
        rate = check_rate(self.rate, "the motion")
        set_fields(self, names=names, parents=parents, rotations=rotations, places=places, tips=tips, rate=rate)
        set_fields(self, name=displayable(self.name))

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


Take = PointCloud | Trajectories | Poses


def _odd_size(positions: Floats, unit: str) -> Iterator[str]:
    """Say if the markers of a typical frame lie too near together or too far apart for their unit."""
    seen = positions[~np.isnan(positions).all(axis=(1, 2))]
    if not len(seen) or positions.shape[1] < 2:
        return
    spread = float(np.median(np.linalg.norm(np.nanmax(seen, axis=1) - np.nanmin(seen, axis=1), axis=1)))
    if spread < _SMALLEST_SPREAD and unit != "m":
        yield f"the markers of a frame span {spread:.3g} mm; if the array is in metres, give unit='m'"
    if spread > _LARGEST_SPREAD and unit != "mm":
        yield f"the markers of a frame span {spread / 1000:.3g} m; if the array is in millimetres, give unit='mm'"
