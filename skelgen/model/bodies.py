"""The bodies of a take: people, animals or things that no joint connects, each a tree of limbs of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from skelgen.model.arrays import Ints

if TYPE_CHECKING:
    from skelgen.model.project import Project


@dataclass(frozen=True, eq=False)
class Body:
    """One tree of limbs.

    Attributes
    ----------
    name : str
        ``body1``, ``body2`` and so on: the one with most limbs first.
    root : int
        The limb without a parent.
    limbs, markers : ndarray of intp
        Indices into the limbs and the markers of the project, rising.
    probability : float or None
        That it is a body of its own and no part of another one; None where that was not estimated, as for things that
        the joints part.
    """

    name: str
    root: int
    limbs: Ints
    markers: Ints
    probability: float | None


def bodies_of(project: Project) -> tuple[Body, ...]:
    """Return the bodies of a project whose joints have been found, the one with most limbs first.

    Parameters
    ----------
    project : Project
        With joints.

    Raises
    ------
    MissingResultError
        If joints have not been found yet.
    """
    limbs, topology = project.limbs, project.topology
    found = []
    for number, members in enumerate(topology.bodies, start=1):
        body = int(limbs.body_of_limb[members[0]])
        is_told = limbs.n_bodies > 1 and np.array_equal(np.flatnonzero(limbs.body_of_limb == body), members)
        markers = np.flatnonzero(np.isin(limbs.limb_of_marker, members))
        root = int(members[topology.parents[members] < 0][0])
        sure = float(limbs.body_probability[body]) if is_told else None
        found.append(Body(f"body{number}", root, members, markers, sure))
    return tuple(found)
