"""Several bodies in one volume, and markers as near to each other as is wished: what makes identities hard to find."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skelgen.simulation.articulated import LimbModel, Structure


def with_spacing(structure: Structure, spacing: float) -> Structure:
    """Return a structure whose markers are drawn together, or apart, about the middle of those of their limb.

    Parameters
    ----------
    structure : Structure
        What wears the markers.
    spacing : float, mm
        Median distance of a marker from the nearest one of its limb, on every limb that wears two or more.
    """
    return Structure(structure.name, tuple(_spaced(limb, spacing) for limb in structure.limbs))


def _spaced(limb: LimbModel, spacing: float) -> LimbModel:
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
