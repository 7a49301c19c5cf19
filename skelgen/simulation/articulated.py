"""An articulated structure as a value: rigid limbs in a tree, with markers on them and joints between them.

At rest all limb frames have the orientation of the world (x forward, y left, z up). The origin of a limb's frame is the
joint to its parent, so that a joint's position in the child's frame is always zero.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skelgen.errors import InputError
from skelgen.geometry.rotations import frame_along, unit_vectors
from skelgen.model.arrays import Floats, Ints, check_fields, check_names
from skelgen.model.topology import joint_children

DEGREES_OF_FREEDOM = {"free": 3, "ball": 3, "universal": 2, "hinge": 1}
"""Angles that move a limb; ``free`` is the root, which hangs on nothing."""

_UNIT_TOLERANCE = 1e-9  # of an axis that was divided by its length

MARKER_STANDOFF = 10.0
"""Distance [mm] of a marker's centre from the skin: a sphere of 14 mm on a base plate."""

_TURN_BETWEEN_MARKERS = np.deg2rad(137.5)  # the golden angle: no two markers of a limb come to lie behind each other
_FIRST_FRACTION, _LAST_FRACTION = 0.2, 0.85  # of the limb's axis: clear of the neighbouring limbs
_MIN_MARKERS, _MAX_MARKERS = 2, 5
_ROOT_AXES = np.eye(3)[::-1]  # turned one after the other: heading, pitch, roll


@dataclass(frozen=True, eq=False)
class LimbModel:
    """One rigid limb, the joint that carries it, and how far that joint is moved.

    Attributes
    ----------
    name : str
        Name, e.g. ``left thigh``.
    parent : str
        Name of the parent, empty for the root.
    kind : str
        Joint to the parent: ``ball``, ``universal`` or ``hinge``; ``free`` for the root.
    joint : ndarray, shape (3,), mm
        Place of the joint in the parent's frame; for the root its place in the world at rest.
    segment : ndarray, shape (2, 3), mm
        Ends of the limb's axis in its own frame; with `radius` the capsule that hides markers from cameras.
    radius : float, mm
        Radius of that capsule.
    markers : ndarray, shape (n, 3), mm
        Markers in the limb's frame.
    axes : ndarray, shape (n_angles, 3)
        Unit axes that the angles turn about. A hinge's axis is the same in both frames. Of a universal joint the first
        axis is fixed in the parent, the second in the child. A ball turns by the rotation vector whose components
        along the axes are the angles; the root turns about its axes one after the other.
    amplitudes, offsets : ndarray, shape (n_angles,), deg
        Each angle stays within offset ± amplitude when the limb moves at random.
    marker_names : tuple of str, length n
        Names of the markers; empty for numbers after the limb's name.
    """

    name: str
    parent: str
    kind: str
    joint: Floats
    segment: Floats
    radius: float
    markers: Floats
    axes: Floats
    amplitudes: Floats
    offsets: Floats
    marker_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in DEGREES_OF_FREEDOM:
            types = ", ".join(DEGREES_OF_FREEDOM)
            raise InputError(f"limb {self.name!r} hangs on a joint of type {self.kind!r}; types are {types}")
        n_angles = DEGREES_OF_FREEDOM[self.kind]
        shapes: dict[str, tuple[int | None, ...]] = {"joint": (3,), "segment": (2, 3), "markers": (None, 3)}
        shapes |= {"axes": (n_angles, 3), "amplitudes": (n_angles,), "offsets": (n_angles,)}
        check_fields(self, shapes, f"{{}} of limb {self.name!r}", finite=True)
        if np.abs(np.linalg.norm(self.axes, axis=1) - 1).max() > _UNIT_TOLERANCE:
            raise InputError(f"an axis of limb {self.name!r} has not the length 1")
        if self.marker_names:
            object.__setattr__(self, "marker_names", check_names(self.marker_names, len(self.markers), "marker"))


