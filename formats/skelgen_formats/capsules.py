"""Masses and inertias of limbs: those of capsules along their bones, as thick as the markers lie far from them. A
capsule is a cylinder between two half spheres. It reaches from end to end of the bone; where it is thicker than long,
its half spheres stick out. Nothing is weighed: with the density of water a thigh comes near a thigh.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Floats
from skelgen_formats.bones import bone_end
from skelgen_formats.options import Option

M_PER_MM = 1e-3
"""Formats of models with masses are in metres."""

DENSITY = Option(
    "density",
    1000.0,
    "Density of the limbs, which gives masses and inertias of capsules along them as thick as their markers lie far.",
    reading=False,
    unit="kg/m³",
    low=1e-3,
    high=1e6,
)
"""The option of every writer of models that have masses."""

_THINNEST = 10.0  # mm
_MOST_INSET = 0.45  # of the bone, from either end: a capsule without length is none


@dataclass(frozen=True, eq=False)
class LimbCapsule:
    """A limb's body.

    Attributes
    ----------
    start, end : ndarray, shape (3,), m
        Centres of the half spheres, in the limb's frame.
    radius : float, m
        Of cylinder and half spheres.
    density : float, kg/m^3
        The same everywhere.
    """

    start: Floats
    end: Floats
    radius: float
    density: float

    @property
    def centre(self) -> Floats:
        """Centre of mass in the limb's frame [m], shape (3,)."""
        return np.asarray((self.start + self.end) / 2)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return sum(self._masses())

    def inertia(self) -> Floats:
        """Return the inertia about the centre of mass in the limb's axes [kg m^2], shape (3, 3)."""
        cylinder, spheres = self._masses()
        height, radius = float(np.linalg.norm(self.end - self.start)), self.radius
        along = cylinder * radius**2 / 2 + spheres * 2 * radius**2 / 5
        across = cylinder * (3 * radius**2 + height**2) / 12
        across += spheres * (2 * radius**2 / 5 + height**2 / 4 + 3 * height * radius / 8)
        axis = (self.end - self.start) / height
        return np.asarray(across * np.eye(3) + (along - across) * np.outer(axis, axis))

    def _masses(self) -> tuple[float, float]:
        """Of the cylinder, and of both half spheres together [kg]."""
        disc = np.pi * self.radius**2 * self.density
        return float(disc * np.linalg.norm(self.end - self.start)), float(disc * self.radius * 4 / 3)


def capsule_of(skeleton: Skeleton, limb: int, density: float) -> LimbCapsule:
    """Return the capsule along a limb's bone.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    limb : int
        Any limb.
    density : float, kg/m^3
        Of the limb.
    """
    end = bone_end(skeleton, limb)
    length = float(np.linalg.norm(end))
    along = end / length
    markers = skeleton.marker_offsets[skeleton.markers_of(limb)]
    aside = np.linalg.norm(markers - np.outer(markers @ along, along), axis=1)
    radius = max(float(aside.mean()) if len(aside) else 0.0, _THINNEST)
    inset = min(radius, _MOST_INSET * length) * along
    return LimbCapsule(inset * M_PER_MM, (end - inset) * M_PER_MM, radius * M_PER_MM, density)
