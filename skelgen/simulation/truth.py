"""What is true of a simulated take, and the file that keeps it (a compressed .npz without pickled objects)."""

import dataclasses
import struct
import warnings
import zipfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from skelgen.errors import FormatError, InputError
from skelgen.files import open_regular, replacing
from skelgen.model.arrays import (
    Floats,
    Ints,
    check_fields,
    check_floats,
    check_ints,
    check_names,
    check_rate,
    set_fields,
)
from skelgen.model.skeleton import JOINT_TYPES
from skelgen.model.topology import check_forest, joint_children

_VERSION = 1
_LATER = ("soft_tissue", "hold_limbs", "hold_frames")  # files of earlier versions do not hold them
_MOST_TIMES, _FREE_MEMORY = 16, 1 << 24  # noise and motion shrink to a half; what a small file may take, in bytes
_BROKEN = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError),  # a damaged archive
    *(ValueError, TypeError, SyntaxError, TokenError, OverflowError, MemoryError),  # a damaged array in it
    KeyError,  # an archive of something else
)


@dataclass(frozen=True, eq=False)
class Truth:
    """The structure, its motion and the identity of all points of a simulated take.

    Attributes
    ----------
    marker_names : tuple of str, length n_markers
        Names of the markers.
    limb_names : tuple of str, length n_limbs
        Names of the limbs.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for the root.
    joint_kinds : tuple of str, length n_joints
        ``ball``, ``universal`` or ``hinge``; joints from the root outward, in the order of `children`.
    joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions.
    joint_axes : ndarray, shape (n_frames, n_joints, 3)
        Unit axis of a hinge, and the axis of a universal joint that is fixed in the parent, in the world; NaN for
        balls.
    positions_in_parent, positions_in_child : ndarray, shape (n_joints, 3), mm
        Each joint in the frames of its two limbs.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses of the limbs.
    marker_positions : ndarray, shape (n_frames, n_markers, 3), mm
        Where each marker is if it is rigidly fixed to its limb: without noise and soft-tissue motion, never unseen.
    soft_tissue : ndarray, shape (n_frames, n_markers, 3), mm
        Displacement of each marker by soft tissue, in the world; 0 where there is none, and in files that do not say.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point of an unlabelled take, -1 for a ghost and for what two markers merged into; empty for a
        labelled one.
    rate : float, Hz
        Frame rate.
    name : str
        Name of the take.
    hold_limbs, hold_frames : ndarray of intp, shape (n_holds, 2)
        Limbs that hold on to each other for a span beyond the tree, and its first and last frame.
    """

    marker_names: tuple[str, ...]
    limb_names: tuple[str, ...]
    limb_of_marker: Ints
    parents: Ints
    joint_kinds: tuple[str, ...]
    joint_positions: Floats
    joint_axes: Floats
    positions_in_parent: Floats
    positions_in_child: Floats
    world_from_limb: Floats
    marker_positions: Floats
    marker_of_point: Ints
    rate: float
    name: str = ""
    soft_tissue: Floats = field(default_factory=lambda: np.empty((0, 0, 3)))
    hold_limbs: Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.intp))
    hold_frames: Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.intp))

    def __post_init__(self) -> None:
        ints: dict[str, tuple[int | None, ...]] = {"parents": (None,), "limb_of_marker": (None,)}
        ints |= {"marker_of_point": (None,), "hold_limbs": (None, 2), "hold_frames": (len(self.hold_limbs), 2)}
        for name, shape in ints.items():
            object.__setattr__(self, name, check_ints(getattr(self, name), shape, name))
        n_limbs, n_markers = len(self.parents), len(self.limb_of_marker)
        n_joints = int((self.parents >= 0).sum())
        poses = check_floats(self.world_from_limb, (None, n_limbs, 4, 4), "world_from_limb", finite=True)
        n_frames = len(poses)
        set_fields(self, world_from_limb=poses)
        shapes: dict[str, tuple[int, ...]] = {"positions_in_parent": (n_joints, 3), "positions_in_child": (n_joints, 3)}
        shapes |= {"joint_positions": (n_frames, n_joints, 3), "marker_positions": (n_frames, n_markers, 3)}
        shapes["soft_tissue"] = (n_frames, n_markers, 3)
        if not len(self.soft_tissue):
            set_fields(self, soft_tissue=np.zeros((n_frames, n_markers, 3)))
        check_fields(self, shapes, finite=True)
        check_fields(self, {"joint_axes": (n_frames, n_joints, 3)})
        markers = check_names(self.marker_names, n_markers, "marker")
        limbs = check_names(self.limb_names, n_limbs, "limb")
        types, rate = tuple(str(kind) for kind in self.joint_kinds), check_rate(self.rate, "the truth")
        set_fields(self, marker_names=markers, limb_names=limbs, joint_kinds=types, rate=rate)
        self._check_references(n_limbs, n_markers, n_joints)

    def _check_references(self, n_limbs: int, n_markers: int, n_joints: int) -> None:
        check_forest(self.parents)
        if (self.limb_of_marker < 0).any() or (self.limb_of_marker >= n_limbs).any():
            raise InputError("limb_of_marker names a limb that is not there")
        if (self.marker_of_point < -1).any() or (self.marker_of_point >= n_markers).any():
            raise InputError("marker_of_point names a marker that is not there")
        if (self.hold_limbs < 0).any() or (self.hold_limbs >= n_limbs).any():
            raise InputError("hold_limbs names a limb that is not there")
        if len(self.joint_kinds) != n_joints or not set(self.joint_kinds) <= set(JOINT_TYPES):
            raise InputError(f"joint_kinds must be {n_joints} of {', '.join(JOINT_TYPES)}")

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.world_from_limb)

    @property
    def n_markers(self) -> int:
        """Number of markers."""
        return len(self.limb_of_marker)

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_kinds)

    @property
    def children(self) -> Ints:
        """The child limb of each joint, from the root outward, shape (n_joints,)."""
        return joint_children(self.parents)

    @property
    def edges(self) -> Ints:
        """Parent and child limb of each joint, shape (n_joints, 2)."""
        return np.stack([self.parents[self.children], self.children], axis=1)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names such as ``chest - head``."""
        return tuple(f"{self.limb_names[parent]} - {self.limb_names[child]}" for parent, child in self.edges)


def write_truth(truth: Truth, path: Path | str) -> Path:
    """Write a truth file and return its path; the file appears whole or not at all.

    Parameters
    ----------
    truth : Truth
        What to keep.
    path : Path or str
        The file; by custom it ends with ``.truth.npz``.

    Raises
    ------
    WriteError
        If the file cannot be written.
    """
    path = Path(path)
    arrays: dict[str, Any] = {one.name: np.asarray(getattr(truth, one.name)) for one in dataclasses.fields(truth)}
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, skelgen_truth=np.array(_VERSION), **arrays)
    return path


def read_truth(path: Path | str) -> Truth:
    """Read a truth file.

    Parameters
    ----------
    path : Path or str
        A file written by `write_truth`.

    Raises
    ------
    FormatError
        If it is not a truth file, or a damaged one.
    """
    path = Path(path)
    try:
        with open_regular(path) as stream, warnings.catch_warnings(), np.load(stream, allow_pickle=False) as archive:
            warnings.simplefilter("ignore")  # of headers as Python 2 wrote them
            size = sum(member.file_size for member in archive.zip.infolist())
            if size > _MOST_TIMES * path.stat().st_size + _FREE_MEMORY:
                raise FormatError(path, "", f"announces arrays of {size} bytes, far more than such a file holds")
            version = int(archive["skelgen_truth"])
            if version != _VERSION:
                what = f"a truth file of version {version} where {_VERSION} is known; update skelgen"
                raise FormatError(path, "", what)
            return _from_arrays({name: archive[name] for name in archive.files})
    except InputError as error:
        raise FormatError(path, "", f"not a consistent truth file: {error}") from error
    except _BROKEN as error:
        raise FormatError(path, "", f"not a truth file written by skelgen, or damaged ({error})") from error


def _from_arrays(arrays: dict[str, Any]) -> Truth:
    texts = {name: tuple(map(str, arrays[name])) for name in ("marker_names", "limb_names", "joint_kinds")}
    values = {entry.name: arrays[entry.name] for entry in dataclasses.fields(Truth) if entry.name not in _LATER}
    values |= {later: arrays[later] for later in _LATER if later in arrays}
    values |= texts | {"rate": float(arrays["rate"]), "name": str(arrays["name"])}
    return Truth(**values)