@dataclass(frozen=True, eq=False)
class Structure:
    """Limbs joined in a tree.

    Attributes
    ----------
    name : str
        What it is, e.g. ``human``.
    limbs : tuple of LimbModel
        A root, or several; parents before their children.
    """

    name: str
    limbs: tuple[LimbModel, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "limbs", tuple(self.limbs))
        names = check_names([limb.name for limb in self.limbs], len(self.limbs), "limb")
        if not names:
            raise InputError("a structure needs at least one limb")
        for index, limb in enumerate(self.limbs):
            is_root = limb.parent == ""
            if is_root != (limb.kind == "free") or (index == 0 and not is_root):
                raise InputError(
                    f"limb {limb.name!r}: limbs without a parent, and no others, must be free; so is the first"
                )
            if not is_root and limb.parent not in names[:index]:
                raise InputError(f"limb {limb.name!r}: its parent {limb.parent!r} must be listed before it")

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.limbs)

    @property
    def n_markers(self) -> int:
        """Number of markers on all limbs."""
        return len(self.limb_of_marker)

    @property
    def limb_names(self) -> tuple[str, ...]:
        """Name of each limb."""
        return tuple(limb.name for limb in self.limbs)

    @property
    def parents(self) -> Ints:
        """Parent of each limb, -1 for the root, shape (n_limbs,)."""
        index_of = {name: index for index, name in enumerate(self.limb_names)}
        return np.array([index_of.get(limb.parent, -1) for limb in self.limbs], dtype=np.intp)

    @property
    def children(self) -> Ints:
        """The child limb of each joint, from the root outward, shape (n_joints,)."""
        return joint_children(self.parents)

    @property
    def limb_of_marker(self) -> Ints:
        """Limb of each marker, shape (n_markers,)."""
        counts = [len(limb.markers) for limb in self.limbs]
        return np.repeat(np.arange(self.n_limbs, dtype=np.intp), counts)

    @property
    def marker_offsets(self) -> Floats:
        """Each marker in its limb's frame [mm], shape (n_markers, 3)."""
        return np.concatenate([limb.markers for limb in self.limbs])

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Names such as ``chest 2`` or ``LASI``."""
        numbered = [(limb, [f"{limb.name} {i + 1}" for i in range(len(limb.markers))]) for limb in self.limbs]
        return tuple(name for limb, numbers in numbered for name in limb.marker_names or numbers)


def resized(structure: Structure, scales: Mapping[str, ArrayLike]) -> Structure:
    """Return a structure in other sizes: every limb, with its markers and the joints on it, along its frame's axes.

    Parameters
    ----------
    structure : Structure
        What is resized.
    scales : mapping of str to float or array_like, shape (3,)
        Factor of each limb by name, or one along each of x, y and z.
    """
    limbs = []
    for one in structure.limbs:
        mine, above = (np.broadcast_to(_floats(scales[name]), 3) for name in (one.name, one.parent or one.name))
        joint, radius = one.joint * above, float(one.radius * np.median(mine))
        limbs.append(replace(one, joint=joint, segment=one.segment * mine, radius=radius, markers=one.markers * mine))
    return Structure(structure.name, tuple(limbs))


class Swing(NamedTuple):
    """How far a joint is moved: every angle stays within offset ± amplitude.

    Attributes
    ----------
    amplitudes : array_like, shape (n_angles,), deg
        Amplitudes.
    offsets : array_like, shape (n_angles,), deg, or None
        Middle positions; None for 0.
    axes : array_like, shape (n_angles, 3), or None
        Axes of any length; None for those of the world.
    """

    amplitudes: ArrayLike
    offsets: ArrayLike | None = None
    axes: ArrayLike | None = None


class Attachment(NamedTuple):
    """How a limb hangs on its parent.

    Attributes
    ----------
    parent : str
        Name of the parent; empty for the root.
    kind : str
        ``free`` for the root, else the type of joint.
    joint : array_like, shape (3,), mm
        The joint in the parent's frame; of the root, its place in the world.
    swing : Swing, optional
        How the joint moves; by default 35 deg about each axis of a ball, and what a walker does for a root.
    """

    parent: str
    kind: str
    joint: ArrayLike
    swing: Swing | None = None


class Capsule(NamedTuple):
    """The shape of a limb.

    Attributes
    ----------
    tip : array_like, shape (3,), mm
        End of the axis in the limb's frame.
    radius : float, mm
        Distance of the skin from the axis.
    start : array_like, shape (3,), mm
        Where the axis begins.
    """

    tip: ArrayLike
    radius: float
    start: ArrayLike = (0.0, 0.0, 0.0)


_ROOT_SWING = Swing((150.0, 12.0, 12.0), axes=_ROOT_AXES)
_BALL_SWING = Swing((35.0, 35.0, 35.0))


def limb(name: str, attachment: Attachment, capsule: Capsule, n_markers: int) -> LimbModel:
    """Build a limb whose markers wind around its axis.

    Parameters
    ----------
    name : str
        What it is called.
    attachment : Attachment
        Parent and joint.
    capsule : Capsule
        Shape.
    n_markers : int
        Number of markers.
    """
    parent, kind, joint, swing = attachment
    swing = swing or (_ROOT_SWING if kind == "free" else _BALL_SWING)
    n_angles = DEGREES_OF_FREEDOM[kind]
    segment = np.stack([_floats(capsule.start), _floats(capsule.tip)])
    distance, phase = capsule.radius + MARKER_STANDOFF, float(len(name) + len(parent))
    markers = markers_around(segment, distance, n_markers, phase)
    axes = unit_vectors(np.eye(3)[:n_angles] if swing.axes is None else swing.axes)
    amplitudes = _floats(swing.amplitudes)
    offsets = np.zeros(n_angles) if swing.offsets is None else _floats(swing.offsets)
    return LimbModel(name, parent, kind, _floats(joint), segment, capsule.radius, markers, axes, amplitudes, offsets)


def markers_around(segment: Floats, distance: float, n_markers: int, phase: float) -> Floats:
    """Place markers on a helix around an axis, so that no three of them lie on one line.

    Parameters
    ----------
    segment : ndarray, shape (2, 3), mm
        Ends of the axis.
    distance : float, mm
        Distance of the markers from the axis.
    n_markers : int
        How many, 2 to 5.
    phase : float, rad
        Where the helix starts.

    Returns
    -------
    ndarray, shape (n_markers, 3), mm
    """
    if not _MIN_MARKERS <= n_markers <= _MAX_MARKERS:
        raise InputError(f"{n_markers} markers per limb; it must be {_MIN_MARKERS} to {_MAX_MARKERS}")
    fractions = np.linspace(_FIRST_FRACTION, _LAST_FRACTION, n_markers)[:, np.newaxis]
    angles = (phase + _TURN_BETWEEN_MARKERS * np.arange(n_markers))[:, np.newaxis]
    first, second, _ = frame_along(unit_vectors(segment[1] - segment[0])).T
    on_axis = segment[0] + fractions * (segment[1] - segment[0])
    return np.asarray(on_axis + distance * (np.cos(angles) * first + np.sin(angles) * second))


def _floats(values: ArrayLike) -> Floats:
    return np.asarray(values, dtype=np.float64)


def with_spacing(structure: Structure, spacing: float) -> Structure:
    """Return a structure whose markers are drawn together, or apart, about the middle of those of their limb.

    Parameters
    ----------
    structure : Structure
        What wears the markers.
    spacing : float, mm
        Median distance of a marker from the nearest one of its limb, on every limb that wears two or more.
    """
    return Structure(structure.name, tuple(_with_spaced_markers(limb, spacing) for limb in structure.limbs))


def _with_spaced_markers(limb: LimbModel, spacing: float) -> LimbModel:
    if len(limb.markers) < 2:
        return limb
    apart = np.linalg.norm(limb.markers[:, np.newaxis] - limb.markers, axis=2)
    np.fill_diagonal(apart, np.inf)
    middle = limb.markers.mean(axis=0)
    return replace(limb, markers=middle + (limb.markers - middle) * spacing / np.median(apart.min(axis=1)))


def side_by_side(structures: Sequence[Structure], apart: float) -> Structure:
    """Return several bodies as one structure with several roots; limbs and markers are named ``subject 1: chest``.

    Parameters
    ----------
    structures : sequence of Structure
        The bodies; those of the result are in their order.
    apart : float, mm
        Distance of each body's place at rest from that of the one before, to the left.
    """
    limbs = []
    for number, structure in enumerate(structures):
        prefix, aside = f"subject {number + 1}: ", np.array([0.0, number * apart, 0.0])
        for limb in structure.limbs:
            parent = prefix + limb.parent if limb.parent else ""
            names = tuple(prefix + name for name in limb.marker_names)
            joint = limb.joint if limb.parent else limb.joint + aside
            limbs.append(replace(limb, name=prefix + limb.name, parent=parent, joint=joint, marker_names=names))
    return Structure(f"{len(structures)} x {structures[0].name}", tuple(limbs))
