"""The matrix of distance deviations: order of the markers, values, colours, borders of limbs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skelgen.app.drawing.colours import ramp_rgba
from skelgen.app.drawing.measures import subtree_markers
from skelgen.app.drawing.scales import LogScale
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class DeviationMatrix:
    """The matrix of distance deviations, ordered by limb.

    Attributes
    ----------
    markers, limbs : ndarray of intp, shape (n,)
        Marker of each row and column, and its limb; -1 = none.
    names : tuple of str, length n
        Names of the markers.
    values : ndarray, shape (n, n), mm
        NaN where two markers are never seen together, 0 on the diagonal.
    scale : LogScale
        Scale of the colours [mm].
    """

    markers: Ints
    limbs: Ints
    names: tuple[str, ...]
    values: Floats
    scale: LogScale

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.markers)

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """A pixel for each cell, shape (n, n, 4): red, green, blue, opacity."""
        return ramp_rgba(self.scale.fractions(self.values))

    @property
    def borders(self) -> list[int]:
        """Rows at which limbs begin, and `n`."""
        return [0, *(np.flatnonzero(np.diff(self.limbs)) + 1).tolist(), self.n] if self.n else [0]


def find_deviation_matrix(project: Project) -> DeviationMatrix:
    """Return the matrix of a project with limbs."""
    markers = subtree_markers(project)
    values = project.limbs.distance_deviation[np.ix_(markers, markers)].copy()
    np.fill_diagonal(values, 0.0)
    names = tuple(project.trajectories.names[marker] for marker in markers.tolist())
    return DeviationMatrix(markers, project.limbs.limb_of_marker[markers], names, values, LogScale.of(values))
