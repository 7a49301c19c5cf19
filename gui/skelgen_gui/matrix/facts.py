"""What the matrix of distance deviations shows: order of the markers, values, colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication

from skelgen.app.report.colours import LogScale, ramp_rgba
from skelgen.app.report.measures import subtree_markers
from skelgen.app.report.wording import millimetres
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints

translate = QCoreApplication.translate


@dataclass(frozen=True, eq=False)
class Matrix:
    """The matrix of distance deviations, ordered by limb.

    Attributes
    ----------
    markers, limbs : ndarray of intp, shape (n,)
        Marker of each row and column, and its limb; -1 = none.
    names : tuple of str, length n
        Of the markers.
    values : ndarray, shape (n, n), mm
        NaN where two markers are never seen together, 0 on the diagonal.
    scale : LogScale
        Of the colours [mm].
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

    def sentence(self, row: int, column: int) -> str:
        """Return what is told of a cell."""
        first, second = self._name(row), self._name(column)
        if row == column:
            return first
        value = float(self.values[row, column])
        if np.isnan(value):
            return translate("Matrix", "{0} – {1}: never seen together").format(first, second)
        varies = translate("Matrix", "{0} – {1}: their distance varies by {2}")
        return varies.format(first, second, millimetres(value))

    def _name(self, row: int) -> str:
        number = int(self.limbs[row])
        limb = translate("Matrix", "limb {0}").format(number) if number >= 0 else translate("Matrix", "no limb")
        return f"{self.names[row]} ({limb})"


def find_matrix(project: Project) -> Matrix:
    """Return the matrix of a project with limbs."""
    markers = subtree_markers(project)
    values = project.limbs.distance_deviation[np.ix_(markers, markers)].copy()
    np.fill_diagonal(values, 0.0)
    names = tuple(project.trajectories.names[marker] for marker in markers.tolist())
    return Matrix(markers, project.limbs.limb_of_marker[markers], names, values, LogScale.of(values))
