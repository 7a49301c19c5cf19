"""An articulated structure as a value: rigid limbs in a tree, with markers on them and joints between them.

At rest all limb frames have the orientation of the world (x forward, y left, z up). The origin of a limb's frame is the
joint to its parent, so that a joint's position in the child's frame is always zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, check_floats, check_names
from skelgen.model.topology import outward_order

DEGREES_OF_FREEDOM = {"free": 3, "ball": 3, "universal": 2, "hinge": 1}
"""Angles that move a limb; ``free`` is the root, which hangs on nothing."""

_UNIT_TOLERANCE = 1e-9  # of an axis that was divided by its length


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
        Each angle stays within offset ± amplitude.
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

    def __post_init__(self) -> None:
        if self.kind not in DEGREES_OF_FREEDOM:
            kinds = ", ".join(DEGREES_OF_FREEDOM)
            raise InputError(f"limb {self.name!r} hangs on a joint of kind {self.kind!r}; kinds are {kinds}")
        n_angles = DEGREES_OF_FREEDOM[self.kind]
        shapes: dict[str, tuple[int | None, ...]] = {"joint": (3,), "segment": (2, 3), "markers": (None, 3)}
        shapes |= {"axes": (n_angles, 3), "amplitudes": (n_angles,), "offsets": (n_angles,)}
        for field, shape in shapes.items():
            clean = check_floats(getattr(self, field), shape, f"{field} of limb {self.name!r}", finite=True)
            object.__setattr__(self, field, clean)
        if np.abs(np.linalg.norm(self.axes, axis=1) - 1).max() > _UNIT_TOLERANCE:
            raise InputError(f"an axis of limb {self.name!r} has not the length 1")


@dataclass(frozen=True, eq=False)
class Structure:
    """Limbs joined in a tree.

    Attributes
    ----------
    name : str
        What it is, e.g. ``human``.
    limbs : tuple of LimbModel
        One root; parents before their children.
    """

    name: str
    limbs: tuple[LimbModel, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "limbs", tuple(self.limbs))
        names = check_names([limb.name for limb in self.limbs], len(self.limbs), "limb")
        if not names:
            raise InputError("a structure needs at least one limb")
        for index, limb in enumerate(self.limbs):
            is_root = index == 0
            if is_root != (limb.kind == "free") or is_root != (limb.parent == ""):
                raise InputError(f"limb {limb.name!r}: the first limb, and no other, must be free and without a parent")
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
        return outward_order(self.parents)[1:]

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
        """Names such as ``chest 2``."""
        return tuple(f"{limb.name} {i + 1}" for limb in self.limbs for i in range(len(limb.markers)))
